"""Gain, friction and delay of a move are those of the wheel that was simulated here, by small steps of its equation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rw_ekf.commissioning.guarded_wheel import Row
from rw_ekf.commissioning.motion_fit import fit_delay, fit_late_motion, fit_motion

GAIN, COULOMB, VISCOUS = 7.0, 0.9, 0.004
STEP_S = 1.0e-4
REST_RAD_S = 1.0


def moved(delay_s: float, noise_rad_s: float, seed: int, sign: float = 1.0) -> list[Row]:
    """Pulses around a steady speed at 25 Hz; a command acts 4 ms and the delay after its reading."""
    rng = np.random.default_rng(seed)
    rows, speed, pending, current = [], 0.0, [], 0.0
    for index in range(25 * 16):
        time_s = 0.04 * index
        wanted = 0.6 if index < 40 else 0.13 + 0.25 * math.copysign(1.0, math.sin(2.0 * math.pi * time_s / 1.13))
        rows.append(
            Row(
                time_s,
                sign * speed + noise_rad_s * rng.standard_normal(),
                None,
                None,
                None,
                0,
                wanted,
                0.004,
                known=True,
            )
        )
        pending.append((time_s + 0.004 + delay_s, wanted))
        for step in range(round(0.04 / STEP_S)):
            while pending and pending[0][0] <= time_s + step * STEP_S:
                current = pending.pop(0)[1]
            push = GAIN * current
            if speed > 0.0 or push > COULOMB:
                speed = max(speed + STEP_S * (push - COULOMB - VISCOUS * speed), 0.0)
    return rows


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_gain_and_friction_are_the_wheel_s(sign: float) -> None:
    """Within five of the sigmas told, which are below 3 %; a reading the other way round has the gain below zero."""
    found = fit_motion(moved(0.0, 0.05, seed=1, sign=sign), REST_RAD_S)
    assert found is not None
    assert found.gain == pytest.approx(sign * GAIN, abs=5.0 * found.gain_std)
    assert found.gain_std < 0.03 * GAIN
    assert found.residual_rad_s == pytest.approx(0.05, rel=0.2)


@pytest.mark.parametrize("delay_s", [0.0, 0.03, 0.11])
def test_the_delay_is_the_one_that_was_put_in(delay_s: float) -> None:
    """Within five told sigmas over three seeds, each below 5 ms; and the gain is no longer biased by it."""
    for seed in range(3):
        rows = moved(delay_s, 0.05, seed)
        found = fit_delay(rows, REST_RAD_S)
        assert found is not None
        assert found.std_s < 0.005
        assert found.delay_s == pytest.approx(delay_s, abs=5.0 * found.std_s)
        fit, _ = fit_late_motion(rows, REST_RAD_S)
        assert fit is not None
        assert fit.gain == pytest.approx(GAIN, rel=0.02)


def test_a_wheel_at_rest_tells_nothing() -> None:
    """Readings below the level of motion give no fit, neither of the motion nor of the delay."""
    rows = [row._replace(speed_rad_s=0.1) for row in moved(0.0, 0.05, seed=1)]
    assert fit_motion(rows, REST_RAD_S) is None
    assert fit_delay(rows, REST_RAD_S) is None
