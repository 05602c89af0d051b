"""Rows in whatever order, and a time in whatever columns: what belongs together is put together by the time."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

import rw_ekf
from rw_ekf.logs.column_map_file import load_column_map
from rw_ekf.logs.last_known import last_known, on_one_axis
from rw_ekf.units import RAD_S_PER_RPM
from tests.foreign_logs import csv, guess

Row = tuple[float, str, float]  # time [s], signal, value
_LATE_S = 0.002  # of the current behind the speed


def _rows(run: rw_ekf.Log) -> list[Row]:
    """A row for each value: speed [rpm], then current [A] a moment later."""
    each = zip(run.time_s.tolist(), (run.speed_rad_s / RAD_S_PER_RPM).tolist(), run.current_A.tolist(), strict=True)
    return [row for t, n, i in each for row in ((t, "speed_rpm", n), (round(t + _LATE_S, 9), "current_A", i))]


def _chunked(rows: list[Row], seconds: float) -> list[Row]:
    return sorted(rows, key=lambda row: (row[0] // seconds, row[1] != "speed_rpm", row[0]))


ORDERS: dict[str, Callable[[list[Row]], Iterable[Row]]] = {
    "by time": lambda rows: rows,
    "newest first": lambda rows: rows[::-1],
    "by signal": lambda rows: sorted(rows, key=lambda row: (row[1], row[0])),
    "in chunks": lambda rows: _chunked(rows, 1.0),
}


def _as_csv(path: Path, rows: Iterable[Row]) -> Path:
    path = path / "long.csv"
    path.write_text("time,signal,value\n" + "".join(f"{t!r},{name},{value!r}\n" for t, name, value in rows))
    return path


def _as_json_lines(path: Path, rows: Iterable[Row]) -> Path:
    path = path / "long.jsonl"
    path.write_text("".join(json.dumps({"t": t, name: value}) + "\n" for t, name, value in rows))
    return path


def _as_database(path: Path, rows: Iterable[Row]) -> Path:
    path = path / "long.sqlite"
    with sqlite3.connect(path) as base:
        base.execute("create table samples (time real, signal text, value real)")
        base.executemany("insert into samples values (?, ?, ?)", rows)
    base.close()
    return path


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("written", [_as_csv, _as_json_lines, _as_database])
def test_values_of_one_moment_are_together_in_whatever_order_they_stand(
    tmp_path: Path, run: rw_ekf.Log, order: str, written: Callable[[Path, Iterable[Row]], Path]
) -> None:
    """A row a signal by time, newest first, one signal after the other, in chunks: the same log to the last bit."""
    log = rw_ekf.read(written(tmp_path, ORDERS[order](_rows(run))))
    assert np.array_equal(log.time_s, run.time_s)
    assert np.allclose(log.speed_rad_s, run.speed_rad_s, rtol=1e-12)
    assert np.array_equal(log.current_A, run.current_A)


def test_runs_of_one_file_keep_their_own_values(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Two runs from zero, each signal's both runs together: the second run has the second run's currents."""
    rows = _rows(run)
    twice = [*rows, *((t, name, -value) for t, name, value in rows)]
    log = rw_ekf.read(_as_csv(tmp_path, sorted(twice, key=lambda row: row[1])))
    assert np.array_equal(log.segment, np.repeat([0, 1], len(run.time_s)))
    assert np.array_equal(log.current_A, np.concatenate((run.current_A, -run.current_A)))


def test_stamps_that_many_rows_share_leave_the_order_of_the_file(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Whole seconds, a speed at each and currents between: the current of a row is no later one of its second."""
    rows: list[Row] = [
        (float(int(t)), name, value)
        for at, (t, n, i) in enumerate(zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A, strict=True))
        for name, value in ([("speed_rad_s", n)] if at % 10 == 0 else []) + [("current_A", float(i))]
    ]
    path = _as_csv(tmp_path, rows)
    path.write_text(path.read_text().replace("time,", "time_s,", 1))
    log = rw_ekf.read(path)
    assert np.array_equal(log.current_A, run.current_A[::10])


def test_wheels_of_one_table_keep_their_own_currents(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Two wheels a little apart in time: each row has the current of its own wheel."""
    lines = ["time,wheel,signal,value"]
    for t, w, c in zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True):
        for at, (wheel, sign) in enumerate((("A", 1.0), ("B", -1.0))):
            lines += [f"{t + 0.002 * at + late!r},{wheel},{name},{sign * value!r}"
                      for late, name, value in ((0.0, "speed_rad_s", w), (0.0015, "current_A", c))]  # fmt: skip
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    for wheel, sign in (("A", 1.0), ("B", -1.0)):
        assert np.array_equal(rw_ekf.read(tmp_path / "a.csv", wheel=wheel).current_A, sign * run.current_A)


def test_clocks_that_never_meet_are_not_compared(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Two boards count from their own start: what stands behind each other is of one moment still."""
    lines = [
        json.dumps({"t": t if name == "rpm" else t + 5000.0, name: value})
        for t, w, c in zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)
        for name, value in (("current_A", c), ("rpm", w))
    ]
    (tmp_path / "a.jsonl").write_text("\n".join(lines) + "\n")
    assert np.array_equal(rw_ekf.read(tmp_path / "a.jsonl").current_A, run.current_A)


def test_a_command_just_ahead_of_a_row_is_not_the_row_befores(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Logged on change and a millisecond ahead of its row: from that row on it holds, and not a row too early."""
    command = np.where(run.current_A > 0.0, 0.3, -0.3)
    rows: list[Row] = []
    for at, (t, n) in enumerate(zip(run.time_s.tolist(), (run.speed_rad_s / RAD_S_PER_RPM).tolist(), strict=True)):
        if at == 0 or command[at] != command[at - 1]:
            rows.append((t - 0.001, "current_command_A", float(command[at])))
        rows.append((t, "speed_rpm", n))
    assert np.array_equal(rw_ekf.read(_as_csv(tmp_path, rows)).current_A, command)


def test_the_last_known_is_of_the_same_turn_where_that_is_steady() -> None:
    """A fifth of a step later, each time, is the same turn; at an own rate, or later than half a step, it is not."""
    at = np.arange(0.0, 10.0, 0.1)
    assert np.array_equal(last_known(at, at + 0.02), np.arange(100))
    assert np.array_equal(last_known(at, at + 0.07), np.arange(100) - 1)
    own = np.sort(np.random.default_rng(1).uniform(0.0, 10.0, size=100))
    assert np.all(own[last_known(at, own)[10:]] <= at[10:] + 0.0101)


def test_kinds_that_begin_anew_differently_are_on_no_axis() -> None:
    """What has one run of one kind and two of another cannot be put together by time."""
    time_s = np.tile(0.1 * np.arange(40), 3)
    assert on_one_axis(time_s, np.repeat([0, 1], [80, 40])) is None
    axis = on_one_axis(time_s, np.repeat([0, 1, 2], 40))
    assert axis is not None
    assert np.array_equal(axis, time_s)


def _clock(t: float) -> tuple[int, int, float]:
    """Hour, minute and second of a run that begins at 23:59:50."""
    day_s = (86390.0 + t) % 86400.0
    return int(day_s // 3600), int(day_s % 3600 // 60), round(day_s % 60.0, 6)


@pytest.mark.parametrize("names", ["hour,min,sec", "Stunde,Minute,Sekunde", "hh,mm,ss", "H,M,S"])
def test_a_time_in_columns_of_its_parts_is_one(tmp_path: Path, run: rw_ekf.Log, names: str) -> None:
    """Hours, minutes and seconds over midnight are one time: the seconds alone were it, and each minute a run."""
    text = csv(run, f"{names},rpm,current_A", lambda i, t, w, c: "{},{},{}".format(*_clock(t)) + f",{w!r},{c!r}")
    log = _read(tmp_path, text)
    assert np.allclose(log.time_s - log.time_s[0], run.time_s - run.time_s[0], atol=1e-9)
    assert np.unique(log.segment).size == 1


def test_columns_that_are_a_time_together_stay_where_they_are(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A map by number, or of the seconds alone, reads what it read before."""
    text = csv(
        run, "hour,min,sec,rpm_cmd,speed,u,current", lambda i, t, w, c: f"9,{int(t // 60)},{t % 60.0!r},7,{w!r},8,{c!r}"
    )
    (tmp_path / "log.csv").write_text(text)
    (tmp_path / "map.yaml").write_text("rate_hz: 10\nspeed_rad_s: {column: 4}\ncurrent_A: {column: 6}\n")
    log = rw_ekf.read(tmp_path / "log.csv", tmp_path / "map.yaml")
    assert np.array_equal(log.speed_rad_s, run.speed_rad_s)
    assert np.array_equal(log.current_A, run.current_A)
    (tmp_path / "map.yaml").write_text("time_s: {column: sec}\nspeed_rad_s: {column: 4}\ncurrent_A: {column: 6}\n")
    assert np.array_equal(rw_ekf.read(tmp_path / "log.csv", tmp_path / "map.yaml").time_s, run.time_s)


def test_thousandths_that_do_not_begin_with_the_second_are_none_of_it(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`ms` may be how long a loop took."""
    text = csv(
        run, "hour,min,sec,ms,rpm,current_A",
        lambda i, t, w, c: "{},{},{}".format(*_clock(t)) + f",{1 + i * 7 % 8},{w!r},{c!r}",
    )  # fmt: skip
    log = _read(tmp_path, text)
    assert np.allclose(log.time_s - log.time_s[0], run.time_s, atol=1e-9)


def test_one_row_of_a_time_in_columns_is_refused_with_a_sentence(tmp_path: Path) -> None:
    """Nothing rises in it, and numpy has nothing to say of it."""
    with pytest.raises(rw_ekf.Error, match="time_s is missing"):
        _read(tmp_path, "hour,minute,second,ms,rpm,current_A\n9,0,1,20,3,0.1\n")


def test_whole_seconds_of_many_rows_are_spread(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Hours, minutes and whole seconds at ten rows a second, as any coarse stamp."""
    text = csv(
        run, "hour,minute,second,rpm,current_A",
        lambda i, t, w, c: "{},{},{:.0f}".format(*_clock(float(int(t)))) + f",{w!r},{c!r}",
    )  # fmt: skip
    log = _read(tmp_path, text)
    assert np.allclose(log.time_s - log.time_s[0], run.time_s, atol=1e-6)


def test_a_date_in_columns_counts_beside_the_hours(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Year, month and day go on at midnight, into a month of another length."""
    begun = np.datetime64("2024-02-29T23:59:50", "ms")

    def line(i: int, t: float, w: float, c: float) -> str:
        text = str(begun + np.timedelta64(round(1000 * t), "ms"))
        return ",".join(text.replace("-", ",").replace("T", ",").split(":")) + f",{w!r},{c!r}"

    log = _read(tmp_path, csv(run, "year,month,day,hour,minute,second,rpm,current_A", line))
    assert np.allclose(log.time_s - log.time_s[0], run.time_s - run.time_s[0], atol=1e-3)


def test_seconds_that_do_not_begin_with_the_minute_are_no_part_of_it(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Seconds since the start beside the hour and minute of the day are a time by themselves."""
    text = csv(run, "hour,minute,time_s,rpm,current_A", lambda i, t, w, c: f"9,{57 + (t > 7.3):d},{t!r},{w!r},{c!r}")
    assert np.array_equal(_read(tmp_path, text).time_s, run.time_s)


@pytest.mark.parametrize(("dates", "order"), [(("3/1/2024", "3/2/2024"), "m/d/y"), (("24/12/09", "24/12/10"), "y/m/d")])
def test_dates_are_read_so_that_the_run_is_short(
    tmp_path: Path, run: rw_ekf.Log, dates: tuple[str, str], order: str
) -> None:
    """Over midnight the next day comes, and not a day of the next month or year: that tells the order of a date."""
    text = csv(
        run, "Timestamp,rpm,current_A",
        lambda i, t, w, c: f"{dates[t >= 10.0]} {_clock(t)[0]:02d}:{_clock(t)[1]:02d}:{_clock(t)[2]:06.3f},{w!r},{c!r}",
    )  # fmt: skip
    assert _read(tmp_path, text).time_s[-1] - _read(tmp_path, text).time_s[0] == pytest.approx(run.time_s[-1]), order


def test_minutes_of_one_digit_are_minutes(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`0:07.250` is seven seconds and a quarter, as `00:07.250` is."""
    text = csv(run, "Elapsed,rpm,current_A", lambda i, t, w, c: f"{int(t // 60)}:{t % 60.0:06.3f},{w!r},{c!r}")
    assert np.allclose(_read(tmp_path, text).time_s, run.time_s, atol=1e-9)


@pytest.mark.parametrize(
    "line",
    [
        "# dwell time: 10 s per step", "# command timeout unit: 10 ms", "# filter time constant unit 10 ms",
        "# PWM timer 10 us per count", "# bit time: 10 us per bit", "# lifetime test, runtime 100 s each step",
        "# system clock 72 MHz", "# ADC clock 14 MHz", "# encoder counter 10 kHz", "# timer 10 Hz", "# cycle: 50 ms",
    ],
)  # fmt: skip
def test_other_times_and_clocks_say_nothing_of_the_stamps(tmp_path: Path, run: rw_ekf.Log, line: str) -> None:
    """A dwell, a timeout, a converter's clock and the rate of the rows: milliseconds stay milliseconds, unasked."""
    log = _read(tmp_path, csv(run, f"{line}\ntime,rpm,current_A", lambda i, t, w, c: f"{t * 1e3:.0f},{w!r},{c!r}"))
    assert np.allclose(log.time_s, run.time_s, atol=1e-9)


def test_a_unit_that_the_steps_contradict_is_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`time unit: s` above rows a hundred apart: with seconds a row would last longer than any log's."""
    text = csv(run, "# time unit: s\ntime,rpm,current_A", lambda i, t, w, c: f"{t * 1e3:.0f},{w!r},{c!r}")
    assert [question.name for question in guess(tmp_path / "a.csv", text).guess.questions] == ["time_s"]


def test_ticks_of_any_size_are_heard(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Stamps of 25 us, which is no unit's name."""
    text = csv(run, "# timestamp unit: 25 us\nstamp,rpm,current_A", lambda i, t, w, c: f"{t * 4e4:.0f},{w!r},{c!r}")
    assert np.allclose(_read(tmp_path, text.replace("stamp,", "timestamp,", 1)).time_s, run.time_s, atol=1e-9)


@pytest.mark.parametrize("line", ["# timestamp unit: 10 us", "# time in units of 10 us", "% timer: 10 us per count"])
def test_what_a_stamp_counts_in_is_heard(tmp_path: Path, run: rw_ekf.Log, line: str) -> None:
    """Stamps of ten microseconds each, by a line above them, are not of one: the run would be ten times as short."""
    log = _read(tmp_path, csv(run, f"{line}\ntimestamp,rpm,current_A", lambda i, t, w, c: f"{t * 1e5:.0f},{w!r},{c!r}"))
    assert np.allclose(log.time_s, run.time_s, atol=1e-9)


def test_the_rate_of_a_timer_beside_a_time_without_a_unit_is_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """100 kHz, or microseconds? With the first answer, the time is right."""
    text = csv(run, "# 100 kHz timer\ntimestamp,rpm,current_A", lambda i, t, w, c: f"{t * 1e5:.0f},{w!r},{c!r}")
    asked = guess(tmp_path / "a.csv", text)
    (question,) = asked.guess.questions
    assert question.answers[0].entry == {"column": "timestamp", "unit": "us", "scale": 10.0}
    answered = rw_ekf.guess_columns(tmp_path / "a.csv", **{"time.unit": "10 us"})
    assert np.allclose(rw_ekf.read(tmp_path / "a.csv", answered.column_map).time_s, run.time_s, atol=1e-9)


def test_stamps_of_wincc_are_millionths_of_a_day(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`Time_MS` holds no milliseconds: 45356415277 is a moment of 5 March 2024."""
    text = csv(
        run, "Time_MS,rpm,current_A", lambda i, t, w, c: f"{45356415277.7778 + t / 0.0864:.6f},{w!r},{c!r}"
    )  # fmt: skip
    log = _read(tmp_path, text)
    assert np.allclose(log.time_s - log.time_s[0], run.time_s, atol=1e-5)


@pytest.mark.parametrize(
    "text",
    [
        "Time,rpm,current_A\n" + "".join(f"10:00:0{i % 10}:050,{i}.5,0.{i}\n" for i in range(40)),
        "time_s,rpm,id,current_A\n" + "".join(f"{i // 2 / 10},{i}.5,{1 + i % 2},0.{i}\n" for i in range(40)),
    ],
    ids=["a cell without a name", "rows of two wheels"],
)
def test_a_map_that_asks_of_all_columns_is_refused_until_it_is_answered(tmp_path: Path, text: str) -> None:
    """Its lines all stand: used as it was written, it would answer by itself."""
    asked = guess(tmp_path / "a.csv", text)
    assert not asked.is_certain
    asked.save(tmp_path / "map.yaml")
    with pytest.raises(rw_ekf.Error, match=r"map\.yaml:\d+:8: asked is not answered yet: .* Delete this line"):
        load_column_map(tmp_path / "map.yaml")


def test_two_wheels_side_by_side_are_no_two_runs(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`RW1` and `RW2` above the same names: which wheel is meant is asked, and neither is a run of the other."""
    names = "Time [s],Speed [rpm],Current [A]"
    text = csv(run, f"RW1,,,RW2,,\n{names},{names}", lambda i, t, w, c: f"{t},{w},{c},{t},{-w},{-c}")
    asked = guess(tmp_path / "a.csv", text)
    assert "'RW1 Speed [rpm]', column 'RW2 Speed [rpm]'" in asked.guess.questions[0].text
    alike = csv(run, f"Run 1,,,Run 2,,\n{names},{names}", lambda i, t, w, c: f"{t},{w},{c},{t},{-w},{-c}")
    assert np.unique(_read(tmp_path, alike).segment).size == 2


@pytest.mark.parametrize(
    "labels", ["Motor run 1,,,Motor run 2,,", "RW1 run 1,,,RW1 run 2,,", "forward 1,,,forward 2,,"]
)
def test_runs_of_one_machine_side_by_side_are_runs(tmp_path: Path, run: rw_ekf.Log, labels: str) -> None:
    """A machine's name above both, or within another word, makes no two machines."""
    names = "Time [s],Speed [rpm],Current [A]"
    text = csv(run, f"{labels}\n{names},{names}", lambda i, t, w, c: f"{t},{w},{c},{t},{-w},{-c}")
    assert np.unique(_read(tmp_path, text).segment).size == 2


def test_wheels_side_by_side_with_clocks_of_their_own_are_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """One wheel's speed has not the other's time."""
    names = "Time [s],Speed [rpm],Current [A]"
    text = csv(run, f"Motor A,,,Motor B,,\n{names},{names}", lambda i, t, w, c: f"{t},{w},{c},{1.2 * t},{-w},{-c}")
    (tmp_path / "a.csv").write_text(text)
    answers = {"speed": "Motor B Speed [rpm]", "current": "Motor B Current [A]"}
    questions = rw_ekf.guess_columns(tmp_path / "a.csv", **answers).guess.questions
    assert [question.name for question in questions] == ["layout"]


def test_inches_are_no_quotes(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`5" wheel` in a note opens no cell."""
    notes = {2: '5" wheel', 7: '5" wheel'}
    text = csv(run, "time_s,speed [rad/s],current_A,note", lambda i, t, w, c: f"{t!r},{w!r},{c!r},{notes.get(i, '')}")
    assert np.array_equal(_read(tmp_path, text).speed_rad_s, run.speed_rad_s)


def test_names_of_several_lines_within_quotes_are_names(tmp_path: Path, run: rw_ekf.Log) -> None:
    """As a sheet writes a header that is broken in its cells; rows keep their line in messages."""
    text = csv(run, '"Time\n[s]","Speed\n[rad/s]",current_A', lambda i, t, w, c: f"{t!r},{w!r},{c!r}")
    assert np.array_equal(_read(tmp_path, text).speed_rad_s, run.speed_rad_s)
    broken = text.replace(f"{float(run.speed_rad_s[5])!r}", "abc", 1).replace("\n", "\r\n")
    with pytest.raises(rw_ekf.Error, match=r"'Speed \[rad/s\]' has 'abc' in line 9"):
        _read(tmp_path, broken)


def test_what_a_board_says_at_its_start_is_no_name(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`INA219 found at 0x40` above `millis,rpm,mA` is prose, and those are names; so is a comment of a run."""
    text = csv(run, "INA219 found at 0x40\nmillis,rpm,mA", lambda i, t, w, c: f"{1e3 * t:.0f},{w!r},{1e3 * c!r}")
    assert np.allclose(_read(tmp_path, text).time_s, run.time_s)
    text = csv(run, "# wheel RW-02  run 17", lambda i, t, w, c: f"{t:.3f}  {w:.3f}  {c:.4f}")
    (tmp_path / "b.dat").write_text(text)
    assert not any("RW-02" in question.text for question in rw_ekf.guess_columns(tmp_path / "b.dat").guess.questions)


def test_a_minus_of_typography_is_a_minus_among_commas(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Negative numbers of a word processor are no gaps."""
    text = csv(run, "time_s,speed [rad/s],current [A]", lambda i, t, w, c: f"{t!r},{w!r},{c!r}").replace("-", "\u2212")
    log = _read(tmp_path, text)
    assert np.array_equal(log.speed_rad_s, run.speed_rad_s)
    assert np.array_equal(log.current_A, run.current_A)


def test_a_direction_may_say_that_the_wheel_stands(tmp_path: Path, run: rw_ekf.Log) -> None:
    """FWD, REV, and STOP where the speed is nothing."""
    speed = np.where(np.abs(run.speed_rad_s) < 0.2, 0.0, run.speed_rad_s)
    words = {-1.0: "REV", 0.0: "STOP", 1.0: "FWD"}
    text = csv(
        run, "time_s,speed [rad/s],direction,current [A]",
        lambda i, t, w, c: f"{t!r},{abs(float(speed[i]))!r},{words[float(np.sign(speed[i]))]},{c!r}",
    )  # fmt: skip
    assert np.array_equal(_read(tmp_path, text).speed_rad_s, speed)


@pytest.mark.parametrize("word", ["STOP", "idle"])
def test_a_wheel_that_coasts_turns_on_as_it_did(tmp_path: Path, run: rw_ekf.Log, word: str) -> None:
    """Where STOP says that nothing drives, the speed keeps the sign that it had."""
    at = int(np.argmin(run.speed_rad_s))
    text = csv(
        run, "time_s,speed [rad/s],direction,current [A]",
        lambda i, t, w, c: f"{t!r},{abs(w)!r},{word if at < i < at + 3 else 'REV' if w < 0.0 else 'FWD'},{c!r}",
    )  # fmt: skip
    assert np.array_equal(_read(tmp_path, text).speed_rad_s[: at + 3], run.speed_rad_s[: at + 3])


def test_columns_of_another_table_in_json_are_not_the_logs(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A matrix of calibration beside the rows has `columns` and `rows` too, and is shorter."""
    rows = [
        {"time_s": t, "speed_rad_s": w, "current_A": c}
        for t, w, c in zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)
    ]
    document = {"columns": ["x", "y"], "rows": [[1, 2], [3, 4], [5, 6]], "samples": rows}
    (tmp_path / "a.json").write_text(json.dumps(document))
    assert np.array_equal(rw_ekf.read(tmp_path / "a.json").speed_rad_s, run.speed_rad_s)


def test_rows_beside_their_names_in_json_have_them(tmp_path: Path, run: rw_ekf.Log) -> None:
    """What a database answers: `columns` beside `rows`, also of texts, also within InfluxDB 1's results."""
    names = ["time_s", "speed_rad_s", "current_A"]
    rows = [[*each] for each in zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)]
    series = {"name": "rw", "columns": names, "values": rows}
    for document in (
        {"columns": names, "rows": rows},
        {"columns": names, "rows": [[repr(cell) for cell in row] for row in rows]},
        {"results": [{"statement_id": 0, "series": [series]}]},
    ):
        (tmp_path / "a.json").write_text(json.dumps(document))
        log = rw_ekf.read(tmp_path / "a.json")
        assert np.array_equal(log.speed_rad_s, run.speed_rad_s)


def test_lines_of_a_journal_are_what_was_said(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`journalctl -o json`: the time is its stamp, and the numbers stand in the message."""
    lines = [
        {"__REALTIME_TIMESTAMP": f"{1.7e15 + 1e6 * t:.0f}", "MESSAGE": f"speed={w!r} rad/s current={c!r} A"}
        for t, w, c in zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)
    ]
    (tmp_path / "a.json").write_text("".join(json.dumps(line) + "\n" for line in lines))
    log = rw_ekf.read(tmp_path / "a.json")
    assert np.array_equal(log.speed_rad_s, run.speed_rad_s)
    assert np.allclose(log.time_s - log.time_s[0], run.time_s, atol=1e-6)


def test_columns_of_a_signal_of_simulink_have_numbers(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A structure with time whose one signal is two wide: what its columns are is asked, and may be answered."""
    signals = {"values": np.column_stack((run.speed_rad_s, run.current_A)), "label": "", "dimensions": 2.0}
    path = tmp_path / "a.mat"
    savemat(path, {"simout": {"time": run.time_s[:, None], "signals": signals, "blockName": "rig/To Workspace"}})
    assert {question.name for question in rw_ekf.guess_columns(path).guess.questions} == {"speed_rad_s", "current_A"}
    answers = {"speed": "signals.values[0]:rad/s", "current": "signals.values[1]:A"}
    log = rw_ekf.read(path, rw_ekf.guess_columns(path, **answers).column_map)
    assert np.array_equal(log.speed_rad_s, run.speed_rad_s)
    assert np.array_equal(log.current_A, run.current_A)


def test_metrics_of_one_moment_are_refused(tmp_path: Path) -> None:
    """What a program shows to Prometheus is no log, and what to ask instead is said."""
    (tmp_path / "a.txt").write_text("# TYPE wheel_rpm gauge\n" + "".join(f"wheel_rpm {i}.5 {i}00\n" for i in range(40)))
    with pytest.raises(rw_ekf.Error, match="query_range"):
        rw_ekf.read(tmp_path / "a.txt")


def _read(path: Path, text: str) -> rw_ekf.Log:
    (path / "log.csv").write_bytes(text.encode())
    return rw_ekf.read(path / "log.csv")
