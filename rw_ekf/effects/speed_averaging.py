"""A speed reading that is a mean over a window: pulses counted, or a filter in the sensor."""

from __future__ import annotations

from typing import ClassVar

from rw_ekf.effects.measures import LONGEST_LAG_S, lacks_current
from rw_ekf.model.effect import Candidate, Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import WindowEffect
from rw_ekf.numbers import plus_minus


class SpeedAveraging(WindowEffect):
    """y(t) = [alpha(t) - alpha(t - a)]/a, alpha the angle: half a window late, and the corners rounded."""

    id = "speed_averaging"
    equation = "y(t) = [alpha(t) - alpha(t - a)]/a"
    source = "tachometers that count pulses over a gate time: frequency measurement, e.g. Petrella et al. 2007"
    coefficient = Coefficient("window_s", "s", 0.0, 60.0, "time before its stamp over which a reading is the mean")
    lacking = (lacks_current,)  # what is late shows in what the current does
    excitation = "many changes of current, read at a rate faster than one over the window: `rw-ekf excite P2`"
    confounded: ClassVar[dict[str, str]] = {
        "transport_delay": "steps of current read several times within the window, in which a mean rises on a ramp",
        "actuator_lag": "steps of current read several times within the window, after which a mean has no tail",
    }

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """A tenth of the sample period: twice the smallest delay, for a mean is half a window late."""
        return 2.0 * max(0.05 * facts.period_s, facts.timing_doubt_s)

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """A tenth of the record, 10 s at most, as for a delay."""
        return min(0.1 * facts.duration_s, LONGEST_LAG_S)

    @staticmethod
    def candidates(facts: RecordFacts) -> list[Candidate]:
        """From two fifths of a period to ten."""
        return [Candidate(facts.period_s * ratio) for ratio in (0.4, 1.0, 2.0, 4.0, 10.0)]

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """In milliseconds, and in samples."""
        window = plus_minus(1e3 * value, 1e3 * std)
        return (
            f"Speed readings are means over {window} ms before their time stamps "
            f"({value / facts.period_s:.2g} sample periods)"
        )
