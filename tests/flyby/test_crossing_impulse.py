"""Torque impulses of zero crossings: the figures of [L17], and an attitude record with a known impulse."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.flyby.crossing_impulse import wheel_axis_impulse, zero_crossing_impulse

INERTIA_2013 = (6400.0, 5300.0, 3500.0)
RWA_4 = tuple(map(math.radians, (45.0, 114.1, 54.74)))
RWA_2 = tuple(map(math.radians, (135.0, 114.0, 54.74)))
INERTIA, IMPULSE, CROSSING_S = 0.5, 2.0e-3, 30.0
RATE = IMPULSE / INERTIA


def milli(values: tuple[float | None, ...]) -> list[float | None]:
    """mN m s."""
    return [None if value is None else 1e3 * value for value in values]


def test_the_crossing_of_2013_005_18_24() -> None:
    """-10.5, -11.3, -8.95, mean -10.3 mNms as printed, within what rates of three digits leave open."""
    found = wheel_axis_impulse((-1.16e-6, 0.87e-6, -1.48e-6), INERTIA_2013, RWA_4)
    assert milli(found.per_axis_Nms) == pytest.approx([-10.5, -11.3, -8.95], abs=0.05)
    assert 1e3 * found.mean_Nms == pytest.approx(-10.3, abs=0.06)
    assert 1e3 * found.least_squares_Nms == pytest.approx(-10.12, abs=0.02)


def test_the_crossing_of_2013_005_17_31() -> None:
    """+10.2 and +8.36, mean 9.28 mNms as printed; the Y axis is hidden by other motion."""
    found = wheel_axis_impulse((1.13e-6, None, 1.38e-6), INERTIA_2013, RWA_4)
    assert found.per_axis_Nms[1] is None
    assert milli(found.per_axis_Nms)[::2] == pytest.approx([10.2, 8.36], abs=0.05)
    assert 1e3 * found.mean_Nms == pytest.approx(9.28, abs=0.03)


def test_the_crossing_of_2007_029_gives_back_the_rates_that_are_not_printed() -> None:
    """12.3 and 11.6, mean 11.9 mNms: the rates are not in the paper; those that these figures stand for give them."""
    inertia = (6882.0, 5688.0, 3620.0)
    rates = (12.3e-3 * math.cos(RWA_2[0]) / inertia[0], None, 11.6e-3 * math.cos(RWA_2[2]) / inertia[2])
    assert rates[0] == pytest.approx(-1.264e-6, abs=1e-9)
    assert rates[2] == pytest.approx(1.850e-6, abs=1e-9)
    assert 1e3 * wheel_axis_impulse(rates, inertia, RWA_2).mean_Nms == pytest.approx(11.9, abs=0.06)


def test_an_impulse_along_a_wheel_is_found_again_on_every_axis() -> None:
    """I rate = J a: all axes, their mean and the least squares give J."""
    axis = np.array([0.48, -0.6, 0.64])
    rates = [3e-3 * a / i for a, i in zip(axis, INERTIA_2013, strict=True)]
    found = wheel_axis_impulse(rates, INERTIA_2013, [math.acos(a) for a in axis])
    assert found.per_axis_Nms == pytest.approx((3e-3,) * 3)
    assert (found.mean_Nms, found.least_squares_Nms) == pytest.approx((3e-3, 3e-3))


@pytest.mark.parametrize("rates", [(None, None, None), (1e-6, 1e-6, 1e-6)])
def test_axes_that_show_nothing_are_refused(rates: tuple[float | None, ...]) -> None:
    """No rate at all, and an axis square to the wheel's: ValueError, no division by nothing."""
    with pytest.raises(ValueError, match="impulse"):
        wheel_axis_impulse(rates, INERTIA_2013, (0.5 * math.pi, 0.3, 1.2))


def record(
    seed: int, *, noise_rad: float = 2e-5, walk: float = 0.0, lasts_s: float = 0.0
) -> tuple[Float64Array, Float64Array]:
    """Time and attitude of a body that drifts, and is kicked at 30 s (evenly over lasts_s), at 10 Hz."""
    rng = np.random.default_rng(seed)
    time = np.arange(600) * 0.1 + rng.uniform(-0.01, 0.01, 600)
    since = time - CROSSING_S
    if lasts_s == 0.0:
        kicked = RATE * np.maximum(since, 0.0)
    else:
        inside = np.clip(since, 0.0, lasts_s)
        kicked = RATE * (0.5 * inside**2 / lasts_s + np.maximum(since - lasts_s, 0.0))
    noise = noise_rad * rng.standard_normal(600) + walk * np.cumsum(rng.standard_normal(600))
    return time, 0.01 - 3e-4 * time + kicked + noise


@pytest.mark.parametrize(
    ("noise_rad", "walk", "degree"), [(2e-5, 0.0, 1), (2e-5, 0.0, 2), (0.0, 1e-5, 1), (2e-5, 1e-5, 2)]
)
def test_the_impulse_is_found_with_an_honest_sigma(noise_rad: float, walk: float, degree: int) -> None:
    """200 records each, white noise, a gyro's random walk, both: no bias, and errors as large as said."""
    scores = []
    for seed in range(200):
        time, attitude = record(seed, noise_rad=noise_rad, walk=walk)
        found = zero_crossing_impulse(time, attitude, CROSSING_S, INERTIA, after_degree=degree)
        scores.append((found.value - IMPULSE) / found.std)
    assert abs(np.mean(scores)) < 4.0 / math.sqrt(200)
    assert 0.8 < np.std(scores) < 1.25


def test_an_impulse_that_lasts_is_found_whole() -> None:
    """A wheel that stands for 2 s: with that time left out the whole impulse is seen, otherwise too little."""
    time, attitude = record(1, lasts_s=2.0)
    whole = zero_crossing_impulse(time, attitude, CROSSING_S, INERTIA, lasts_s=2.0)
    assert abs(whole.value - IMPULSE) < 4.0 * whole.std
    assert whole.std < 0.1 * IMPULSE
    early = zero_crossing_impulse(time, attitude, CROSSING_S, INERTIA, after_degree=1)
    assert early.value < 0.95 * IMPULSE


def test_a_controller_that_pulls_the_body_back() -> None:
    """Under PD control the mean slope up to the peak, [L17]'s reading, is less than half; a short parabola has all."""
    natural, damping = 0.188, 0.6  # rad/s: 0.03 Hz
    time = np.arange(600) * 0.1
    since = np.maximum(time - CROSSING_S, 0.0)
    damped = natural * math.sqrt(1.0 - damping**2)
    attitude = RATE / damped * np.exp(-damping * natural * since) * np.sin(damped * since)
    attitude += 1e-6 * np.random.default_rng(2).standard_normal(600)
    peak = int(np.argmax(attitude))
    to_the_peak = INERTIA * attitude[peak] / (time[peak] - CROSSING_S)
    assert 0.35 < to_the_peak / IMPULSE < 0.5
    found = zero_crossing_impulse(time, attitude, CROSSING_S, INERTIA, after_s=2.0)
    assert found.value == pytest.approx(IMPULSE, rel=0.02)


def test_gaps_are_left_out_and_too_little_is_refused() -> None:
    """NaN attitudes do no harm; too few samples on one side, or time that does not rise, are a ValueError."""
    time, attitude = record(3)
    holes = attitude.copy()
    holes[::7] = math.nan
    found = zero_crossing_impulse(time, holes, CROSSING_S, INERTIA)
    assert abs(found.value - IMPULSE) < 4.0 * found.std
    with pytest.raises(ValueError, match="after the crossing"):
        zero_crossing_impulse(time[:305], attitude[:305], CROSSING_S, INERTIA)
    with pytest.raises(ValueError, match="before the crossing"):
        zero_crossing_impulse(time[296:], attitude[296:], CROSSING_S, INERTIA)
    with pytest.raises(ValueError, match="must rise"):
        zero_crossing_impulse(np.round(time), attitude, CROSSING_S, INERTIA)


def test_a_record_without_noise_has_no_sigma_to_speak_of() -> None:
    """Exact lines: the impulse to rounding."""
    time, attitude = record(4, noise_rad=0.0)
    found = zero_crossing_impulse(time, attitude, CROSSING_S, INERTIA)
    assert found.value == pytest.approx(IMPULSE, rel=1e-9)
    assert found.std < 1e-9 * IMPULSE
