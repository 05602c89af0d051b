"""A diagnosis of a log that is too long to be held looks at stretches of it, and says so."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.cli import main
from rw_ekf.logs import csv_table, long_log, parquet_table
from rw_ekf.logs.excerpt import read_log_or_excerpt
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.tables import write_table
from tests.commands.logs import plant_columns
from tests.logs.test_long_log import columns_of


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_the_rows_are_those_of_the_log_evenly_spread(
    tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each row is one of the log read as a whole, stretches are segments, and what is left out is counted."""
    monkeypatch.setattr(long_log, "LONG_ROWS", 640)
    monkeypatch.setattr(csv_table, "_ROWS_AT_ONCE", 150)
    monkeypatch.setattr(parquet_table, "_ROWS_AT_ONCE", 257)
    path = tmp_path / f"log{suffix}"
    write_table(path, columns_of(4))
    whole, found = read_log(path), read_log_or_excerpt(path)
    at = np.searchsorted(whole.channels["temperature_degC"], found.channels["temperature_degC"])  # which only rises
    assert np.array_equal(found.time_s, whole.time_s[at])
    assert np.array_equal(found.speed_rad_s, whole.speed_rad_s[at], equal_nan=True)
    assert np.array_equal(found.current_A, whole.current_A[at])
    tanks = found.numbers("tank_K"), whole.numbers("tank_K")
    assert tanks[0] is not None
    assert tanks[1] is not None
    assert np.array_equal(tanks[0], tanks[1][at])
    assert found.left_out == len(whole) - len(found)
    assert found.warnings == whole.warnings
    gaps = np.diff(at)
    assert np.array_equal(np.diff(found.segment) > 0, (gaps > 1) | (np.diff(whole.segment[at]) > 0))
    assert 31 <= int(np.sum(gaps > 1)) + 1 <= 33
    assert float(gaps[gaps > 1].max()) < 1.5 * float(gaps[gaps > 1].min())


@pytest.mark.slow
def test_an_effect_is_found_in_stretches(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A drag that the model lacks, named from three quarters of the rows; the rest is said not to be known."""
    monkeypatch.setattr(long_log, "LONG_ROWS", 9_000)
    monkeypatch.setattr(parquet_table, "_ROWS_AT_ONCE", 2_000)
    runs = [plant_columns("identification", ["quadratic_drag:coefficient_1_rad=4e-6"], seed=s) for s in range(1, 5)]
    columns = {name: np.concatenate([run[name] for run in runs]) for name in runs[0]}
    columns["segment"] = np.repeat(np.arange(4.0), [run["time_s"].size for run in runs])
    log = tmp_path / "log.parquet"
    write_table(log, columns)
    assert main(["diagnose", str(log), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["verdict"]["effects"] == ["quadratic_drag"]
    assert f"of {columns['time_s'].size} samples " in json.dumps(document)
    whole = document["whole_log"]
    assert whole["samples"] == columns["time_s"].size
    drag = whole["fit"]["effects"]["quadratic_drag"]["coefficient_1_rad"]
    assert drag["value"] == pytest.approx(4.0e-6, abs=3.5 * drag["std"])
    assert whole["after"]["rms_rpm"] < 0.99 * whole["before"]["rms_rpm"]  # whose filter learns what it can of a drag
    assert whole["after"]["nis_mean"] == pytest.approx(1.0, abs=0.1)
    assert any(text.startswith("over all ") for text in document["warnings"])
