"""Wheels, spacecraft and flyby: what the planner is given, as arrays in SI."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array


@dataclass(eq=False, frozen=True)
class Wheels:
    """Reaction wheels on a spacecraft."""

    names: tuple[str, ...]
    axes: Float64Array  # (3, n), unit columns in the body frame, rank 3
    inertia_kg_m2: Float64Array  # (n,)

    def __len__(self) -> int:
        return len(self.names)

    @property
    def allocation(self) -> Float64Array:
        """Body momentum to wheel momenta, (n, 3): the inverse of `axes`, its pseudo-inverse for more than three."""
        return np.asarray(np.linalg.pinv(self.axes), dtype=np.float64)

    @property
    def null_projection(self) -> Float64Array:
        """Part of the wheel momenta (n, n) that the body does not feel: zero for three wheels."""
        if len(self) == 3:
            return np.zeros((3, 3))
        return np.eye(len(self)) - self.allocation @ self.axes


@dataclass(eq=False, frozen=True)
class Flyby:
    """A straight flyby at constant speed with one body axis held at nadir ([L17] figure A1)."""

    wheels: Wheels
    inertia_kg_m2: Float64Array  # (3, 3), of the spacecraft in its body frame
    slew_axis: Float64Array  # (3,), unit
    miss_distance_m: float  # h + R
    speed_m_s: float
    start_rad: float  # angle alpha between track and nadir, 0 to pi; pi/2 at closest approach
    end_rad: float

    @property
    def peak_rate_rad_s(self) -> float:
        """The body's rate at closest approach, V/(h+R)."""
        return self.speed_m_s / self.miss_distance_m

    @property
    def closest_approach_s(self) -> float:
        """Time of closest approach, from the start."""
        return self.time_s(0.5 * math.pi)

    @property
    def duration_s(self) -> float:
        """Time of the end, from the start."""
        return self.time_s(self.end_rad)

    def time_s(self, angle_rad: float) -> float:
        """Time at which alpha is angle_rad: cot(alpha) = cot(alpha0) - V t/(h+R), the solution of (A3)."""
        return (_cot(self.start_rad) - _cot(angle_rad)) / self.peak_rate_rad_s

    def angle_rad(self, time_s: float) -> float:
        """Angle alpha at a time: the inverse of `time_s`."""
        return math.atan2(1.0, _cot(self.start_rad) - self.peak_rate_rad_s * time_s)

    def rate_rad_s(self, angle_rad: float) -> float:
        """The body's rate d alpha/dt about the slew axis (A3)."""
        return self.peak_rate_rad_s * math.sin(angle_rad) ** 2


def _cot(angle_rad: float) -> float:
    return math.cos(angle_rad) / math.sin(angle_rad)
