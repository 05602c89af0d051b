"""A log of a controller that is faster than the log, with the current of a moment in each row, is told so."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

import rw_ekf
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.investigate.sampled_loop import answer_of, between_rows, stated_of_sampled_loop
from rw_ekf.diagnosis.prepare.preparation import Prepared, prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.log_simulation import simulate
from tests.diagnosis.speed_loop import log_of, regulated

EACH = 10  # turns of the controller a row


def thinned(seed: int, *, mean: bool = False) -> rw_ekf.Log:
    """A controller of 100 Hz in a log of 10 Hz; mean: of the current until the next row, else that of the moment."""
    time_s, reading, current_A = regulated(seed, rate_hz=10 * EACH, limit_A=0.4)
    taken = current_A.reshape(-1, EACH).mean(axis=1) if mean else current_A[::EACH]
    return log_of(time_s[::EACH], reading[::EACH], taken, "current_command_A")


def stated(log: rw_ekf.Log) -> str:
    """What is said of it before anything is searched."""
    prepared: Prepared = prepare(source_of([log]), None, None, "blocks")
    return stated_of_sampled_loop(cast("Found", SimpleNamespace(prepared=prepared)))


@pytest.mark.parametrize("seed", range(3))
def test_the_current_of_a_moment_is_told(seed: int) -> None:
    """With by how much it answers a reading, .12 A per rad/s."""
    assert "by 0.12 A per rad/s" in stated(thinned(seed))


@pytest.mark.parametrize("seed", range(3))
def test_the_mean_of_the_current_is_not(seed: int) -> None:
    """Of the same loops, as the sentence advises: nothing is said."""
    assert stated(thinned(seed, mean=True)) == ""


@pytest.mark.parametrize("seed", range(3))
def test_a_controller_in_step_with_its_log_is_not(seed: int) -> None:
    """Its current answers each reading as much, and the wheel feels it."""
    time_s, reading, current_A = regulated(seed, limit_A=0.4)
    assert stated(log_of(time_s, reading, current_A, "current_command_A")) == ""


@pytest.mark.parametrize("effects", [[], ["transport_delay"], ["viscous_temperature"]])
def test_a_command_that_knows_no_reading_is_not(effects: list[str]) -> None:
    """An open loop answers none."""
    log = simulate("P2", effects=effects, seed=4, duration_s=300.0)
    assert between_rows(prepare(source_of([log]), None, None, "blocks")) is None


def test_how_a_current_answers_is_told_where_it_moves_freely() -> None:
    """.2 A per rad/s beside a slow motion, within four sigma; rows that stand at a limit say nothing of it."""
    rng = np.random.default_rng(1)
    noise = rng.standard_normal(4000)
    current_A = np.clip(np.sin(0.01 * np.arange(4000)) - 0.2 * noise, -0.5, 0.5)
    found = answer_of(current_A, noise, np.zeros(4000, dtype=np.int64))
    assert found.is_certain
    assert found.along_A == pytest.approx(0.2, abs=max(4.0 * found.std, 1.0e-3))
    assert not found.free[np.abs(current_A) == 0.5].any()


@pytest.mark.slow
def test_a_diagnosis_says_it_first_and_its_advice_mends_the_log() -> None:
    """Viscous friction and laws of the current came of it; the mean current of the same loop is adequate."""
    reported = rw_ekf.diagnose(thinned(1)).verdict
    assert reported["statement"].startswith("The log's current seems to be that of a moment")
    assert reported["kind"] != "adequate"
    assert rw_ekf.diagnose(thinned(1, mean=True)).verdict["kind"] == "adequate"
