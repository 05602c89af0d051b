"""The current loop: the winding follows the command with a first-order lag."""

from __future__ import annotations

import math
from typing import ClassVar

from rw_ekf.effects.measures import LONGEST_LAG_S, lacks_current
from rw_ekf.model.effect import Candidate, Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import CurrentEffect
from rw_ekf.numbers import plus_minus


class ActuatorLag(CurrentEffect):
    """tau dI/dt = I_command - I."""

    id = "actuator_lag"
    equation = "tau dI/dt = I_command - I"
    source = "inductance and resistance of the winding behind a current controller: a first-order loop"
    coefficient = Coefficient("time_constant_s", "s", 0.0, 60.0, "time constant of the current loop")
    lacking = (lacks_current,)  # a coast-down has no current to lag behind
    excitation = "many changes of current: `rw-ekf excite P2`"
    confounded: ClassVar[dict[str, str]] = {
        "transport_delay": "current steps read at a rate faster than one over the lag",
        "speed_averaging": "steps of current read several times within the window, after which a mean has no tail",
    }

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """A twentieth of the sample period: 5 ms at 10 Hz; no less than readings may be older than their rows."""
        return max(0.05 * facts.period_s, facts.timing_doubt_s)

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """A tenth of the record, 10 s at most: what is slower is not a current loop."""
        return min(0.1 * facts.duration_s, LONGEST_LAG_S)

    @staticmethod
    def candidates(facts: RecordFacts) -> list[Candidate]:
        """From a fifth of a period to ten."""
        return [Candidate(facts.period_s * ratio) for ratio in (0.2, 0.5, 1.0, 3.0, 10.0)]

    @staticmethod
    def lagged(a: float, q: Shape, state: float, current: float, duration: float) -> tuple[float, float]:
        """Exponential approach; its mean over the piece is exact, so that the impulse is."""
        if a <= 1.0e-9 * duration:
            return current, current
        x = duration / a
        decay = math.exp(-x)
        return current + (state - current) * (1.0 - decay) / x, current + (state - current) * decay

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """In milliseconds."""
        return f"The current follows its command {plus_minus(1e3 * value, 1e3 * std)} ms late (first-order lag)"
