"""What an estimate says of the next interval is what the filter itself then predicts for it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.filter.belief import DEFAULT_PRIOR, Belief
from rw_ekf.filter.constants import filter_constants
from rw_ekf.filter.estimator import Estimator
from rw_ekf.model.effect import Term
from rw_ekf.records import Estimate, IssuedCommand, Outcome, WheelSample, WheelState
from rw_ekf.wheel.effect_table import EffectSet

PERIOD_S, LATE_S = 0.1, 0.012
CONSTANTS = filter_constants(0.42, speed_noise_rad_s=0.1, acceleration_noise=0.003)
EFFECTS = {
    "none": (),
    "offset": (("offset_torque", 0.03, (0.0, 0.0, 0.0)),),
    "delay": (("transport_delay", 0.037, (0.0, 0.0, 0.0)), ("torque_ripple", 0.02, (1.0, 0.0, 0.0))),
    "lag": (("actuator_lag", 0.06, (0.0, 0.0, 0.0)), ("coulomb_temperature", -0.01, (0.0, 0.0, 0.0))),
    "bristle": (("presliding_hysteresis", 0.05, (0.3, 0.0, 0.0)),),
}


def estimator_with(name: str) -> Estimator:
    """An estimator that is sure of its parameters and of the effects."""
    effects = EffectSet(tuple(Term.of(CATALOGUE[i], shape, value, 1e-6) for i, value, shape in EFFECTS[name]))
    values = [*DEFAULT_PRIOR.parameters, *effects.values]
    belief = Belief.of_known(values, 1e-12 * np.eye(len(values)), effects.table().size)
    return Estimator(CONSTANTS, belief.mean, belief.covariance, effects)


@pytest.mark.parametrize("name", EFFECTS)
def test_the_speed_at_the_next_reading_is_what_the_filter_then_predicts(name: str) -> None:
    """Through a reversal, a stop and a break-away, by a current that acts late, later still by a delay."""
    estimator = estimator_with(name)
    exact = 1e-6 if name == "delay" else 1e-9  # the angle that it acts at: by one mean speed
    late_s = LATE_S + (EFFECTS[name][0][1] if name == "delay" else 0.0)
    draw = np.random.default_rng(5)
    speed, foreseen, compared = 0.5, None, 0
    for i in range(120):
        sample = WheelSample(i * PERIOD_S, speed, temperature_degC=25.0, segment=0)
        estimate = estimator.step(sample)
        if foreseen is not None and estimate.outcome is Outcome.UPDATED and i > 3:
            assert estimate.predicted_speed_rad_s == pytest.approx(foreseen, abs=exact)
            compared += 1
        current = -0.06 if i < 25 else 0.03 if i < 40 else 0.07 * np.sin(0.4 * i)
        speed = estimate.state.speed_rad_s if i == 0 else estimate.predicted_speed_rad_s + 0.02 * draw.standard_normal()
        foreseen = estimate.outlook().end_rad_s(current, PERIOD_S - late_s)
        estimator.command_issued(IssuedCommand(current, LATE_S))
        later = estimate.outlook().end_rad_s(current, PERIOD_S - late_s)
        assert later == foreseen  # the estimate is of its own moment, whatever was issued since
    assert compared > 100


def test_a_speed_may_be_taken_for_known() -> None:
    """Then the outlook starts from it, and the rest of the belief stays."""
    estimator = estimator_with("none")
    estimate = estimator.step(WheelSample(0.0, 0.05))
    assert estimate.outlook().begin_rad_s == 0.05
    assert estimate.outlook(0.0).begin_rad_s == 0.0
    assert estimate.outlook(0.0).end_rad_s(0.03, 0.1) == 0.0  # below break-away
    assert estimate.outlook(0.0).end_rad_s(0.05, 0.1) > 0.0


def test_an_estimate_that_no_estimator_made_knows_nothing_of_it() -> None:
    """It says so."""
    state = WheelState(1.0, 15.0, 0.003, 0.58, 0.6)
    with pytest.raises(ValueError, match="no estimator made"):
        Estimate(0.0, Outcome.FIRST, state, state).outlook()


@pytest.mark.parametrize(
    ("name", "value", "left"),
    [
        ("current_deadzone", 0.004, lambda i: i - math.copysign(0.004, i)),
        ("motor_saturation", 0.3, lambda i: i * (1.0 - 0.3 * abs(i))),
        ("motor_gain_temperature", -0.002, lambda i: i * (1.0 - 0.002 * 15.0)),
        ("offset_torque", 0.03, lambda i: i),
    ],
)
def test_the_current_for_a_drive_undoes_what_effects_take_from_it(
    name: str, value: float, left: Callable[[float], float]
) -> None:
    """Put through the effect by hand, the current found is the drive over the motor gain."""
    effects = EffectSet((Term.of(CATALOGUE[name], value=value, std=1e-6),))
    belief = Belief.of_known([*DEFAULT_PRIOR.parameters, value], 1e-12 * np.eye(5))
    estimate = Estimator(CONSTANTS, belief.mean, belief.covariance, effects).step(
        WheelSample(0.0, 5.0, temperature_degC=35.0)
    )
    for drive in (0.9, -0.4, 0.003):
        current = estimate.current_for_A(drive)
        assert left(current) * estimate.state.motor_gain == pytest.approx(drive, rel=1e-9)
    assert estimate.current_for_A(0.0) == 0.0


def test_a_time_that_went_back_leaves_the_forecast_where_the_belief_is() -> None:
    """Friction, current and outlook with a torque of the time: those of the reading before, not of that time."""
    effect = Term.of(CATALOGUE["external_torque"], (0.5, 0.0, 0.0), 0.05, 1e-6)
    values = [*DEFAULT_PRIOR.parameters, *effect.values]
    belief = Belief.of_known(values, 1e-12 * np.eye(len(values)), 5 + len(effect.values))
    estimator = Estimator(CONSTANTS, belief.mean, belief.covariance, EffectSet((effect,)))
    for i in range(5):
        before = estimator.step(WheelSample(i * PERIOD_S, 5.0))
        estimator.command_issued(IssuedCommand(0.05, LATE_S))
    stated = estimator.step(WheelSample(0.1, 5.0))
    assert stated.outcome is Outcome.BACKWARD
    assert stated.friction_value_rad_s2(5.0) == before.friction_value_rad_s2(5.0)
    assert stated.current_for_A(1.0) == before.current_for_A(1.0)
    later = before.outlook().end_rad_s(0.05, PERIOD_S)
    assert stated.outlook().end_rad_s(0.05, PERIOD_S) == pytest.approx(later, abs=1e-2)  # of a command issued since
