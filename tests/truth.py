"""The truth that tests compare with: a fine-step integration that shares no code with the estimator.

Heun's method in steps of 0.2 ms with the sign of the speed written out, the stop found on a straight line. Its own
error is below 1e-5 rad/s (tests/model/test_flow.py holds it against scipy), far below any reading's noise.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numba import njit

from rw_ekf.arrays import Float64Array
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.model.friction import LAW_CODES
from rw_ekf.model.state import CK13_STATISTICAL, FrictionParameters
from rw_ekf.units import RAD_S_PER_RPM
from tools.measure.runs import OMEGA_S, Run, bound_from

FINE_STEP_S = 2.0e-4


@njit(cache=True)  # type: ignore[untyped-decorator]
def _drift(omega: float, sign: float, drive: float, b: float, c: float, s: float, omega_s: float, law: int) -> float:
    u = abs(omega) / omega_s
    if law == 0:
        g = math.exp(-u * u)
    elif law == 1:
        g = math.exp(-u)
    else:
        g = 1.0 / (1.0 + u * u)
    return drive - b * omega - sign * (c * (1.0 - g) + s * g)


@njit(cache=True)  # type: ignore[untyped-decorator]
def _hold(
    omega: float, drive: float, b: float, c: float, s: float, omega_s: float, law: int, duration: float, fine: float
) -> float:
    """Speed after `duration` seconds of one drive."""
    left = duration
    while left > 1.0e-13:
        if omega == 0.0:
            if abs(drive) <= s:
                return 0.0
            sign = math.copysign(1.0, drive)
        else:
            sign = math.copysign(1.0, omega)
        h = min(fine, left)
        f0 = _drift(omega, sign, drive, b, c, s, omega_s, law)
        f1 = _drift(omega + h * f0, sign, drive, b, c, s, omega_s, law)
        after = omega + 0.5 * h * (f0 + f1)
        if sign * after < 0.0 and omega != 0.0:
            h *= omega / (omega - after)
            after = 0.0
        omega = after
        left -= h
    return omega


@njit(cache=True)  # type: ignore[untyped-decorator]
def _trajectory(
    omega: float,
    k: float,
    b: float,
    c: float,
    s: float,
    omega_s: float,
    law: int,
    time_s: Float64Array,
    current_A: Float64Array,
    delay_s: float,
    kicks: Float64Array,
    fine: float,
    out: Float64Array,
) -> None:
    for i in range(time_s.size):
        out[i] = omega
        if i + 1 == time_s.size:
            break
        dt = time_s[i + 1] - time_s[i]
        if delay_s > 0.0 and i > 0:
            omega = _hold(omega, k * current_A[i - 1], b, c, s, omega_s, law, delay_s, fine)
            dt -= delay_s
        omega = _hold(omega, k * current_A[i], b, c, s, omega_s, law, dt, fine)
        if omega != 0.0:
            omega += kicks[i]


def fine_flow(
    omega: float,
    drive: float,
    parameters: tuple[float, float, float],
    law: str,
    duration_s: float,
    omega_s: float = OMEGA_S,
    fine_step_s: float = FINE_STEP_S,
) -> float:
    """Speed after `duration_s` under a constant drive; parameters are (b, c, s)."""
    return float(_hold(omega, drive, *parameters, omega_s, LAW_CODES[law], duration_s, fine_step_s))


def fine_trajectory(
    parameters: FrictionParameters,
    time_s: Float64Array,
    current_A: Float64Array,
    *,
    law: str = "gauss",
    initial_speed_rad_s: float = 0.0,
    delay_s: float = 0.0,
    kicks_rad_s: Float64Array | None = None,
    omega_s: float = OMEGA_S,
) -> Float64Array:
    """True speed at each sample; current i acts from time i + delay_s; the delay is shorter than the period.

    kicks_rad_s: process noise, added to the speed of a turning wheel after each interval.
    """
    out = np.empty(time_s.size)
    kicks = np.zeros(time_s.size) if kicks_rad_s is None else kicks_rad_s
    _trajectory(
        initial_speed_rad_s, *parameters, omega_s, LAW_CODES[law], time_s, current_A, delay_s, kicks, FINE_STEP_S, out
    )
    return out


@lru_cache(maxsize=400)
def _true_run(
    profile: str, profile_seed: int, parameters: FrictionParameters, rate_hz: float, law: str
) -> tuple[Float64Array, Float64Array, Float64Array]:
    sampled = sample_profile(make_profile(profile, seed=profile_seed), rate_hz)
    time_s, current_A = np.array(sampled[0]), np.array(sampled[1])
    return time_s, current_A, fine_trajectory(parameters, time_s, current_A, law=law)


def run_of(
    profile: str,
    seed: int,
    *,
    noise_rpm: float = 1.0,
    parameters: FrictionParameters = CK13_STATISTICAL,
    rate_hz: float = 10.0,
    law: str = "gauss",
    profile_seed: int | None = None,
) -> Run:
    """One run; the seed draws the readings' noise and, for P1 and P2, the profile unless profile_seed is given."""
    drawn = seed if profile_seed is None else profile_seed
    time_s, current_A, speed = _true_run(profile, drawn if profile in {"P1", "P2"} else 1, parameters, rate_hz, law)
    noise = np.random.default_rng([seed, len(profile), ord(profile[-1])]).standard_normal(time_s.size)
    return Run(time_s, current_A, speed, speed + noise_rpm * RAD_S_PER_RPM * noise, parameters)


def cramer_rao_std_fine(run: Run, noise_rpm: float, law: str = "gauss") -> Float64Array:
    """The same bound from central differences of the fine-step truth: nothing of the estimator in it."""
    steps = np.array([1e-3, 1e-6, 1e-4, 1e-4])
    jacobian = np.empty((run.time_s.size, 5))
    for j in range(4):
        ends = []
        for way in (1.0, -1.0):
            moved = np.array(run.parameters)
            moved[j] += way * steps[j]
            ends.append(fine_trajectory(FrictionParameters(*moved), run.time_s, run.current_A, law=law))
        jacobian[:, 1 + j] = (ends[0] - ends[1]) / (2.0 * steps[j])
    starts = [
        fine_trajectory(run.parameters, run.time_s, run.current_A, law=law, initial_speed_rad_s=way * 1e-3)
        for way in (1.0, -1.0)
    ]
    jacobian[:, 0] = (starts[0] - starts[1]) / 2.0e-3
    return bound_from(jacobian, noise_rpm)
