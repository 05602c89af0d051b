"""Something that lasts a while: between two times a parameter, or a torque, is another."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rw_ekf.effects.change import Change
from rw_ekf.effects.measures import utc_of
from rw_ekf.model.effect import RecordFacts, Term
from rw_ekf.numbers import plus_minus
from rw_ekf.units import rpm_from_rad_s

if TYPE_CHECKING:
    from rw_ekf.model.effect import Matrix
    from rw_ekf.model.law import Law


_KNOTS = 128  # within a hundredth of its length it has come, and gone
_KNOCK_S = 1.0
_INTERVALS, _SIGMAS = 1.5, 2.0  # of the record, and of its times: what lasts no longer is an impulse
VALUES = (0.0, *(1.0,) * (_KNOTS - 2), 0.0)


def is_impulse(law: Law, period_s: float) -> bool:
    """Whether a law of time lasts no longer than a sample, or than its own times are known to."""
    return law.last - law.first <= max(_INTERVALS * period_s, _SIGMAS * max(law.spread, default=0.0))


class Spell(Change):
    """f(t) = size x (1 meanwhile, 0 before and after): a law of time that begins and ends with nothing."""

    id = "spell"
    equation = "f = a (0 before begins_at, 1 until ends_at, 0 after it)"
    source = "changed segment of a sequence: Olshen, Venkatraman, Lucito & Wigler 2004"
    excitation = "varied motion before, within and after it"
    local_in_time = True

    @classmethod
    def torque(cls, term: Term, facts: RecordFacts) -> float:
        """Its mean over a second at the least [rad/s^2]: a knock is as strong as it is short."""
        assert term.law is not None
        return super().torque(term, facts) * min((term.law.last - term.law.first) / _KNOCK_S, 1.0)

    @classmethod
    def lasts_of(cls, term: Term) -> tuple[float, float]:
        """When it begins, and a third of how long it lasts, as if it decayed."""
        assert term.law is not None
        return term.law.first, (term.law.last - term.law.first) / 3.0

    @classmethod
    def parameters_of(cls, term: Term, covariance: Matrix) -> dict[str, dict[str, Any]]:
        """What changes, from when to when, by how much."""
        assert term.law is not None
        reported = super().parameters_of(term, covariance)
        del reported["takes_s"]
        _, ends_std = term.law.spread or (None, None)
        return reported | {"ends_at": {"value": term.law.last, "std": ends_std, "unit": "s"}}

    @classmethod
    def sentence_of(cls, term: Term, covariance: Matrix, facts: RecordFacts) -> str:
        """From 280 +- 1 to 320 +- 1 s the motor gain is 5.0 +- 0.1 % lower."""
        assert term.law is not None
        if not cls.has_a_kind(term, facts):
            return cls._impulse(term, covariance, facts)
        begins, ends = map(plus_minus, (term.law.first, term.law.last), term.law.spread or (0.0, 0.0))
        utc = " to ".join(filter(None, (utc_of(time_s, facts) for time_s in (term.law.first, term.law.last))))
        when = f"From {begins} to {ends} s{f' ({utc})' if utc else ''}"
        return f"{when}, and neither before nor after, {cls.changes(term, covariance, facts)}"

    @classmethod
    def has_a_kind(cls, term: Term, facts: RecordFacts) -> bool:
        """Not of an impulse."""
        return term.law is None or not is_impulse(term.law, facts.period_s)

    @classmethod
    def _impulse(cls, term: Term, covariance: Matrix, facts: RecordFacts) -> str:
        """At 129.9 +- 0.1 s the speed falls by 1.5 +- 0.2 rpm: what did it is not known."""
        assert term.law is not None
        law, (size, std) = term.law, cls.amplitude(term.values, covariance)
        lasts_s = law.last - law.first
        by = plus_minus(rpm_from_rad_s(abs(size) * lasts_s), rpm_from_rad_s(std * lasts_s))
        middle_s = 0.5 * (law.first + law.last)
        utc, when = utc_of(middle_s, facts), plus_minus(middle_s, law.spread[0] if law.spread else 0.0)
        slower, faster = (
            ("the wheel is slowed", "the wheel is sped up")
            if law.acts_as == "drag"
            else ("the speed falls", "the speed rises")
        )
        does = slower if size > 0.0 else faster  # a law is an addition to friction
        at = f"At {when} s{f' ({utc})' if utc else ''}"
        return f"{at} {does} by {by} rpm at once (a knock, or a command that came late or not at all)"
