"""What torques periodic in angle or in time share: a sine and a cosine, reported as amplitude and phase.

    S sin(x + phi) + C sin(x + phi + pi/2) = A sin(x + phi + psi),  A = sqrt(S^2 + C^2),  psi = atan2(C, S)

so that an unknown phase leaves the effect linear in its two coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rw_ekf.model.effect import Shape
from rw_ekf.model.effect_kinds import StaticEffect

if TYPE_CHECKING:
    from rw_ekf.model.effect import Matrix


def amplitude_and_phase(sine: float, cosine: float, covariance: Matrix) -> tuple[float, float, float, float | None]:
    """(amplitude, std, phase [rad], std) of sine and cosine, by the delta method; no phase std at amplitude 0."""
    amplitude = math.hypot(sine, cosine)
    ss, sc, cc = float(covariance[0][0]), float(covariance[0][1]), float(covariance[1][1])
    if amplitude == 0.0:
        return 0.0, math.sqrt(max(ss, cc)), 0.0, None
    along, across = sine / amplitude, cosine / amplitude
    variance = along * along * ss + 2.0 * along * across * sc + across * across * cc
    turned = across * across * ss - 2.0 * along * across * sc + along * along * cc
    return (
        amplitude,
        math.sqrt(max(variance, 0.0)),
        math.atan2(cosine, sine),
        math.sqrt(max(turned, 0.0)) / amplitude,
    )


class PeriodicEffect(StaticEffect):
    """A torque a sin(x + phase) whose second shape constant is the phase [rad]; the first says what x runs with.

    A term has a sine and a cosine; one of a known phase has the sine alone.
    """

    components = 2
    repeats = True

    @staticmethod
    def component_shape(shape: Shape, component: int) -> Shape:
        """The cosine is a sine a quarter ahead."""
        return shape[0], shape[1] + 0.5 * math.pi * component, shape[2]

    @classmethod
    def admits(cls, found: float) -> bool:
        """Either sign: the phase takes it up."""
        return True

    @classmethod
    def amplitude(cls, values: Sequence[float], covariance: Matrix) -> tuple[float, float]:
        """Amplitude of sine and cosine."""
        if len(values) == 1:
            return super().amplitude(values, covariance)
        return amplitude_and_phase(values[0], values[1], covariance)[:2]

    @classmethod
    def parameters(
        cls, values: Sequence[float], covariance: Matrix, shape: Shape
    ) -> dict[str, dict[str, float | str | None]]:
        """Amplitude and phase, both with std; of a sine alone the phase is that given."""
        found = super().parameters(values, covariance, shape)
        if len(values) == 2:
            _, _, phase, phase_std = amplitude_and_phase(values[0], values[1], covariance)
            total = math.remainder(shape[1] + phase, 2.0 * math.pi)
            found[cls.constants[1].name] = {"value": total, "std": phase_std, "unit": cls.constants[1].unit}
        return found
