"""A log is known again by what it holds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from rw_ekf.logs.reader import read_log
from rw_ekf.logs.record_print import made_of, print_of
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.logs.writer import SampleWriter
from rw_ekf.records import IssuedCommand, WheelSample


def log_of(path: Path, seed: int, rows: int = 300) -> Path:
    """Noisy readings of a wheel that always does the same."""
    noise = np.random.default_rng(seed).standard_normal(rows)
    with SampleWriter(path) as writer:
        for i in range(rows):
            writer.write(WheelSample(0.1 * i, 20.0 + np.sin(0.1 * i) + 0.1 * noise[i]), IssuedCommand(0.1))
    return path


def test_a_record_is_known_in_another_form_and_under_another_name(tmp_path: Path) -> None:
    """As Parquet, and longer: the same record; of another noise: another, whatever it is called."""
    log = read_log(log_of(tmp_path / "a.csv", 1))
    log.save(tmp_path / "b.parquet")
    assert print_of(read_log(tmp_path / "b.parquet")) == print_of(log)
    assert print_of(read_log(log_of(tmp_path / "longer.csv", 2, 400))) != print_of(log)
    source = {"method": "filter", "log": "a.csv", "record": print_of(log)}
    renamed = replace(log, name="x/c.csv")
    stated = made_of(source, renamed)
    assert stated is not None
    assert "x/c.csv: the model given was made of this very log (a.csv)" in stated
    (tmp_path / "other").mkdir()
    assert made_of(source, read_log(log_of(tmp_path / "other" / "a.csv", 3))) is None


def test_a_model_without_a_fingerprint_goes_by_the_name_of_its_log() -> None:
    """As older versions wrote it; and one of no log is of none."""
    zeros = np.zeros(3)
    log = WheelLog("runs/a.csv", np.arange(3.0), zeros, zeros, "current_A", zeros, np.zeros(3, dtype=np.int64))
    assert made_of({"log": "a.csv"}, log) is not None
    assert made_of({"log": "b.csv"}, log) is None
    assert made_of({"method": "start"}, log) is None
