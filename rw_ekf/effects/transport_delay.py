"""Commands that act later than the log says, or telemetry that is late: the same from here."""

from __future__ import annotations

from typing import ClassVar

from rw_ekf.effects.measures import LONGEST_LAG_S, lacks_current
from rw_ekf.model.effect import Candidate, Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import DelayEffect
from rw_ekf.numbers import plus_minus


class TransportDelay(DelayEffect):
    """I(t) = I_command(t - a), on top of the log's own command_delay_s."""

    id = "transport_delay"
    equation = "I(t) = I_command(t - a)"
    source = "commands that wait on the line or in the drive, readings stamped late"
    coefficient = Coefficient("delay_s", "s", 0.0, 60.0, "delay beyond the one that the log states")
    lacking = (lacks_current,)
    excitation = "many changes of current: `rw-ekf excite P2`"
    confounded: ClassVar[dict[str, str]] = {
        "actuator_lag": "current steps read at a rate faster than one over the delay",
        "speed_averaging": "steps of current read several times within the window, in which a mean rises on a ramp",
    }

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """A twentieth of the sample period: 5 ms at 10 Hz; no less than readings may be older than their rows."""
        return max(0.05 * facts.period_s, facts.timing_doubt_s)

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """A tenth of the record, 10 s at most: a command that late would have been taken for lost."""
        return min(0.1 * facts.duration_s, LONGEST_LAG_S)

    @staticmethod
    def candidates(facts: RecordFacts) -> list[Candidate]:
        """From a fifth of a period to five."""
        return [Candidate(facts.period_s * ratio) for ratio in (0.2, 0.5, 1.0, 2.0, 5.0)]

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """In milliseconds, and in samples."""
        late = plus_minus(1e3 * value, 1e3 * std)
        return (
            f"Commands act {late} ms later than the log says ({value / facts.period_s:.2g} sample periods), or "
            "readings are as much older than their time stamps: to a log these are one and the same"
        )
