"""What flowed before a record begins is not known; what flowed before a block of it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.one_step import Record, Trajectory, predict
from rw_ekf.likelihood.unknown_past import variance_of_past
from rw_ekf.model.effect import Candidate, Term
from rw_ekf.units import RAD_S_PER_RPM
from tests.diagnosis.simulated import TRUTH, log_of, record_of, simulated

FINE_S = 1.0e-4
ROWS = (
    "time_s",
    "current_command_A",
    "measured_speed_rad_s",
    "speed_rad_s",
    "temperature_degC",
    "angle_rad",
    "current_A",
)
GAIN = TRUTH.parameters.motor_gain


def course_of_ones(samples: int) -> Course:
    """One ampere throughout, ten times a second."""
    time_s = np.arange(samples, dtype=np.float64) / 10.0
    return Course.of(time_s, np.zeros(samples), np.ones(samples))


def missing_impulses(delay_s: float, lag_s: float, samples: int) -> Float64Array:
    """By how much speeds change differently if nothing had flowed before the first of them, integrated finely."""
    before_s = 2.0
    fine = np.arange(-before_s, 0.1 * samples, FINE_S)
    command = np.where(fine - delay_s >= 0.0, 1.0, 0.0)
    current = command.copy()
    if lag_s > 0.0:
        for i in range(1, fine.size):
            current[i] = command[i] + (current[i - 1] - command[i]) * np.exp(-FINE_S / lag_s)
    speed = np.concatenate(([0.0], np.cumsum((1.0 - current) * FINE_S)))[:-1]  # what an eternal ampere would add
    at = np.searchsorted(fine, 0.1 * np.arange(samples) - 1.0e-9)
    return GAIN * np.abs(np.diff(speed[at], prepend=speed[at[0]]))


@pytest.mark.parametrize(("delay_s", "lag_s"), [(0.0, 0.08), (0.0, 0.4), (0.07, 0.0), (0.23, 0.0), (0.05, 0.12)])
def test_the_variance_is_that_of_a_current_that_was_not_there(delay_s: float, lag_s: float) -> None:
    """A wheel at zero current before its first row against one with the row's: each step of speed within 1 %."""
    terms = []
    for name, value in (("transport_delay", delay_s), ("actuator_lag", lag_s)):
        if value > 0.0:
            terms.append(Term.at(CATALOGUE[name], Candidate(value)))
    found = np.sqrt(variance_of_past(course_of_ones(40), TRUTH.with_terms(*terms)) / 2.0)
    expected = missing_impulses(delay_s, lag_s, 40)
    assert found == pytest.approx(expected, rel=0.01, abs=0.002 * GAIN * (delay_s + lag_s))
    assert found[0] == 0.0
    assert expected.max() > 0.01 * GAIN * (delay_s + lag_s)


def test_what_remembers_nothing_knows_all() -> None:
    """Without lag, delay and window, and once a window is over, nothing is added."""
    assert not variance_of_past(course_of_ones(20), TRUTH).any()
    window = TRUTH.with_terms(Term.at(CATALOGUE["speed_averaging"], Candidate(0.3)))
    found = variance_of_past(course_of_ones(20), window)
    assert found[1] > found[2] > found[3] > 0.0
    assert not found[5:].any()


def test_each_segment_has_a_past_of_its_own() -> None:
    """Behind a gap the current before is as little known as at the begin."""
    course = course_of_ones(40)
    course = Course.of(course.time_s, course.speed_rad_s, np.ones(40), segment=np.repeat([0, 1], 20))
    found = variance_of_past(course, TRUTH.with_terms(Term.at(CATALOGUE["actuator_lag"], Candidate(0.1))))
    assert found[20] == 0.0
    assert found[1:20] == pytest.approx(found[21:40], rel=1.0e-6)


def test_a_block_of_a_record_begins_with_the_current_that_flows_there() -> None:
    """Predictions of every other ten seconds are those of the whole, to rounding, though the current lags by 0.3 s."""
    run = simulated(["actuator_lag:time_constant_s=0.3"], seed=3, samples=1500)
    record = record_of(run)
    model = TRUTH.with_terms(Term.at(CATALOGUE["actuator_lag"], Candidate(0.3)))
    path = Trajectory.of_speed(run.speed_rad_s.copy(), np.full(1500, 0.1 * RAD_S_PER_RPM))
    part = np.arange(1500) // 100 % 2 == 1
    block = Record.of(record.course, part, record.constants)
    whole = predict(record, model.coefficients, model.effects, model.stribeck, path)
    there = predict(block, model.coefficients, model.effects, model.stribeck, path)
    assert block.follows.sum() > 600
    assert there.end[block.follows] == pytest.approx(whole.end[block.follows], abs=1.0e-9)
    assert not there.end[~block.follows].any()


@pytest.mark.slow
def test_a_log_that_begins_with_full_current_shows_a_lag() -> None:
    """A small, fast wheel, at rest until the first row commands 0.35 A: the lag is named, its size right, and no more.

    That current taken for one that had flowed for long cost the lag's likelihood a thousand.
    """
    seed = 3
    draws = np.random.default_rng(seed)
    coulomb = 9.0 * draws.uniform(0.9, 1.1)
    wheel = PlantParameters(90.0, 0.03, coulomb, 1.1 * coulomb)._replace(actuator_lag_s=0.08)
    levels = np.repeat(draws.uniform(-0.5, 0.5, 40), 100)
    levels[:100] = 0.35
    current_A = levels * (1.0 + 0.3 * np.sin(2.0 * np.pi * np.arange(4000) / 37.0))
    current_A = np.concatenate((np.zeros(20), current_A))
    run = simulate_run(wheel, current_A, 0.1 * np.arange(4020.0), PlantNoise(0.2), seed=seed)
    late = {name: getattr(run, name)[20:] for name in ROWS}
    document = diagnose_log(log_of(replace(run, **late))).document()
    assert document["verdict"]["effects"] == ["actuator_lag"], document["verdict"]["statement"]
    found = next(item for item in document["candidates"] if item["effect"] == "actuator_lag")
    lag_s = found["parameters"]["time_constant_s"]
    assert abs(lag_s["value"] - 0.08) < 4.0 * lag_s["std"]
    assert lag_s["std"] < 0.001
