"""Drag beyond a model is found from readings, and a wheel that the model explains is left to the model."""

from __future__ import annotations

import math

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy.stats import norm

from rw_ekf.control.compensation.followed_wheel import FollowedWheel
from rw_ekf.control.compensation.predictive_crossing import PredictiveCrossing
from rw_ekf.control.compensation.unmodelled_drag import WALKS_OF_COULOMB, SpeedNoise, UnmodelledDrag, mean_sign
from rw_ekf.records import WheelSample
from rw_ekf.units import rad_s_from_rpm
from tests.control.compensation.bare_wheel import COULOMB, BareWheel, coulomb
from tests.ticks import tick_of

DT = 0.1
NOISE = SpeedNoise(rad_s_from_rpm(1.0) ** 2, 1.0e-5)


def textbook(walk: float) -> KalmanFilter:
    """The same hypothesis as a linear filter of another library."""
    made = KalmanFilter(dim_x=2, dim_z=1)
    made.x = np.zeros((2, 1))
    made.P = np.diag([NOISE.speed_variance, (0.001 * COULOMB) ** 2])
    made.F = np.array([[1.0, -DT], [0.0, 1.0]])
    made.H = np.array([[1.0, 0.0]])
    made.Q = np.diag([NOISE.acceleration_density * DT, (walk * COULOMB) ** 2 * DT])
    made.R = np.array([[NOISE.speed_variance]])
    return made


def test_the_bank_is_textbook_filters_weighed_by_bayes_rule() -> None:
    """Five linear filters of another library, mixed by hand with a changeover in 300 s: drag, error and weights."""
    residuals = 0.1 * np.random.default_rng(5).standard_normal(300) + 0.02 * np.arange(300) * DT
    bank, others = UnmodelledDrag(COULOMB, NOISE), [textbook(walk) for walk in WALKS_OF_COULOMB]
    prior = np.array(bank.weights)
    weights, corrected = prior.copy(), 0.0
    for residual in residuals:
        likelihood = []
        for other in others:
            other.predict()
            spread = math.sqrt(other.P[0, 0] + NOISE.speed_variance)
            likelihood.append(norm.pdf(residual, other.x[0, 0], spread))
            other.update(np.array([[residual]]))
        weights = ((1.0 - DT / 300.0) * weights + DT / 300.0 * prior) * np.array(likelihood)
        weights /= weights.sum()
        corrected += bank.step(residual - corrected, DT, 1.0)
        mixed = weights @ np.array([other.x[:, 0] for other in others])
        assert bank.weights == pytest.approx(weights, rel=1e-6, abs=1e-12)
        assert corrected == pytest.approx(mixed[0], abs=1e-9)
        assert bank.drag_rad_s2 == pytest.approx(mixed[1], abs=1e-9)


def followed(extra: float, noise_rpm: float, lasts_s: float = 60.0, seed: int = 3) -> FollowedWheel:
    """A wheel that coasts, driven a little, and has more Coulomb friction than is believed."""
    draw = np.random.default_rng(seed)
    noise = SpeedNoise(rad_s_from_rpm(noise_rpm) ** 2, 1.0e-5)
    wheel = BareWheel(
        coulomb(COULOMB + extra), speed=60.0, noise=lambda: math.sqrt(noise.speed_variance) * draw.standard_normal()
    )
    found = FollowedWheel(noise)
    for i in range(round(lasts_s / DT)):
        tick = wheel.tick()
        found.follow(tick, wheel.known(), None if i == 0 else (DT, wheel.current_A))
        found.ahead(wheel.known())
        wheel.current_A = 0.03
        wheel.advance(DT)
    return found


@pytest.mark.parametrize("noise_rpm", [1.0, 5.0])
def test_a_wheel_that_the_model_explains_has_no_drag_beyond_it(noise_rpm: float) -> None:
    """Over twenty draws of the noise: within a thousandth of Coulomb friction, but for one in ten."""
    drags = [abs(followed(0.0, noise_rpm, seed=seed).drag_rad_s2) for seed in range(20)]
    assert float(np.quantile(drags, 0.9)) < 0.002 * COULOMB


@pytest.mark.parametrize("share", [-0.2, 0.1, 1.0, 3.0])
def test_constant_drag_is_found_without_bias(share: float) -> None:
    """From a fifth less to four times the friction that is believed, within 3 % of Coulomb friction in 20 s."""
    drags = [followed(share * COULOMB, 1.0, 20.0, seed).drag_rad_s2 for seed in range(12)]
    assert float(np.mean(drags)) == pytest.approx(share * COULOMB, abs=0.03 * COULOMB)


def test_one_reading_that_no_drag_explains_is_left_out_and_many_are_not() -> None:
    """A glitch of 100 rpm moves nothing; a speed that stays 10 rpm off is believed within a second."""
    wheel, found = BareWheel(coulomb(), speed=60.0), FollowedWheel(NOISE)
    for i in range(80):
        reading = 70.0 if i == 20 else wheel.speed + (rad_s_from_rpm(10.0) if i >= 40 else 0.0)
        found.follow(tick_of(WheelSample(i * DT, reading)), wheel.known(), None if i == 0 else (DT, 0.0))
        found.ahead(wheel.known())
        if i == 20:
            assert found.speed_rad_s == pytest.approx(wheel.speed, abs=1e-3)
        wheel.advance(DT)
    assert found.speed_rad_s == pytest.approx(reading, abs=0.3)


def lag(noise: SpeedNoise | None, extra: float) -> float:
    """How far a wheel with more friction than is believed stays behind the momentum asked of it, through a reversal."""
    wheel = BareWheel(coulomb((1.0 + extra) * COULOMB), speed=6.0)
    wheel.run(PredictiveCrossing(10.0, noise), lambda time_s: -0.2, 60.0)
    wanted = 6.0 - 0.2 * DT * np.arange(1, len(wheel.speeds) + 1)
    wanted_s = np.diff(np.array(wheel.speeds) - wanted)[100:]  # once it has been seen
    return float(np.abs(np.cumsum(wanted_s)).max())


def test_predictive_control_is_free_of_offset() -> None:
    """A fifth more friction, and with it a drag that turns with the motion: a tenth of what the model alone leaves."""
    assert lag(NOISE, 0.2) < 0.1 * lag(None, 0.2)


@pytest.mark.parametrize(
    ("begin", "end", "mean"), [(2.0, 1.0, 1.0), (-1.0, 0.0, -1.0), (1.0, -3.0, -0.5), (0.0, 0.0, 0.0)]
)
def test_the_mean_sign_is_the_share_of_the_time(begin: float, end: float, mean: float) -> None:
    """Of a speed that goes evenly through zero."""
    assert mean_sign(begin, end) == mean
