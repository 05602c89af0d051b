"""What a residual can depend on: torques per unit inertia, each with the name that an alarm gives it.

A torque phi(t) that the model lacks shows in the innovations as the filter's response to it, g (docs/watch.md eq. 10).
The first three are the model's own terms: the estimator absorbs them, so that a lasting lack of another kind is seen
beside them only, and a sudden change of one of them by itself.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.model.friction import CREEP_STRIBECK_SPEEDS
from rw_ekf.watch.observation import Observation


class Torque(NamedTuple):
    """A torque that the residual may follow: the name in an alarm, and its law."""

    name: str
    torque: str


TORQUES = (
    Torque("dry friction", "sgn(omega)"),
    Torque("speed", "omega"),
    Torque("current", "I"),
    Torque("direction", "1"),
    Torque("speed", "|omega|"),
    Torque("speed", "omega |omega|"),
    Torque("low speed", "sgn(omega) exp(-|omega| / 3 omega_s)"),
    Torque("current", "I |I|"),
    Torque("change of current", "dI/dt"),
    Torque("temperature", "(T - mean) sgn(omega)"),
    Torque("temperature", "(T - mean) omega"),
    Torque("temperature", "(T - mean) I"),
    Torque("time", "(t - mean) sgn(omega)"),
)
MODEL_TERMS = 3


class Responses:
    """The filter's response to every torque, carried from block to block."""

    def __init__(self, stribeck_speed_rad_s: float) -> None:
        self._low_speed = CREEP_STRIBECK_SPEEDS * stribeck_speed_rad_s
        self._g = np.zeros(len(TORQUES))
        self._left = 0.0  # of the response after the last update
        self._current_A = 0.0
        self._samples = 0
        self._temperature_mean = 0.0
        self._time_mean = 0.0

    def of_block(self, rows: list[Observation]) -> tuple[Float64Array, Float64Array]:
        """(responses (n, q), normalised innovations (n,); NaN where there is none or it shows nothing of torques)."""
        columns = np.array([row[:10] for row in rows])
        time_s, dt_s, direction, speed, current, temperature, innovation, variance, gain, keep = columns.T
        torques = self._torques(time_s, dt_s, direction, speed, current, temperature)
        left = (1.0 - gain) * np.array([not row.reseeded for row in rows])
        restart = np.array([row.restart for row in rows])
        keep = np.where(restart, 0.0, keep) * np.concatenate(([self._left], left[:-1]))
        responses = np.empty_like(torques)
        g = self._g
        for i, share in enumerate(keep.tolist()):
            g = share * g + torques[i]
            responses[i] = g
        self._g, self._left = g, float(left[-1])
        root = np.sqrt(variance)
        used = (direction != 0.0) & (gain > 0.0) & ~restart  # a wild reading is a matter of the line, not of the wheel
        normalised = np.where(used, innovation / root, np.nan)
        return responses / root[:, None], normalised

    def _torques(
        self,
        time_s: Float64Array,
        dt_s: Float64Array,
        direction: Float64Array,
        speed: Float64Array,
        current: Float64Array,
        temperature: Float64Array,
    ) -> Float64Array:
        """Torque times interval [rad/s per unit], (n, q); temperature and time about their means so far."""
        change = np.diff(current, prepend=self._current_A) / np.maximum(dt_s, 1.0e-9)
        self._current_A = float(current[-1])
        n = time_s.size
        self._samples += n
        self._time_mean += n / self._samples * (float(np.mean(time_s)) - self._time_mean)
        known = not np.isnan(temperature[-1])
        if known:
            self._temperature_mean += n / self._samples * (float(np.nanmean(temperature)) - self._temperature_mean)
        warmer = np.nan_to_num(temperature - self._temperature_mean) if known else np.zeros(n)
        size = np.abs(speed)
        columns = (
            direction,
            speed,
            current,
            np.ones(n),
            size,
            speed * size,
            direction * np.exp(-size / self._low_speed),
            current * np.abs(current),
            change,
            warmer * direction,
            warmer * speed,
            warmer * current,
            (time_s - self._time_mean) * direction,
        )
        moving: Float64Array = np.where(direction != 0.0, dt_s, 0.0)
        return np.stack(columns, axis=1) * moving[:, None]
