"""Something that lasts a while: between two times a parameter, or a torque, is another."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rw_ekf.effects.change import Change
from rw_ekf.model.effect import RecordFacts, Term
from rw_ekf.numbers import plus_minus

if TYPE_CHECKING:
    from rw_ekf.model.effect import Matrix


_KNOTS = 128  # within a hundredth of its length it has come, and gone
VALUES = (0.0, *(1.0,) * (_KNOTS - 2), 0.0)


class Spell(Change):
    """f(t) = size x (1 meanwhile, 0 before and after): a law of time that begins and ends with nothing."""

    id = "spell"
    equation = "f = a (0 before begins_at, 1 until ends_at, 0 after it)"
    source = "changed segment of a sequence: Olshen, Venkatraman, Lucito & Wigler 2004"
    excitation = "varied motion before, within and after it"
    local_in_time = True

    @classmethod
    def lasts_of(cls, term: Term) -> tuple[float, float]:
        """When it begins, and a third of how long it lasts, as if it decayed."""
        assert term.law is not None
        return term.law.first, (term.law.last - term.law.first) / 3.0

    @classmethod
    def parameters_of(cls, term: Term, covariance: Matrix) -> dict[str, dict[str, Any]]:
        """What changes, from when to when, by how much."""
        assert term.law is not None
        told = super().parameters_of(term, covariance)
        del told["takes_s"]
        _, ends_std = term.law.spread or (None, None)
        return told | {"ends_at": {"value": term.law.last, "std": ends_std, "unit": "s"}}

    @classmethod
    def sentence_of(cls, term: Term, covariance: Matrix, facts: RecordFacts) -> str:
        """From 280 +- 1 to 320 +- 1 s the motor gain is 5.0 +- 0.1 % lower."""
        assert term.law is not None
        begins, ends = map(plus_minus, (term.law.first, term.law.last), term.law.spread or (0.0, 0.0))
        return f"From {begins} to {ends} s, and neither before nor after, {cls.changes(term, covariance, facts)}"
