"""Effects as states of the filter: online and compiled alike, learnt from the plant, absent without a trace."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.course.course import Course
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_parameters import PlantNoise
from rw_ekf.effects.catalogue import CATALOGUE, FORMULAS
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.filter.constants import DEFAULT_ACCELERATION_NOISE
from rw_ekf.filter.estimator import Estimator
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.kernel import filter_pass, filter_pass_with_effects, nothing_past
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.filter.step import memory_of
from rw_ekf.model.effect import Shape, Term
from rw_ekf.model.friction import GAUSS, FrictionCurve, Stribeck
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.records import Estimate, IssuedCommand, Outcome, WheelSample
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet
from rw_ekf.wheel.interval import Interval, Pieces
from rw_ekf.wheel.pieces import effect_interval
from rw_ekf.wheel.transition import interval
from tests.filter.effect_replay import believed, both, in_use, rough_log
from tests.filter.replay import OUTCOMES
from tests.truth import run_of
from tools.measure.runs import OMEGA_S, constants_for, prior_drawn_around

Injected = tuple[str, str, EffectSet, Float64Array]

SEEDS = range(6)
TOGETHER = ("quadratic_drag", "actuator_lag", "presliding_hysteresis")


def assert_same(results: list[Estimate], run: FilterRun) -> None:
    """Every outcome, every mean and every sigma, to 1e-12 of a sigma."""
    assert [r.outcome for r in results] == [OUTCOMES[code] for code in run.outcome]
    shown = len(results[0].values)
    means, stds = np.array([r.values for r in results]), np.array([r.stds for r in results])
    assert np.max(np.abs(means - run.states[:, :shown]) / run.stds[:, :shown]) < 1e-12
    assert np.max(np.abs(stds / run.stds[:, :shown] - 1.0)) < 1e-12


@pytest.mark.parametrize("ids", [*((effect.id,) for effect in FORMULAS), TOGETHER], ids="+".join)
def test_online_and_compiled_are_one_filter(ids: tuple[str, ...]) -> None:
    """Every effect, and three at once, on a rough log: the same numbers and the same decisions at every sample."""
    log, temperature, angle = rough_log(5)
    results, run = both(log, temperature, angle, in_use(*ids))
    assert {Outcome.FIRST, Outcome.MISSING, Outcome.GATED, Outcome.RESEEDED} <= {r.outcome for r in results}
    assert_same(results, run)


@pytest.mark.parametrize("name", ["actuator_lag", "friction_lag", "presliding_hysteresis"])
def test_a_run_of_bad_readings_seeds_hidden_states_alike(name: str) -> None:
    """Where the gate gives up and the speed starts afresh, the hidden state does so too, online and compiled."""
    log, temperature, angle = rough_log(6, burst=True)
    results, run = both(log, temperature, angle, in_use(name))
    assert Outcome.RESEEDED in {r.outcome for r in results[550:557]}
    assert_same(results, run)


@pytest.mark.parametrize("name", ["actuator_lag", "transport_delay", "speed_averaging"])
def test_what_remembers_the_current_starts_from_the_first_command(name: str) -> None:
    """Nothing earlier is known, so that both filters begin with a segment's first command, in doubt by as much."""
    log, temperature, angle = rough_log(7, first_A=0.1)
    results, run = both(log, temperature, angle, in_use(name))
    assert_same(results, run)


@pytest.mark.parametrize("effect", ["actuator_lag:time_constant_s=0.3", "transport_delay:delay_s=0.25"])
def test_a_log_that_begins_with_a_step_is_followed_from_there(effect: str) -> None:
    """A wheel at rest, its first row commands 0.3 A late by a lag or a delay that the filter knows: nothing is gated.

    With that current taken for one that had flowed for long 5 to 26 readings were thrown away.
    """
    name, _, setting = effect.partition(":")
    value = float(setting.partition("=")[2])
    current_A = np.concatenate((np.zeros(50), np.full(100, 0.3), np.full(100, -0.2)))
    run = simulate_run(parse_effects([effect]), current_A, 0.1 * np.arange(250.0), PlantNoise(RAD_S_PER_RPM), seed=3)
    course = Course.of(run.time_s[50:], run.measured_speed_rad_s[50:], current_A[50:])
    known = EffectSet((Term.of(CATALOGUE[name], (0.0, 0.0, 0.0), value, 0.01 * value),))
    belief = believed(known)
    found = filter_log(course, constants_for(), belief.mean, belief.covariance, known)
    outcomes = [OUTCOMES[code] for code in found.outcome]
    assert outcomes[0] is Outcome.FIRST
    assert set(outcomes[1:]) == {Outcome.UPDATED}
    nis = found.innovation_rad_s[1:] ** 2 / found.innovation_variance[1:]
    assert 0.7 < float(np.mean(nis)) < 1.4


def test_a_settled_current_keeps_the_covariance_one() -> None:
    """Under a constant command a lag's hidden state has next to no variance: a missing reading is no error then."""
    effects = in_use("actuator_lag")
    belief = believed(effects)
    estimator = Estimator(constants_for(), belief.mean, belief.covariance, effects)
    rng = np.random.default_rng(2)
    for i in range(300):
        reading = None if i % 7 == 6 else 20.0 + 0.1 * float(rng.standard_normal())
        estimator.step(WheelSample(0.1 * i, reading))
        estimator.command_issued(IssuedCommand(0.05))


def injected(name: str, values: str, columns: list[tuple[float, float, float, Shape]]) -> Injected:
    """(name, plant's effect, columns to be learnt, true coefficients); columns: truth, prior mean and std, shape."""
    effect = CATALOGUE[name]
    made = tuple(Term(effect, (mean,), (std,), shape) for _, mean, std, shape in columns)
    return name, f"{name}:{values}", EffectSet(made), np.array([truth for truth, *_ in columns])


NONE: Shape = (0.0, 0.0, 0.0)
LEARNT = (
    injected("offset_torque", "torque_rad_s2=0.03", [(0.03, 0.0, 0.06, NONE)]),
    injected("viscous_asymmetry", "difference_1_s=3e-4", [(3e-4, 0.0, 6e-4, NONE)]),
    injected("quadratic_drag", "coefficient_1_rad=1.5e-6", [(1.5e-6, 0.0, 3e-6, NONE)]),
    injected("viscous_temperature", "slope_1_K=-0.03", [(-0.03, 0.0, 0.06, NONE)]),
    injected("motor_saturation", "slope_1_A=0.1", [(0.1, 0.0, 0.2, NONE)]),
    injected("current_deadzone", "width_A=0.003", [(0.003, 0.001, 0.004, NONE)]),
    injected("actuator_lag", "time_constant_s=0.08", [(0.08, 0.04, 0.06, NONE)]),
    injected("transport_delay", "delay_s=0.08", [(0.08, 0.04, 0.06, NONE)]),
    injected("speed_averaging", "window_s=0.16", [(0.16, 0.08, 0.12, NONE)]),
    injected("presliding_hysteresis", "deflection_rad=0.1,damping=0.3", [(0.1, 0.05, 0.07, (0.3, 0.0, 0.0))]),
    injected("friction_lag", "time_constant_s=0.2", [(0.2, 0.1, 0.15, NONE)]),
    injected("stribeck_shape", "speed_rad_s=1.2", [(1.2, 0.6, 0.8, NONE)]),
    injected(
        "torque_ripple",
        "order=1,amplitude_rad_s2=0.05,phase_rad=0.7",
        [
            (0.05 * math.cos(0.7), 0.0, 0.1, (1.0, 0.0, 0.0)),
            (0.05 * math.sin(0.7), 0.0, 0.1, (1.0, 0.5 * math.pi, 0.0)),
        ],
    ),
)  # fmt: skip


@pytest.mark.parametrize(("text", "effects", "truth"), [case[1:] for case in LEARNT], ids=[case[0] for case in LEARNT])
def test_the_filter_learns_what_the_plant_has(text: str, effects: EffectSet, truth: Float64Array) -> None:
    """From 300 s of the identification profile every coefficient ends within 4 sigma of the plant's.

    The sigma is neither a third nor three times of what the errors over seeds say. Plant and filter share no code.
    """
    times, currents = sample_profile(make_profile("identification", seed=1), 10.0)
    noise = PlantNoise(RAD_S_PER_RPM, DEFAULT_ACCELERATION_NOISE)
    errors, stds = [], []
    for seed in SEEDS:
        run = simulate_run(parse_effects([text]), currents[:3000], times[:3000], noise, seed=seed)
        belief = believed(effects, prior_drawn_around(CK13_STATISTICAL, seed))
        course = Course.of(
            run.time_s, run.measured_speed_rad_s, run.current_command_A, None, None, run.temperature_degC, run.angle_rad
        )
        found = filter_log(course, constants_for(), belief.mean, belief.covariance, effects)
        places = slice(5, 5 + truth.size)
        errors.append(found.mean[places] - truth)
        stds.append(np.sqrt(np.diag(found.covariance))[places])
    assert np.max(np.abs(np.array(errors) / stds)) < 4.0
    ratio = np.sqrt(np.mean(np.square(stds), axis=0) / np.mean(np.square(errors), axis=0))
    assert np.all((ratio > 1.0 / 3.0) & (ratio < 3.0)), ratio
    assert np.all(np.mean(stds, axis=0) < 0.5 * np.array([std for term in effects.terms for std in term.stds]))


def test_without_effects_nothing_changes_at_all() -> None:
    """No effects, and a grid of no width, which is no state, give the five-state results to the last bit."""
    log, _, _ = rough_log(8, burst=True)
    course = Course.of(log.time_s, log.speed_rad_s, log.current_A, log.delay_s, log.segment)
    grid = EffectSet((Term.of(CATALOGUE["speed_quantisation"]),))
    warm = course._replace(temperature_degC=np.full(log.time_s.size, 50.0), angle_rad=np.zeros(log.time_s.size))
    plain = filter_log(course, constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance, keep_states=True)
    for other, effects in ((course, NO_EFFECTS), (course, grid), (warm, NO_EFFECTS)):
        run = filter_log(
            other, constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance, effects, keep_states=True
        )
        for name in ("states", "stds", "outcome", "mean", "covariance"):
            assert np.array_equal(getattr(run, name), getattr(plain, name)), name


def test_an_effect_known_to_be_nothing_is_none() -> None:
    """A torque of zero without variance leaves the five states where the filter without effects has them."""
    log, temperature, angle = rough_log(8, burst=True)
    course = Course.of(log.time_s, log.speed_rad_s, log.current_A, log.delay_s, log.segment, temperature, angle)
    nothing = EffectSet((Term.of(CATALOGUE["offset_torque"]),))
    belief = believed(nothing)
    plain = filter_log(course, constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance, keep_states=True)
    run = filter_log(course, constants_for(), belief.mean, belief.covariance, nothing, keep_states=True)
    assert np.max(np.abs(run.states[:, :5] - plain.states) / plain.stds) < 1e-9
    assert np.max(np.abs(run.stds[:, :5] / plain.stds - 1.0)) < 1e-9
    assert np.all(run.stds[:, 5] == 0.0)


@pytest.mark.parametrize("profile", ["P1", "P2", "S1", "S2"])
def test_the_five_states_alone_are_the_general_pass_unrolled(profile: str) -> None:
    """The pass for a model without effects, kept for its speed, and the general one agree to the last bit."""
    course, constants = run_of(profile, 3).course, constants_for()
    runs = [FilterRun.empty(DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance, course.samples, states=True) for _ in "ab"]
    for run, table, kernel in zip(
        runs, (None, NO_EFFECTS.table()), (filter_pass, filter_pass_with_effects), strict=True
    ):
        memory = memory_of(run.mean, run.covariance, constants, table, mends=True)
        kernel(constants, table, course, run, memory, nothing_past(), 0)
    assert np.array_equal(runs[0].states, runs[1].states)
    assert np.array_equal(runs[0].stds, runs[1].stds)
    assert np.array_equal(runs[0].outcome, runs[1].outcome)


def test_the_flow_of_a_table_without_effects_is_the_models() -> None:
    """Speed and slopes over an interval in two pieces are those of the transition, to the last bit."""
    rng = np.random.default_rng(3)
    table = NO_EFFECTS.table()
    row, end = np.zeros(5), np.zeros(5)
    for _ in range(200):
        x = np.array([rng.normal(0.0, 2.0), *CK13_STATISTICAL])
        cut = float(rng.uniform(0.01, 0.09))
        pieces = Pieces([0.0, cut], [cut, 0.1 - cut], list(rng.normal(0.0, 0.05, 2)))
        whole = Interval(0.0, 0.1, 20.0, 0.0, first=0, start=0, stop=2)
        effect_interval(x, table, Stribeck(OMEGA_S, GAUSS), pieces, whole, True, row, end)
        plain = interval(x[0], x[1], FrictionCurve(x[2], x[3], x[4], OMEGA_S, GAUSS), pieces, 0, 2)
        assert (end[0], *row) == plain


def test_a_filter_with_an_effect_of_the_angle_recovers_from_broken_arithmetic() -> None:
    """A parameter that is no number for once: the angle that was reckoned with it goes on, and so does the filter."""
    effects = in_use("torque_ripple")
    belief = believed(effects)
    estimator = Estimator(constants_for(), belief.mean, belief.covariance, effects, np.full(effects.size, 1.0e-9))
    outcomes = []
    for i in range(60):
        if i == 20:
            estimator.ekf.x[2] = math.nan
        outcomes.append(estimator.step(WheelSample(0.1 * i, 10.0 + 0.01 * i)).outcome)
        estimator.command_issued(IssuedCommand(0.05))
    assert Outcome.RESEEDED in outcomes[20:22]
    assert set(outcomes[25:]) == {Outcome.UPDATED}
