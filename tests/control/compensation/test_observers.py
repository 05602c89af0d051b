"""Observers find constant friction without bias, and what a model explains is not found once more."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.control.compensation.adrc import ActiveDisturbanceRejection, BareObserver, ModelObserver, speed_after
from rw_ekf.control.compensation.disturbance_observer import DisturbanceObserver, ObserverFilter
from rw_ekf.model.state import FrictionParameters
from rw_ekf.records import WheelSample
from tests.control.compensation.bare_wheel import COULOMB, GAIN, BareWheel, coulomb
from tests.ticks import tick_of


def dob() -> DisturbanceObserver:
    return DisturbanceObserver(GAIN, ObserverFilter(2.0))


def bare() -> ActiveDisturbanceRejection:
    return ActiveDisturbanceRejection(BareObserver(2.0), GAIN)


def found(scheme: DisturbanceObserver | ActiveDisturbanceRejection) -> float:
    return scheme.friction_rad_s2 if isinstance(scheme, DisturbanceObserver) else -scheme.rest_rad_s2


@pytest.mark.parametrize("make", [dob, bare])
@pytest.mark.parametrize("request_rad_s2", [0.0, 0.4, -0.2])
def test_constant_friction_is_found_exactly_and_the_request_is_what_the_wheel_does(make, request_rad_s2) -> None:  # type: ignore[no-untyped-def]
    """Without noise, to the rounding; in steady state the wheel accelerates by what is asked for."""
    scheme, wheel = make(), BareWheel(coulomb(), speed=30.0)
    wheel.run(scheme, lambda t: request_rad_s2, 30.0)
    assert found(scheme) == pytest.approx(COULOMB, abs=1e-6)
    assert (wheel.speeds[-1] - wheel.speeds[-101]) / 10.0 == pytest.approx(request_rad_s2, abs=1e-6)


@pytest.mark.parametrize("make", [dob, bare])
def test_noise_of_the_readings_does_not_bias_the_friction(make) -> None:  # type: ignore[no-untyped-def]
    """The mean over 400 s at 5 rpm of noise, within four of its standard deviations."""
    draw = np.random.default_rng(3)
    scheme, wheel = make(), BareWheel(coulomb(), speed=30.0, noise=lambda: float(draw.normal(0.0, 0.52)))
    wheel.run(scheme, lambda t: 0.0, 20.0)
    values = []
    for _ in range(4000):
        wheel.run(scheme, lambda t: 0.0, 0.1)
        values.append(found(scheme))
    blocks = np.array(values).reshape(40, 100).mean(axis=1)
    assert abs(blocks.mean() - COULOMB) < 4.0 * blocks.std() / math.sqrt(40.0)
    assert np.std(values) > 0.05  # the noise did reach it


@pytest.mark.parametrize("make", [dob, bare])
def test_readings_that_are_missing_leave_the_friction_where_it_was(make) -> None:  # type: ignore[no-untyped-def]
    """Two seconds without a speed: the current holds, and the next reading finds the same friction."""
    scheme, wheel = make(), BareWheel(coulomb(), speed=30.0)
    wheel.run(scheme, lambda t: 0.0, 30.0)
    before = wheel.current_A
    for _ in range(20):
        tick = wheel.tick()
        wheel.current_A = scheme.current_A(
            replace(tick, sample=replace(tick.sample, speed_rad_s=None)), 0.0, wheel.known()
        )
        assert wheel.current_A == pytest.approx(before, abs=1e-6)
        wheel.advance(0.1)
    wheel.run(scheme, lambda t: 0.0, 1.0)
    assert found(scheme) == pytest.approx(COULOMB, abs=1e-5)


def test_an_observer_with_the_exact_model_finds_nothing_left() -> None:
    """Through two reversals and a stop; the bare observer finds all of the friction."""
    rests = {}
    for name, scheme in (("model", ActiveDisturbanceRejection(ModelObserver(2.0))), ("bare", bare())):
        wheel = BareWheel(coulomb(), speed=8.0)
        most = 0.0
        for i in range(600):
            wheel.run(scheme, lambda t: -1.0 * math.copysign(1.0, math.sin(0.21 * t + 0.2)), 0.1)
            most = max(most, abs(scheme.rest_rad_s2)) if i > 50 else most
        rests[name] = most
    assert rests["bare"] > COULOMB
    assert rests["model"] < 0.02 * COULOMB


def test_an_observer_with_a_model_finds_what_the_model_lacks() -> None:
    """Friction half as large again as believed: the other half is the rest."""
    scheme, wheel = ActiveDisturbanceRejection(ModelObserver(2.0)), BareWheel(coulomb(1.5 * COULOMB), speed=30.0)
    wheel.run(scheme, lambda t: 0.0, 20.0)
    assert -scheme.rest_rad_s2 == pytest.approx(0.5 * COULOMB, rel=1e-3)


@pytest.mark.parametrize(
    ("speed", "drive"), [(3.0, 0.2), (0.1, -2.0), (0.02, 0.3), (0.0, 0.3), (0.0, -0.9), (-0.05, 4.0)]
)
def test_the_prediction_of_a_speed_is_that_of_fine_steps(speed: float, drive: float) -> None:
    """Over a tenth of a second, through zero and to rest."""
    wheel = BareWheel(coulomb(COULOMB, 0.05), speed=speed, current_A=drive / GAIN)
    wheel.believed = FrictionParameters(GAIN, 0.05, COULOMB, COULOMB)
    model = wheel.known()
    wheel.advance(0.1)
    assert speed_after(speed, drive, 0.1, model) == pytest.approx(wheel.speed, abs=4e-3)


def test_a_gap_starts_the_speed_anew_and_keeps_the_friction() -> None:
    """A wheel that was handed to someone else for a minute gives no false friction."""
    for scheme in (dob(), bare()):
        wheel = BareWheel(coulomb(), speed=30.0)
        wheel.run(scheme, lambda t: 0.0, 30.0)
        later = tick_of(WheelSample(wheel.time_s + 60.0, 200.0, current_command_A=0.3))
        assert scheme.current_A(later, 0.0, wheel.known()) == pytest.approx(COULOMB / GAIN, rel=1e-5)
