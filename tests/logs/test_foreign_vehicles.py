"""Logs of machines within machines: the speed of a vehicle, a pedal or a body, the current and the heat of others."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import rw_ekf
from rw_ekf.units import RAD_S_PER_RPM
from tests.foreign_logs import csv, guess

RPM = 1.0 / RAD_S_PER_RPM


def _wanted(found: rw_ekf.GuessedColumns) -> list[str]:
    return [question.name for question in found.guess.questions]


def test_a_yaw_rate_beside_a_motor_is_no_speed_of_it(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`omega` that does not go with the electrical speed beside it is asked about; one that does is the motor's."""
    for yaws, other in ((True, "v"), (False, "v")):
        text = csv(
            run,
            f"t,{other},omega,erpm,current",
            lambda i, t, w, c, yaws=yaws: f"{t},{w / 9},{math.sin(t / 3) if yaws else w},{w * RPM * 7},{c}",  # type: ignore[misc]
        )
        found = guess(tmp_path / "a.csv", text)
        assert (_wanted(found) == ["speed_rad_s"]) == yaws, found.text()


def test_a_rate_beside_x_and_y_may_be_a_heading_s(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A pose has one too; of a speed that is called the wheel's nothing is asked."""
    for name, wanted in (("omega", ["speed_rad_s"]), ("wheel_omega", [])):
        text = csv(run, f"t,x,y,{name},current", lambda i, t, w, c: f"{t},{w / 9 + t},{w / 8},{w / 10},{c}")
        assert _wanted(guess(tmp_path / "a.csv", text)) == wanted


@pytest.mark.parametrize("other", ["Speed_kmh", "speed [mph]", "Cadence_rpm", "pedal_rpm", "crank rpm"])
def test_what_a_motor_moves_stands_behind_its_own_speed(tmp_path: Path, run: rw_ekf.Log, other: str) -> None:
    """A vehicle's or a pedal's speed is passed over for the motor's, electrical too, and alone asked about."""
    text = csv(run, f"t_s,{other},ERPM,IMotor_A", lambda i, t, w, c: f"{t},{50 + w / 9},{w * RPM * 7},{c}")
    beside = guess(tmp_path / "a.csv", text).guess
    assert [question.text.split("'")[1] for question in beside.questions] == ["ERPM"]
    text = csv(run, f"t_s,{other},IMotor_A", lambda i, t, w, c: f"{t},{w / 9},{c}")
    assert _wanted(guess(tmp_path / "b.csv", text)) in (["speed_rad_s"], ["speed_rpm"])


@pytest.mark.parametrize(
    ("names", "wanted"),
    [
        ("Current,Voltage", True), ("ESC current [A],ESC voltage [V]", True),
        ("motor_hv_current,motor_hv_voltage", True),
        ("motor_current,voltage", False), ("iq,vbus", False), ("current,bus_voltage", False),
    ],
)  # fmt: skip
def test_a_voltage_that_holds_beside_a_current_is_the_supply_s(
    tmp_path: Path, run: rw_ekf.Log, names: str, *, wanted: bool
) -> None:
    """A motor's would go with its speed: then the current may be the supply's too, where nothing says whose it is."""
    text = csv(run, f"t_s,rpm,{names}", lambda i, t, w, c: f"{t},{w * RPM},{c},{24.0 - 0.1 * abs(c):.3f}")
    found = guess(tmp_path / "a.csv", text)
    assert _wanted(found) == (["current_A"] if wanted else []), found.text()


def test_a_current_beside_a_voltage_that_goes_with_the_speed_is_the_motor_s(tmp_path: Path, run: rw_ekf.Log) -> None:
    """So it is beside a commanded one, which nobody commands a supply."""
    text = csv(run, "t_s,rpm,current,voltage", lambda i, t, w, c: f"{t},{w * RPM},{c},{w * 0.02 + c * 0.3}")
    assert not _wanted(guess(tmp_path / "a.csv", text))
    text = csv(
        run,
        "t_s,rpm,current,voltage,current_set",
        lambda i, t, w, c: f"{t},{w * RPM},{c},{24.0 - 0.1 * abs(c):.3f},{c}",
    )
    assert not _wanted(guess(tmp_path / "b.csv", text))


def test_the_temperature_of_electronics_is_not_the_wheel_s(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A bridge warms with its current, and no friction goes with that."""
    for name, taken in (("temp_mos_C", False), ("esc_temp_c", False), ("motor_temp_C", True), ("T_bearing [°C]", True)):
        text = csv(run, f"t_s,rpm,i_A,{name}", lambda i, t, w, c: f"{t},{w * RPM},{c},{25 + i / 100}")
        assert ("temperature_degC" in guess(tmp_path / "a.csv", text).guess.mapping()) == taken


def test_an_angle_that_turns_as_no_unit_makes_it_is_of_something_else(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A gear's output is left out with a word; the wheel's own angle is taken."""
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (run.speed_rad_s[1:] + run.speed_rad_s[:-1]) * np.diff(run.time_s))])
    for ratio in (1.0, 1.0 / 18.0):
        text = csv(
            run,
            "t_s,rpm,i_A,angle_deg",
            lambda i, t, w, c, ratio=ratio: f"{t},{w * RPM},{c},{math.degrees(angle[i]) * ratio}",  # type: ignore[misc]
        )
        found = guess(tmp_path / "a.csv", text).guess
        assert ("angle_rad" in found.mapping()) == (ratio == 1.0)
        assert any("left out" in note for note in found.notes) == (ratio != 1.0)


def test_a_doubt_about_guessed_columns_is_a_warning_of_every_verb(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A current that explains next to nothing of the motion: `columns` doubts it, and a replay and a fit say so."""
    text = csv(run, "t_s,rpm,current", lambda i, t, w, c: f"{t},{w * RPM},{math.sin(i * i):.4f}")
    found = guess(tmp_path / "a.csv", text)
    assert len(found.doubts) == 1
    log = rw_ekf.read(tmp_path / "a.csv")
    for reported in (rw_ekf.replay(log), rw_ekf.fit(log)):
        assert sum(found.doubts[0] in warning for warning in reported.warnings) == 1
    with_map = rw_ekf.read(tmp_path / "a.csv", found.column_map)
    assert not any(found.doubts[0] in warning for warning in rw_ekf.replay(with_map).warnings)


@pytest.mark.parametrize(
    "names", ["Timp (s);Turație (rot/min);Curent (A)", "Χρόνος (s);Ταχύτητα (rpm);Ρεύμα (A)",
              "Thời gian (s);Tốc độ (vòng/phút);Dòng điện (A)", "Tid [s];Omdrejningstal [omdr/min];Motorstrøm [A]"],
)  # fmt: skip
def test_what_rises_in_a_unit_of_time_is_the_time_in_any_language(tmp_path: Path, run: rw_ekf.Log, names: str) -> None:
    """Where no word is known for it; a delay, whose word is known, is none."""
    text = csv(run, names, lambda i, t, w, c: f"{t!r};{w * RPM!r};{c!r}".replace(".", ","))
    assert not _wanted(guess(tmp_path / "a.csv", text))
    delay = text.replace(names.split(";", maxsplit=1)[0], "integral (s)")
    assert _wanted(guess(tmp_path / "b.csv", delay)) == ["time_s"]


def test_a_mark_between_names_and_rows_is_not_the_names(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`TRIP_START,,,` below the names; the word in front of names that are a comment is none of them either."""
    text = csv(run, "t_ms,motor_rpm,i_A,x\nTRIP_START,,,", lambda i, t, w, c: f"{1e3 * t:.0f},{w * RPM},{c},0")
    found = guess(tmp_path / "a.csv", text + "TRIP_END,,,\n")
    assert not _wanted(found)
    text = csv(run, "#FW,bench,1.2\n#COLS,t_ms,rpm,i_A", lambda i, t, w, c: f"{1e3 * t:.0f},{w * RPM},{c}")
    marked = guess(tmp_path / "b.csv", text)
    assert not _wanted(marked)
    assert marked.guess.mapping()["current_A"] == {"column": "i_A"}


def test_dates_of_serial_studio_are_read(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A stroke behind the day, and two colons before the thousandths."""

    def row(i: int, t: float, w: float, c: float) -> str:
        return f"2026/03/04/ 12:{int(t) // 60:02d}:{int(t) % 60:02d}::{round(t % 1 * 1e3):03d},{w * RPM},{c}"

    (tmp_path / "a.csv").write_text(csv(run, "RX Date/Time,Wheel/Speed(RPM),Wheel/Current(A)", row))
    log = rw_ekf.read(tmp_path / "a.csv")
    assert np.allclose(log.time_s - log.time_s[0], run.time_s - run.time_s[0], atol=1e-6)


@pytest.mark.parametrize(
    "name",
    [
        "laptop_current", "pack current [A]", "dyno current [A]", "load current [A]", "VDD_A", "I_inv [A]",
        "flux current [A]", "inverter current [A]", "amperageLatest",
    ],
)  # fmt: skip
def test_a_word_that_no_list_has_says_whose_a_current_is(tmp_path: Path, run: rw_ekf.Log, name: str) -> None:
    """Beside a word that is known, one that is not says of what it is: it is asked about, and can be answered."""
    path = tmp_path / "a.csv"
    assert _wanted(guess(path, csv(run, f"t_s,rpm,{name}", lambda i, t, w, c: f"{t},{w * RPM},{c}"))) == ["current_A"]
    assert rw_ekf.guess_columns(path, current=name).is_certain


@pytest.mark.parametrize(
    "name", ["Vsoll [rpm]", "synchronous speed [rpm]", "n_Feld [1/min]", "idler_rpm", "secondary rpm",
             "output shaft rpm", "belt speed [m/s]", "air speed (m/s)", "Limited Velocity (rpm)"],
)  # fmt: skip
def test_a_word_that_no_list_has_says_whose_a_speed_is(tmp_path: Path, run: rw_ekf.Log, name: str) -> None:
    """So it does of a speed; a set-point by its name is none that was measured."""
    text = csv(run, f"t_s,{name},i_mot_A", lambda i, t, w, c: f"{t},{w * RPM},{c}")
    assert [question.name.split("_")[0] for question in guess(tmp_path / "a.csv", text).guess.questions] == ["speed"]


@pytest.mark.parametrize(
    "names",
    [
        "RW4 speed [rpm],RW4 current [A]", "epos speed [rpm],epos current [A]", "n_mech [rpm],Irms [A]",
        "speed sensor [rpm],active current [A]", "rpm (corrected),torque-generating current [A]",
        "Vitesse mesurée (tr/min),courant moteur [A]", "motor optical speed (rpm),motor bridge current (A)",
    ],
)  # fmt: skip
def test_a_word_of_a_device_or_of_no_meaning_is_not_asked_about(tmp_path: Path, run: rw_ekf.Log, names: str) -> None:
    """What other names have too is a device's, and some words say nothing of whose it is."""
    text = csv(run, f"t_s,{names}", lambda i, t, w, c: f"{t},{w * RPM},{c}")
    assert not _wanted(guess(tmp_path / "a.csv", text))


def test_names_between_the_rows_of_which_one_is_another_are_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`i_mA` behind the first run, above it `i_A`: the rest of the names is the same, and the numbers are not."""

    def runs(name: str, scale: float) -> str:
        first = csv(run, "# run 1\nt_s,rpm,i_A", lambda i, t, w, c: f"{t:.3f},{w * RPM:.3f},{c:.5f}")
        return first + csv(run, f"# run 2\nt_s,rpm,{name}", lambda i, t, w, c: f"{t:.3f},{w * RPM:.3f},{c * scale:.5f}")

    assert _wanted(guess(tmp_path / "a.csv", runs("i_mA", 1e3))) == ["layout"]
    assert not _wanted(guess(tmp_path / "b.csv", runs("i_A", 1.0)))


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("time,speed_rpm,current_A", "PT{t:.3f}S,{n!r},{c!r}"),
        ("Source,CH1,CH2\nSecond,rpm,A", "{t:.4f},{n!r},{c!r}"),
        ("t_ms,rpm_u16,i_mA_i16", "{ms:.0f},{wrapped},{ma}"),
    ],
)
def test_durations_and_types_of_numbers_are_read(tmp_path: Path, run: rw_ekf.Log, head: str, row: str) -> None:
    """ISO 8601's `PT0.1S`, seconds below a name that says nothing of time, and a unit in front of a number's type."""

    def line(i: int, t: float, w: float, c: float) -> str:
        return row.format(t=t, ms=1e3 * t, n=w * RPM, c=c, wrapped=round(w * RPM) % 65536, ma=round(1e3 * c))

    (tmp_path / "a.csv").write_text(csv(run, head, line))
    log = rw_ekf.read(tmp_path / "a.csv")
    assert np.allclose(log.time_s, run.time_s, atol=1e-3)
    assert np.allclose(log.speed_rad_s, run.speed_rad_s, atol=0.51 / RPM)
    assert np.allclose(log.current_A, run.current_A, atol=6e-4)


def test_a_frequency_stands_behind_a_speed_in_rpm(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Of pulses or of a field it says less; where it stands alone it is asked about, as before."""
    text = csv(run, "t_s,rpm,freq_hz,i_mot_A", lambda i, t, w, c: f"{t},{w * RPM},{w * RPM / 15},{c}")
    assert not _wanted(guess(tmp_path / "a.csv", text))
    text = csv(run, "t_s,freq_hz,i_mot_A", lambda i, t, w, c: f"{t},{w * RPM / 15},{c}")
    assert _wanted(guess(tmp_path / "b.csv", text)) == ["speed_rad_s"]


def test_lists_of_numbers_in_lines_are_columns_without_names(tmp_path: Path, run: rw_ekf.Log) -> None:
    """They go by their number: all is asked, and the answers read the log."""
    path = tmp_path / "a.jsonl"
    rows = zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)
    path.write_text("".join(f"[{t!r}, {w!r}, {c!r}]\n" for t, w, c in rows))
    assert len(rw_ekf.guess_columns(path).guess.questions) == 3
    reported = rw_ekf.guess_columns(path, time="0:s", speed="1:rad/s", current="2:A")
    assert np.array_equal(rw_ekf.read(path, reported).speed_rad_s, run.speed_rad_s)
