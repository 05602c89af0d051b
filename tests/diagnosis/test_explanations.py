"""The explanations that stand after a diagnosis: evidence, probabilities, and what the document says of them."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from rw_ekf.course.course import Course
from rw_ekf.course.warming import Warming, warming_of
from rw_ekf.diagnosis.ledger.evidence import log_evidence
from rw_ekf.diagnosis.log_diagnosis import diagnose_log, richer_part
from rw_ekf.diagnosis.prepare.preparation import Prepared, prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.linearisation import Linearisation
from rw_ekf.likelihood.model_vector import prior_rows
from rw_ekf.likelihood.profile import LEAST_RATIO, MOST_RATIO
from rw_ekf.model.effect import Term
from tests.contract import check_document
from tests.diagnosis.simulated import log_of, simulated

OFFSET = CATALOGUE["offset_torque"]


@lru_cache
def prepared() -> Prepared:
    """Three minutes of a wheel with a small offset, at 5 rpm."""
    run = simulated(["offset_torque:torque_rad_s2=0.006"], seed=5, profile="P2", samples=1800, noise_rpm=5.0)
    return richer_part(prepare(source_of([log_of(run)]), None, None, "blocks"))


def log_integral(fit: Fit, linearised: Linearisation) -> float:
    """Log of the likelihood integrated over everything that is linearised, R and the ratio: dense sums, no closed form.

    Up to the constants that all models of a record share: the a priori's own, and those of R.
    """
    W, aim = prior_rows(fit.prior, fit.model) if fit.prior is not None else (np.zeros((0, 4)), np.zeros(0))
    x = linearised.model.vector
    total = []
    steps = np.arange(math.log(LEAST_RATIO), math.log(MOST_RATIO), 0.4)
    for log_ratio in steps:
        R = fit.noise.variance
        r, A, logs = linearised.whitened(math.exp(log_ratio), R, linearised.jacobian)
        B, z = np.vstack((A, W[:, : x.size])), np.concatenate((r, aim - W[:, : x.size] @ x))
        step = np.linalg.lstsq(B, z, rcond=None)[0]
        left, scales = r - A @ step, np.linalg.norm(B, axis=0)
        half_log_det = 0.5 * np.linalg.slogdet((B / scales).T @ (B / scales))[1] + np.sum(np.log(scales))
        n, s = r.size, float(left @ left) / r.size
        density = math.exp(log_ratio) * s * R / linearised.record.course.period_s
        assert linearised.record.torque_noise is not None
        known = linearised.record.torque_noise.log_density(density) + 0.5 * math.log(density)
        total.append(-0.5 * (n * math.log(s) + logs + n) - half_log_det + 0.5 * x.size * math.log(s) + known)
    top = max(total)
    return float(top) + math.log(sum(math.exp(value - top) for value in total) * 0.4)


def test_the_evidence_of_an_effect_is_its_likelihood_integrated_over_its_size() -> None:
    """The odds between an offset and none are those of a sum over sizes of the offset, each with its prior density."""
    made = prepared()
    whole = made.base
    fit = whole.refitted(whole.model.with_terms(Term.of(OFFSET)))
    odds = log_evidence(fit, (OFFSET.id,), made.facts) - log_evidence(fit.without(OFFSET.id), (), made.facts)

    low, high = OFFSET.smallest(made.facts), OFFSET.largest(made.facts)
    found, linearised = fit.model.vector[4], fit.linearised
    bare = replace(linearised, model=fit.model.base, jacobian=np.ascontiguousarray(linearised.jacobian[:, :4]))
    sizes = np.geomspace(low, 10.0 * abs(found), 60)
    logs = []
    for size in (*sizes, *-sizes):
        defect = linearised.chain.defect + (size - found) * linearised.jacobian[:, 4]
        moved = replace(bare, chain=linearised.chain._replace(defect=defect))
        logs.append(log_integral(replace(fit, model=bare.model), moved))
    width = math.log(sizes[1] / sizes[0])
    top = max(logs)
    summed = top + math.log(sum(math.exp(v - top) for v in logs) * width / (2.0 * math.log(high / low)))
    without = fit.without(OFFSET.id)
    testable = [e for e in CATALOGUE.values() if e.in_state and e.untestable(made.facts) is None]
    expected = summed - log_integral(without, without.linearised) - math.log(len(testable))
    assert odds == pytest.approx(expected, abs=0.3)


def test_what_slow_sines_cannot_tell_apart_stands_with_even_odds() -> None:
    """A lag, a delay and a mean over a window under slow sines all stand; the document is as the contract has it."""
    document = diagnose_log(log_of(simulated(["actuator_lag"], seed=11, profile="P1"))).document()
    check_document(document)
    stand = {tuple(item["effects"]): item["posterior"] for item in document["explanations"]}
    assert set(stand) == {("actuator_lag",), ("transport_delay",), ("speed_averaging",)}
    assert min(stand.values()) > 0.1
    assert sum(stand.values()) == pytest.approx(1.0, abs=0.02)
    for item in document["explanations"]:
        assert [entry["effect"] for entry in item["model"]["effects"]] == item["effects"]


def test_the_law_of_a_temperature_is_found_again() -> None:
    """A body with known heating by speed and current, under steady surroundings, is predicted from its own record."""
    time = np.arange(0.0, 600.0, 0.1)
    speed, current = 150.0 * np.sin(time / 40.0) ** 2, np.where(time % 120.0 < 30.0, 0.3, 0.0)
    law = Warming(22.0, 250.0, 0.03, 5.0)
    warmth = law.temperature(20.0, time, speed, np.concatenate(([0.0], current[:-1])))
    course = Course.of(time, speed, current, temperature_degC=np.round(warmth, 2), angle_rad=np.zeros(time.size))
    found = warming_of(course, speed)
    assert found is not None
    ahead = np.arange(600.0, 720.0, 0.1)
    fast, still = np.full(ahead.size, 250.0), np.zeros(ahead.size)
    start = float(warmth[-1])
    np.testing.assert_allclose(
        found.temperature(start, ahead, fast, still), law.temperature(start, ahead, fast, still), atol=0.1
    )
