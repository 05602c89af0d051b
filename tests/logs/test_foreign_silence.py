"""Logs that were read in a wrong meaning without a word: each is read in the right one, or asked about."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import rw_ekf
from rw_ekf.arrays import Float64Array
from rw_ekf.logs.row_rules import spread_stamps
from rw_ekf.units import RAD_S_PER_RPM
from tests.foreign_logs import csv, guess

RPM = 1.0 / RAD_S_PER_RPM


def _stamped(log: rw_ekf.Log, header: str, part: Callable[[float], str]) -> tuple[str, Float64Array]:
    """Rows at uneven times with a stamp of whole seconds, and the part of one beside it; and these times [s]."""
    time_s = np.floor(1e3 * np.cumsum(0.02 + 0.16 * np.random.default_rng(3).random(len(log)))) / 1e3
    at = [f"2026-03-04 12:{30 + int(t) // 60}:{int(t) % 60:02d},{part(round(t % 1.0, 3))}" for t in time_s]
    return csv(log, header, lambda i, t, w, c: f"{at[i]},{w * RPM!r},{c!r}"), time_s - time_s[0]


@pytest.mark.parametrize(
    "names",
    ["P,I,D", "p,i,d", "P,I,u", "pid_p,pid_i,pid_d", "vel_p,vel_i,u", "P Term,I Term,D Term", "psi,psi_i,u",
     "kp_err,i_err,u", "axisP[0],axisI[0],axisD[0]", "u,pid.i,x"],
)  # fmt: skip
def test_what_a_controller_has_integrated_is_no_current(tmp_path: Path, run: rw_ekf.Log, names: str) -> None:
    """`I` beside `P` and `D` is a controller's, by its name or by what stands beside it: asked, and never amperes."""
    text = csv(run, f"t_s,rpm,{names}", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c + 0.01 * w!r},{c!r},{c - i / 1e3!r}")
    found = guess(tmp_path / "a.csv", text)
    assert "current_A" in [question.name for question in found.guess.questions], found.guess.mapping()
    beside = "\n".join(f"{row},{0.5 + k % 7}" if k else f"{row},i_motor" for k, row in enumerate(text.splitlines()))
    assert guess(tmp_path / "b.csv", beside).guess.mapping()["current_A"] == {"column": "i_motor"}


@pytest.mark.parametrize(
    "names",
    ["i_q,p_q,x", "I_motor,P_motor,x", "I,x,y", "motor_i,motor_v,x", "I,U,P", "I,V,P", "i_q,i_d,u", "I,P [W],x"],
)
def test_an_i_that_no_controller_stands_beside_is_a_current(tmp_path: Path, run: rw_ekf.Log, names: str) -> None:
    """Beside a voltage, `P` is a power; an `I` alone, of a motor or of an axis, is a current as before."""
    text = csv(run, f"t_s,rpm,{names}", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r},{c + 0.01 * w!r},{c - i / 1e3!r}")
    assert guess(tmp_path / "a.csv", text).guess.mapping()["current_A"] == {"column": names.split(",", 1)[0]}


_TWINCAT = """Name\tScope
File\tD:\\rw.csv


Name\tramp\tName\tActCurrent\tSetCurrent\tVdc\tActVelo
SymbolComment\t\tSymbolComment
Data-Type\tREAL32\tData-Type\tREAL32\tREAL32\tINT16\tREAL64
SampleTime[ms]\t0,2\tSampleTime[ms]\t100\t100\t100\t100
VariableSize\t4\tVariableSize\t4\t4\t2\t8
SymbolBased\tTrue\tSymbolBased\tTrue\tTrue\tTrue\tTrue
Port\t851\tPort\t851\t851\t851\t851
Offset\t0\tOffset\t0\t0\t0\t0
ScaleFactor\t1\tScaleFactor\t1\t1\t1\t1
BitMask\t0xff\tBitMask\t0xff\t0xff\t0xff\t0xff
Unit\t(None)\tUnit\tmA\tA\tV (Voltage)\trpm
Unit ScaleFactor\t1\tUnit ScaleFactor\t1\t1\t1\t1
Unit Offset\t0\tUnit Offset\t0\t0\t0\t0
"""


@pytest.mark.parametrize("rows", [8, 30, 60, 80, 99, 200])
def test_units_stand_over_their_columns_in_few_rows_too(tmp_path: Path, run: rw_ekf.Log, rows: int) -> None:
    """Names, units and rows are cut at the same marks however few rows there are: no mA is read as an A."""
    log = [f"{100 * i}\t{i}\t{100 * i}\t{651 + i % 9}\t{6 + i % 3}\t24\t{1 + i % 37}" for i in range(rows)]
    found = guess(tmp_path / "a.csv", _TWINCAT + "\n" + "\n".join(log) + "\n").guess.mapping()
    assert found["current_A"] == {"column": "ActCurrent [mA]", "unit": "mA"}
    assert found["current_command_A"] == {"column": "SetCurrent [A]"}
    assert found["speed_rpm"] == {"column": "ActVelo [rpm]"}


def test_cells_between_tabs_are_not_cut_at_blanks(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Where tabs stand between all cells of all rows, a blank in a name or a unit cuts nothing."""
    head = "# of the bench\nt (s)\tVdc actual (V)\tspeed (rpm)\tI mot (mA)"
    text = csv(run, head, lambda i, t, w, c: f"{t!r}\t24\t{w * RPM!r}\t{1e3 * c!r}")
    found = guess(tmp_path / "a.csv", text).guess.mapping()
    assert found["current_A"] == {"column": "I mot (mA)", "unit": "mA"}


@pytest.mark.parametrize("name", ["Millitm", "Frac", "ms part", "Time ms", "Milliseconds", "x"])
def test_what_begins_anew_with_each_second_is_the_part_of_it(tmp_path: Path, run: rw_ekf.Log, name: str) -> None:
    """Thousandths beside whole seconds are the time's by how they go, whatever they are called, and it is said."""
    text, time_s = _stamped(run, f"Time,{name},rpm,I_motor", lambda part: f"{1e3 * part:.0f}")
    (tmp_path / "a.csv").write_text(text)
    log = rw_ekf.read(tmp_path / "a.csv")
    assert log.time_s - log.time_s[0] == pytest.approx(time_s, abs=2e-6)
    assert name == "Milliseconds" or any(f"'{name}' begins anew with each second" in stated for stated in log.warnings)


def test_a_part_of_a_second_may_be_a_fraction_or_of_nobody_knows_what(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Fractions and hundredths are read; of 256ths of a second it is asked how many they are."""
    text, time_s = _stamped(run, "Time,f,rpm,I_motor", lambda part: f"{part:.3f}")
    (tmp_path / "a.csv").write_text(text)
    log = rw_ekf.read(tmp_path / "a.csv")
    assert log.time_s - log.time_s[0] == pytest.approx(time_s, abs=2e-6)
    wanted = guess(tmp_path / "b.csv", _stamped(run, "Time,f,rpm,I_motor", lambda part: f"{int(256 * part)}")[0])
    assert [question.name for question in wanted.guess.questions] == ["time_s"]
    assert "of how many parts of a second" in wanted.guess.questions[0].text


def test_rows_that_count_within_a_second_are_spread_over_it(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A count of the rows of each second is no part of it, and asks nothing."""
    text = csv(
        run, "Time,n,rpm,I_motor",
        lambda i, t, w, c: f"2026-03-04 12:30:{i // 20 % 60:02d},{i % 20},{w * RPM!r},{c!r}",
    )  # fmt: skip
    found = guess(tmp_path / "a.csv", text)
    assert not found.guess.questions
    assert found.guess.options["repeats"] == "spread"


def test_rows_of_one_stamp_among_fine_stamps_stay_within_it() -> None:
    """Where one row in a hundred has the stamp of the row before, it is not moved half way to the next."""
    time_s = np.concatenate((np.arange(100.0) * 0.05, [4.951, 4.951], 5.0 + 0.05 * np.arange(100.0)))
    moved = spread_stamps(time_s, np.zeros(len(time_s), dtype=np.int64)) - time_s
    assert moved[101] == pytest.approx(0.0005, abs=1e-6)
    assert not np.delete(moved, 101).any()


@pytest.mark.parametrize(
    "unit", ["p.u.", "P.U.", "a.u.", "A.U.", "i.u.", "arb. units", "arb.u.", "V/A", "Skt", "raw", "mA/A", "% of rated"]
)
def test_a_current_in_a_unit_that_is_not_known_is_asked_about(tmp_path: Path, run: rw_ekf.Log, unit: str) -> None:
    """What stands in brackets behind a name and is no unit that is known makes no amperes of its numbers."""
    for name in (f"Current [{unit}]", f"I [{unit}]", f"I_motor[{unit}]"):
        text = csv(run, f"time_s,rpm,{name}", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r}")
        wanted = guess(tmp_path / "a.csv", text).guess.questions
        assert [question.name for question in wanted] == ["current_A"], name
        assert not any("has no unit" in question.text for question in wanted), name
    reported = rw_ekf.guess_columns(tmp_path / "a.csv", current=f"I_motor[{unit}]:A")
    assert not reported.guess.questions


@pytest.mark.parametrize(
    "remark", ["(measured)", "[measured]", "(filt.)", "(motor)", "(act/set)", "[motor]", "(to wheel)"]
)
def test_words_in_brackets_are_no_unit(tmp_path: Path, run: rw_ekf.Log, remark: str) -> None:
    """A word that says which current it is asks nothing, and its size says amperes as before."""
    text = csv(run, f"time_s,rpm,Current {remark}", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r}")
    assert not guess(tmp_path / "a.csv", text).guess.questions


@pytest.mark.parametrize(
    "comment",
    ["# missing reply", "# missing reply\n# missing reply", "# time current speed", "# t, I, n", "# 0 0 0", "% started",
     "// started logging now", "; note one two", "! warn a b", "# current sensor offset", "# run of wheel 7\n\n# go"],
)  # fmt: skip
def test_a_comment_behind_the_names_is_none_of_them(tmp_path: Path, run: rw_ekf.Log, comment: str) -> None:
    """What a logger remarks between the names and the rows changes no name, also with as many words as columns."""
    for mark in (",", "\t", "|"):
        header = f"time [s]{mark}current [A]{mark}speed [rpm]"
        text = csv(run, f"{header}\n{comment}", lambda i, t, w, c: f"{t!r}{mark}{c!r}{mark}{w * RPM!r}")  # noqa: B023
        found = guess(tmp_path / "a.csv", text).guess
        assert found.mapping()["speed_rpm"] == {"column": "speed [rpm]"}
        assert found.mapping()["current_A"] == {"column": "current [A]"}


def test_comments_between_the_first_rows_leave_the_names(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Where a reply is missing again after one row, that row is the first one all the same."""
    text = csv(run, "time [s],current [A],speed [rpm]\n# missing reply", lambda i, t, w, c: f"{t!r},{c!r},{w * RPM!r}")
    lines = text.split("\n")
    lines[3:3] = ["# missing reply"]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    assert rw_ekf.read(tmp_path / "a.csv").speed_rad_s == pytest.approx(run.speed_rad_s)


@pytest.mark.parametrize(
    "head",
    ["# time [s],current [A],speed [rpm]", "my log of today\n# time [s],current [A],speed [rpm]",
     "% run 7\n% time [s], current [A], speed [rpm]",
     "time,current,speed\n# s,A,rpm", "time,current,speed\n# [s] [A] [rpm]",
     "a,b,c\n# time [s],current [A],speed [rpm]"],
)  # fmt: skip
def test_names_and_units_may_be_a_comment(tmp_path: Path, run: rw_ekf.Log, head: str) -> None:
    """A line with a comment's mark has the names where no other has them, and units where it has these."""
    text = csv(run, head, lambda i, t, w, c: f"{t!r},{c!r},{w * RPM!r}")
    mapping = guess(tmp_path / "a.csv", text).guess.mapping()
    assert "rpm" in str(mapping["speed_rpm"])
    assert "[A]" in str(mapping["current_A"])


def _with_cells(log: rw_ekf.Log, cells: dict[int, str]) -> str:
    """Rows in which some speeds, by row, are other cells."""
    return csv(log, "Time [s],Speed [rpm],Current [A]", lambda i, t, w, c: f"{t!r},{cells.get(i, repr(w * RPM))},{c!r}")


@pytest.mark.parametrize("mark", ["OVR", "OL", "N.A.", "overflow", "Bad", "#N/A", "Inf", "-inf", "---", "#DIV/0!"])
def test_what_stands_for_a_number_is_a_gap_and_told(tmp_path: Path, run: rw_ekf.Log, mark: str) -> None:
    """A meter's `OVR` is a gap, and one line says what was taken for one and where; a dash is told to nobody."""
    (tmp_path / "a.csv").write_text(_with_cells(run, {300: mark, 400: mark}))
    log = rw_ekf.read(tmp_path / "a.csv")
    assert np.flatnonzero(np.isnan(log.speed_rad_s)).tolist() == [300, 400]
    mapped = rw_ekf.read(tmp_path / "a.csv", columns=rw_ekf.guess_columns(tmp_path / "a.csv").column_map)
    assert np.array_equal(mapped.speed_rad_s, log.speed_rad_s, equal_nan=True)
    reported = [text for text in log.warnings if "taken for a gap" in text]
    assert len(reported) == (mark != "---")
    assert all(f"{mark!r} stands for a number in 2 cells, first in line 302" in text for text in reported)


@pytest.mark.parametrize("cell", ["see note", "12x4"])
def test_a_cell_that_is_no_number_is_shown_with_its_line(tmp_path: Path, run: rw_ekf.Log, cell: str) -> None:
    """One word in a column of numbers does not make it one that never changes."""
    (wanted,) = guess(tmp_path / "a.csv", _with_cells(run, {300: cell})).guess.questions
    assert f"column 'Speed [rpm]' has '{cell}' in line 302, which is no number" in wanted.text
    (tmp_path / "map.yaml").write_text("time_s: Time [s]\nspeed_rpm: Speed [rpm]\ncurrent_A: Current [A]\n")
    with pytest.raises(rw_ekf.Error, match=rf"line 302, column 'Speed \[rpm\]': '{cell}' is not a number"):
        rw_ekf.read(tmp_path / "a.csv", columns=tmp_path / "map.yaml")
    text = csv(run, "t_s,rpm,I [A]", lambda i, t, w, c: f"{t!r},{w * RPM!r},{'x' if i == 30 else repr(c)}")
    (wanted,) = guess(tmp_path / "b.csv", text).guess.questions
    assert "column 'I [A]' has 'x' in line 32" in wanted.text


def test_lists_in_cells_are_named(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`"[10, 9]"` is no number, and the question says that it is a list."""
    text = csv(run, "timestamp,speed,I_motor", lambda i, t, w, c: f'{t!r},"[{w:.3f}, {i}]",{c!r}')
    (wanted,) = guess(tmp_path / "a.csv", text).guess.questions
    assert "column 'speed' holds lists, such as '[" in wanted.text


def test_a_reading_that_no_machine_has_is_no_other_unit(tmp_path: Path, run: rw_ekf.Log) -> None:
    """One speed of a million rad/s and more is asked about as a reading, with the line that makes a gap of it."""
    (wanted,) = guess(tmp_path / "a.csv", _with_cells(run, {300: "98765432"})).guess.questions
    assert "goes to 98765432 in 1 of 600 rows" in wanted.text
    assert [line.entry.get("missing") for line in wanted.answers] == [None, 98765432.0]


def test_a_row_with_a_cell_too_many_is_named(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Where the rows before are whole, no other delimiter is suspected: the line is to be mended."""
    (tmp_path / "a.csv").write_text(_with_cells(run, {300: "1,2"}))
    with pytest.raises(rw_ekf.Error, match="line 302: 4 fields where the header has 3, as the rows before it: mend or"):
        rw_ekf.read(tmp_path / "a.csv")


def test_one_of_several_outputs_tells_no_wheels_apart(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`motor[2]` of few values is an output beside `motor[1]`, and no choice of rows is asked for."""
    header = "t_s,rpm,I [A],motor[1],motor[2]"
    text = csv(run, header, lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r},{137 + i % 8},{140 + i % 5}")
    assert not guess(tmp_path / "a.csv", text).guess.questions


_STEPS = "%Timestep increments at 8kHz\n%timestep (8Hz),voltage,velocity\n%[#],[V],[turns/s]"


def test_a_time_whose_scale_was_given_is_asked_about_no_more(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`--set time=COLUMN --set time.scale=0.000125` answers what a step is, also where steps are uneven."""
    text = csv(run, _STEPS, lambda i, t, w, c: f"{800 * i + 7 * (i % 3)},{c!r},{w / 6.283185307:.6f}")
    (tmp_path / "a.csv").write_text(text)
    assert "--set 'time=timestep (8Hz) [#]'" in rw_ekf.guess_columns(tmp_path / "a.csv").guess.questions[0].text
    found = rw_ekf.guess_columns(tmp_path / "a.csv", time="timestep (8Hz) [#]", time__scale=0.000125)
    assert not found.guess.questions
    log = rw_ekf.read(tmp_path / "a.csv", columns=found.column_map)
    assert log.time_s[3] - log.time_s[0] == pytest.approx(0.3)


def test_rows_that_hold_nothing_are_skipped_and_counted(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A row of nan alone has no time that could be missing; one that has a value but no time is refused as before."""
    lines = csv(run, "t [s],rpm,I [A],note", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r},").split("\n")
    lines[12:12], lines[31:31] = ["nan,nan,nan,"], [",,,"]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    log = rw_ekf.read(tmp_path / "a.csv")
    assert log.time_s == pytest.approx(run.time_s)
    assert any("2 rows without a time or a value were skipped, first at line 13" in text for text in log.warnings)
    lines[12] = "nan,12,nan,"
    (tmp_path / "b.csv").write_text("\n".join(lines))
    with pytest.raises(rw_ekf.Error):
        rw_ekf.read(tmp_path / "b.csv")


def test_without_a_column_of_time_an_empty_row_is_a_gap(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Where rows are the clock, none of them is skipped."""
    lines = csv(run, "# sampling rate 10 Hz\nrpm,I_motor", lambda i, t, w, c: f"{w * RPM!r},{c!r}").split("\n")
    lines[12] = "nan,nan"
    (tmp_path / "a.csv").write_text("\n".join(lines))
    assert rw_ekf.read(tmp_path / "a.csv").time_s == pytest.approx(run.time_s)


def test_a_clock_that_goes_to_summer_time_is_doubted(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Where stamps jump by an hour between two rows, the drive may change there: the wheel went on for a row alone."""
    change = int(np.argmax(np.abs(np.diff(run.current_A[5:])))) + 6

    def stamped(i: int, t: float) -> str:
        return f"2026-03-29 0{1 + (i >= change)}:59:{t % 60.0:06.3f}"

    text = csv(run, "Time,Speed [rpm],I [A]", lambda i, t, w, c: f"{stamped(i, t)},{w * RPM!r},{c!r}")
    doubts = guess(tmp_path / "a.csv", text).doubts
    assert any("the clock was set forward by 3600 s" in text for text in doubts), doubts


def test_an_hour_between_two_runs_is_a_pause(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A wheel that has stopped over an hour has not been told another time."""
    text = csv(run, "t_s,Speed [rpm],I [A]", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r}")
    later = csv(run, "", lambda i, t, w, c: f"{t + run.time_s[-1] + 3600.1!r},{w * RPM!r},{c!r}").lstrip("\n")
    assert abs(run.speed_rad_s[-1]) > 1.0
    assert not guess(tmp_path / "a.csv", text + later).doubts
