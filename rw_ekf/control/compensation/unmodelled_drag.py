"""Drag that the filter's model lacks, from readings alone: a bank of two-state Kalman filters, weighted by likelihood.

The filter learns friction in minutes at best, and refuses readings that its model cannot explain: that makes its sigmas
honest, and leaves an ageing wheel or a drag spike to the attitude. Here the model's own propagation omega* is followed
from tick to tick, and what the wheel does beyond it is a speed error e and a drag delta against the motion,

    e' = e - s delta dt + w,   delta' = delta + r u sqrt(dt),   y = omega* + e + v,

s the sign of the speed, w and v the noises given to the filter, u white with variance 1. How fast the drag walks,
r, is not known: hypotheses from "not at all" to "a spike" each have a filter of their own, and are weighted by their
likelihood, changing over to one another at a low rate (Magill 1965; Blom and Bar-Shalom 1988). A wheel that the model
explains keeps its weight on the first, which is the filter's own belief; a disturbance that is estimated beside the
model makes predictive control free of offset (Pannocchia and Rawlings 2003).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rw_ekf.filter.constants import FilterConstants

WALKS_OF_COULOMB = (1.0e-5, 0.001, 0.004, 0.02, 0.3)  # r per sqrt(s): none, wear, warmth, a bump, a spike
_PRIOR = (0.98, 0.005, 0.005, 0.005, 0.005)
_CHANGES_S = 300.0  # after which a hypothesis gives way to the prior
_FIRST_SHARE = 0.001  # of Coulomb friction: sigma of the drag at the start
_MOST_SHARE = 5.0  # of Coulomb friction: no drag is larger
_READING_SIGMAS = 6.0
_MOST_CHI_SQUARE = 60.0  # more says no more: every hypothesis is surprised


class SpeedNoise(NamedTuple):
    """What the filter is given as the noises of a wheel."""

    speed_variance: float  # of a reading [rad^2/s^2]
    acceleration_density: float  # of a torque over the inertia [rad^2/s^3]

    @classmethod
    def of(cls, constants: FilterConstants) -> SpeedNoise:
        """The two of a filter."""
        return cls(constants.speed_variance, constants.acceleration_density)


class _Walk:
    """The filter of one hypothesis: error e and drag delta with their covariance."""

    def __init__(self, density: float, noise: SpeedNoise, first_variance: float) -> None:
        """density: of the walk, r^2 [rad^2/s^5]."""
        self._density = density
        self._noise = noise
        self.error_rad_s = 0.0
        self.drag_rad_s2 = 0.0
        self._P = (noise.speed_variance, 0.0, first_variance)

    def step(self, residual_rad_s: float, dt_s: float, sign: float) -> float:
        """Predict over an interval and weigh a reading; its log likelihood but for a constant."""
        gain_s = -sign * dt_s
        p00, p01, p11 = self._P
        p00 += gain_s * (2.0 * p01 + gain_s * p11) + self._noise.acceleration_density * dt_s
        p01 += gain_s * p11
        p11 += self._density * dt_s
        error = self.error_rad_s + gain_s * self.drag_rad_s2
        variance = p00 + self._noise.speed_variance
        innovation = residual_rad_s - error
        share, per_speed = p00 / variance, p01 / variance
        self.error_rad_s = error + share * innovation
        self.drag_rad_s2 += per_speed * innovation
        self._P = ((1.0 - share) * p00, (1.0 - share) * p01, p11 - per_speed * p01)
        return -0.5 * (min(innovation * innovation / variance, _MOST_CHI_SQUARE) + math.log(variance))

    def begin(self, variance: float) -> None:
        """A speed of its own variance [rad^2/s^2] is taken from elsewhere; the drag is kept."""
        self.error_rad_s, self._P = 0.0, (variance, 0.0, self._P[2])


class UnmodelledDrag:
    """Speed and drag beyond a model, tick by tick."""

    def __init__(self, coulomb_rad_s2: float, noise: SpeedNoise) -> None:
        """coulomb_rad_s2: the Coulomb friction that a drag is measured by."""
        unit = abs(coulomb_rad_s2)
        self._walks = [_Walk((r * unit) ** 2, noise, (_FIRST_SHARE * unit) ** 2) for r in WALKS_OF_COULOMB]
        self._most_rad_s2 = _MOST_SHARE * unit
        self._reading_std = math.sqrt(noise.speed_variance)
        self.weights: tuple[float, ...] = _PRIOR
        self.drag_rad_s2 = 0.0  # against the motion, above the model's friction

    def plausible_rad_s(self, elapsed_s: float) -> float:
        """The largest residual [rad/s] that noise and any drag can make in a time [s]."""
        return _READING_SIGMAS * self._reading_std + self._most_rad_s2 * elapsed_s

    def step(self, residual_rad_s: float, dt_s: float, sign: float) -> float:
        """Take a reading less what the model led to; return what the speed is beyond that [rad/s].

        The caller continues from that corrected speed. sign: of the speed over the interval, -1 to 1; 0 where it stood.
        """
        reported = [walk.step(residual_rad_s, dt_s, sign) for walk in self._walks]
        best, change = max(reported), min(dt_s / _CHANGES_S, 1.0)
        weights = [
            ((1.0 - change) * weight + change * prior) * math.exp(log - best)
            for weight, prior, log in zip(self.weights, _PRIOR, reported, strict=True)
        ]
        total = sum(weights)
        self.weights = tuple(weight / total for weight in weights)
        pairs = list(zip(self.weights, self._walks, strict=True))
        error = sum(weight * walk.error_rad_s for weight, walk in pairs)
        drag = sum(weight * walk.drag_rad_s2 for weight, walk in pairs)
        self.drag_rad_s2 = max(-self._most_rad_s2, min(self._most_rad_s2, drag))
        for walk in self._walks:
            walk.error_rad_s -= error
        return error

    def begin(self, variance: float = 0.0) -> None:
        """The caller continues from a speed of another source, of a variance [rad^2/s^2]; 0 for a wheel that stands."""
        for walk in self._walks:
            walk.begin(variance)


def mean_sign(begin_rad_s: float, end_rad_s: float) -> float:
    """Mean of the sign of a speed that goes evenly from one to another, -1 to 1."""
    if begin_rad_s * end_rad_s >= 0.0:
        return float((begin_rad_s + end_rad_s > 0.0) - (begin_rad_s + end_rad_s < 0.0))
    return (begin_rad_s + end_rad_s) / (abs(begin_rad_s) + abs(end_rad_s))
