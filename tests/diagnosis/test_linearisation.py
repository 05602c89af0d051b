"""Frames and fits against the simulated plant: slopes, likelihoods, coefficients, and the law of the statistics."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.hypotheses.scorer import Scorer
from rw_ekf.diagnosis.prepare.preparation import facts_of
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.likelihood.fitting import fit_model
from rw_ekf.likelihood.gauss_newton import Problem, Start, smoothed_trajectory
from rw_ekf.likelihood.linearisation import Noise, linearise
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import Record, Trajectory, predict
from rw_ekf.likelihood.profile import likelihood
from rw_ekf.model.effect import NO_SHAPE, Shape, Term
from rw_ekf.units import RAD_S_PER_RPM
from tests.diagnosis.simulated import TRUTH, fitted, record_of, simulated

QUIET = Noise(RAD_S_PER_RPM**2, 1.0e-4)


def term(name: str, value: float, shape: Shape = NO_SHAPE) -> Term:
    """An effect of this size in use; its shape stays as it is."""
    return Term(CATALOGUE[name], (value,), (0.0,), shape, settled=True)


SHAPES: dict[str, Shape] = {"presliding_hysteresis": (0.3, 0.0, 0.0)}
# As many kinds of contribution as there are: torque, viscous, factors, current, in angle, in time.
STATIC = [
    term("offset_torque", 0.02),
    term("viscous_asymmetry", 2.0e-4),
    term("quadratic_drag", 1.0e-6),
    term("viscous_temperature", -0.02),
    term("coulomb_temperature", -0.01),
    term("motor_saturation", 0.1),
    term("torque_ripple", 0.03, (2.0, 0.4, 0.0)),
    term("drag_spike", 0.04, (50.0, 30.0, 0.0)),
]


def along_truth(samples: int, seed: int) -> tuple[Record, Trajectory]:
    """A record, and the plant's own speed as the trajectory."""
    run = simulated(seed=seed, samples=samples)
    return record_of(run), Trajectory.of_speed(run.speed_rad_s.copy(), np.full(samples, 0.1 * RAD_S_PER_RPM))


def differences(record: Record, model: Model, trajectory: Trajectory, sizes: Float64Array) -> Float64Array:
    """Slopes of every prediction by the model's coefficients, from two predictions each, (n, p)."""
    found = []
    for j, size in enumerate(sizes):
        up, down = model.coefficients, model.coefficients
        up[j] += size
        down[j] -= size
        ends = [
            predict(record, point, model.effects, model.stribeck, trajectory, with_slopes=False).end
            for point in (up, down)
        ]
        found.append((ends[0] - ends[1]) / (2.0 * size))
    return np.column_stack(found)


def test_written_slopes_are_the_derivative() -> None:
    """Parameters and static effects together: slopes by the chain rule are those of two predictions each.

    Close to zero speed both are as exact as the integration; one in a thousand may break loose at one of the two only.
    """
    record, trajectory = along_truth(1500, 1)
    model = TRUTH.with_terms(*STATIC)
    linearised = linearise(record, model, trajectory, QUIET, np.zeros(1500, dtype=bool))
    checked = differences(record, model, trajectory, 1.0e-5 * np.abs(model.coefficients))
    scale = np.max(np.abs(checked), axis=0)
    assert np.all(scale > 0.0)
    assert np.mean(np.abs(linearised.jacobian - checked) < 1.0e-4 * scale) > 0.999
    assert np.all(linearised.jacobian[~record.follows] == 0.0)


@pytest.mark.parametrize(
    "added", [term("friction_lag", 0.08), term("presliding_hysteresis", 0.1, SHAPES["presliding_hysteresis"])]
)
def test_slopes_of_a_friction_with_a_memory_are_the_derivative(added: Term) -> None:
    """Speed and memory alike: the chain rule over the flow's own differences says what two whole passes say.

    One interval in fifty may break loose, or come to rest, in one of them only.
    """
    record, trajectory = along_truth(1500, 3)
    model = TRUTH.with_terms(*STATIC, added)
    memory = np.clip(0.3 * trajectory.speed, -TRUTH.parameters.coulomb, TRUTH.parameters.coulomb)
    trajectory = trajectory._replace(memory=memory, memory_spread=np.full(1500, 0.05))
    linearised = linearise(record, model, trajectory, QUIET, np.zeros(1500, dtype=bool))
    for j, size in enumerate(1.0e-4 * np.abs(model.coefficients)):
        ends = []
        for way in (size, -size):
            point = model.coefficients
            point[j] += way
            ends.append(predict(record, point, model.effects, model.stribeck, trajectory, with_slopes=False))
        for found, up, down in (
            (linearised.jacobian[:, j], ends[0].end, ends[1].end),
            (linearised.memory_jacobian[:, j], ends[0].memory_end, ends[1].memory_end),
        ):
            checked = (up - down) / (2.0 * size)
            scale = np.quantile(np.abs(checked), 0.99)
            assert np.mean(np.abs(found - checked) <= 0.03 * scale) > 0.98, (j, scale)


@pytest.mark.parametrize(
    "added", [term("transport_delay", 0.05), term("stribeck_shape", 0.8), term("actuator_lag", 0.06)]
)
def test_slopes_by_differences_hardly_depend_on_the_step(added: Term) -> None:
    """Beside what has no written slope, written or by difference: differences of another width say the same."""
    record, trajectory = along_truth(1500, 2)
    model = TRUTH.with_terms(added)
    linearised = linearise(record, model, trajectory, QUIET, np.zeros(1500, dtype=bool))
    checked = differences(record, model, trajectory, 1.0e-4 * np.abs(model.coefficients))
    away = np.linalg.norm(linearised.jacobian - checked, axis=0) / np.linalg.norm(checked, axis=0)
    assert np.all(away < 0.05), away


def test_the_truth_is_beaten_by_chance_alone() -> None:
    """Twice the log-likelihood that a fit gains over the plant's own parameters is a chi-square of four."""
    gains = []
    for seed in range(12):
        record = record_of(simulated(seed=seed, profile="P2", samples=1500))
        fit = fitted(record)
        trajectory = fit.trajectory
        for _ in range(2):  # the truth is judged along its own trajectory, as the fit is
            linearised = linearise(record, TRUTH, trajectory, fit.noise, fit.omit, with_jacobian=False)
            own = likelihood(linearised, None, fit.noise)
            trajectory = smoothed_trajectory(linearised, np.zeros(0), own.noise)
        gains.append(2.0 * (fit.likelihood.value - own.value))
    assert max(gains) < chi2(4).ppf(1.0 - 1.0e-4)
    assert min(gains) > -2.0  # the two are not judged along quite the same trajectory
    assert 2.0 < np.mean(gains) < 7.0


def test_a_model_whose_predictions_blow_up_is_as_unlikely_as_can_be() -> None:
    """One prediction that is no number, or huge: no likelihood is NaN, of which nothing is the greatest."""
    record, trajectory = along_truth(400, 3)
    linearised = linearise(record, TRUTH, trajectory, QUIET, np.zeros(400, dtype=bool))
    for wild in (math.nan, math.inf, 1.0e200):
        defect = linearised.chain.defect.copy()
        defect[200] = wild
        blown = likelihood(replace(linearised, chain=linearised.chain._replace(defect=defect)), None, QUIET)
        assert blown.value == -math.inf
        assert np.isfinite(blown.correction).all()


@pytest.mark.parametrize(
    ("name", "text", "truth", "start"),
    [
        ("quadratic_drag", "coefficient_1_rad=1.5e-6", 1.5e-6, 0.0),
        ("transport_delay", "delay_s=0.06", 0.06, 0.1),
        ("presliding_hysteresis", "deflection_rad=0.1,damping=0.3", 0.1, 0.2),
    ],
)
def test_a_fit_recovers_what_was_injected(name: str, text: str, truth: float, start: float) -> None:
    """One linear effect, one delay, one memory: the plant's value within 4 sigma, the four parameters too."""
    for seed in range(3):
        record = record_of(simulated([f"{name}:{text}"], seed=seed, samples=3000))
        base = fitted(record)
        fit = fitted(record, base.model.with_terms(term(name, start, SHAPES.get(name, NO_SHAPE))), base)
        assert abs(fit.model.terms[0].values[0] - truth) < 4.0 * fit.std[4]
        assert fit.std[4] < 0.25 * truth
        assert np.all(np.abs(fit.model.coefficients[:4] - TRUTH.coefficients) < 4.0 * fit.std[:4])
        assert fit.likelihood.value > base.likelihood.value + 20.0


def test_fits_start_again_to_the_same_place() -> None:
    """A fit begun where another ended hardly moves and gains nothing: it had converged."""
    record = record_of(simulated(["quadratic_drag:coefficient_1_rad=1e-6"], seed=3, samples=2000))
    first = fitted(record, TRUTH.with_terms(term("quadratic_drag", 0.0)))
    again = fitted(record, first.model, first)
    assert np.all(np.abs(again.model.vector - first.model.vector) < 0.3 * first.std)
    assert abs(again.likelihood.value - first.likelihood.value) < 0.5


def test_readings_left_out_do_not_count() -> None:
    """A fit that is told to leave out spiked readings is the fit of a record in which they are missing."""
    run = simulated(seed=4, samples=1200)
    speed = run.measured_speed_rad_s
    spikes = np.zeros(1200, dtype=bool)
    spikes[[200, 500, 900]] = True
    record = record_of(run)
    clean = fitted(record)
    speed[spikes] += 100.0 * RAD_S_PER_RPM
    left_out = fit_model(Problem(record, DEFAULT_PRIOR, spikes), Start(TRUTH, clean.trajectory, clean.noise))
    assert left_out.likelihood.count == clean.likelihood.count - 3
    assert math.sqrt(left_out.noise.variance / clean.noise.variance) == pytest.approx(1.0, abs=0.01)
    assert np.all(np.abs(left_out.model.vector - clean.model.vector) < clean.std)


@pytest.fixture(scope="module")
def healthy() -> tuple[dict[str, list[float]], list[float]]:
    """Statistics by effect, and the noise found in rpm, over 40 healthy logs of their own profiles."""
    names = ("offset_torque", "quadratic_drag")
    statistics: dict[str, list[float]] = {name: [] for name in names}
    noises = []
    for seed in range(40):
        record = record_of(simulated(seed=seed, profile="P2", samples=1500))
        fit = fitted(record)
        sigma = math.sqrt(fit.noise.variance)
        facts = facts_of(record.course, fit, frozenset())
        scorer = Scorer(fit)
        for name, score in scorer.best_of_each(facts, [CATALOGUE[name] for name in names]).items():
            statistics[name].append(score.statistic)
        noises.append(sigma / RAD_S_PER_RPM)
    return statistics, noises


@pytest.mark.parametrize("name", ["offset_torque", "quadratic_drag"])
def test_statistics_of_healthy_wheels_are_chi_square(
    name: str, healthy: tuple[dict[str, list[float]], list[float]]
) -> None:
    """Nothing being there, the gain of one coefficient is a chi-square: by Kolmogorov and Smirnov, and in size."""
    found = np.array(healthy[0][name])
    assert found.size == 40
    assert kstest(found, chi2(1).cdf).pvalue > 0.01
    assert 0.5 < np.mean(found) < 1.6


def test_the_noise_of_the_readings_is_found(healthy: tuple[dict[str, list[float]], list[float]]) -> None:
    """R comes out of the profile likelihood: 1 rpm but for the chance of 1500 readings."""
    noises = np.array(healthy[1])
    expected = 1.0 / math.sqrt(2.0 * 1500.0)
    assert np.mean(noises) == pytest.approx(1.0, abs=0.01)
    assert np.max(np.abs(noises - 1.0)) < 4.0 * expected


def test_the_ratio_of_noises_is_found() -> None:
    """Process noise of the plant comes back within a factor of two, and R beside it does not suffer."""
    ratios, noises = [], []
    for seed in range(6):
        fit = fitted(record_of(simulated(seed=seed, profile="P2", samples=3000, process_rpm=0.1)))
        ratios.append(fit.noise.ratio)
        noises.append(math.sqrt(fit.noise.variance) / RAD_S_PER_RPM)
    assert 0.5 < np.exp(np.mean(np.log(ratios))) / (0.1**2 * 0.1) < 2.0
    assert np.mean(noises) == pytest.approx(1.0, abs=0.02)


def test_process_noise_does_not_pass_for_an_effect() -> None:
    """A healthy wheel whose speed wanders a little: statistics stay near chi-square, and sigmas near the errors.

    Ten minutes at 0.02 rpm per sqrt(s), which is little beside the readings' noise and much beside the sigmas.
    """
    statistics, squares = [], []
    for seed in range(12):
        record = record_of(simulated(seed=1000 + seed, process_rpm=0.02))
        fit = fitted(record)
        facts = facts_of(record.course, fit, frozenset())
        scorer = Scorer(fit)
        score = scorer.best_of_each(facts, [CATALOGUE["offset_torque"]])["offset_torque"]
        statistics.append(score.statistic)
        squares.append(np.mean(((fit.model.coefficients - TRUTH.coefficients) / fit.std)[:3] ** 2))
    assert np.mean(statistics) < 3.0
    assert np.mean(squares) < 4.0
