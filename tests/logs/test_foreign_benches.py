"""Logs as benches, drives and hobby projects write them: read in the right meaning, or asked with answers that work."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import rw_ekf
from rw_ekf.logs.odd_columns import turn_of
from rw_ekf.units import RAD_S_PER_RPM

RPM = 1.0 / RAD_S_PER_RPM
Formula = Callable[[float, float, float], float]


@pytest.fixture(scope="module")
def run() -> rw_ekf.Log:
    """30 s of a simulated wheel at 10 Hz, in both directions."""
    return rw_ekf.simulate("steps", duration_s=30.0, seed=8)


def _wanted(path: Path, run: rw_ekf.Log, header: str, *further: Formula) -> tuple[rw_ekf.GuessedColumns, str]:
    """What is found of a log of time, speed [rpm], current and further columns, of these; and what is asked."""
    rows = zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)
    cells = ((t, w * RPM, i, *(formula(t, w, i) for formula in further)) for t, w, i in rows)
    path.write_text("\n".join([header, *(",".join(map(repr, row)) for row in cells)]) + "\n")
    found = rw_ekf.guess_columns(path)
    return found, " ".join(question.text for question in found.guess.questions)


@pytest.mark.parametrize(
    "header",
    [
        "t_s,rpm_dot,i_A", "t_s,d_rpm,i_A", "t_s,rpm_rate,i_A", "t_s,omega_dot,i_A", "t_s,rpm10,i_A", "t_s,Mrpm,i_A",
        "t_s,mrpm,i_A", "t_s,drpm,i_A", "t_s,rpm_gradient,i_A", "t_s,rpm,I2t", "t_s,rpm,int_I", "t_s,rpm,I_dot",
        "t_s,rpm,accumulated_current_A", "t_s,theta_ddot,i_A", "t_s,d2theta_dt2,i_A", "t_s,theta_dotdot,i_A",
        "t_s,d2q,i_A",
    ],
)  # fmt: skip
def test_a_rate_or_a_sum_of_what_is_sought_is_asked_about(tmp_path: Path, run: rw_ekf.Log, header: str) -> None:
    """Neither is the reading itself, nor is what a factor or a letter at its name may have changed."""
    assert _wanted(tmp_path / "a.csv", run, header)[1]


@pytest.mark.parametrize(
    "name", ["wheel_rate_rpm", "rotation rate (rpm)", "theta_dot_rpm", "mRPM [rpm]", "speed [mrpm]"]
)
def test_the_rate_of_a_wheel_is_its_speed(tmp_path: Path, run: rw_ekf.Log, name: str) -> None:
    """And a unit in brackets is one."""
    assert _wanted(tmp_path / "a.csv", run, f"t_s,{name},i_A")[1] == ""


@pytest.mark.parametrize(
    ("further", "names"),
    [("I_brake", ["rpm", "I"]), ("fan_rpm", ["rpm", "I"]), ("currentAnalog", ["rpm", "I"]), ("ampHours", ["rpm", "I"])],
)
def test_what_is_of_another_load_stands_behind_a_plain_column(
    tmp_path: Path, run: rw_ekf.Log, further: str, names: list[str]
) -> None:
    """Alone it is asked about; beside the one that is sought it is passed over."""
    found, wanted = _wanted(tmp_path / "a.csv", run, f"t_s,rpm,I,{further}", lambda t, w, i: abs(i) + t)
    assert not wanted
    assert [line.entry["column"] for line in found.guess.lines if line.name != "time_s"] == names


@pytest.mark.parametrize("cell", ["", "---"])
def test_a_speed_that_few_rows_have_is_not_passed_over_for_an_angle(tmp_path: Path, run: rw_ekf.Log, cell: str) -> None:
    """What turns once and more between two rows has an angle too, and its rate is no speed of anything."""
    rows = zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)
    lines = (
        f"{t!r},{i!r},{(137.0 * k) % 360.0!r},{w * RPM if k % 3 == 0 else cell}" for k, (t, w, i) in enumerate(rows)
    )
    (tmp_path / "a.csv").write_text("\n".join(["t_s,i_A,angle_deg,feedback_rpm", *lines]))
    found = rw_ekf.guess_columns(tmp_path / "a.csv").guess
    assert any("'feedback_rpm' is no number in 200 of 300 rows" in question.text for question in found.questions)
    assert rw_ekf.guess_columns(tmp_path / "a.csv", speed="feedback_rpm").guess.is_certain


def test_a_rate_of_steps_is_no_rate_of_rows_that_have_not_each_one(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Rows some 800 steps apart, and "steps at 8 kHz" above them: what the steps are of is asked."""

    def wanted(apart: Callable[[int], int]) -> str:
        rows = zip(run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)
        lines = (f"{apart(k)},{i!r},{w!r}" for k, (w, i) in enumerate(rows))
        above = ["% Timestep increments at 8kHz", "timestep,i_A,omega_rad_s"]
        (tmp_path / "a.csv").write_text("\n".join([*above, *lines]))
        return " ".join(question.text for question in rw_ekf.guess_columns(tmp_path / "a.csv").guess.questions)

    assert "rises by some 801 from row to row" in wanted(lambda k: 800 * k + k % 7)
    assert not wanted(lambda k: k)


def test_hundredths_that_somebody_has_converted_are_none(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Betaflight logs hundredths of an ampere; with decimals the numbers are none, and 2.45 is no 24.5 mA."""

    def unit(factor: float) -> object:
        rows = zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)
        lines = (f"{k},{t!r},{round(100 * i) * factor!r},{w!r}" for k, (t, w, i) in enumerate(rows))
        (tmp_path / "a.csv").write_text("\n".join(["loopIteration,time_s,amperageLatest,omega_rad_s", *lines]))
        found = rw_ekf.guess_columns(tmp_path / "a.csv").guess
        assert "supply" in found.questions[0].text  # of one battery, and all motors
        return found.questions[0].answers[0].entry.get("unit")

    assert unit(1) == "0.01 A"
    assert unit(0.01) is None


def test_gyros_are_no_wheel_whose_speed_stands_still(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Of a motor at rest the log says so, and not which of three gyros is its speed."""
    _, wanted = _wanted(tmp_path / "a.csv", run, "t_s,gyroX,i_A,gyroY,erpm", lambda t, w, i: w + t, lambda t, w, i: 0.0)
    assert "'erpm' never changes" in wanted
    assert "gyro" not in wanted


def test_answers_of_a_choice_say_unit_and_kind(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Each is a line that reads the column as it is: rpm, the rate of an angle; where that is not known, none."""

    def answers(header: str) -> list[tuple[str, dict[str, object]]]:
        found, _ = _wanted(tmp_path / "a.csv", run, header, lambda t, w, i: w * t)
        return [(line.name, line.entry) for question in found.guess.questions for line in question.answers]

    assert answers("t_s,RPM_M1,i_A,RPM_M2") == [("speed_rpm", {"column": name}) for name in ("RPM_M1", "RPM_M2")]
    assert answers("t_s,encoderL (meters),i_A,encoderR (meters)") == [
        ("speed_rad_s", {"derivative_of": f"encoder{side} (meters)", "unit": "meters"}) for side in "LR"
    ]
    assert not answers("t_s,Velocity 0,i_A,Velocity 3")
    assert not answers("t_s,q1,i_A,q2")


def test_an_angle_that_is_named_for_the_speed_is_differentiated(tmp_path: Path, run: rw_ekf.Log) -> None:
    """With `--set speed=COLUMN`; a unit of a speed says that it is one."""
    _wanted(tmp_path / "a.csv", run, "t_s,left angle (deg),i_A,right angle (deg)", lambda t, w, i: w * t)
    found = rw_ekf.guess_columns(tmp_path / "a.csv", speed="left angle (deg)").guess
    entry = next(line.entry for line in found.lines if line.name == "speed_rad_s")
    assert entry == {"derivative_of": "left angle (deg)", "unit": "deg"}
    found = rw_ekf.guess_columns(tmp_path / "a.csv", speed="left angle (deg):deg/s").guess
    assert next(line.entry["column"] for line in found.lines if line.name == "speed_rad_s") == "left angle (deg)"


def test_a_noisy_angle_that_goes_beyond_its_turn_begins_anew_all_the_same() -> None:
    """Its jumps say so; counts of a turn are told apart by a hundredth still."""
    true = np.cumsum(np.linspace(40.0, 12.0, 900))
    noise = np.random.default_rng(3).normal(0.0, 2.0, true.size)
    angle = true % 360.0 + noise
    assert np.ptp(angle) > 360.0
    assert turn_of(angle) == 360.0
    assert turn_of(np.radians(angle), (2.0 * math.pi,), only=True) == 2.0 * math.pi
    assert turn_of(true + noise) is None
    assert turn_of((true * 10.0) % 4000.0, (4096.0,)) == 4000.0


def test_an_angle_that_goes_half_a_turn_between_rows_is_asked_about(tmp_path: Path) -> None:
    """Which way around it went nobody knows then."""

    def wanted(step_deg: float) -> str:
        rows = (f"{i / 10!r},{round(step_deg * i % 360.0, 2)!r},{math.sin(i)!r}" for i in range(100))
        (tmp_path / "a.csv").write_text("\n".join(["t_s,angle_deg,i_A", *rows]))
        return " ".join(question.text for question in rw_ekf.guess_columns(tmp_path / "a.csv").guess.questions)

    assert "half a turn" in wanted(201.0)
    assert not wanted(31.0)


def test_a_row_of_dates_is_no_row_of_names(tmp_path: Path) -> None:
    """The first of a file without names is a row as all others; its columns have numbers."""
    rows = [f"2024-03-0{1 + i // 60} 10:{i % 60:02d}:00,{100.0 - 0.5 * i!r}" for i in range(100)]
    (tmp_path / "a.csv").write_text("\n".join(rows))
    table = rw_ekf.guess_columns(tmp_path / "a.csv")
    assert any("a number from 0 to 1" in note for note in table.guess.notes)
    assert {line.entry.get("column") for line in table.guess.lines} <= {0, 1}


def test_what_a_vesc_calls_rpm_is_electrical(tmp_path: Path, run: rw_ekf.Log) -> None:
    """As its library for microcontrollers passes it on, whatever it is called."""
    rows = [
        {
            "rpm": round(w * RPM * 7),
            "t": t,
            "avgMotorCurrent": i,
            "dutyCycleNow": w / 400.0,
            "inpVoltage": 12.0 - 0.1 * i,
        }
        for t, w, i in zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)
    ]
    (tmp_path / "a.jsonl").write_text("\n".join(map(json.dumps, rows)))
    wanted = [question.text for question in rw_ekf.guess_columns(tmp_path / "a.jsonl").guess.questions]
    assert len(wanted) == 1
    assert "pole pairs" in wanted[0]


def test_a_current_that_makes_the_power_of_a_supply_is_the_supplys(tmp_path: Path, run: rw_ekf.Log) -> None:
    """With a voltage that hardly changes; with the motor's own it is the motor's."""
    header = "Time (s),Speed (RPM),Current (A),Voltage (V),Power (W)"
    assert (
        "the supply gives"
        in _wanted(tmp_path / "a.csv", run, header, lambda t, w, i: 24 - i / 9, lambda t, w, i: (24 - i / 9) * abs(i))[
            1
        ]
    )
    assert not _wanted(tmp_path / "a.csv", run, header, lambda t, w, i: w / 9 + i, lambda t, w, i: (w / 9 + i) * i)[1]


def test_a_symbol_in_brackets_is_no_unit(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`time(t)`, `speed(n) [rpm]`; another letter is asked about still."""
    assert not _wanted(tmp_path / "a.csv", run, "time(t),speed(n) [rpm],current(i) [A]")[1]
    assert "'b'" in _wanted(tmp_path / "a.csv", run, "time(t),rpm (b),current(i) [A]")[1]


def test_a_heading_is_no_angle_of_a_wheel(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Where x and y stand beside it."""
    assert (
        "heading" in _wanted(tmp_path / "a.csv", run, "t_s,theta(deg),I_A,x,y", lambda t, w, i: t, lambda t, w, i: w)[1]
    )


@pytest.mark.parametrize(
    "header",
    [
        "t_s,RPM_M1,CURRENT_M2",
        "t_s,ODrive 3 Velocity [rpm],ODrive 1 Current [A]",
        "t_s,input_speed [rpm],output_torque [Nm]",
    ],
)
def test_speed_and_current_of_two_drives_are_asked_about(tmp_path: Path, run: rw_ekf.Log, header: str) -> None:
    """By their numbers, or the sides of a gear."""
    assert "two wheels" in _wanted(tmp_path / "a.csv", run, header)[1]


def test_a_speed_that_never_changes_is_named(tmp_path: Path) -> None:
    """Not only that none is known."""
    (tmp_path / "a.csv").write_text("t_s,rpm,i_A\n" + "".join(f"{i / 10!r},19.5,{math.sin(i)!r}\n" for i in range(50)))
    wanted = [question.text for question in rw_ekf.guess_columns(tmp_path / "a.csv").guess.questions]
    assert any("'rpm' never changes" in text for text in wanted)


def test_a_refusal_says_what_is_known_beside_what_is_asked(tmp_path: Path, run: rw_ekf.Log) -> None:
    """And not that a time is missing which was found."""
    _wanted(tmp_path / "a.csv", run, "time,rpm,pid")
    with pytest.raises(rw_ekf.Error) as caught:
        rw_ekf.read(tmp_path / "a.csv")
    assert "time_s is missing" not in str(caught.value)
    assert "speed_rpm = 'rpm'" in str(caught.value)
    assert "--set current=none" in str(caught.value)


def test_the_thrust_of_a_propeller_is_what_the_speed_does(tmp_path: Path, run: rw_ekf.Log) -> None:
    """And no drive; a force that is none is one still."""
    assert "thrust" in _wanted(tmp_path / "a.csv", run, "t_s,rpm,thrust (N)")[1]
    assert not _wanted(tmp_path / "a.csv", run, "t_s,rpm,force (N)")[1]
