"""The excitation profiles, on a small simulated wheel."""

from __future__ import annotations

import itertools
import math

import pytest

from rw_ekf.control.profiles import PROFILE_NAMES, Profile, make_profile, sample_profile
from rw_ekf.control.profiles.profile_pieces import Piece, PiecewiseLinear, hold, ramped
from rw_ekf.errors import BadInputError
from rw_ekf.units import RAD_S_PER_RPM

WHEEL = (15.205, 0.00322, 0.5863, 0.6037)  # motor gain, viscous, Coulomb, static


def simulated_rpm(profile: Profile, wheel: tuple[float, ...], step_s: float = 0.02) -> list[float]:
    """Speed [rpm] of a wheel that follows `profile`; Euler steps, coming to rest where the speed changes sign."""
    gain, viscous, coulomb, static = wheel
    assert profile.duration_s is not None
    speed, result = 0.0, []
    for index in range(round(profile.duration_s / step_s)):
        drive = gain * profile.current_A(index * step_s)
        if speed == 0.0:
            speed = 0.0 if abs(drive) <= static else step_s * math.copysign(abs(drive) - static, drive)
        else:
            bump = (static - coulomb) * math.exp(-((speed / (4.0 * RAD_S_PER_RPM)) ** 2))
            after = speed + step_s * (drive - viscous * speed - math.copysign(coulomb + bump, speed))
            speed = 0.0 if after * speed < 0.0 else after
        result.append(speed / RAD_S_PER_RPM)
    return result


def reversals(speed_rpm: list[float]) -> int:
    signs = [speed > 0.0 for speed in speed_rpm if speed != 0.0]
    return sum(one != two for one, two in itertools.pairwise(signs))


@pytest.mark.parametrize(
    ("name", "amplitude_A", "period_s", "duration_s"),
    [("S1", 0.1, 480, 1440), ("S2", 0.1, 120, 360), ("S3", 0.1, 30, 90), ("S4", 0.2, 120, 360), ("S5", 0.2, 30, 90)],
)
def test_the_signals_of_the_source(name: str, amplitude_A: float, period_s: float, duration_s: float) -> None:
    """Proves that S1 to S5 are those of [F12], Table 1, all with a bias of -50 mA."""
    profile = make_profile(name)
    assert profile.duration_s == duration_s
    for time_s in (0.0, 1.7, 0.25 * period_s, 0.9 * duration_s):
        expected_A = amplitude_A * math.sin(2 * math.pi / period_s * time_s) - 0.05
        assert profile.current_A(time_s) == pytest.approx(expected_A, abs=1e-12)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_p1_crosses_zero_about_24_times_at_low_speed(seed: int) -> None:
    """Proves that P1 is like the profile 1 of [CK13]: 300 s, about 24 crossings, low speeds."""
    profile = make_profile("P1", seed=seed)
    speed_rpm = simulated_rpm(profile, WHEEL)
    assert profile.duration_s == 300.0
    assert 20 <= reversals(speed_rpm) <= 28
    assert 50 < max(map(abs, speed_rpm)) < 300


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_p2_reverses_every_30_seconds(seed: int) -> None:
    """Proves that P2 is like the profile 2 of [CK13]: 300 s, 9 crossings, constant currents of random amplitude."""
    profile = make_profile("P2", seed=seed)
    speed_rpm = simulated_rpm(profile, WHEEL)
    assert profile.duration_s == 300.0
    assert reversals(speed_rpm) == 9
    assert 150 < max(map(abs, speed_rpm)) < 600
    levels = [profile.current_A(30.0 * index + 1.0) for index in range(10)]
    assert all(one * two < 0 for one, two in itertools.pairwise(levels))
    assert levels[0] == profile.current_A(29.9)


@pytest.mark.parametrize("factors", [(1.0,) * 4, *itertools.product((0.8, 1.2), repeat=4)])
def test_identification_works_on_wheels_20_percent_off(factors: tuple[float, ...]) -> None:
    """Proves that every such wheel reverses often, is driven fast and creeps slowly, within all limits."""
    profile = make_profile("identification")
    wheel = tuple(value * factor for value, factor in zip(WHEEL, factors, strict=True))
    speed_rpm = simulated_rpm(profile, wheel)
    assert profile.duration_s == 600.0
    assert reversals(speed_rpm) >= 17
    assert 1300 < max(speed_rpm) < 3000
    assert -3000 < min(speed_rpm) < -1300
    assert 0.02 * sum(2 <= abs(speed) <= 20 for speed in speed_rpm) > 30.0
    assert max(abs(profile.current_A(0.5 * index)) for index in range(1200)) <= 0.4


def test_identification_has_coast_downs_and_bursts() -> None:
    """Proves that there is a coast of more than a minute in each direction, from about 2000 rpm."""
    profile = make_profile("identification")
    speed_rpm = simulated_rpm(profile, WHEEL)
    coasting = [index for index in range(600) if profile.current_A(index + 0.5) == 0.0]
    assert sum(speed_rpm[50 * index] > 1000 for index in coasting) > 60
    assert sum(speed_rpm[50 * index] < -1000 for index in coasting) > 60
    assert max(speed_rpm) == pytest.approx(1923, rel=0.02)


@pytest.mark.parametrize("rate_hz", [5.0, 10.0, 33.0, 100.0, 997.0])
def test_identification_never_asks_for_more_than_the_default_slew_limit(rate_hz: float) -> None:
    """Proves that from rest on no step is faster than 4 A/s, so that a tick 20 % early is granted too, at any rate."""
    _, currents = sample_profile(make_profile("identification"), rate_hz)
    steps = [abs(late - early) * rate_hz for early, late in itertools.pairwise((0.0, *currents))]
    assert max(steps) <= 4.0 + 1e-9


def test_ramps_lead_up_to_each_piece() -> None:
    """Proves that jumps become ramps that end where the next piece begins, and slopes stay what they were."""
    course = PiecewiseLinear(ramped([hold(1.0, 0.2), hold(1.0, -0.2), Piece(2.0, 0.1, 0.3)], 2.0))
    assert course.duration_s == pytest.approx(4.0)
    points = {0.0: 0.0, 0.1: 0.2, 0.8: 0.2, 0.9: 0.0, 1.0: -0.2, 1.85: -0.2, 2.0: 0.1, 3.0: 0.2, 3.999: 0.2999}
    for time_s, current_A in points.items():
        assert course.current_A(time_s) == pytest.approx(current_A, abs=1e-9), time_s


@pytest.mark.parametrize("name", PROFILE_NAMES)
def test_a_profile_is_a_pure_function_of_time_and_seed(name: str) -> None:
    """Proves that asking in another order, or of another object, gives the same currents."""
    times = [0.0, 250.0, 3.3, 77.7, 3.3, 10.0]
    first, second = make_profile(name, seed=5), make_profile(name, seed=5)
    forwards = {t: first.current_A(t) for t in times}
    backwards = {t: second.current_A(t) for t in sorted(times, reverse=True)}
    assert forwards == backwards


@pytest.mark.parametrize("name", ["steps", "random-sines", "P1", "P2"])
def test_another_seed_is_another_profile(name: str) -> None:
    """Proves that the seed matters where it should."""
    assert make_profile(name, seed=1).current_A(5.0) != make_profile(name, seed=2).current_A(5.0)


@pytest.mark.parametrize("name", ["sine", "steps", "random-sines"])
def test_shaped_profiles_stay_within_amplitude_and_bias(name: str) -> None:
    """Proves that amplitude plus bias, which the configuration checks against the limit, is never exceeded."""
    profile = make_profile(name, amplitude_A=0.2, period_s=7.0, bias_A=0.1, seed=3)
    currents = [profile.current_A(0.05 * index) for index in range(4000)]
    assert max(currents) <= 0.3 + 1e-12
    assert min(currents) >= -0.1 - 1e-12
    assert max(currents) > 0.25
    assert min(currents) < -0.05


def test_nothing_is_commanded_outside_the_profile() -> None:
    """Proves that before the start and from the end on the current is zero."""
    profile = make_profile("S3")
    assert profile.current_A(-0.1) == 0.0
    assert profile.current_A(90.0) == 0.0
    assert profile.current_A(89.9) != 0.0
    assert make_profile("zero").current_A(1e6) == 0.0


def test_sampling() -> None:
    """Proves the number of samples, their times, and that an endless profile needs an end."""
    time_s, current_A = sample_profile(make_profile("S3"), 10.0)
    assert len(time_s) == len(current_A) == 900
    assert time_s[-1] == 89.9
    assert len(sample_profile(make_profile("sine"), 10.0, 5.0)[0]) == 50
    with pytest.raises(ValueError, match="no end"):
        sample_profile(make_profile("sine"), 10.0)


def test_an_unknown_profile_lists_the_known_ones() -> None:
    """Proves that a wrong name is bad input with a remedy."""
    with pytest.raises(BadInputError, match="identification"):
        make_profile("P3")
