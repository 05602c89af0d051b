"""A wheel that shares no assumption with the estimator: Karnopp's friction, explicit small steps, faults of its own.

Within a narrow band about zero the wheel holds while the drive is below break-away; beyond it Euler's method takes
steps of a millisecond, or the caller's. Friction and the motor may change while it runs.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from rw_ekf.arrays import Float64Array
from rw_ekf.model.state import FrictionParameters
from tools.measure.runs import OMEGA_S

_BAND_RAD_S = 1.0e-3


@njit(cache=True)  # type: ignore[untyped-decorator]
def _run(
    omega: float,
    parameters: tuple[float, float, float, float],
    omega_s: float,
    time_s: Float64Array,
    current_A: Float64Array,
    friction: Float64Array,
    kicks: Float64Array,
    step_s: float,
    out: Float64Array,
) -> None:
    k, b, c0, s0 = parameters
    for i in range(time_s.size):
        out[i] = omega
        if i + 1 == time_s.size:
            break
        c, s, drive = c0 * friction[i], s0 * friction[i], k * current_A[i]
        steps = max(1, math.ceil((time_s[i + 1] - time_s[i]) / step_s - 1e-9))
        h = (time_s[i + 1] - time_s[i]) / steps
        for _ in range(steps):
            if abs(omega) < _BAND_RAD_S and abs(drive) <= s:
                omega = 0.0
                continue
            sign = math.copysign(1.0, omega) if abs(omega) >= _BAND_RAD_S else math.copysign(1.0, drive)
            g = math.exp(-((omega / omega_s) ** 2))
            omega += h * (drive - b * omega - sign * (c * (1.0 - g) + s * g))
        if omega != 0.0:
            omega += kicks[i]


def karnopp(
    parameters: FrictionParameters,
    time_s: Float64Array,
    current_A: Float64Array,
    *,
    initial_speed_rad_s: float = 0.0,
    friction: Float64Array | None = None,
    kicks_rad_s: Float64Array | None = None,
    omega_s: float = OMEGA_S,
    step_s: float = 1.0e-3,
) -> Float64Array:
    """True speed at each sample (n,); current i acts from time i on. Explicit Euler is stable for b step_s < 1.

    friction (n,): what both dry frictions are multiplied by at each time. kicks_rad_s (n,): torque noise, as a jump of
    the speed after each interval in which the wheel turns.
    """
    out = np.empty(time_s.size)
    ones, none = np.ones(time_s.size), np.zeros(time_s.size)
    _run(
        initial_speed_rad_s, tuple(parameters), omega_s, time_s, current_A,
        ones if friction is None else friction, none if kicks_rad_s is None else kicks_rad_s, step_s, out,
    )  # fmt: skip
    return out


def holding_current_A(parameters: FrictionParameters, speed_rad_s: float) -> float:
    """Current at which the wheel keeps a speed far above the Stribeck speed."""
    k, b, c, _ = parameters
    return (b * speed_rad_s + math.copysign(c, speed_rad_s)) / k
