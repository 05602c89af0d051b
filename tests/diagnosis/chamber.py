"""A wheel in a chamber, by steps of 5 ms and without any code of the package: what it has is a function of time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

import rw_ekf
from rw_ekf.logs.wheel_log import WheelLog

GAIN, VISCOUS, COULOMB, STATIC, STRIBECK = 30.0, 0.02, 0.55, 0.66, 0.42
SAMPLES, RATE_HZ, STEP_S = 6000, 10.0, 0.005
_WARMED_K = 24.0

OfTime = Callable[[float], float]


def cycle(seed: int) -> OfTime:
    """Warmed by 24 K and cooled again within 400 to 600 s."""
    period_s = np.random.default_rng(seed).uniform(400.0, 600.0)
    return lambda time_s: 20.0 + 0.5 * _WARMED_K * (1.0 - math.cos(2.0 * math.pi * time_s / period_s))


def ramp(time_s: float) -> float:
    """Warmed by 24 K over the record."""
    return 20.0 + _WARMED_K * time_s * RATE_HZ / SAMPLES


def wheel_log(
    seed: int,
    *,
    lag_s: float = 0.0,
    slopes: Mapping[str, float] | None = None,
    chamber: OfTime | None = None,
    torque: OfTime = lambda time_s: 0.0,
    gain: OfTime = lambda time_s: 1.0,
    noise_rpm: float = 1.0,
) -> WheelLog:
    """Ten minutes at 10 Hz; slopes: of viscous_temperature and coulomb_temperature [1/K], both exponential.

    torque: per unit inertia [rad/s^2]; gain: as a factor. The torque is new each moment by .01 rad/s per sqrt(s) as
    well; the thermometer reads to .05 K, and the bearing follows it by lag_s.
    """
    rng, n = np.random.default_rng(seed), SAMPLES
    slopes = {} if slopes is None else slopes
    current = np.repeat(rng.uniform(-0.1, 0.1, n // 200), 200).round(4)
    time_s = np.arange(n) / RATE_HZ
    warmth = np.array([(cycle(seed) if chamber is None else chamber)(t) for t in time_s.tolist()])
    kicks = 0.01 * math.sqrt(1.0 / RATE_HZ) * rng.standard_normal(n)
    speed, body, found = 0.0, float(warmth[0]), np.empty(n)
    for i in range(n):
        found[i] = speed
        speed += kicks[i]
        driven = GAIN * gain(time_s[i]) * current[i] + torque(time_s[i])
        for _ in range(round(1.0 / (RATE_HZ * STEP_S))):
            body += (warmth[i] - body) * (STEP_S / lag_s if lag_s else 1.0)
            viscous = VISCOUS * math.exp(slopes.get("viscous_temperature", 0.0) * (body - 20.0))
            dry = math.exp(slopes.get("coulomb_temperature", 0.0) * (body - 20.0))
            pushed, breaks = driven - viscous * speed, STATIC + COULOMB * (dry - 1.0)
            if speed == 0.0 and abs(pushed) <= breaks:
                continue
            way = math.copysign(1.0, speed if speed != 0.0 else pushed)
            friction = COULOMB * dry + (STATIC - COULOMB) * math.exp(-((speed / STRIBECK) ** 2))
            moved = speed + STEP_S * (pushed - way * friction)
            speed = 0.0 if moved * way < 0.0 else moved
    return rw_ekf.read({
        "time_s": time_s, "speed_rad_s": found + noise_rpm * math.pi / 30.0 * rng.standard_normal(n),
        "current_A": current, "temperature_degC": warmth + 0.05 * rng.standard_normal(n),
    })  # fmt: skip
