"""A scheme starts with what its entry in the registry says that it knows of the wheel."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.attitude_bench.bench_start import POOR_SHARE, diagnosed, start_of
from rw_ekf.attitude_bench.bench_wheels import deterministic, drawn_wheel, nominal
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.control.compensation.schemes import SCHEMES
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.errors import ConfigError
from rw_ekf.filter.belief import prior_around
from rw_ekf.model.effect import Term
from rw_ekf.records import FilterHealth, FilterReset, FilterTrouble, Tick, WheelSample
from rw_ekf.wheel.effect_table import EffectSet
from rw_ekf.wheel.model_file import WheelModel

DRAWN = Scenario.model_validate({"wheel": {"spread_percent": 15.0}})
OFFSET = Scenario.model_validate({"wheel": {"effects": ["offset_torque:torque_rad_s2=0.03"]}})


def known_at_the_first_tick(word: str, scenario: Scenario = DRAWN, model: WheelModel | None = None):  # type: ignore[no-untyped-def]
    """Start, what is known after one reading of 50 rad/s."""
    start = start_of(replace(SCHEMES["dmc"], parameters_from=word), scenario, 1.0, 3, model)
    sample = WheelSample(0.0, 50.0, current_command_A=0.0, temperature_degC=20.0, angle_rad=0.0)
    return start, start.knowledge(Tick(sample, start.estimator.step(sample)))


def test_an_estimator_that_has_learned_knows_the_drawn_wheel_and_not_the_nominal_one() -> None:
    """Within a percent for what the identification profile shows, where the draw is up to 15 % off."""
    start, known = known_at_the_first_tick("estimator")
    truth = drawn_wheel(DRAWN, 3)
    assert start.plant == truth
    assert known.parameters.motor_gain == pytest.approx(truth.motor_gain, rel=0.01)
    assert known.parameters.coulomb == pytest.approx(truth.coulomb, rel=0.01)
    assert abs(nominal(DRAWN).coulomb / truth.coulomb - 1.0) > 0.02
    assert known.speed_rad_s == 50.0
    assert known.estimate is not None


def test_fixed_parameters_stay_and_take_no_more_than_the_speed_from_the_filter() -> None:
    """The deterministic set is off as [CK13] Table 1 is; a scheme that needs no model has the data sheet."""
    for word, expected in (("deterministic", deterministic(drawn_wheel(DRAWN, 3))), ("none", nominal(DRAWN))):
        start, known = known_at_the_first_tick(word)
        assert known.parameters == expected
        assert known.estimate is None
        assert known.speed_rad_s == 50.0
        assert start.sheet.parameters == nominal(DRAWN)


def test_a_poor_prior_is_off_in_every_parameter_and_wide() -> None:
    """Thirty percent of each parameter, and the sigmas of the default prior around that."""
    start, known = known_at_the_first_tick("adaptive")
    shares = np.array(known.parameters) / np.array(nominal(DRAWN)) - 1.0
    assert np.abs(shares) == pytest.approx(np.full(4, POOR_SHARE))
    assert start.estimator.parameter_covariance == pytest.approx(prior_around(known.parameters).parameter_covariance)


def test_an_inner_loop_is_started_at_its_own_rate() -> None:
    """The filter's period and the data sheet's are those of the loop that the scheme runs in."""
    start = start_of(replace(SCHEMES["dmc"], inner_rate_hz=100.0), DRAWN, 1.0, 3)
    assert start.sheet.rate_hz == 100.0


def test_a_word_that_nobody_knows_is_refused() -> None:
    """With the scheme's id and the word."""
    with pytest.raises(ConfigError, match="dmc: parameters from 'the stars'"):
        known_at_the_first_tick("the stars")


def test_coefficients_of_a_given_model_are_learned_anew_on_the_seeds_own_record() -> None:
    """A model that has the offset at half its size: the filter ends at the wheel's own, and its friction has it."""
    prior = prior_around(nominal(OFFSET))
    covariance = np.zeros((5, 5))
    covariance[:4, :4], covariance[4, 4] = prior.parameter_covariance, 0.01**2
    model = WheelModel(
        prior.parameters,
        tuple(tuple(row) for row in covariance.tolist()),
        0.419,
        effects=EffectSet((Term.of(CATALOGUE["offset_torque"], value=0.015, std=0.01),)),
    )
    _, known = known_at_the_first_tick("diagnosed", OFFSET, model)
    assert known.estimate.effects["offset_torque"].value == pytest.approx(0.03, rel=0.05)
    both_ways = known.friction_rad_s2(50.0) + known.friction_rad_s2(-50.0)
    assert both_ways == pytest.approx(2.0 * 0.03, rel=0.05)


@pytest.mark.slow
def test_a_structure_is_diagnosed_once_and_is_a_plain_value() -> None:
    """The offset is found on seed 0's record, nothing is found on a healthy wheel; both go through a pickle."""
    for scenario, ids in ((OFFSET, ("offset_torque",)), (Scenario(), ())):
        found = diagnosed(scenario, 1.0)
        assert found.effects.ids == ids
        assert pickle.loads(pickle.dumps(found)) == found
        assert diagnosed(scenario, 1.0) is found


def test_parameters_of_a_filter_that_is_not_well_are_not_used() -> None:
    """As on a wheel: the last trusted ones are, with the present speed."""
    start, known = known_at_the_first_tick("estimator")
    sample = WheelSample(0.1, 49.0, current_command_A=0.0, temperature_degC=20.0, angle_rad=0.0)
    estimate = start.estimator.step(sample)
    sick = replace(
        estimate,
        state=estimate.state._replace(motor_gain=-0.01),
        health=FilterHealth(FilterTrouble.DIVERGED, FilterReset.PARAMETERS, "lost", 0.1, beyond_mending=False),
    )
    after = start.knowledge(Tick(sample, sick))
    assert after.parameters == known.parameters
    assert after.speed_rad_s == estimate.state.speed_rad_s
