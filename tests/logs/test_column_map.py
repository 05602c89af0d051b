"""Foreign logs through a column map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

import rw_ekf
from rw_ekf.errors import ConfigError, LogError
from rw_ekf.logs.column_map_file import load_column_map
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.settings.resources import config_directory


def read(tmp_path: Path, text: str, columns: str) -> WheelLog:
    (tmp_path / "log.csv").write_text(text)
    (tmp_path / "map.yaml").write_text(columns)
    return read_log(tmp_path / "log.csv", tmp_path / "map.yaml")


def test_names_numbers_scale_offset_and_constants(tmp_path: Path) -> None:
    """Proves that a column is taken by name, by number from 0, or as a constant, as scale * value + offset."""
    log = read(
        tmp_path,
        "t_ms,v,x\n0,1,5\n100,2,6\n",
        "time_s: {column: 0, scale: 1e-3}\nspeed_rad_s: {column: v, scale: 2, offset: 1}\ncurrent_A: {constant: 0.0}\n",
    )
    assert log.time_s.tolist() == [0.0, 0.1]
    assert log.speed_rad_s.tolist() == [3.0, 5.0]
    assert (log.current_A.tolist(), log.drive) == ([0.0, 0.0], "constant")
    assert list(log.other) == ["x"]
    assert log.channels == {}


def test_the_short_form_and_own_names(tmp_path: Path) -> None:
    """Proves that `speed_rad_s: v` is enough, and that columns with the log's own names need no line."""
    log = read(tmp_path, "time_s,v,current_A\n0,1,5\n1,2,6\n", "speed_rad_s: v\n")
    assert (log.speed_rad_s.tolist(), log.current_A.tolist()) == ([1, 2], [5, 6])


def test_delimiter_preamble_and_no_header(tmp_path: Path) -> None:
    """Proves that a preamble is skipped, and that a first row of numbers is data, not a header."""
    columns = 'delimiter: ";"\nskip_rows: 2\ntime_s: {column: 0}\nspeed_rpm: {column: 1}\ncurrent_A: {column: 2}\n'
    log = read(tmp_path, "# made by\n# somebody\n0;60;1\n1;60;2\n", columns)
    assert log.time_s.tolist() == [0, 1]
    assert log.speed_rad_s == pytest.approx([2 * np.pi, 2 * np.pi])


def test_a_header_of_numbers(tmp_path: Path) -> None:
    """Proves that `header: true` makes a first row of numbers names."""
    columns = 'header: true\ntime_s: {column: "0"}\nspeed_rpm: {column: "1"}\ncurrent_A: {column: "2"}\n'
    assert len(read(tmp_path, "0,1,2\n0,60,1\n1,60,2\n", columns)) == 2


def test_rate_in_place_of_time(tmp_path: Path) -> None:
    """Proves that rows are timed by rate_hz, from 0 in each segment."""
    log = read(tmp_path, "v,segment\n1,0\n1,0\n1,1\n1,1\n", "rate_hz: 50\nspeed_rad_s: v\ncurrent_A: {constant: 1}\n")
    assert log.time_s.tolist() == [0, 0.02, 0, 0.02]
    assert log.rate_hz == pytest.approx(50)


def test_a_speed_derived_from_a_position(tmp_path: Path) -> None:
    """Proves that the derivative is a backward difference within a segment, without a value in its first row."""
    log = read(
        tmp_path,
        "time_s,x,segment\n0,1,0\n2,5,0\n3,9,0\n0,0,1\n1,1,1\n",
        "speed_rad_s: {derivative_of: x, scale: 10}\nangle_rad: x\ncurrent_A: {constant: 0}\n",
    )
    assert np.array_equal(log.speed_rad_s, [np.nan, 20, 40, np.nan, 10], equal_nan=True)
    assert log.channels["angle_rad"].tolist() == [1, 5, 9, 0, 1]


def test_decimation_keeps_rows_and_averages_the_current(tmp_path: Path) -> None:
    """Proves that every n-th row of a segment stays, and that the current it holds is the mean until the next one."""
    rows = "".join(f"{t},{10 * t},{t},{t // 5}\n" for t in range(10))
    columns = "decimate: 2\nspeed_rad_s: {derivative_of: x}\ncurrent_A: i\nangle_rad: x\n"
    log = read(tmp_path, "time_s,x,i,segment\n" + rows, columns)
    assert log.time_s.tolist() == [0, 2, 4, 5, 7, 9]
    assert log.current_A.tolist() == [0.5, 2.5, 4.0, 5.5, 7.5, 9.0]
    assert np.array_equal(log.speed_rad_s, [np.nan, 10, 10, np.nan, 10, 10], equal_nan=True)
    assert log.rows_read == 10


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ("speed: {column: v}", "1:1: unknown key speed; did you mean"),
        ("speed_rad_s: {colum: v}", "1:15: unknown key speed_rad_s.colum; did you mean 'column'?"),
        (
            "speed_rad_s: {column: -1}",
            "1:23: speed_rad_s.column must be 0 or more, found -1: columns are counted",
        ),
        ("speed_rad_s: {column: 1.5}", "1:23: speed_rad_s.column must be a column's name or number, found 1.5"),
        (
            "speed_rad_s: {column: v, constant: 1}",
            "1:1: speed_rad_s must have exactly one of column, constant,",
        ),
        ("speed_rad_s: 3", "1:14: speed_rad_s must be {column: name or number} or {constant: value}, found 3"),
        ("speed_rad_s: {column: v, scale: big}", "1:33: speed_rad_s.scale must be a number"),
        ("speed_rad_s: {column: v, scale: 0}", "1:33: speed_rad_s.scale must not be 0, which leaves nothing of it"),
        ("time_s: {constant: 1}", "1:1: time_s cannot be a constant; give rate_hz"),
        ("current_A: {derivative_of: x}", "1:1: current_A cannot be a derivative: only a speed can"),
        ("current_A: {constant: 1, scale: 2}", "no meaning beside a constant"),
        ("rate_hz: 0", "1:10: rate_hz must be above 0"),
        ("rate_hz: 10\ntime_s: t", "1:10: rate_hz stands in for a time column"),
        ("speed_rpm: a\nspeed_rad_s: b", "1:12: speed_rpm is mapped, and speed_rad_s too"),
        ("delimiter: ',,'", "1:12: delimiter must be one character"),
        ("skip_rows: -1", "1:12: skip_rows must be at least 0, found -1"),
        ("decimate: 0", "1:11: decimate must be at least 1, found 0"),
        ("header: yes", "1:9: header must be true or false, found the text 'yes'"),
        ("layout: cell", "1:9: layout must be one of columns, rows, cells"),
        ("variable: 3", "1:11: variable must be text, found 3 (variable of a MATLAB file)"),
        ("time_s: t\ntime_s: u", "2:1: key 'time_s' is repeated"),
        ("- a", "1:1: a column map must be a table of delimiter, decimal"),
        ("", "empty"),
    ],
)
def test_mistakes_in_a_map(tmp_path: Path, columns: str, words: str) -> None:
    """Proves that each mistake is a ConfigError with file:line:column and the key."""
    path = tmp_path / "map.yaml"
    path.write_text(columns)
    with pytest.raises(ConfigError) as caught:
        load_column_map(path)
    assert str(caught.value).startswith(f"{path}:")
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ("speed_rad_s: w\n", "map.yaml:1:1: column 'w' is not in"),
        ("speed_rad_s: velocty\n", "(did you mean 'velocity'?); its columns: time_s, velocity, current_A"),
        ("speed_rad_s: {column: 7}\n", "column 7 is not in"),
        ("speed_rad_s: velocity\nvariable: x\n", None),
    ],
)
def test_a_map_that_does_not_fit_the_log(tmp_path: Path, columns: str, words: str | None) -> None:
    """Proves that a column that is not there is named with the map's line and the log's columns."""
    text = "time_s,velocity,current_A\n0,1,2\n1,1,2\n"
    if words is None:
        assert len(read(tmp_path, text, columns)) == 2
        return
    with pytest.raises(LogError) as caught:
        read(tmp_path, text, columns)
    assert words in str(caught.value)


def test_matlab_matrix_struct_and_cells(tmp_path: Path) -> None:
    """Proves the layouts of a MATLAB variable: matrix by columns or rows, struct of vectors, cells by segment."""
    t, v, i = np.arange(3.0), np.array([1.0, 2, 3]), np.array([5.0, 6, 7])
    cells = np.empty((3, 2), dtype=object)
    for segment in (0, 1):
        cells[:, segment] = [np.array([[0.5]]), t[None, : 2 + segment], v[None, : 2 + segment]]
    path, columns = tmp_path / "m.mat", tmp_path / "map.yaml"
    savemat(path, {"m": np.c_[t, v, i], "r": np.c_[t, v, i].T, "s": {"t": t, "v": v, "i": i, "n": 1}, "c": cells})
    numbers = "time_s: {column: 0}\nspeed_rad_s: {column: 1}\ncurrent_A: {column: 2}\n"
    named = "time_s: t\nspeed_rad_s: v\ncurrent_A: i\n"
    for text in (f"variable: m\n{numbers}", f"variable: r\nlayout: rows\n{numbers}", f"variable: s\n{named}"):
        columns.write_text(text)
        log = read_log(path, columns)
        assert (log.speed_rad_s.tolist(), log.current_A.tolist()) == ([1, 2, 3], [5, 6, 7])
    columns.write_text(
        "variable: c\nlayout: cells\ncurrent_A: {column: 0}\ntime_s: {column: 1}\nspeed_rad_s: {column: 2}\n"
    )
    log = read_log(path, columns)
    assert log.segment.tolist() == [0, 0, 1, 1, 1]
    assert log.current_A.tolist() == [0.5] * 5


def test_structs_within_a_struct(tmp_path: Path) -> None:
    """A recording with X.Data and Y[].Name, Y[].Data: by name, by path, without its variable; scalars are left out."""
    t, v, i = np.arange(3.0), np.array([1.0, 2, 3]), np.array([5.0, 6, 7])
    channels = np.zeros(3, dtype=[("Name", object), ("Data", object), ("Type", object)])
    channels["Name"], channels["Type"] = ['"Root"/"w"', "current", "current"], 2
    for number, values in enumerate((v, i, -i)):
        channels[number]["Data"] = values
    path, columns = tmp_path / "m.mat", tmp_path / "map.yaml"
    savemat(path, {"rec": {"X": {"Data": t, "Unit": "s"}, "Y": channels, "Capture": {"Length": 3.0}}})
    for variable in ("variable: rec\n", ""):
        for current, sign in (("current", 1), ("Y[2].Data", -1)):
            lines = ("time_s: X.Data", """speed_rad_s: {column: '"Root"/"w"'}""", f"current_A: {current}", "")
            columns.write_text(variable + "\n".join(lines))
            log = read_log(path, columns)
            assert log.speed_rad_s.tolist() == [1, 2, 3]
            assert log.current_A.tolist() == [sign * 5, sign * 6, sign * 7]


def test_recordings_that_name_their_channels(tmp_path: Path) -> None:
    """A unit within a named channel (dSPACE), labels of a structure with time (Simulink) beside a stray vector."""
    t = 0.1 * np.arange(600.0)
    w, u = 30.0 * np.sin(0.2 * t), np.cos(0.2 * t)
    channels = np.zeros(2, dtype=[("Name", object), ("Data", object), ("Unit", object)])
    channels[0], channels[1] = ("omega", w, "rad/s"), ("i_q", u, "A")
    savemat(tmp_path / "d.mat", {"rec": {"X": {"Name": "Time", "Data": t, "Unit": "s"}, "Y": channels}})
    signals = np.zeros(2, dtype=[("values", object), ("label", object)])
    signals[0], signals[1] = (w, "omega_m (rad/s)"), (u, "Im (A)")
    savemat(tmp_path / "s.mat", {"ScopeData": {"time": t, "signals": signals}, "tout": t})
    for name in ("d.mat", "s.mat"):
        log = rw_ekf.read(tmp_path / name)
        assert log.speed_rad_s == pytest.approx(w)
        assert log.current_A == pytest.approx(u)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ("variable: gone\n", "has no variable 'gone'; variables: m, c"),
        ("variable: c\n", "use `layout: cells`"),
        ("variable: m\nlayout: cells\n", "is not a cell array"),
        ("layout: rows\n", "needs `variable`"),
    ],
)
def test_matlab_variables_that_do_not_fit(tmp_path: Path, columns: str, words: str) -> None:
    """Proves that a wrong variable or layout says what there is instead."""
    cells = np.empty((1, 2), dtype=object)
    cells[0, 0], cells[0, 1] = np.arange(3.0), np.arange(2.0)
    savemat(tmp_path / "m.mat", {"m": np.eye(3), "c": cells})
    (tmp_path / "map.yaml").write_text(columns)
    with pytest.raises(LogError) as caught:
        read_log(tmp_path / "m.mat", tmp_path / "map.yaml")
    assert words in str(caught.value)


def test_the_shipped_maps_are_valid() -> None:
    """Proves that every map in config/ passes the checks."""
    maps = sorted(config_directory().glob("columns-*.yaml"))
    assert len(maps) >= 5
    for path in maps:
        load_column_map(path)
