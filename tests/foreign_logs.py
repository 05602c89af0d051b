"""What the tests of foreign log formats share: a record, the map that reads it, and files that are damaged."""

from __future__ import annotations

import contextlib
import gc
import random
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import rw_ekf
from rw_ekf.arrays import Float64Array
from rw_ekf.errors import LogError
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.wheel_log import WheelLog

ROWS = 60


class Record:
    """A seeded random walk of a speed [rad/s] and a current [A], every 0.25 s."""

    def __init__(self, seed: int, rows: int = ROWS, digits: int = 17) -> None:
        draws = np.random.default_rng(seed)
        self.time_s: Float64Array = np.asarray(0.25 * np.arange(rows), dtype=np.float64)
        self.speed: Float64Array = np.asarray(np.cumsum(draws.normal(size=rows)).round(digits), dtype=np.float64)
        self.current: Float64Array = np.asarray(
            np.cumsum(0.1 * draws.normal(size=rows)).round(digits), dtype=np.float64
        )


def csv(log: rw_ekf.Log, header: str, line: Callable[[int, float, float, float], str]) -> str:
    """Rows as a header and a way to write number, time [s], speed [rad/s] and current [A] of each."""
    rows = zip(log.time_s.tolist(), log.speed_rad_s.tolist(), log.current_A.tolist(), strict=True)
    return header + "\n" + "".join(line(i, t, w, c) + "\n" for i, (t, w, c) in enumerate(rows))


def guess(path: Path, text: str) -> rw_ekf.GuessedColumns:
    """What is guessed of the columns of a file of this text."""
    path.write_text(text)
    return rw_ekf.guess_columns(path)


def read_with(path: Path, *lines: str) -> WheelLog:
    """Read a log with a column map of these lines beside it."""
    columns = path.with_name("map.yaml")
    columns.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return read_log(path, columns)


def assert_same(log: WheelLog, record: Record) -> None:
    """Every number of the record came back as it was."""
    assert np.array_equal(log.time_s, record.time_s)
    assert np.array_equal(log.speed_rad_s, record.speed)
    assert np.array_equal(log.current_A, record.current)


def refusal(path: Path, *lines: str) -> str:
    """What is said of a log that is refused: one line, with the file's name before it."""
    with pytest.raises(LogError) as caught:
        read_with(path, *lines)
    text = str(caught.value)
    assert "\n" not in text
    return text


def assert_says_what_to_install(monkeypatch: pytest.MonkeyPatch, path: Path, module: str, extra: str) -> None:
    """Without the library the refusal names the extra that brings it."""
    with monkeypatch.context() as without:
        without.setitem(sys.modules, module, None)
        assert f'pip install "rw-ekf[{extra}]"' in refusal(path, "time_s: t")


def assert_survives_damage(
    path: Path, *lines: str, seed: int = 1, begin: int = 16, cuts: int = 20, flips: int = 50
) -> None:
    """Cut at 20 places; with 50 bytes changed behind `begin`, in every other file 50 times: a log or a LogError.

    Behind each refusal the reader frees what is left of it; what other tests loaded is kept out of that search.
    """
    gc.freeze()
    whole = path.read_bytes()
    draws = random.Random(seed)
    damaged = [whole[: begin + (len(whole) - begin) * part // cuts] for part in range(cuts)]
    for number in range(flips):
        flipped = bytearray(whole)
        for _ in range(1 if number % 2 else 50):
            flipped[draws.randrange(begin, len(flipped))] = draws.randrange(256)
        damaged.append(bytes(flipped))
    target = path.with_name(f"damaged{path.suffix}")
    for data in damaged:
        target.write_bytes(data)
        with contextlib.suppress(LogError):
            read_with(target, *lines)
