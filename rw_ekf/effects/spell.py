"""Something that lasts a while: between two times a parameter, or a torque, is another."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rw_ekf.effects.learned_law import WORDS, LearnedLaw, size_text, torque_per_unit
from rw_ekf.model.effect import Coefficient, RecordFacts, Term
from rw_ekf.numbers import plus_minus

if TYPE_CHECKING:
    from rw_ekf.model.effect import Matrix


_KNOTS = 128  # within a hundredth of its length it has come, and gone
VALUES = (0.0, *(1.0,) * (_KNOTS - 2), 0.0)


class Spell(LearnedLaw):
    """f(t) = size x (1 meanwhile, 0 before and after): a law of time that begins and ends with nothing."""

    id = "spell"
    equation = "f = a (0 before begins_at, 1 until ends_at, 0 after it)"
    source = "changed segment of a sequence: Olshen, Venkatraman, Lucito & Wigler 2004"
    coefficient = Coefficient("size", "1", -1.0e6, 1.0e6, "of the change, in the unit of what changes")
    excitation = "varied motion before, within and after it"
    of_one_record = True
    local_in_time = True
    shown_against = "time"

    @classmethod
    def lasts_of(cls, term: Term) -> tuple[float, float]:
        """When it begins, and a third of how long it lasts, as if it decayed."""
        assert term.law is not None
        return term.law.first, (term.law.last - term.law.first) / 3.0

    @classmethod
    def torque(cls, term: Term, facts: RecordFacts) -> float:
        """Of all of it, as a torque per inertia [rad/s^2]."""
        assert term.law is not None
        return abs(torque_per_unit(term.law, facts) * term.values[0])

    @classmethod
    def parameters_of(cls, term: Term, covariance: Matrix) -> dict[str, dict[str, Any]]:
        """What changes, from when to when, by how much."""
        assert term.law is not None
        law, (size, std) = term.law, cls.amplitude(term.values, covariance)
        begins_std, ends_std = law.spread or (None, None)
        return {
            "size": {"value": size, "std": std, "unit": law.own_unit},
            "what": {"value": law.acts_as, "std": None, "unit": None},
            "begins_at": {"value": law.first, "std": begins_std, "unit": "s"},
            "ends_at": {"value": law.last, "std": ends_std, "unit": "s"},
        }

    @classmethod
    def sentence_of(cls, term: Term, covariance: Matrix, facts: RecordFacts) -> str:
        """From 280 +- 1 to 320 +- 1 s the motor gain is 5.0 +- 0.1 % lower."""
        assert term.law is not None
        law, (size, std) = term.law, cls.amplitude(term.values, covariance)
        begins, ends = map(plus_minus, (law.first, law.last), law.spread or (0.0, 0.0))
        what = f"{WORDS[law.acts_as][:1].lower()}{WORDS[law.acts_as][1:]}"
        by = size_text(law, size, std, facts)
        return f"From {begins} to {ends} s, and neither before nor after, {what} changes by {by}"
