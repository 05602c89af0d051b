"""A log whose current stands a row late is told so, and read rightly with what the verdict advises."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

import rw_ekf
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.investigate.late_rows import read_earlier, sentence_about_late_rows
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.log_simulation import simulate
from rw_ekf.logs.wheel_log import WheelLog

MAP = "time_s: {column: t}\nspeed_rad_s: {column: w}\ncurrent_A: {column: i}\ncurrent_before: true\n"


def gained(log: WheelLog, by: float = 1.0) -> float:
    """What the base model gains in log-likelihood where the current is in force so much of a row earlier."""
    prepared = prepare(source_of([log]), None, None, "blocks")
    return read_earlier(prepared, by).likelihood.value - prepared.base.likelihood.value


@pytest.mark.slow
def test_what_a_logger_has_just_done_is_told_and_read(tmp_path: Path) -> None:
    """Each row with the current before it: told with the line that mends it, and with that line adequate."""
    log = simulate("P2", seed=3, duration_s=300.0)
    just_done = np.append(log.current_A[:1], log.current_A[:-1])
    path, columns = tmp_path / "bench.csv", tmp_path / "map.yaml"
    np.savetxt(
        path, np.column_stack((log.time_s, log.speed_rad_s, just_done)), delimiter=",", header="t,w,i", comments=""
    )
    columns.write_text(MAP)
    as_it_stands = rw_ekf.diagnose(replace(log, current_A=just_done))
    assert "`current_before: true`" in as_it_stands.verdict["statement"]
    reported = rw_ekf.diagnose(rw_ekf.read(path, columns=columns))
    assert reported.verdict["kind"] == "adequate", reported.verdict["statement"]


@pytest.mark.parametrize("effects", [[], ["transport_delay"], ["actuator_lag"], ["viscous_temperature"]])
def test_a_log_that_is_read_as_it_should_be_is_not(effects: list[str]) -> None:
    """Nor one whose commands take force late, which is the other way: a row earlier explains it worse."""
    log = simulate("P2", effects=effects, seed=4, duration_s=300.0)
    assert gained(log) < 5.0
    assert gained(log, 0.5) < 5.0


def test_one_that_is_a_row_late_gains_much() -> None:
    """The same wheel, its current moved by a row."""
    log = simulate("P2", seed=4, duration_s=300.0)
    assert gained(replace(log, current_A=np.append(log.current_A[:1], log.current_A[:-1]))) > 50.0


@pytest.mark.parametrize(("numbers", "reported"), [(1, False), (9, True)])
def test_what_was_found_pays_for_its_numbers(numbers: int, reported: bool) -> None:
    """A likelihood that is larger by 20 than that of the other reading: a law's single number is, nine are not."""
    log = simulate("P2", seed=4, duration_s=300.0)
    prepared = prepare(source_of([replace(log, current_A=np.append(log.current_A[:1], log.current_A[:-1]))]),
                       None, None, "blocks")  # fmt: skip
    fit = SimpleNamespace(
        likelihood=SimpleNamespace(value=read_earlier(prepared).likelihood.value + 20.0),
        model=SimpleNamespace(vector=np.zeros(prepared.base.model.vector.size + numbers)),
    )
    assert bool(sentence_about_late_rows(cast("Found", SimpleNamespace(prepared=prepared, fit=fit)))) is reported


def test_one_whose_readings_are_means_over_the_row_gains_by_half_a_row() -> None:
    """The current of a logger that writes what it has just done, beside the speed of counts from row to row.

    A row earlier it is worse than as it stands: that is half a row too much.
    """
    log = simulate("P2", seed=4, duration_s=300.0)
    mean = 0.5 * (log.speed_rad_s + np.append(log.speed_rad_s[:1], log.speed_rad_s[:-1]))
    counted = replace(log, speed_rad_s=mean, current_A=np.append(log.current_A[:1], log.current_A[:-1]))
    assert gained(counted, 0.5) > 50.0
    assert gained(counted, 0.5) > gained(counted)


def test_each_segment_keeps_its_last_current(tmp_path: Path) -> None:
    """Every row takes the next one's, within its segment; of a file that is thinned, before it is."""
    rows = "0,0,1,0\n0.1,0,2,0\n0.2,0,3,0\n0,0,4,1\n0.1,0,5,1\n"
    path, columns = tmp_path / "two.csv", tmp_path / "map.yaml"
    path.write_text(f"t,w,i,s\n{rows}")
    columns.write_text(f"{MAP}segment: {{column: s}}\n")
    assert rw_ekf.read(path, columns=columns).current_A.tolist() == [2.0, 3.0, 3.0, 5.0, 5.0]
    columns.write_text(f"{MAP}segment: {{column: s}}\ndecimate: 2\n")
    assert rw_ekf.read(path, columns=columns).current_A.tolist() == [2.5, 3.0, 5.0]
