"""Dry friction on a bristle (Dahl, LuGre): below break-away the wheel is held by a spring, not stuck."""

from __future__ import annotations

from typing import ClassVar

from rw_ekf.effects.measures import dry_scale, lacks_slow_motion
from rw_ekf.model.effect import Candidate, Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import FrictionMemoryEffect
from rw_ekf.model.friction import FrictionCurve
from rw_ekf.model.memory_flow import bristle_flow
from rw_ekf.numbers import plus_minus

_DAMPINGS = (0.3, 0.0)  # LuGre as it mostly is, and Dahl
_MORE_DAMPING = 0.6
_LARGEST = 1.0e3


def _natural_deflection(facts: RecordFacts) -> float:
    """omega_s^2/c [rad]: on a bristle that bends so far a wheel swings with omega_s."""
    return float(facts.stribeck_speed_rad_s**2 / dry_scale(facts))


class PreslidingHysteresis(FrictionMemoryEffect):
    """F = sigma0 z + sigma1 dz/dt with dz/dt = omega - |omega| z/z_ss, in place of friction that sticks.

    sigma0 = s/deflection, z_ss = [c + (s - c) g]/sigma0, sigma1 = 2 damping sqrt(sigma0); damping 0 is Dahl's model.
    """

    id = "presliding_hysteresis"
    equation = "F = sigma0 z + sigma1 dz/dt, dz/dt = omega - |omega| sigma0 z/[c + (s - c) g(|omega|/omega_s)]"
    source = "[L17 (4), (5)]; Dahl 1977, Canudas de Wit et al. 1995"
    coefficient = Coefficient("deflection_rad", "rad", 0.0, _LARGEST, "deflection of the bristle at break-away")
    constants = (Coefficient("damping", "", 0.0, 10.0, "damping ratio of the wheel on its bristle"),)
    refined = (0,)  # but for Dahl's
    lacking = (lacks_slow_motion,)  # a wheel that is never near rest keeps its bristle bent
    excitation = "creep through zero and currents below break-away, both ways: `rw-ekf excite identification`"
    confounded: ClassVar[dict[str, str]] = {
        "friction_lag": "creep through zero: a bristle yields by an angle, a lag by a time",
        "stribeck_shape": "dwells at half to five Stribeck speeds without a reversal: there a bristle does nothing",
    }

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """On which a wheel swings with 6 % of omega_s; about 1 mrad for a reaction wheel."""
        return min(0.004 * _natural_deflection(facts), _LARGEST)

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """What the wheel turns in a second at top speed: what has not slid by then is a spring."""
        return facts.top_speed_rad_s * 1.0

    @staticmethod
    def candidates(facts: RecordFacts) -> list[Candidate]:
        """Bristles on which a wheel swings with a tenth of omega_s to nearly twice omega_s; 3 mrad to 0.9 rad."""
        deflection = _natural_deflection(facts)
        ratios = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0)
        return [
            Candidate(min(deflection * ratio, _LARGEST), (damping, 0.0, 0.0))
            for damping in _DAMPINGS
            for ratio in ratios
        ]

    @classmethod
    def starts(cls, candidate: Candidate, found: float) -> list[Candidate]:
        """Dampings on either side: a step along the reference hardly distinguishes them, a fit does."""
        return [
            Candidate(found, (_DAMPINGS[0], 0.0, 0.0)),
            *(candidate._replace(shape=(damping, 0.0, 0.0)) for damping in (_MORE_DAMPING, 0.0)),
        ]

    @staticmethod
    def valleys(facts: RecordFacts) -> list[Candidate]:
        """Bristles on which a wheel swings with a seventh to seven tenths of omega_s, damped little and well."""
        deflection = _natural_deflection(facts)
        return [
            Candidate(min(deflection * ratio, _LARGEST), (damping, 0.0, 0.0))
            for ratio in (0.02, 0.1, 0.5)
            for damping in (0.2, 0.5)
        ]

    @staticmethod
    def flow(
        omega: float, memory: float, drive: float, curve: FrictionCurve, a: float, q: Shape, duration: float
    ) -> tuple[float, float]:
        """(speed, friction) after `duration`; the memory is the elastic part sigma0 z, damping comes on top."""
        return bristle_flow(omega, memory, drive, curve, a, q[0], duration)

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """In milliradians."""
        bends = plus_minus(1e3 * value, 1e3 * std)
        return f"Below break-away the wheel is held by a spring: dry friction yields by {bends} mrad before it lets go"
