"""Predictive crossing inverts the propagation, leaves a wheel at rest alone, and pays back what it fell short of."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rw_ekf.attitude_bench.bench_start import start_of
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.predictive_crossing import Payback, PredictiveCrossing, inverted
from rw_ekf.control.compensation.schemes import SCHEMES
from rw_ekf.drivers.sim.plant import advance
from rw_ekf.drivers.sim.plant_parameters import PlantParameters, PlantState
from rw_ekf.model.friction import GAUSS, Stribeck
from rw_ekf.model.state import FrictionParameters
from rw_ekf.records import IssuedCommand, Tick, WheelSample
from rw_ekf.units import rad_s_from_rpm
from tests.control.compensation.bare_wheel import BELIEVED, COULOMB, BareWheel, coulomb
from tests.ticks import tick_of

PERIOD_S = 0.1
PLANT = PlantParameters()
TRUE = FrictionParameters(PLANT.motor_gain, PLANT.viscous, PLANT.coulomb, PLANT.static)
STRIBECK = Stribeck(PLANT.stribeck_speed_rad_s, GAUSS)


def first_current(speed: float, request: float, parameters: FrictionParameters = TRUE) -> float:
    """What a fresh scheme asks for."""
    known = WheelKnown.of_parameters(speed, parameters, STRIBECK)
    return PredictiveCrossing(1.0 / PERIOD_S).current_A(tick_of(WheelSample(0.0, speed)), request, known)


@pytest.mark.parametrize(
    ("speed", "request_rad_s2"),
    [
        (70.0, 0.3),
        (-70.0, 0.3),
        (0.5, -0.3),
        (0.0149, -0.31),  # through zero within the interval
        (0.03, -0.31),  # to the brink of zero
        (-0.2, 3.0),
        (0.2, -2.5),
        (0.0, 0.31),
        (0.0, -0.21),
        (1e-5, -0.31),
    ],
)
def test_the_inversion_is_exact(speed: float, request_rad_s2: float) -> None:
    """The simulated wheel, integrated by itself in steps of 10 us, ends where the request leads, within 1e-6 rad/s."""
    current = first_current(speed, request_rad_s2)
    end = advance(PLANT, PlantState(speed_rad_s=speed), current, PERIOD_S, 1e-5).speed_rad_s
    assert end == pytest.approx(speed + request_rad_s2 * PERIOD_S, abs=1e-6)


def test_a_wheel_at_rest_is_left_alone_until_enough_is_asked_for_and_then_gets_all_of_it() -> None:
    """A request too small for a tick adds up; the wheel breaks free with all that was asked for meanwhile."""
    scheme, request, given_up = PredictiveCrossing(10.0), 0.03, 0
    known = WheelKnown.of_parameters(0.0, TRUE, STRIBECK)
    current, i = 0.0, 0
    while current == 0.0:
        current = scheme.current_A(tick_of(WheelSample(i * PERIOD_S, 0.0)), request, known)
        i += 1
        given_up += 1
    assert given_up == pytest.approx(Payback().least_rad_s / (request * PERIOD_S), abs=2)
    end = advance(PLANT, PlantState(), current, PERIOD_S, 1e-5).speed_rad_s
    assert end == pytest.approx(given_up * request * PERIOD_S, rel=0.05)


@pytest.mark.parametrize("noise_rpm", [1.0, 5.0])
@pytest.mark.parametrize("request_noise", [0.0, 0.0045])
def test_no_limit_cycle_at_rest(noise_rpm: float, request_noise: float) -> None:
    """Ten minutes of noisy readings of a wheel that stands: not one current, nor by the noise of the request."""
    scenario = Scenario()
    start = start_of(SCHEMES["predictive_crossing"], scenario, noise_rpm, 1)
    scheme = SCHEMES["predictive_crossing"].make(start.sheet)
    draw = np.random.default_rng(7)
    for i in range(6000):
        reading = rad_s_from_rpm(noise_rpm) * draw.standard_normal()
        sample = WheelSample(i * PERIOD_S, reading, current_command_A=0.0, temperature_degC=20.0, angle_rad=0.0)
        tick = Tick(sample, start.estimator.step(sample))
        assert scheme.current_A(tick, request_noise * draw.standard_normal(), start.knowledge(tick)) == 0.0
        start.estimator.command_issued(IssuedCommand(0.0, 0.01))


@given(st.lists(st.tuples(st.floats(-2.0, 2.0), st.floats(-3.0, 3.0)), min_size=1, max_size=8))
@example([(-1.0, 0.0), (1e-89, 2.5)])  # the target is zero, whichever way the wheel still turns
@settings(max_examples=60, deadline=None)
def test_the_mirrored_wheel_gets_the_mirrored_current(turns: list[tuple[float, float]]) -> None:
    """Over runs of any speeds and requests, what is owed included."""
    one, other = PredictiveCrossing(10.0), PredictiveCrossing(10.0)
    for i, (speed, request) in enumerate(turns):
        currents = [
            scheme.current_A(
                tick_of(WheelSample(i * PERIOD_S, way * speed)),
                way * request,
                WheelKnown.of_parameters(way * speed, TRUE, STRIBECK),
            )
            for scheme, way in ((one, 1.0), (other, -1.0))
        ]
        assert currents[0] == pytest.approx(-currents[1], abs=1e-7)


@given(
    st.floats(-1e4, 1e4),
    st.floats(allow_nan=False, allow_infinity=False),
    st.tuples(st.floats(-100.0, 1e3), st.floats(-1.0, 10.0), st.floats(-1.0, 10.0), st.floats(-1.0, 10.0)),
)
@settings(max_examples=200, deadline=None)
def test_any_finite_input_gives_a_finite_current(
    speed: float, request: float, parameters: tuple[float, float, float, float]
) -> None:
    """Also for parameters that no wheel has, as a filter may pass through them."""
    assert math.isfinite(first_current(speed, request, FrictionParameters(*parameters)))


@given(st.floats(-0.5, 0.5), st.floats(0.0, 0.1), st.floats(0.5, 30.0), st.floats(0.1, 3.0), st.floats(-2.0, 2.0))
@settings(max_examples=300, deadline=None)
def test_any_rising_map_with_a_flat_part_is_inverted(
    middle: float, half: float, slope: float, ratio: float, target: float
) -> None:
    """Flat between two currents, with other slopes on either side: the target is reached, wherever the guess lies."""

    def end(current: float) -> float:
        over = current - middle
        if abs(over) <= half:
            return 0.0
        return slope * (over - half) if over > 0.0 else slope * ratio * (over + half)

    for guess in (0.0, middle, -0.6):
        assert end(inverted(end, target, guess, 1.5)) == pytest.approx(target, abs=1e-7)


def test_without_a_motor_nothing_is_asked_of_it() -> None:
    """A motor gain that is believed zero or negative."""
    for gain in (0.0, -3.0):
        assert first_current(1.0, 0.3, TRUE._replace(motor_gain=gain)) == 0.0


def test_with_the_least_motor_that_can_be_the_current_is_finite() -> None:
    """The least positive number there is as a gain: times an interval it is nothing."""
    for gain in (5e-324, 1e-300):
        assert math.isfinite(first_current(0.0, 1.0, FrictionParameters(gain, 0.0, 0.0, 0.0)))


def reversal(payback: Payback) -> tuple[float, float]:
    """Final and largest lag behind the speed that was asked for, of a wheel with 5 % more friction than is believed."""
    wheel = BareWheel(coulomb(1.05 * COULOMB), speed=0.6, believed=BELIEVED)
    wheel.run(PredictiveCrossing(10.0, payback=payback), lambda time_s: -0.2, 8.0)
    lag = np.array(wheel.speeds) - (0.6 - 0.2 * 0.1 * np.arange(1, len(wheel.speeds) + 1))
    return abs(float(lag[-1])), float(np.abs(lag).max())


def test_a_shortfall_is_paid_back() -> None:
    """Friction that is believed 5 % too low costs the more speed the longer it lasts; paid back it stays a moment's."""
    without, paid = reversal(Payback(share=0.0)), reversal(Payback())
    assert without[0] > 0.05
    assert paid[0] < 0.01
    assert paid[1] < 0.25 * without[1]


def test_what_is_forgotten_is_not_owed() -> None:
    """After a gap in time the scheme asks for what a fresh one does, whatever was owed."""
    scheme = PredictiveCrossing(10.0)
    for i, speed in enumerate((1.0, 0.8, 0.5)):
        known = WheelKnown.of_parameters(speed, TRUE, STRIBECK)
        owing = scheme.current_A(tick_of(WheelSample(i * PERIOD_S, speed)), 0.0, known)
    assert owing > first_current(0.5, 0.0) + 0.01
    after = scheme.current_A(tick_of(WheelSample(60.0, 0.5)), 0.0, known)
    assert after == first_current(0.5, 0.0)
    other = replace(tick_of(WheelSample(60.1, 0.5)).sample, segment=1)
    assert scheme.current_A(tick_of(other), 0.0, known) == first_current(0.5, 0.0)
