"""Readings rounded on plateaus: one error that nobody knows for all readings of a level, integrated out exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.likelihood.levels import Integrated, Levels
from rw_ekf.likelihood.whitening import Chain, whiten
from rw_ekf.logs.wheel_log import WheelLog
from tests.diagnosis.test_whitening import random_chain

Q, R = 0.3, 0.8
GRID = 0.667


def whitened(chain: Chain, rows: Float64Array, memory_rows: Float64Array) -> tuple[Float64Array, Float64Array]:
    """(r, A) where there is an innovation."""
    n, m = rows.shape
    r, A = np.full(n, np.nan), np.zeros((n, m))
    whiten(chain, rows, memory_rows, Q, R, r, A, np.zeros((0, 0)))
    at = np.isfinite(r)
    return r[at], A[at]


@pytest.mark.parametrize("memory", [False, True])
def test_what_an_error_of_a_level_does_to_the_innovations_is_its_regressor(memory: bool) -> None:
    """Errors added to all readings of two levels move the whitened innovations by the regressors times the errors."""
    for seed in range(4):
        chain = random_chain(seed, memory=memory)
        of_sample = np.full(chain.reading.size, -1)
        of_sample[2:10], of_sample[14:19], of_sample[22:30] = 0, 1, 0
        levels = Levels(of_sample, 2, 0.25)
        r, N = whitened(chain, *levels.regressors(chain, with_memory=memory))
        errors = np.array([0.4, -0.7])
        off = np.append(errors, 0.0)[of_sample]
        moved, _ = whitened(chain._replace(reading=chain.reading + off), np.zeros((off.size, 0)), np.zeros((0, 0)))
        assert np.allclose(moved - r, N @ (errors / 0.5), atol=1.0e-10)


def test_integrating_errors_out_is_generalised_least_squares() -> None:
    """Squares and log-determinant are those of the dense covariance I + N N'."""
    rng = np.random.default_rng(3)
    N, r = rng.normal(size=(40, 5)), rng.normal(size=40)
    dense = np.eye(40) + N @ N.T
    found = Integrated.of(N)
    left = found.taken_out(r)
    assert left @ left == pytest.approx(r @ np.linalg.solve(dense, r), rel=1.0e-10)
    assert found.logs == pytest.approx(np.linalg.slogdet(dense)[1], rel=1.0e-10)


def test_a_level_is_where_a_speed_stays_and_is_the_same_when_it_comes_back() -> None:
    """Two visits to one cell are one level, a ramp is none, and a gap ends a stay."""
    ramp = np.linspace(0.0, 10.0, 20)
    speed = np.concatenate((np.full(12, 0.1), ramp, np.full(15, 10.0), ramp[::-1], np.full(9, 0.05)))
    follows = np.ones(speed.size, dtype=bool)
    follows[40] = False
    levels = Levels.of(speed, follows, 1.0, 0.08)
    assert levels.count == 2
    assert set(levels.of_sample[:12]) == set(levels.of_sample[-9:]) == {0}
    assert set(levels.of_sample[15:28]) == {-1}
    assert set(levels.of_sample[32:47]) == {1}


def staircase(seed: int, ratio: float) -> WheelLog:
    """A motor of exactly viscous and Coulomb friction led over levels at 10 Hz; the grid is so many noises."""
    rng = np.random.default_rng(seed)
    k, b, c, h, rows = 70.0, 1.7, 14.0, 0.1, 60
    levels = rng.choice([-28.0, -21.0, -14.0, -7.0, 7.0, 14.0, 21.0, 28.0], 40)
    current = np.repeat((b * levels + c * np.sign(levels)) / k, rows)
    speed, w = np.empty(current.size), 0.0
    for i, u in enumerate(current):
        speed[i], left = w, h
        while left > 0.0:  # in closed form between crossings of zero
            sign = math.copysign(1.0, w if w != 0.0 else u)
            aim = (k * u - c * sign) / b
            if w == 0.0 and abs(k * u) <= c:
                break
            if w * aim < 0.0 and (crossing := math.log(1.0 - w / aim) / b) < left:
                w, left = 0.0, left - crossing
                continue
            w, left = aim + (w - aim) * math.exp(-b * left), 0.0
    noisy = speed + GRID / ratio * rng.standard_normal(speed.size)
    read: Float64Array = GRID * np.rint(noisy / GRID, dtype=np.float64)
    n = read.size
    time: Float64Array = h * np.arange(n, dtype=np.float64)
    drive: Float64Array = np.asarray(current, dtype=np.float64)
    none = np.zeros(n, dtype=np.int64)
    return WheelLog("staircase.csv", time, read, drive, "current_command_A", np.zeros(n), none)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [50.0, 2.0])
def test_rounded_plateaus_make_no_friction_up(ratio: float) -> None:
    """A motor without any effect: nothing is named but the grid, and one of two noises is said to cost nothing."""
    verdict = diagnose_log(staircase(5, ratio)).document()["verdict"]
    assert verdict["effects"] == ["speed_quantisation"]
    assert ("no held-out error is smaller" in verdict["statement"]) == (ratio < 3.0)
