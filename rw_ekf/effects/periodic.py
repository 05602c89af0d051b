"""What torques periodic in angle or in time share: a sine and a cosine column, told to a person as amplitude and phase.

    S sin(x + phi) + C sin(x + phi + pi/2) = A sin(x + phi + psi),  A = sqrt(S^2 + C^2),  psi = atan2(C, S)

so that an unknown phase leaves the effect linear in its two coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

from rw_ekf.model.effect import RecordFacts, Shape, StaticEffect

if TYPE_CHECKING:
    from rw_ekf.arrays import Float64Array

    Covariance = Sequence[Sequence[float]] | Float64Array  # 2 x 2, of sine and cosine


def amplitude_and_phase(
    sine: float, cosine: float, covariance_2x2: Covariance
) -> tuple[float, float, float, float | None]:
    """(amplitude, std, phase [rad], std) of two quadratures, by the delta method; no phase std at amplitude 0."""
    amplitude = math.hypot(sine, cosine)
    ss, sc, cc = float(covariance_2x2[0][0]), float(covariance_2x2[0][1]), float(covariance_2x2[1][1])
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
    """A torque a sin(x + phase) whose second shape constant is the phase [rad]; the first says what x runs with."""

    quadrature: ClassVar[bool] = True

    @classmethod
    def admits(cls, found: float) -> bool:
        """Either sign: the phase takes it up."""
        return True

    @classmethod
    def described_pair(
        cls, sine: float, cosine: float, covariance_2x2: Covariance, shape: Shape
    ) -> dict[str, dict[str, float | str | None]]:
        """`described` for both columns: amplitude and phase with std; shape is that of the sine."""
        amplitude, amplitude_std, phase, phase_std = amplitude_and_phase(sine, cosine, covariance_2x2)
        found = cls.described(amplitude, amplitude_std, shape)
        found[cls.constants[1].name] = {
            "value": math.remainder(shape[1] + phase, 2.0 * math.pi),
            "std": phase_std,
            "unit": cls.constants[1].unit,
        }
        return found

    @classmethod
    def sentence_pair(
        cls, sine: float, cosine: float, covariance_2x2: Covariance, shape: Shape, facts: RecordFacts
    ) -> str:
        """`sentence` for both columns."""
        amplitude, std, _, _ = amplitude_and_phase(sine, cosine, covariance_2x2)
        return cls.sentence(amplitude, std, shape, facts)
