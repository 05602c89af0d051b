"""The friction torque of an estimate is the motor's drive less the acceleration that the filter's transition has."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.effects.catalogue import CATALOGUE, FORMULAS
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.estimator import Estimator
from rw_ekf.model.considered import Direction, Off
from rw_ekf.model.effect import Term
from rw_ekf.model.friction import stribeck
from rw_ekf.model.moment import Moment
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.records import Estimate, IssuedCommand, WheelSample
from rw_ekf.starting_point import model_of, setup_of_model
from rw_ekf.wheel.dispatch import STATIC_EFFECTS
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet
from rw_ekf.wheel.interval import Interval, Pieces
from rw_ekf.wheel.model_file import WheelModel
from rw_ekf.wheel.pieces import effect_interval
from tests.filter.effect_replay import believed, in_use
from tests.ticks import tick_of
from tools.measure.runs import OMEGA_S, constants_for

CURRENT_A, SPEED, HEAT_DEGC = 0.12, 7.0, 31.0
SHORT_S = 1.0e-8


def driven(effects: EffectSet, speed: float = SPEED, current_A: float = CURRENT_A) -> tuple[Estimator, Estimate]:
    """An estimator after two seconds at a steady speed under a constant current."""
    belief = believed(effects)
    estimator = Estimator(constants_for(), belief.mean, belief.covariance, effects)
    for i in range(20):
        sample = WheelSample(0.1 * i, speed, temperature_degC=HEAT_DEGC, angle_rad=0.3 + 0.1 * i * speed)
        estimate = estimator.step(sample)
        estimator.command_issued(IssuedCommand(current_A))
    return estimator, estimate


def accelerations(estimator: Estimator, estimate: Estimate, x: Float64Array, current_A: float) -> float:
    """Speed gained per second over ten nanoseconds of the filter's own transition."""
    assert estimate.conditions is not None
    end, now = np.zeros(x.size), estimate.time_s
    pieces = Pieces(np.array([now - 9.0]), np.array([9.0 + 1.0]), np.array([current_A]))
    interval = Interval(
        from_s=now,
        to_s=now + SHORT_S,
        temperature_degC=estimate.conditions.temperature_degC,
        angle_rad=estimate.conditions.angle_rad,
        first=0,
        start=0,
        stop=1,
    )
    effect_interval(x, estimator.ekf.table, estimator.constants.stribeck, pieces, interval, False, np.zeros(0), end)
    return float((end[0] - x[0]) / SHORT_S)


def amperes(effects: EffectSet, estimate: Estimate, x: Float64Array, current_A: float) -> float:
    """What static effects add to the current, asked of each by itself."""
    assert estimate.conditions is not None
    table, total = effects.table(), 0.0
    for at, code, shape in zip(table.static_at, table.static_code, table.static_shape, strict=True):
        now = Moment(float(x[0]), current_A, *estimate.conditions[:2], estimate.time_s, 0.0)
        total += STATIC_EFFECTS[code].contribution(float(x[at]), shape, now)[0]
    return total


@pytest.mark.parametrize("name", [*(effect.id for effect in FORMULAS), "none"])
@pytest.mark.parametrize("speed", [None, SPEED, -3.0, 0.4])
def test_it_is_the_drive_less_the_acceleration(name: str, speed: float | None) -> None:
    """Every effect of the catalogue, hidden states included, at the believed speed and at others."""
    effects = NO_EFFECTS if name == "none" else in_use(name)
    estimator, estimate = driven(effects)
    x = estimator.mean
    if speed is not None:
        x[0] = speed
    table = estimator.ekf.table
    current_A = CURRENT_A if table.lag_state_at < 0 else float(x[table.lag_state_at])
    drive = x[1] * (current_A + amperes(effects, estimate, x, current_A))
    expected = drive - accelerations(estimator, estimate, x, CURRENT_A)
    found = estimate.friction_torque_rad_s2(speed)
    assert found.value == pytest.approx(expected, rel=1e-4, abs=1e-4)
    assert 0.0 < found.std < max(5.0, abs(found.value))


def test_away_from_zero_speed_its_deviation_is_that_of_a_linear_model() -> None:
    """At a given speed the four parameters enter linearly: the deviation is the root of phi' P phi."""
    estimator, estimate = driven(NO_EFFECTS)
    for speed in (40.0, 1.0, -0.7):
        g = stribeck(abs(speed) / estimator.constants.stribeck.omega_s, estimator.constants.stribeck.law)
        phi = np.array([0.0, abs(speed), 1.0 - g, g])
        found = estimate.friction_torque_rad_s2(speed)
        assert found.value == pytest.approx(math.copysign(phi @ np.array(estimator.parameters), speed), rel=1e-12)
        assert found.std == pytest.approx(math.sqrt(phi @ estimator.parameter_covariance @ phi), rel=1e-9)


def test_at_rest_it_is_the_drive_that_is_held() -> None:
    """Below break-away the friction is what the motor gives; it is not the break-away friction."""
    current_A = 0.5 * CK13_STATISTICAL.static / CK13_STATISTICAL.motor_gain
    estimator, estimate = driven(NO_EFFECTS, 0.0, current_A)
    expected = estimator.parameters.motor_gain * current_A
    assert estimate.friction_torque_rad_s2(0.0).value == pytest.approx(expected, rel=1e-12)


def test_it_stays_that_of_its_own_moment() -> None:
    """An estimate that is kept answers as it did, whatever the estimator has seen since."""
    estimator, estimate = driven(in_use("presliding_hysteresis"))
    before = estimate.friction_torque_rad_s2(), estimate.friction_torque_rad_s2(2.0)
    for i in range(20, 40):
        estimator.step(WheelSample(0.1 * i, SPEED + 0.5 * (i - 20), temperature_degC=20.0))
    assert (estimate.friction_torque_rad_s2(), estimate.friction_torque_rad_s2(2.0)) == before


def test_a_delayed_command_is_not_in_force_yet() -> None:
    """With a delay in the model, what is held at rest just after a change of current is the old drive."""
    effects = in_use("transport_delay")
    estimator, _ = driven(effects, 0.0, 0.01)
    delay_s = float(estimator.mean[estimator.ekf.table.delay_at])
    assert 0.005 < delay_s < 0.1
    estimator.command_issued(IssuedCommand(0.02, 0.1 - 0.5 * delay_s))  # acts half a delay before the next sample
    estimate = estimator.step(WheelSample(2.0, 0.0))
    held = estimate.friction_torque_rad_s2(0.0).value / estimator.parameters.motor_gain
    assert held == pytest.approx(0.01, rel=1e-9)


def test_hidden_states_have_names() -> None:
    """A lag's current and a bristle's friction are in the estimate; a model without a memory has none."""
    _, lagging = driven(in_use("actuator_lag"))
    _, bristle = driven(in_use("presliding_hysteresis"))
    _, plain = driven(NO_EFFECTS)
    assert lagging.hidden is not None
    assert lagging.hidden.current_A == pytest.approx(CURRENT_A, rel=0.05)
    assert lagging.hidden.friction_rad_s2 is None
    assert bristle.hidden is not None
    assert bristle.hidden.current_A is None
    assert bristle.hidden.friction_rad_s2 == pytest.approx(CK13_STATISTICAL.coulomb, rel=0.5)
    assert plain.hidden is None
    assert list(lagging.effects) == ["actuator_lag"]


def test_an_estimate_that_no_estimator_made_knows_no_friction() -> None:
    """It says so instead of answering zero."""
    with pytest.raises(ValueError, match="no estimator"):
        tick_of(WheelSample(0.0, 1.0)).estimate.friction_torque_rad_s2()


def considered_bump() -> tuple[EffectSet, Belief]:
    """A bump whose place and amplitude are open together, and the belief that a filter begins with."""
    bump = Term(CATALOGUE["drag_bump"], (0.08,), (0.02,), (60.0, 8.0, 0.0))
    way = Direction((0.0, 0.0, 1.0e-3, 0.0, 0.01), (Off((0.5, 0.0, 0.0)),))
    belief = believed(EffectSet((bump,)))
    covariance = belief.covariance.copy()
    covariance[1:, 1:] += np.outer(way.numbers, way.numbers)
    return EffectSet((bump,), (way,)), Belief(belief.mean, covariance, ("drag_bump",))


def test_what_shapes_make_of_a_number_is_never_learned() -> None:
    """At first the amplitude's deviation is the belief's; minutes later no less than the bump's place allows."""
    effects, belief = considered_bump()
    estimator = Estimator(constants_for(), belief.mean, belief.covariance, effects)
    plain = Estimator(constants_for(), belief.mean, belief.covariance, EffectSet(effects.terms))
    first = estimator.step(WheelSample(0.0, 60.0))
    assert first.effects["drag_bump"].std == pytest.approx(math.sqrt(belief.covariance[5, 5]))
    assert first.effects["drag_bump"] == plain.step(WheelSample(0.0, 60.0)).effects["drag_bump"]
    for i in range(1, 6000):
        sample = WheelSample(0.1 * i, 60.0 + 20.0 * math.sin(0.02 * i))
        for one in (estimator, plain):
            one.command_issued(IssuedCommand(CURRENT_A))
        last, without = estimator.step(sample), plain.step(sample)
    assert np.array_equal(estimator.mean, plain.mean)
    follows, began, now = 0.01**2, belief.covariance[5, 5], without.effects["drag_bump"].std ** 2
    assert now < 0.5 * began
    by_hand = 1.0 / (1.0 / (began - follows) + 1.0 / now - 1.0 / began) + follows
    assert last.effects["drag_bump"].std == pytest.approx(math.sqrt(by_hand), rel=1e-9)
    assert last.std.coulomb > without.std.coulomb
    assert last.std.motor_gain == without.std.motor_gain


def test_the_file_that_a_run_leaves_counts_it_too() -> None:
    """As it began where nothing was learned; with what the place leaves open on top where all was."""
    effects, belief = considered_bump()
    covariance = tuple(tuple(row) for row in belief.covariance[1:6, 1:6].tolist())
    setup = setup_of_model(WheelModel(belief.parameters, covariance, OMEGA_S, effects=effects), 0.1, 0.003, 0.1)
    assert np.allclose(model_of(setup.prior, setup, {}).covariance, belief.covariance[1:6, 1:6], rtol=1e-12)
    known = Belief(belief.mean, 1.0e-6 * belief.covariance, belief.effect_ids)
    left = np.array(model_of(known, setup, {}).covariance)
    follows = np.array(effects.considered[0].numbers)
    assert np.allclose(left, 1.0e-6 * belief.covariance[1:6, 1:6] + np.outer(follows, follows), rtol=1e-5, atol=1e-12)
    half = Belief(belief.mean, 0.3 * belief.covariance, belief.effect_ids)
    began, now, shape = belief.covariance[5, 5], 0.3 * belief.covariance[5, 5], 0.01**2
    by_hand = 1.0 / (1.0 / (began - shape) + 1.0 / now - 1.0 / began) + shape
    assert model_of(half, setup, {}).covariance[4][4] == pytest.approx(by_hand, rel=1e-9)
    assert model_of(half, setup, {}).effects.terms[0].stds[0] == pytest.approx(math.sqrt(by_hand), rel=1e-9)
