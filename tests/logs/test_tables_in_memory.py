"""Logs of tables and arrays in memory: what is missing, of which shape and type a column may be."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

import rw_ekf

N = 40
TIME_S = np.arange(N) * 0.1
SPEED = np.linspace(-3.0, 5.0, N)
CURRENT = np.linspace(0.2, -0.1, N)


def columns(**others: object) -> dict[str, Any]:
    return {"time_s": TIME_S, "speed_rad_s": SPEED, "current_A": CURRENT, **others}


@pytest.mark.parametrize("kind", [float, "f4", "i8", ">f8"])
def test_what_is_masked_is_missing(kind: str) -> None:
    masked = np.arange(N) % 7 == 0
    held = SPEED.astype(kind)
    column = np.ma.array(np.where(masked, -99, held), mask=masked)
    others = columns(speed_rad_s=column)
    for log in (rw_ekf.read(others), rw_ekf.Log.from_arrays(others.pop("time_s"), **others)):
        assert np.array_equal(log.speed_rad_s, np.where(masked, np.nan, held), equal_nan=True)


def test_words_and_dates_may_be_masked() -> None:
    mask = np.arange(N) == 3
    words = np.ma.array(np.full(N, "on"), mask=mask)
    dates = np.ma.array((np.datetime64("2026-01-01") + (1e9 * TIME_S).astype("m8[ns]")), mask=mask)
    assert rw_ekf.read(columns(mode=words)).other["mode"].null_count == 1
    with pytest.raises(rw_ekf.Error, match="row 4, column 'time_s'"):
        rw_ekf.read(columns(time_s=dates))


@pytest.mark.parametrize(
    ("column", "words"),
    [
        (np.c_[SPEED, SPEED], r"has the shape \(40, 2\): .*give each its own name"),
        (SPEED[None], r"has the shape \(1, 40\): .*transpose it"),
        ([[1.0, 2.0], [3.0]], "has several values in a row"),
        (0.5, "is float '0.5', no sequence of values"),
        (np.array(0.5), "is ndarray '0.5', no sequence of values"),
        ("0.5", "is str '0.5', no sequence of values"),
        (SPEED + 0j, "holds complex numbers"),
        ([object()] * N, "holds what is neither a number, a word nor a date"),
    ],
)
def test_what_is_no_column_is_said(column: object, words: str) -> None:
    with pytest.raises(rw_ekf.Error, match=f"table: column 'speed_rad_s' {words}"):
        rw_ekf.read(columns(speed_rad_s=column))
    with pytest.raises(rw_ekf.Error, match=f"arrays: column 'speed_rad_s' {words}"):
        rw_ekf.Log.from_arrays(**columns(speed_rad_s=column))


@pytest.mark.parametrize("kind", [np.array, list, pa.array, lambda values: np.ma.array(values, mask=values)])
@pytest.mark.parametrize("name", ["speed_rad_s", "current_A", "temperature_degC"])
def test_true_and_false_are_no_speeds(kind: Callable[[Any], object], name: str) -> None:
    """Nor currents or temperatures: they were read as 1 and 0; of segments, and of what nobody reads, they go on."""
    held = kind(SPEED > 0.5)
    with pytest.raises(rw_ekf.Error, match=rf"column '{name}' holds (bool|true and false), not numbers"):
        rw_ekf.read(**columns(**{name: held}))
    log = rw_ekf.read(**columns(segment=TIME_S[9] < TIME_S, armed=held))
    assert len(np.unique(log.segment)) == 2


@pytest.mark.parametrize(
    "make",
    [
        lambda values: values[:, None],
        iter,
        list,
        lambda values: [str(value) for value in values],
        lambda values: pa.array(map(str, values), pa.large_string()),
        lambda values: pa.array(values).dictionary_encode(),
        lambda values: pa.chunked_array([values[:9], values[9:]]).dictionary_encode(),
    ],
)
def test_numbers_in_other_clothes_are_the_numbers(make: Callable[[Any], object]) -> None:
    log = rw_ekf.read({name: make(values) for name, values in columns().items()})
    assert np.array_equal(log.time_s, TIME_S)
    assert np.array_equal(log.speed_rad_s, SPEED)
    assert np.array_equal(log.current_A, CURRENT)


@pytest.mark.parametrize("name", ["time_s", "time"])
@pytest.mark.parametrize(
    "stamps",
    [
        (1e9 * TIME_S).round().astype("m8[ns]"),
        pa.chunked_array([pa.array((1e3 * TIME_S).round().astype("i8")).cast(pa.duration("ms"))]),
        [timedelta(seconds=value) for value in TIME_S],
    ],
)
def test_durations_are_a_time(name: str, stamps: object) -> None:
    others = columns()
    others.pop("time_s")
    assert rw_ekf.read({name: stamps, **others}).time_s == pytest.approx(TIME_S)


def test_a_log_with_columns_of_any_kind_is_written(tmp_path: Path) -> None:
    """Dates, durations, decimals, bytes and lists, as JSON and as CSV."""
    more = {
        "when": np.full(N, np.datetime64("2026-01-02T03:04:05")),
        "took": [timedelta(seconds=1.5)] * N,
        "exact": pa.array(["1.25"] * N).cast(pa.decimal128(5, 2)),
        "raw": [b"x"] * N,
        "list": pa.array([[1, 2]] * N),
    }
    log = rw_ekf.read(columns(**more))
    found = json.loads(log.to_json())["columns"]
    assert [found[name][0] for name in more] == ["2026-01-02T03:04:05", 1.5, 1.25, "x", [1, 2]]
    log.save(tmp_path / "log.csv")
    assert rw_ekf.read(tmp_path / "log.csv").table["list"][0].as_py() == "[1, 2]"


def test_words_that_are_no_numbers_stay_words() -> None:
    log = rw_ekf.read(columns(note=["", *["1"] * (N - 2), "one"], mode=pa.array(["a", "b"] * 20).dictionary_encode()))
    assert log.table["note"][1].as_py() == "1"
    assert log.table["mode"][1].as_py() == "b"


def foreign(**others: object) -> dict[str, Any]:
    return {"t": TIME_S, "n": 30.0 * SPEED, "I": 1000.0 * CURRENT, **others}


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (foreign(), r"'I' has no unit.*`rw_ekf.guess_columns` of it makes the map.* as current__unit=\"mA\"$"),
        ({"n": SPEED, "I": CURRENT}, 'no column is known to be the time: time="COLUMN", or rate_hz="ROWS_A_SECOND"'),
        (pa.table([TIME_S, SPEED, SPEED], names=["time_s", "n", "n"]), "2 columns are called 'n': rename all but"),
    ],
)
def test_what_is_open_in_a_table_is_asked_in_python(table: object, words: str) -> None:
    with pytest.raises(rw_ekf.Error, match=words) as caught:
        rw_ekf.read(table)
    assert "--" not in str(caught.value)


def test_the_columns_of_a_table_are_guessed_as_those_of_a_file() -> None:
    found = rw_ekf.guess_columns(foreign(), current__unit="mA")
    log = rw_ekf.read(foreign(), found)
    assert log.current_A == pytest.approx(CURRENT)
    assert found.document()["out"] is None
