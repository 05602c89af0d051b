"""Logs that are in order, or can be put in order with a warning."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.logs.reader import read_log
from rw_ekf.logs.wheel_log import WheelLog

RPM = 2.0 * math.pi / 60.0


def read(tmp_path: Path, text: str | bytes, name: str = "log.csv") -> WheelLog:
    path = tmp_path / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_log(path)


def test_a_plain_log(tmp_path: Path) -> None:
    """Proves that the columns are found in any order, unknown ones are carried, and rpm becomes rad/s."""
    log = read(tmp_path, "note,speed_rpm,time_s,current_command_A\na,60,0.0,0.1\nb,30,0.1,0.2\nc,,0.3,0.2\n")
    assert log.time_s.tolist() == [0.0, 0.1, 0.3]
    assert log.speed_rad_s[:2] == pytest.approx([60 * RPM, 30 * RPM])
    assert math.isnan(log.speed_rad_s[2])
    assert log.current_A.tolist() == [0.1, 0.2, 0.2]
    assert (log.drive, log.skipped_rows, log.rows_read, log.warnings) == ("current_command_A", 0, 3, ())
    assert log.other["note"].to_pylist() == ["a", "b", "c"]
    assert log.command_delay_s.tolist() == [0.0, 0.0, 0.0]
    assert log.duration_s == 0.3
    assert log.speed_rad_s.flags.writeable


@pytest.mark.parametrize("gap", ["", " ", "nan", "NaN", "NAN", "nAn", " nan ", "-nan", '""'])
def test_every_spelling_of_a_gap(tmp_path: Path, gap: str) -> None:
    """Proves that an empty field and nan in any case are missing values, with no warning."""
    log = read(tmp_path, f"time_s,speed_rad_s,current_A\n0,{gap},1\n1,5,1\n")
    assert math.isnan(log.speed_rad_s[0])
    assert log.warnings == ()


@pytest.mark.parametrize(
    "text",
    [
        b"\xef\xbb\xbftime_s,speed_rad_s,current_A\n0,1,2\n1,2,3\n",
        b"time_s,speed_rad_s,current_A\r\n0,1,2\r\n1,2,3\r\n",
        b'"time_s","speed_rad_s","current_A"\n"0","1","2"\n"1","2","3"\n',
        b" time_s , speed_rad_s ,current_A\n 0, 1, 2\n 1, 2, 3\n",
        b"\n\ntime_s,speed_rad_s,current_A\n0,1,2\n\n1,2,3\n   \n\n",
        b"time_s,speed_rad_s,current_A\n0,1,2\n1,2,3",
        b"time_s,speed_rad_s,current_A,\n0,1,2,\n1,2,3,\n",
        b'time_s,speed_rad_s,current_A,note\n0,1,2,"two\nlines"\n1,2,3,x\n',
        b"time_s,speed_rad_s,current_A\n+0,1.0e0,2\n1.,2,.3e1\n",
    ],
    ids=["bom", "crlf", "quoted", "blanks", "empty lines", "no newline at end", "empty column", "newline in text",
         "number forms"],
)  # fmt: skip
def test_forms_of_csv(tmp_path: Path, text: bytes) -> None:
    """Proves that each form that instruments and spreadsheets write gives the same log."""
    log = read(tmp_path, text)
    assert log.time_s.tolist() == [0, 1]
    assert log.speed_rad_s.tolist() == [1, 2]
    assert log.current_A.tolist() == [2, 3]
    assert log.warnings == ()


@pytest.mark.parametrize(
    ("tail", "words"),
    [("2.0,7", "2 of 3 fields"), ("2.0,7\n", "2 of 3 fields"), ("2", "1 of 3 fields"), ("2.0,7,1e", "'1e' is not a"),
     ("2.0,7,-", "'-' is not a"), ("2.0,\x00\x00\x00", "zero bytes")],
)  # fmt: skip
def test_a_truncated_last_line_is_dropped_with_a_warning(tmp_path: Path, tail: str, words: str) -> None:
    """Proves that a log cut off in mid-line (loss of power) loses that line only, and says which."""
    log = read(tmp_path, f"time_s,speed_rad_s,current_A\n0,1,2\n1,2,3\n{tail}")
    assert log.time_s.tolist() == [0, 1]
    assert len(log.warnings) == 1
    assert "line 4" in log.warnings[0]
    assert words in log.warnings[0]


def test_repeated_and_backward_rows_are_skipped_and_counted(tmp_path: Path) -> None:
    """Proves that a row is kept only if it is later than all before it, and that the warning names the first place."""
    times = [float(index) for index in range(300)]
    times[100], times[200] = 99.0, 50.0
    text = "time_s,speed_rad_s,current_A\n" + "".join(f"{time},{index},1\n" for index, time in enumerate(times))
    log = read(tmp_path, text)
    assert (log.skipped_rows, len(log), log.rows_read) == (2, 298, 300)
    assert (np.diff(log.time_s) > 0).all()
    assert 100.0 not in log.speed_rad_s
    assert 201.0 in log.speed_rad_s
    assert "2 of 300 rows" in log.warnings[0]
    assert "line 102" in log.warnings[0]


def test_time_may_restart_where_the_segment_changes(tmp_path: Path) -> None:
    """Proves that segments are numbered from 0 by change, and that rate and duration do not count the joints."""
    log = read(tmp_path, "time_s,speed_rad_s,current_A,segment\n5,1,1,7\n6,1,1,7\n0,1,1,3\n1,1,1,3\n0,1,1,7\n1,1,1,7\n")
    assert log.segment.tolist() == [0, 0, 1, 1, 2, 2]
    assert log.segment.dtype == np.int64
    assert log.skipped_rows == 0
    assert (log.rate_hz, log.duration_s) == (1.0, 3.0)


def test_the_command_drives_and_the_measured_current_is_a_channel(tmp_path: Path) -> None:
    """Proves the precedence of current_command_A, its gaps held, 0 A before the first with a warning."""
    log = read(tmp_path, "time_s,speed_rad_s,current_A,current_command_A\n0,1,9,\n1,1,9,0.5\n2,1,,\n3,1,9,0.1\n")
    assert log.current_A.tolist() == [0.0, 0.5, 0.5, 0.1]
    assert log.drive == "current_command_A"
    assert np.isnan(log.channels["current_A"][2])
    assert "no current_command_A in 1 row" in log.warnings[0]


def test_the_current_is_not_held_into_the_next_segment(tmp_path: Path) -> None:
    """Proves that what drove one segment says nothing about the start of the next."""
    log = read(tmp_path, "time_s,speed_rad_s,current_A,segment\n0,1,5,0\n1,1,,0\n0,1,,1\n1,1,2,1\n")
    assert log.current_A.tolist() == [5, 5, 0, 2]


def test_an_empty_command_column_gives_way_to_the_measured_current(tmp_path: Path) -> None:
    """Proves that a column that is there but empty throughout does not silence the other one."""
    log = read(tmp_path, "time_s,speed_rad_s,current_A,current_command_A\n0,1,9,\n1,1,8,\n")
    assert (log.drive, log.current_A.tolist()) == ("current_A", [9, 8])
    assert "empty throughout" in log.warnings[0]


def test_both_speeds(tmp_path: Path) -> None:
    """Proves that speed_rad_s is preferred to speed_rpm, with a warning."""
    log = read(tmp_path, "time_s,speed_rad_s,speed_rpm,current_A\n0,1,2,3\n1,1,2,3\n")
    assert log.speed_rad_s.tolist() == [1, 1]
    assert "speed_rad_s is used" in log.warnings[0]


def test_one_sample_is_read_and_flagged(tmp_path: Path) -> None:
    """Proves that who needs more than one row can decide, from an honest log."""
    log = read(tmp_path, "time_s,speed_rad_s,current_A\n0,1,2\n")
    assert len(log) == 1
    assert math.isnan(log.rate_hz)
    assert log.duration_s == 0.0
    assert "only one sample" in log.warnings[0]


def test_a_log_without_any_speed_is_flagged(tmp_path: Path) -> None:
    """Proves that an empty speed column is a warning, not a number."""
    assert "holds no speed" in read(tmp_path, "time_s,speed_rad_s,current_A\n0,,2\n1,,2\n").warnings[0]


def test_all_optional_columns_become_channels(tmp_path: Path) -> None:
    """Proves that temperature, pressure, voltage, angle, status and delay are taken up."""
    names = "temperature_degC,pressure_Pa,bus_voltage_V,angle_rad,status"
    log = read(
        tmp_path, f"time_s,speed_rad_s,current_command_A,command_delay_s,{names}\n0,1,2,.01,20,3,4,5,6\n1,1,2,,,,,,\n"
    )
    assert set(log.channels) == {"current_command_A", *names.split(",")}
    assert log.command_delay_s.tolist() == [0.01, 0.0]
    assert log.channels["status"][0] == 6.0
    assert log.other == {}


def test_a_sound_log_never_takes_the_slow_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Proves that gaps in their usual spellings, text columns and line ends of any kind are read at full speed."""

    def fail(*_: object) -> None:
        raise AssertionError("the slow reader was asked")

    monkeypatch.setattr("rw_ekf.logs.csv_slow.read_slowly", fail)
    log = read(tmp_path, "time_s,speed_rpm,current_A,note,status\r\n0,nan,1,ok,\r\n1,,1,,3\r\n2,NaN,1,x,4\r\n")
    assert len(log) == 3


def test_reading_does_not_load_what_it_does_not_need() -> None:
    """Proves that reading CSV loads neither scipy nor pydantic, which would cost more than the reading."""
    code = (
        "import sys, tempfile, pathlib; from rw_ekf.logs.reader import read_log;"
        "p = pathlib.Path(tempfile.mkdtemp()) / 'a.csv'; p.write_text('time_s,speed_rpm,current_A\\n0,1,2\\n1,1,2\\n');"
        "read_log(p); print([m for m in ('scipy', 'pydantic', 'pandas', 'numba') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
