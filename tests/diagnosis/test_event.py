"""What confirms an event that happened once: every other five seconds of it and all else."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.diagnosis.checks.cross_fit import (
    _chi_square,
    _excess,
    _score_and_information,
    disputed_share,
    expected_excess,
)
from rw_ekf.diagnosis.checks.event_agreement import agrees_with_itself, percent_gained
from rw_ekf.diagnosis.checks.heldout import by_fit_part, performance
from rw_ekf.diagnosis.hypotheses import event
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.preparation import Prepared, prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.diagnosis.thresholds import MOST_DISPUTED
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.effects.catalogue import CATALOGUE, CHANGE, SPELL
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.logs.metadata import RunMetadata, write_metadata
from rw_ekf.model.effect import Term
from rw_ekf.model.law import Law
from tests.diagnosis.simulated import log_of, simulated

SPIKE, OFFSET = CATALOGUE["drag_spike"], CATALOGUE["offset_torque"]


def prepared_with(effect: str) -> Prepared:
    """A record with an effect at 150 s."""
    return prepare(source_of([log_of(simulated([effect], seed=5, samples=3000))]), None, None, "blocks")


def believed(effect: str, decay_s: float) -> tuple[Fit, Fit]:
    """Base fit of a record with an effect at 150 s, and a fit with a spike there that decays as is believed."""
    base = prepared_with(effect).base
    return base, base.refitted(
        base.model.with_terms(replace(Term.of(SPIKE, (150.0, decay_s, 0.0), 0.02), settled=True))
    )


@pytest.mark.parametrize(("amplitude_rad_s2", "decay_s"), [(0.03, 60.0), (0.3, 4.0)])
def test_seconds_of_an_event_agree(amplitude_rad_s2: float, decay_s: float) -> None:
    """Those of a weak spike, and of a short one, half of whose seconds know next to nothing of it."""
    base, fit = believed(f"drag_spike:amplitude_rad_s2={amplitude_rad_s2},onset_s=150,decay_s={decay_s}", decay_s)
    assert fit.likelihood.value > base.likelihood.value + 20.0  # the record as a whole has use for it
    assert agrees_with_itself(fit, SPIKE.id)


@pytest.mark.parametrize("everywhere", [True, False])
def test_parts_agree_on_a_torque_that_acts_all_the_time_alone(everywhere: bool) -> None:
    """A current offset that the log does not have, in all of the record or in its first half."""
    times, currents = sample_profile(make_profile("P2", seed=4), 10.0)
    times, logged = times[:3000], np.array(currents[:3000])
    first = np.arange(3000) < 1500
    sent = np.where(first | everywhere, logged + 0.004, logged)
    run = simulate_run(PlantParameters(), sent, times, PlantNoise(0.1), seed=6)
    base = prepare(source_of([log_of(replace(run, current_command_A=logged))]), None, None, "blocks").base
    fit = base.refitted(base.model.with_terms(Term.of(OFFSET, value=0.02)))
    assert fit.likelihood.value > base.likelihood.value + 20.0
    assert (disputed_share(fit, OFFSET.id, first) < MOST_DISPUTED) is everywhere


def test_what_an_event_gains_is_told_on_seconds_that_were_left_out() -> None:
    """Five seconds between readings are bridged nearly as well without a weak spike."""
    _, fit = believed("drag_spike:amplitude_rad_s2=0.03,onset_s=150,decay_s=60", 60.0)
    gained = percent_gained(fit, SPIKE.id)
    assert gained is not None
    assert -5.0 < gained < 50.0


def test_parts_dispute_what_a_test_of_two_fits_would_dispute() -> None:
    """The chi-square of the difference of two coefficients with their sigmas; one that knows nothing has none."""
    rng = np.random.default_rng(3)
    column, other = rng.standard_normal((2, 400))
    half = np.arange(400) < 150
    seen = 0.2 * column + np.where(half, 0.3 * column, 0.0) + 0.5 * other + 0.1 * rng.standard_normal(400)
    found = 0.31
    sizes, sigmas, stated = [], [], []
    for rows in (half, ~half):
        both = np.column_stack((column, other))[rows]
        covariance = np.linalg.inv(both.T @ both)
        sizes.append(float((covariance @ both.T @ seen[rows])[0]))
        sigmas.append(float(covariance[0, 0]))
        left = (seen - found * column)[rows]
        stated.append(
            _score_and_information(left, column[rows, None], other[rows, None], np.zeros((0, 1)), np.array([found]))
        )
    (u, J), (v, K) = stated
    disputed = _chi_square(u, J) + _chi_square(v, K) - _chi_square(u + v, J + K)
    assert disputed == pytest.approx((sizes[0] - sizes[1]) ** 2 / sum(sigmas), rel=1.0e-9)
    assert _chi_square(np.zeros(1), np.zeros((1, 1))) == 0.0


def test_what_a_part_does_not_know_costs_the_rest_what_it_does_in_draws() -> None:
    """Regressions on 30 rows of 200, of 4000 noises: squared errors elsewhere, beyond the noise's own, within 5 %."""
    rng = np.random.default_rng(8)
    rows = rng.standard_normal((200, 4)) * np.array([1.0, 30.0, 1.0e-3, 5.0])
    rows[30:, 2] *= 4.0  # shown less by the part than by the rest
    noise = rng.standard_normal((30, 4000))
    missed = rows[30:] @ np.linalg.lstsq(rows[:30], noise, rcond=None)[0]
    covariance = np.linalg.inv(rows[:30].T @ rows[:30])
    assert _excess(rows[30:], covariance) == pytest.approx(float(np.mean(missed**2)), rel=0.05)
    assert _excess(rows[:0], covariance) == 0.0


@pytest.mark.parametrize(("samples", "tells"), [(6000, True), (400, False)])
def test_half_of_a_minute_predicts_nothing_and_half_of_ten_does(samples: int, tells: bool) -> None:
    """Identification, its first 40 s or all: what half leaves open adds over a tenth to squared errors, or 2 %."""
    prepared = prepare(source_of([log_of(simulated([], seed=5, samples=samples))]), None, None, "blocks")
    excess = expected_excess(prepared.base, by_fit_part(prepared, prepared.base), prepared.split.fit)
    assert excess < 0.025 if tells else excess > 0.1


@pytest.mark.slow
def test_the_expected_excess_is_that_of_wheels_without_torque_noise() -> None:
    """Twelve wheels, either half predicting the other: NIS beyond 1 is as expected, within 3 errors of its mean."""
    beyond, expected = [], []
    for seed in range(12):
        prepared = prepare(source_of([log_of(simulated([], seed=100 + seed, samples=3000))]), None, None, "blocks")
        for way in (prepared, prepared.exchanged()):
            beyond.append(performance(way, way.base).figures["nis_mean"] - 1.0)
            expected.append(expected_excess(way.base, by_fit_part(way, way.base), way.split.fit))
    error = np.std(beyond) / math.sqrt(len(beyond))
    assert abs(np.mean(beyond) - np.mean(expected)) < 3.0 * error
    assert error < 2.0 * np.mean(expected)


def test_an_event_is_fitted_beside_other_laws_as_long_as_there_is_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside two laws with their aliases an event has fifteen fits of a second each; laws are to be asked after it."""
    effect = "drag_spike:amplitude_rad_s2=0.3,onset_s=150,decay_s=4"
    _, fit = believed(effect, 4.0)
    facts = prepared_with(effect).facts
    wanted: list[Fit] = []

    def as_it_was(less: Fit, *_: object) -> Fit:
        wanted.append(less)
        if len(wanted) == 3:
            monkeypatch.setattr(spent, "has", lambda _: False)
        return fit

    spent = fit.linearised.record.work
    monkeypatch.setattr(event, "may_confound", lambda *_: True)
    monkeypatch.setattr(event, "_others", lambda model, _: [model] * 5)
    monkeypatch.setattr(event, "fitted_event", as_it_was)
    assert event.with_other_laws(fit, SPIKE.id, facts).model.of(SPIKE.id)
    assert len(wanted) == 3
    assert spent.left_out == ["drag_spike beside the model"]


def test_the_time_of_an_event_is_told_in_utc_where_the_run_s_metadata_know_it(tmp_path: Path) -> None:
    """Beside the log's own time and that since its start; without metadata, and of a clock that began anew, not."""
    spike = "drag_spike:amplitude_rad_s2=0.3,onset_s=150,decay_s=20"
    log = log_of(simulated([spike], seed=5, samples=3000))
    log = replace(log, time_s=log.time_s + 2.0, name=str(tmp_path / "run.csv"))
    stated = diagnose_log(log).verdict["statement"]
    assert re.search(r"at 15\d\.\d s \(1(49|50|51)\.\d s after the log's start\)", stated)
    write_metadata(log.name, RunMetadata("2026-11-22T04:00:00.500000Z"))
    stated = diagnose_log(log).verdict["statement"]
    assert re.search(r"at 15\d\.\d s \(1\d\d\.\d s after the log's start, 2026-11-22T04:02:(29|30|31)Z\)", stated)
    anew = replace(log, segment=(np.arange(len(log)) > 2000).astype(np.int64))
    assert source_of([anew]).began_utc_s is None


def test_a_change_a_spell_and_a_knock_are_told_in_utc() -> None:
    """Each in its sentence, to the second, where it is known when the log began."""
    facts = replace(prepared_with("offset_torque").facts, began_utc_s=1.8e9)
    begins, ends = "2027-01-15T08:01:40Z", "2027-01-15T08:02:10Z"
    for kind, last_s, words in (
        (CHANGE, 130.0, f"From 100.0 +- 1.0 s on ({begins})"),
        (SPELL, 130.0, f"s ({begins} to {ends}), and neither before nor after"),
        (SPELL, 100.1, f"At 100.0 +- 1.0 s ({begins}) the "),
    ):
        law = Law("time", "torque", 100.0, last_s, ((0.0, 1.0),), spread=(1.0, 1.0))
        assert words in kind.sentence_of(Term(kind, (0.05,), (0.01,), law=law), ((1.0e-4,),), facts)
