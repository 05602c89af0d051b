"""Coast-downs of a flywheel without a motor, by an integration of their own (classical Runge-Kutta)."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from rw_ekf.logs.wheel_log import WheelLog

Drag = Callable[[float, float], float]  # deceleration [rad/s^2] at a speed [rad/s] and a time [s]


def coast_down(drag: Drag, seed: int, *, start: float = 520.0, samples: int = 5000, rate_hz: float = 14.6) -> WheelLog:
    """A log of 0.11 rpm noise from a start speed [rad/s], the current zero throughout."""
    h = 1.0 / rate_hz
    speed = np.empty(samples)
    w = start
    for i in range(samples):
        speed[i] = w
        t = i * h
        k1 = -drag(w, t)
        k2 = -drag(w + 0.5 * h * k1, t + 0.5 * h)
        k3 = -drag(w + 0.5 * h * k2, t + 0.5 * h)
        k4 = -drag(w + h * k3, t + h)
        w += h * (k1 + 2.0 * k2 + 2.0 * k3 + k4) / 6.0
    noise = 0.11 * math.pi / 30.0 * np.random.default_rng(seed).standard_normal(samples)
    zero = np.zeros(samples)
    return WheelLog(
        f"coast-down-{start:.0f}", np.linspace(0.0, (samples - 1) * h, samples), speed + noise, zero, "constant", zero,
        np.zeros(samples, dtype=np.int64),
    )  # fmt: skip


def cubic(w: float, t: float) -> float:
    """An S-shaped drag of one coefficient."""
    return 0.61 + 0.0021 * w + 2.8e-9 * w**3


def between(w: float, t: float) -> float:
    """A drag that neither the square nor the cube is alone."""
    return 0.6 + 0.0018 * w + 9e-8 * w * w * math.sqrt(w)


def event(t: float, onset_s: float, size: float, decay_s: float) -> float:
    """Drag from an onset on [rad/s^2]."""
    return size * math.exp(-(t - onset_s) / decay_s) if t >= onset_s else 0.0
