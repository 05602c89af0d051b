"""A ripple whose angle is integrated from the readings: the angle's loss is followed, and its likelihood is right."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.linearisation import Noise, linearise
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import Record, Trajectory
from rw_ekf.likelihood.phase_particles import follow
from rw_ekf.likelihood.whitening import Chain, whiten
from rw_ekf.model.effect import Candidate, Term
from tests.diagnosis.simulated import TRUTH, record_of, simulated
from tools.measure.effect_coverage import drawn, reported
from tools.proof.plants import log_of

RIPPLE = CATALOGUE["torque_ripple"]
R, Q = 0.4, 0.02


def chain_of(reading: Float64Array) -> Chain:
    """A speed that decays slowly, read every tenth of a second."""
    n = reading.size
    slopes = np.zeros((n, 4))
    slopes[:, 0] = 0.98
    step, follows = np.full(n, 0.1), np.ones(n, dtype=bool)
    follows[0] = False
    nothing = np.zeros(n)
    return Chain(follows, step, step, slopes, nothing, nothing, nothing, 0.0, reading)


def test_particles_whose_phase_stays_integrate_over_phase_and_amplitude() -> None:
    """With no walk the log-likelihood is that of a dense grid of phases and amplitudes, each whitened by itself."""
    rng = np.random.default_rng(5)
    n, order = 300, 3.0
    angle = np.cumsum(rng.uniform(0.02, 0.2, n))
    regressors = 0.1 * np.column_stack((np.sin(order * angle), np.cos(order * angle)))
    chain = chain_of(np.zeros(n))
    added = np.zeros(n)
    for i in range(1, n):
        added[i] = 0.98 * added[i - 1] + regressors[i] @ [0.9, 0.5]
    chain = chain._replace(reading=added + math.sqrt(R) * rng.standard_normal(n))
    r, A = np.zeros(n), np.zeros((n, 2))
    sum_logs, _ = whiten(chain, regressors, np.zeros((0, 2)), Q, R, r, A, np.zeros((0, 0)))
    logs = np.random.default_rng(1).permutation(np.linspace(math.log(0.3), math.log(3.0), 4000))
    values, sizes = [], np.repeat(np.linspace(math.log(0.3), math.log(3.0), 200), 60)
    for size in np.exp(sizes[::60]):
        for phase in np.linspace(0.0, 2.0 * math.pi, 60, endpoint=False):
            left = r - A @ (size * np.array([math.cos(phase), math.sin(phase)]))
            values.append(-0.5 * float(left @ left) - 0.5 * sum_logs)
    dense = float(np.logaddexp.reduce(values)) - math.log(len(values))
    normals = np.random.default_rng(2).standard_normal(100_003)
    found = follow(chain, regressors, logs, normals, 0.0, Q, R, np.zeros((0, n)))
    assert found == pytest.approx(dense, abs=0.5)
    weights = np.exp(np.array(values) - max(values))
    mean = float(weights @ sizes / weights.sum())
    assert float(logs.mean()) == pytest.approx(mean, abs=0.15)


def test_what_an_integrated_angle_is_wrong_by_is_in_the_chain() -> None:
    """An angle path shifted by a little: predictions change by the chain's slope by the angle, to first order."""
    record = replace(record_of(simulated(seed=12, samples=600)), angle_is_integrated=True)
    term = replace(Term.at(RIPPLE, Candidate(1.0, (5.0, 0.0, 0.0))), values=(0.04, -0.03))
    model: Model = TRUTH.with_terms(term)
    n = record.course.samples
    path = Trajectory.of_speed(record.course.speed_rad_s, np.full(n, 0.01))
    noise, none = Noise(0.01, 1.0e-4), np.zeros(n, dtype=bool)
    shift = 1.0e-4
    here, there = (
        linearise(record, model, path._replace(angle=record.course.angle_rad + by), noise, none) for by in (0.0, shift)
    )
    moved = (there.chain.defect - here.chain.defect) / shift
    assert here.follows_angle
    assert np.abs(moved).max() > 0.01
    np.testing.assert_allclose(here.chain.slopes[:, 1], moved, atol=2.0e-3 * np.abs(moved).max())
    assert not linearise(replace(record, angle_is_integrated=False), model, path, noise, none).follows_angle


def test_a_part_of_a_record_keeps_its_angle_and_a_gap_loses_it() -> None:
    """Where a block of a record without gaps begins the angle is known from the whole; behind a gap it is not."""
    run = simulated(seed=12, samples=600)
    whole = replace(record_of(run), angle_is_integrated=True)
    half = np.arange(600) % 200 < 100
    part = Record.of(whole.course, half, whole.constants, angle_is_integrated=True)
    later = whole.course._replace(time_s=whole.course.time_s + 10.0 * (np.arange(600) >= 300))
    broken = Record.of(later, np.ones(600, dtype=bool), whole.constants, angle_is_integrated=True)
    model = TRUTH.with_terms(replace(Term.at(RIPPLE, Candidate(1.0, (2.0, 0.0, 0.0))), values=(0.05, 0.0)))
    path = Trajectory.of_speed(whole.course.speed_rad_s, np.full(600, 0.01))
    lost = [
        linearise(record, model, path, Noise(0.01, 1e-4), np.zeros(600, dtype=bool)).chain.memory_variance
        for record in (part, broken)
    ]
    assert lost[0] == 0.0
    assert lost[1] > 0.5


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "order"), [(20, 3), (34, 4)])
def test_orders_above_two_are_found_without_an_angle(seed: int, order: int) -> None:
    """Ripples of order 3 and 4 at 1 rpm: the order is named, and the amplitude holds the truth within two sigma."""
    what = drawn("torque_ripple", seed)
    document = diagnose_log(log_of(what.case)).document()
    entry = next(item for item in document["candidates"] if item["effect"] == "torque_ripple")
    assert document["verdict"]["effects"] == ["torque_ripple"]
    assert entry["parameters"]["order"]["value"] == what.truth["order"] == order
    assert entry["parameters"]["order"]["probability"][f"{order:g}"] > 0.9
    found = reported({"found": entry["parameters"], "truth": what.truth})
    value, std, truth = found["amplitude_rad_s2"]
    assert abs(value - truth) < 2.0 * std
    assert std < 0.1 * truth
