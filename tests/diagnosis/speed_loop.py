"""A wheel under a speed controller, in small explicit steps: logs whose current knows the readings' noise."""

from __future__ import annotations

import math

import numpy as np

import rw_ekf
from rw_ekf.arrays import Float64Array
from rw_ekf.logs.wheel_log import Drive
from rw_ekf.units import RAD_S_PER_RPM

GAIN, VISCOUS, COULOMB, STATIC, STRIBECK_RAD_S = 15.2, 0.0032, 0.57, 0.60, 0.42
_STEP_S = 0.001


def regulated(
    seed: int, rate_hz: int = 10, seconds: float = 420.0, limit_A: float = 0.2, along_A: float = 0.12
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Times, speeds as they are read and commanded currents, (n,) each.

    A PI controller with anti-windup on readings of 1 rpm of noise, its set-point a step every 8 to 30 s.
    along_A: current of the proportional part for an error of 1 rad/s.
    """
    rng = np.random.default_rng(seed)
    n = round(seconds * rate_hz)
    time_s = np.arange(n) / rate_hz
    ends = np.cumsum(rng.uniform(8.0, 30.0, n))
    wanted = rng.uniform(-60.0, 60.0, n)[np.searchsorted(ends, time_s)]
    noise = RAD_S_PER_RPM * rng.standard_normal(n)
    reading, current_A = np.empty(n), np.empty(n)
    speed = held = 0.0
    for i in range(n):
        reading[i] = speed + noise[i]
        error = float(wanted[i] - reading[i])
        requested = along_A * error + held
        drive_A = min(max(requested, -limit_A), limit_A)
        if drive_A == requested or (requested - drive_A) * error < 0.0:
            held += 0.3 * along_A * error / rate_hz
        current_A[i] = drive_A
        for _ in range(round(1.0 / (rate_hz * _STEP_S))):
            speed = _after(speed, GAIN * drive_A)
    return time_s, reading, current_A


def _after(speed: float, drive: float) -> float:
    if speed == 0.0:
        return _STEP_S * (drive - math.copysign(STATIC, drive)) if abs(drive) > STATIC else 0.0
    dry = COULOMB + (STATIC - COULOMB) * math.exp(-((speed / STRIBECK_RAD_S) ** 2))
    further = speed + _STEP_S * (drive - VISCOUS * speed - math.copysign(dry, speed))
    return 0.0 if further * speed < 0.0 else further


def log_of(time_s: Float64Array, reading: Float64Array, current_A: Float64Array, drive: Drive) -> rw_ekf.Log:
    """As a log; drive: the name of its current."""
    return rw_ekf.read({"time_s": time_s, "speed_rad_s": reading, drive: current_A})
