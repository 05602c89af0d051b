"""A log that is too long to be held is replayed in parts, in memory that does not grow, to the same numbers."""

from __future__ import annotations

import json
import math
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.cli import main
from rw_ekf.course.course import Course
from rw_ekf.effects.catalogue import FORMULAS
from rw_ekf.filter import log_filter
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.filter.log_filter import LogFilter, filter_log
from rw_ekf.log_replay import replay_log
from rw_ekf.logs import csv_table, long_log, parquet_table
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.long_log import long_log_of
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.tables import write_table
from rw_ekf.long_replay import replay_long
from rw_ekf.model.state import CK13_STATISTICAL
from tests.commands.logs import write_columns
from tests.filter.effect_replay import believed, in_use
from tests.truth import fine_trajectory
from tools.measure.runs import constants_for

TOGETHER = ("quadratic_drag", "actuator_lag", "presliding_hysteresis")
CONFIGURATION = """wheel: {port: /dev/ttyUSB0}
limits: {current_A: 1.0}
"""


def wheel_log(path: Path, rows: int, seed: int, **more: float) -> Path:
    """A wheel of [CK13] under steps of current that reverse it now and then, by an integrator of the tests' own."""
    rng = np.random.default_rng(seed)
    time_s = 0.1 * np.arange(rows, dtype=np.float64)
    current = np.repeat(rng.uniform(-0.12, 0.12, -(-rows // 60)), 60)[:rows]
    speed = fine_trajectory(CK13_STATISTICAL, time_s, np.asarray(current, dtype=np.float64))
    noisy = speed + 0.1047 * rng.standard_normal(rows)
    columns = {"time_s": time_s, "speed_rad_s": noisy, "current_command_A": current}
    write_table(path, {**columns, **{name: np.full(rows, value) for name, value in more.items()}})
    return path


@pytest.fixture
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Logs above 4,000 rows are long, and read some thousand rows at a time."""
    monkeypatch.setattr(long_log, "LONG_ROWS", 4000)
    monkeypatch.setattr(csv_table, "_ROWS_AT_ONCE", 1200)
    monkeypatch.setattr(parquet_table, "_ROWS_AT_ONCE", 2000)


def replayed(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    """The document of a log, without what depends on the clock."""
    assert main(["replay", *arguments, "--json"]) == 0
    entry: dict[str, object] = json.loads(capsys.readouterr().out)["logs"][0]
    return entry


@pytest.mark.usefixtures("small_parts")
@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_with_a_configuration_nothing_is_another_number(
    tmp_path: Path, suffix: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Estimates and rows of one pass in parts are those of the log as a whole, to the last bit."""
    log = wheel_log(tmp_path / f"log{suffix}", 12_000, 1)
    (tmp_path / "c.yaml").write_text(CONFIGURATION, encoding="utf-8")
    found, rows = [], []
    for name in ("parts", "whole"):
        out = tmp_path / f"{name}.csv"
        found.append(replayed([str(log), "--config", str(tmp_path / "c.yaml"), "--out", str(out)], capsys))
        rows.append(out.read_bytes())
        monkeypatch.setattr(long_log, "LONG_ROWS", 10**12)
    assert rows[0] == rows[1]
    for key in ("samples", "missing", "rejected", "state", "std", "covariance", "effects"):
        assert found[0][key] == found[1][key], key
    assert found[0]["duration_s"] == pytest.approx(found[1]["duration_s"], rel=1e-12)
    assert found[0]["innovation"] == pytest.approx(found[1]["innovation"], rel=1e-9)


@pytest.mark.parametrize("ids", [*((effect.id,) for effect in FORMULAS), TOGETHER], ids="+".join)
def test_a_filter_goes_on_where_it_was(tmp_path: Path, ids: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    """With effects that remember (lags, delays, bristles) and such of angle and temperature: the same bits."""
    monkeypatch.setattr(long_log, "LONG_ROWS", 100)
    monkeypatch.setattr(parquet_table, "_ROWS_AT_ONCE", 170)
    path = wheel_log(tmp_path / "log.parquet", 1200, 3, command_delay_s=0.03, temperature_degC=27.0)
    effects, constants = in_use(*ids), constants_for()
    start = believed(effects)
    drift = np.full(effects.size, 1.0e-9)
    whole = filter_log(
        Course.of_log(read_log(path)), constants, start.mean, start.covariance, effects, drift, keep_states=True
    )
    log = long_log_of(path, ColumnMap())
    assert log is not None
    going = LogFilter(constants, start.mean, start.covariance, effects, drift)
    states = []
    for part in log.parts():
        run = going.over(Course.of_log(part.log), part.begin, keep_states=True)
        states.append(run.states[part.begin :])
    assert len(states) > 5
    assert np.array_equal(np.concatenate(states), whole.states, equal_nan=True)
    assert np.array_equal(going.covariance, whole.covariance)


@pytest.mark.usefixtures("small_parts")
def test_without_one_the_wheel_is_found_with_sigmas_that_hold(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the busiest part and two passes: true parameters of eight wheels within their sigmas, as from a whole."""
    monkeypatch.setattr(parquet_table, "_ROWS_AT_ONCE", 8000)  # as many as are looked at of any log
    scores, ratios = [], []
    for seed in range(8):
        path = wheel_log(tmp_path / "log.parquet", 20_000, 100 + seed)
        log = long_log_of(path, ColumnMap())
        assert log is not None
        run = replay_long(log)
        scores.append((np.array(run.belief.parameters) - np.array(CK13_STATISTICAL)) / run.belief.core.parameter_std)
        if seed < 2:
            whole = replay_log(read_log(path))
            ratios.append(np.array(run.belief.core.parameter_std) / np.array(whole.belief.core.parameter_std))
            apart = np.array(run.belief.parameters) - np.array(whole.belief.parameters)
            assert np.all(np.abs(apart) < 0.7 * np.array(whole.belief.core.parameter_std))
    assert float(np.sqrt(np.mean(np.square(scores)))) < 1.5
    assert float(np.abs(scores).max()) < 4.0
    assert np.all((np.array(ratios) > 0.75) & (np.array(ratios) < 1.35))


@pytest.mark.usefixtures("small_parts")
@pytest.mark.parametrize(("arguments", "most"), [(["--config"], 1.0), ([], 2.2)])
def test_a_row_is_filtered_once_or_twice(
    tmp_path: Path,
    arguments: list[str],
    most: float,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Once where it is said from where; else twice, and the part over again that says it (a tenth of this log)."""
    log = wheel_log(tmp_path / "log.parquet", 60_000, 5)
    (tmp_path / "c.yaml").write_text(CONFIGURATION, encoding="utf-8")
    passed = []
    over = log_filter.LogFilter.over

    def counted(self: LogFilter, course: Course, begin: int = 0, **more: bool) -> object:
        passed.append(course.samples - begin)
        return over(self, course, begin, **more)

    monkeypatch.setattr(log_filter.LogFilter, "over", counted)
    replayed([str(log), *(argument for a in arguments for argument in (a, str(tmp_path / "c.yaml")))], capsys)
    shares = np.array(passed) / 60_000
    of_part = shares.sum() - math.floor(shares.sum())
    assert shares.sum() - of_part <= most
    assert of_part < 0.9


def test_memory_does_not_grow_with_the_log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What Python and numpy hold at most is the same for four times as many rows."""
    monkeypatch.setattr(long_log, "LONG_ROWS", 10_000)
    monkeypatch.setattr(parquet_table, "_ROWS_AT_ONCE", 10_000)
    monkeypatch.setattr(long_log, "_KEPT_BYTES", 2_000_000)  # less than either log has
    peaks = []
    for rows in (60_000, 60_000, 240_000):  # the first also pays for what is imported and compiled
        path = wheel_log(tmp_path / "log.parquet", rows, 6)
        log = long_log_of(path, ColumnMap())
        assert log is not None
        tracemalloc.start()
        replay_long(log)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[2] < 1.5 * peaks[1]  # 8 MB of 7; held whole it would be four times as much


@pytest.mark.usefixtures("small_parts")
def test_a_cell_that_is_no_number_is_placed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What pyarrow stumbles over far down is told with line and column, and no table is left behind."""
    log = wheel_log(tmp_path / "log.csv", 9_000, 7)
    lines = log.read_text(encoding="utf-8").splitlines(keepends=True)
    lines[8000] = lines[8000].replace(",", ",oops", 1)
    log.write_text("".join(lines), encoding="utf-8")
    out = tmp_path / "out.csv"
    (tmp_path / "c.yaml").write_text(CONFIGURATION, encoding="utf-8")
    assert main(["replay", str(log), "--config", str(tmp_path / "c.yaml"), "--out", str(out)]) == 2
    assert "line 8001" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["c.yaml", "log.csv"]


@pytest.mark.usefixtures("small_parts")
def test_a_picture_and_several_tables_of_long_logs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A picture is drawn of rows in between; tables of several logs stand under each other, with their names."""
    logs = [str(wheel_log(tmp_path / f"{name}.parquet", rows, rows)) for name, rows in (("a", 9_000), ("b", 3_000))]
    assert main(["replay", logs[0], "--picture", str(tmp_path / "p.svg")]) == 0
    assert (tmp_path / "p.svg").read_text(encoding="utf-8").count("<path") > 20
    assert main(["replay", *logs, "--out", str(tmp_path / "both.parquet")]) == 0
    capsys.readouterr()
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(tmp_path / "both.parquet")
    assert table.column("log").to_pylist() == [logs[0]] * 9_000 + [logs[1]] * 3_000
    assert table.column("time_s").to_pylist()[8_999:9_001] == [pytest.approx(899.9), 0.0]


@pytest.mark.usefixtures("small_parts")
def test_a_log_without_a_speed_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As a short one is."""
    rows = 6_000
    columns = {"time_s": 0.1 * np.arange(rows), "speed_rad_s": np.full(rows, np.nan), "current_A": np.zeros(rows)}
    log = write_columns(tmp_path / "log.csv", columns)
    for more in ([], ["--config", str(tmp_path / "c.yaml")]):
        (tmp_path / "c.yaml").write_text(CONFIGURATION, encoding="utf-8")
        assert main(["replay", str(log), *more]) == 2
        assert "not one of its 6000 samples has a speed" in capsys.readouterr().err


def test_the_prior_is_not_changed() -> None:
    """A filter that goes on changes a belief of its own."""
    before = DEFAULT_PRIOR.mean.copy()
    going = LogFilter(constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
    going.over(Course.of(0.1 * np.arange(50.0), np.full(50, 3.0), np.zeros(50)))
    assert np.array_equal(DEFAULT_PRIOR.mean, before)
