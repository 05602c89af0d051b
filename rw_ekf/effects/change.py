"""Something that begins: from one time on a parameter, or a torque, is another."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rw_ekf.effects.learned_law import WORDS, LearnedLaw, size_text, torque_per_unit
from rw_ekf.effects.measures import utc_of
from rw_ekf.model.effect import Coefficient, RecordFacts, Term
from rw_ekf.numbers import plus_minus

if TYPE_CHECKING:
    from rw_ekf.model.effect import Matrix


_ABRUPT_S = 1.0


class Change(LearnedLaw):
    """f(t) = size x (0 before, 1 after): a law of time with two knots."""

    id = "change"
    equation = "f = a (0 before begins_s, 1 after it has come)"
    source = "step in a regression at an unknown time: Quandt 1958; Chow & Lin 1971"
    coefficient = Coefficient("size", "1", -1.0e6, 1.0e6, "of the change, in the unit of what changes")
    excitation = "a record that goes on long after it, and is as varied before and after"
    of_one_record = True
    shown_against = "time"

    @classmethod
    def torque(cls, term: Term, facts: RecordFacts) -> float:
        """Of all of it, as a torque per inertia [rad/s^2]."""
        assert term.law is not None
        return abs(torque_per_unit(term.law, facts) * term.values[0])

    @classmethod
    def parameters_of(cls, term: Term, covariance: Matrix) -> dict[str, dict[str, Any]]:
        """What changes, when, over how long, by how much."""
        assert term.law is not None
        law, (size, std) = term.law, cls.amplitude(term.values, covariance)
        when = {"value": law.first, "std": law.spread[0] if law.spread else None, "unit": "s"}
        takes = {"value": law.last - law.first, "std": None, "unit": "s"}
        return {
            "size": {"value": size, "std": std, "unit": law.own_unit},
            "what": {"value": law.acts_as, "std": None, "unit": None}, "begins_at": when, "takes_s": takes,
        }  # fmt: skip

    @classmethod
    def sentence_of(cls, term: Term, covariance: Matrix, facts: RecordFacts) -> str:
        """From 280 +- 2 s on the motor gain is 5.0 +- 0.1 % lower."""
        assert term.law is not None
        law = term.law
        when = plus_minus(law.first, law.spread[0]) if law.spread else f"{law.first:.4g}"
        slowly = "" if law.last - law.first < _ABRUPT_S else f", within {law.last - law.first:.3g} s,"
        utc = utc_of(law.first, facts)
        return f"From {when} s on{f' ({utc})' if utc else ''}{slowly} {cls.changes(term, covariance, facts)}"

    @classmethod
    def changes(cls, term: Term, covariance: Matrix, facts: RecordFacts) -> str:
        """What changes, and by how much."""
        assert term.law is not None
        law, (size, std) = term.law, cls.amplitude(term.values, covariance)
        what = f"{WORDS[law.acts_as][:1].lower()}{WORDS[law.acts_as][1:]}"
        return f"{what} changes by {size_text(law, size, std, facts)}"
