"""Dry friction that follows its static value with a delay (Walrath)."""

from __future__ import annotations

from typing import ClassVar

from rw_ekf.effects.measures import LONGEST_LAG_S, dry_scale, lacks_slow_motion
from rw_ekf.model.effect import Candidate, Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import FrictionMemoryEffect
from rw_ekf.model.friction import FrictionCurve
from rw_ekf.model.memory_flow import lag_flow
from rw_ekf.numbers import plus_minus

_LONGEST_S = 60.0


class FrictionLag(FrictionMemoryEffect):
    """tau dF/dt = sgn(omega) [c + (s - c) g(|omega|/omega_s)] - F; at rest F is the drive that is held."""

    id = "friction_lag"
    equation = "tau dF/dt = sgn(omega) [c + (s - c) g(|omega|/omega_s)] - F"
    source = "[L17 (7)]; Walrath 1984"
    coefficient = Coefficient("time_constant_s", "s", 0.0, _LONGEST_S, "time constant with which dry friction follows")
    lacking = (lacks_slow_motion,)  # friction that never changes has nothing to lag behind
    excitation = "reversals, fast ones and creep through zero: `rw-ekf excite identification`"
    confounded: ClassVar[dict[str, str]] = {
        "presliding_hysteresis": "creep through zero: a bristle yields by an angle, a lag by a time",
        "stribeck_shape": "dwells at half to five Stribeck speeds without a reversal: there a lag does nothing",
    }

    holds = True

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """What shifts the speed by omega_s/50 at a reversal (2 c tau), a twentieth of a sample period at least."""
        return min(max(0.01 * facts.stribeck_speed_rad_s / dry_scale(facts), 0.05 * facts.period_s), _LONGEST_S)

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """A tenth of the record, 10 s at most: [L17 (7)] has fractions of a second."""
        return min(0.1 * facts.duration_s, LONGEST_LAG_S)

    @staticmethod
    def candidates(facts: RecordFacts) -> list[Candidate]:
        """A fifth of to ten sample periods, or of tenths of the time to brake through omega_s where that is longer."""
        time = max(facts.period_s, 0.1 * facts.stribeck_speed_rad_s / dry_scale(facts))
        return [Candidate(min(time * ratio, _LONGEST_S)) for ratio in (0.2, 0.5, 1.0, 3.0, 10.0)]

    @staticmethod
    def flow(
        omega: float, memory: float, drive: float, curve: FrictionCurve, a: float, q: Shape, duration: float
    ) -> tuple[float, float]:
        """(speed, friction) after `duration`; the memory is the friction F."""
        return lag_flow(omega, memory, drive, curve, a, duration)

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """In milliseconds."""
        return f"Dry friction follows speed and direction with a lag of {plus_minus(1e3 * value, 1e3 * std)} ms"
