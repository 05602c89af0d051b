"""What a scheme starts a run with: an estimator, what it may know of the wheel, wheel, data sheet; and the run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.attitude_bench.bench_run import BenchRun, run_bench
from rw_ekf.attitude_bench.bench_wheels import (
    constants_of,
    deterministic,
    drawn_wheel,
    identification_course,
    identification_log,
    learned,
    nominal,
)
from rw_ekf.attitude_bench.margins import scenario_for
from rw_ekf.attitude_bench.scenario import BeliefSection, Scenario
from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.scheme import Knowledge
from rw_ekf.control.compensation.schemes import SchemeEntry, WheelSheet
from rw_ekf.control.compensation.tick_intervals import Elapsed
from rw_ekf.control.compensation.trust import ParameterTrust
from rw_ekf.control.compensation.unmodelled_drag import SpeedNoise
from rw_ekf.errors import ConfigError
from rw_ekf.filter.belief import Belief, prior_around
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.estimator import Estimator
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.learning.aged_model import carried_over
from rw_ekf.model.state import PARAMETER_NAMES, PARAMETERS, FrictionParameters
from rw_ekf.records import Tick
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet
from rw_ekf.wheel.model_file import WheelModel

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.plant_parameters import PlantParameters

_SURE = 1.0e-4  # of the learned standard deviations is left to a filter that is to be wrong
POOR_SHARE = 0.3  # each parameter of a poor prior is off by so much, one way or the other


@dataclass(frozen=True)
class BenchStart:
    """What one run of one scheme begins with."""

    estimator: Estimator  # fresh, at the scheme's rate
    knowledge: Knowledge
    plant: PlantParameters  # the true wheel of the seed
    sheet: WheelSheet


def start_of(
    entry: SchemeEntry, scenario: Scenario, noise_rpm: float, seed: int, model: WheelModel | None = None
) -> BenchStart:
    """Start as `entry.parameters_from` says: with what the EKF learned of the seed's wheel, or with something poorer.

    "estimator", and the speed of all others: learned on the seed's identification record; "adaptive": nothing but a
    poor prior; "diagnosed": learned with the effects of `model`, by default those that a diagnosis of seed 0 found;
    "deterministic" and "none": fixed parameters. Raises ConfigError for any other word.
    """
    rate_hz = scenario.cycle.rate_hz if entry.inner_rate_hz is None else entry.inner_rate_hz
    constants = constants_of(scenario, noise_rpm, rate_hz)
    plant = drawn_wheel(scenario, seed)
    effects, belief = NO_EFFECTS, learned(scenario, noise_rpm, seed)
    fixed: FrictionParameters | None = None
    if entry.parameters_from == "adaptive":
        belief = poor_prior(scenario, seed)
    elif entry.parameters_from == "diagnosed":
        effects, belief = learned_with(
            scenario, noise_rpm, seed, diagnosed(scenario, noise_rpm) if model is None else model
        )
    elif entry.parameters_from == "deterministic":
        fixed = deterministic(plant)
    elif entry.parameters_from == "none":
        fixed = nominal(scenario)
    elif entry.parameters_from != "estimator":
        raise ConfigError(f"{entry.id}: parameters from {entry.parameters_from!r} are not known on the bench")
    sheet = nominal(scenario)
    if scenario.belief != BeliefSection():
        constants, belief = _misled(scenario.belief, constants, belief)
        fixed = None if fixed is None else _off(scenario.belief, fixed)
        sheet = _off(scenario.belief, sheet)
    return BenchStart(
        estimator=Estimator(constants, belief.mean, belief.covariance, effects),
        knowledge=_knowledge(constants, fixed, adaptive=entry.parameters_from == "adaptive"),
        plant=plant,
        sheet=WheelSheet(sheet, constants.stribeck, rate_hz, SpeedNoise.of(constants)),
    )


def _off(wrong: BeliefSection, parameters: FrictionParameters) -> FrictionParameters:
    """Parameters as a scenario spoils them."""
    gain, friction = 1.0 + 0.01 * wrong.gain_error_percent, 1.0 + 0.01 * wrong.friction_error_percent
    k, b, c, s = parameters
    return FrictionParameters(k * gain, b * friction, c * friction, s * friction)


def _misled(wrong: BeliefSection, constants: FilterConstants, belief: Belief) -> tuple[FilterConstants, Belief]:
    """A filter that is sure of spoiled parameters, and lets them never go."""
    mean, covariance = belief.mean.copy(), belief.covariance.copy()
    mean[PARAMETERS] = _off(wrong, belief.parameters)
    covariance[PARAMETERS, :] *= _SURE
    covariance[:, PARAMETERS] *= _SURE
    still = constants._replace(
        motor_gain_drift=0.0, viscous_drift=0.0, coulomb_drift=0.0, static_drift=0.0, relative_drift=0.0
    )
    return still, Belief(mean, covariance, belief.effect_ids)


def poor_prior(scenario: Scenario, seed: int) -> Belief:
    """The default prior around a mean of which every parameter is 30 % off, which way the seed draws."""
    ways = np.random.default_rng([seed, 78]).choice((-1.0, 1.0), 4)
    named = nominal(scenario)
    off = FrictionParameters(*(value * (1.0 + POOR_SHARE * way) for value, way in zip(named, ways, strict=True)))
    return prior_around(off)


@lru_cache(maxsize=8)
def diagnosed(scenario: Scenario, noise_rpm: float) -> WheelModel:
    """The model that a diagnosis of seed 0's identification record ends with; without effects where none is found.

    It takes 6 to 17 s, and is a plain value that can be handed to `start_of` in other processes.
    """
    from rw_ekf.diagnosis.log_diagnosis import diagnose_log

    prior, constants = prior_around(nominal(scenario)), constants_of(scenario, noise_rpm, 10.0)
    known = WheelModel(
        prior.parameters,
        tuple(tuple(row) for row in prior.parameter_covariance.tolist()),
        constants.stribeck.omega_s,
        speed_noise_rad_s=constants.speed_noise_rad_s,
        acceleration_noise=constants.acceleration_noise,
        inertia_kg_m2=scenario.wheel.inertia_kg_m2,
    )
    found = diagnose_log(identification_log(scenario, noise_rpm, 0), model=known)
    return known if found.model is None else found.model  # none where the base model explains the record


def learned_with(scenario: Scenario, noise_rpm: float, seed: int, model: WheelModel) -> tuple[EffectSet, Belief]:
    """The effects of a model that hold beyond its record, and what the EKF learned of the seed's wheel with them.

    The four parameters start around the nominal ones as without effects, a coefficient from the model's own value, as
    uncertain as it is large.
    """
    effects = carried_over(model)[0].effects
    prior = prior_around(nominal(scenario))
    for term in effects.state_terms:
        for value, std in zip(term.values, term.stds, strict=True):
            prior = prior.with_coefficient(term.id, value, max(abs(value), std))
    start = _sized(prior, effects.table().size)
    found = filter_log(
        identification_course(scenario, noise_rpm, seed),
        constants_of(scenario, noise_rpm, 10.0),
        start.mean,
        start.covariance,
        effects,
    )
    return effects, Belief(found.mean, found.covariance, effects.coefficient_ids)


def _sized(belief: Belief, size: int) -> Belief:
    """With room for hidden states."""
    values, covariance = belief.known(len(belief.effect_ids))
    return Belief.of_known(values, covariance, size, effect_ids=belief.effect_ids)


def _knowledge(constants: FilterConstants, fixed: FrictionParameters | None, *, adaptive: bool) -> Knowledge:
    """The filter's speed with fixed parameters, or its belief as far as a run on a wheel would trust it.

    adaptive: its belief from the first tick on, whatever the motion has shown so far; the parameters of a filter that
    is not well are not used there either.
    """
    stribeck = constants.stribeck
    if fixed is not None:
        return lambda tick: WheelKnown.of_parameters(tick.estimate.state.speed_rad_s, fixed, stribeck)
    trust = ParameterTrust(() if adaptive else PARAMETER_NAMES, stribeck, start_trusted=True, well=_filter_is_well)
    elapsed = Elapsed()

    def knowledge(tick: Tick) -> WheelKnown:
        known = trust.step(tick, elapsed.step(tick)).known
        assert known is not None  # what a run starts with is trusted
        return known

    return knowledge


def _filter_is_well(tick: Tick) -> bool:
    return tick.estimate.health is None


def run_scheme(
    entry: SchemeEntry,
    scenario: Scenario,
    noise_rpm: float,
    seed: int,
    model: WheelModel | None = None,
    *,
    plant: PlantParameters | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> BenchRun:
    """Run a scheme on the wheel of a seed.

    model: what a diagnosis made of this wheel, see `start_of`. plant: a wheel in place of the one that was learned
    from. parameters: in place of the scheme's own.
    """
    start = start_of(entry, scenario, noise_rpm, seed, model)
    return run_bench(
        scenario_for(entry, scenario),
        start.plant if plant is None else plant,
        noise_rpm,
        seed,
        start.estimator,
        entry.make(start.sheet, **(parameters or {})),
        start.knowledge,
        entry.inner_rate_hz,
    )
