"""MDF files are read, written by the library itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asammdf import MDF, Signal

from tests.foreign_logs import (
    Record,
    assert_same,
    assert_says_what_to_install,
    assert_survives_damage,
    read_with,
    refusal,
)

MAP = ("speed_rad_s: fast.w", "current_A: fast.i", "temperature_degC: slow.T")


def save(path: Path, record: Record, version: str = "4.10") -> Path:
    """A fast group with a raw current and a state of texts, a slow one with an invalid value, and a third as long."""
    counts: Any = {"a": 0.5, "b": 1.0}
    states: Any = {"val_0": 0, "text_0": b"off", "val_1": 1, "text_1": b"on"}
    raw = np.arange(60)
    fast = [
        Signal(record.speed, record.time_s, name="w"),
        Signal(raw, record.time_s, name="i", conversion=counts),
        Signal(raw % 2, record.time_s, name="on", conversion=states),
    ]
    invalid: dict[str, Any] = {"invalidation_bits": raw[::2] == 2} if version.startswith("4") else {}
    slow = [Signal(np.arange(30.0), record.time_s[::2], name="T", **invalid)]
    with MDF(version=version) as file:
        file.append(fast, comment="fast", common_timebase=True)
        file.append(slow, comment="slow", common_timebase=True)
        file.save(path, overwrite=True)
    return path


def test_round_trip(tmp_path: Path) -> None:
    """Conversions are applied, states stay numbers, invalid values are gaps, groups are joined."""
    record = Record(1)
    record.current = np.asarray(0.5 * np.arange(60) + 1.0, dtype=np.float64)
    path = save(tmp_path / "a.mf4", record)
    log = read_with(path, *MAP)
    assert_same(log, record)
    expected = np.repeat(np.arange(30.0), 2)
    expected[2:4] = np.nan  # the second value is invalid
    assert np.array_equal(log.channels["temperature_degC"], expected, equal_nan=True)
    assert log.other["fast.on"].to_pylist()[:3] == [0, 1, 0]
    assert "all were put on the times of 'fast'" in log.warnings[0]
    assert_same(read_with(path, "variable: fast", "speed_rad_s: w", "current_A: i"), record)
    assert_same(
        read_with(save(tmp_path / "a.mdf", record, "3.30"), "variable: fast", "speed_rad_s: w", "current_A: i"), record
    )


@pytest.mark.slow
def test_damage_and_a_missing_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither ends in anything but a LogError."""
    path = save(tmp_path / "a.mf4", Record(2))
    assert_says_what_to_install(monkeypatch, path, "asammdf", "mdf")
    assert "has no 'gone'" in refusal(path, "variable: gone", "speed_rad_s: w", "current_A: i")
    assert_survives_damage(path, *MAP, cuts=4, flips=8)  # a process each
