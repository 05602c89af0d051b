"""Names in other languages, and the forms of drives, PLCs and oscilloscopes: what they say is heard, or asked about."""

from __future__ import annotations

from pathlib import Path

import pytest

import rw_ekf
from rw_ekf.errors import LogError
from rw_ekf.units import RAD_S_PER_RPM
from tests.foreign_logs import csv, guess, read_with

RPM = 1.0 / RAD_S_PER_RPM


@pytest.fixture(scope="module")
def run() -> rw_ekf.Log:
    """30 s of a simulated wheel at 10 Hz, in both directions."""
    return rw_ekf.simulate("steps", duration_s=30.0, seed=33)


def _wanted(path: Path, run: rw_ekf.Log, speed: str, drive: str) -> list[str]:
    """What is asked of a log whose speed and drive are called so."""
    text = csv(run, f"time_s;{speed};{drive}", lambda i, t, w, c: f"{t!r};{w * RPM!r};{c!r}")
    return [question.name.split("_")[0] for question in guess(path / "a.csv", text).guess.questions]


@pytest.mark.parametrize(
    "name",
    [
        "Heizstrom [A]", "Bremsstrom [A]", "Erregerstrom [A]", "Blindstrom [A]", "Zwischenkreisstrom [A]",
        "Strombegrenzung [A]", "Lastmoment [Nm]", "Reibmoment [mNm]", "Courant batterie (A)", "Courant d'entrée [A]",
        "Corriente de entrada (A)", "limite de courant (A)", "par de carga [Nm]", "入力電流[A]", "输入电流(A)",
        "总电流(A)", "励磁电流(A)", "負荷トルク[N·m]", "负载转矩(N·m)", "tau_ext [Nm]", "cogging_torque_Nm",
        "Hall voltage [V]", "Tachospannung [V]", "MTQ current [mA]", "Iq_ff [A]", "Stromregler I-Anteil",
    ],
)  # fmt: skip
def test_another_current_or_torque_is_asked_about_in_other_languages(
    tmp_path: Path, run: rw_ekf.Log, name: str
) -> None:
    """A supply's, a heater's, a load's, a limit: a compound whose first part no list has says that it is of that."""
    assert _wanted(tmp_path, run, "n [rpm]", name) == ["current"]


@pytest.mark.parametrize(
    "name",
    [
        "Motorstrom [A]", "Ankerstrom [A]", "Iststrom [A]", "Stromistwert [A]", "Momentenbildender Strom [A]",
        "Wirkstrom [A]", "Courant d'induit [A]", "courant moteur (A)", "Antriebsmoment [Nm]", "电机电流(A)",
        "电枢电流(A)", "驱动电流(A)", "反馈电流(A)", "q軸電流[A]", "電機子電流[A]", "モータ電流[A]", "モータトルク[Nm]",
        "모터 전류(A)", "Iref [A]",
    ],
)  # fmt: skip
def test_a_motors_own_is_not(tmp_path: Path, run: rw_ekf.Log, name: str) -> None:
    """Where all parts of a compound are known ones, there is nothing to ask."""
    assert not _wanted(tmp_path, run, "n [rpm]", name)


@pytest.mark.parametrize(
    "name",
    [
        "Elektrische Drehzahl [1/min]", "Vitesse électrique (tr/min)", "velocidad eléctrica (rpm)",
        "velocità elettrica [rpm]", "电角速度(rad/s)", "電気角速度[rad/s]", "Schlupf [1/min]", "slip [rpm]",
        "omega_z [rad/s]", "rate_z_dps", "sat_omega_rad_s", "Synchrondrehzahl [1/min]", "gyroADC[1]", "gz (deg/s)",
    ],
)  # fmt: skip
def test_no_speed_of_the_wheel_is_taken_for_it(tmp_path: Path, run: rw_ekf.Log, name: str) -> None:
    """An electrical speed, a slip, the turning of what carries the wheel."""
    assert _wanted(tmp_path, run, name, "I [A]") == ["speed"]


@pytest.mark.parametrize(
    "name",
    [
        "U/min", "r/min", "min⁻¹", "giri/min", "Vitesse mesurée (tr/mn)", "rotações/min", "r.p.m.", "转每分",
        "Wellendrehzahl [1/min]", "Messdrehzahl [U/min]", "Istdrehzahl (0x606C.00) [1/min]", "飞轮转速[rpm]",
        "フライホイール回転数[rpm]", "モーター回転速度(rpm)", "모터 회전수(rpm)", "wheel_z [rpm]", "rad s^-1",
    ],
)  # fmt: skip
def test_a_speed_that_says_its_unit_is_taken(tmp_path: Path, run: rw_ekf.Log, name: str) -> None:
    """Also where the unit is all that it is called, or an object of a drive stands beside it."""
    assert not _wanted(tmp_path, run, name, "I [A]")


def test_a_trend_of_a_controller_has_parts_of_a_second_behind_a_semicolon(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`10:31:02;120 AM`, with a word in front of each row."""
    head = "Trend Name:,Wheel,,\nSample Period:,100,ms,\n\nHeader:,Date,Time,Speed_rpm,Current_A"

    def line(i: int, t: float, w: float, c: float) -> str:
        return f"Data:,3/4/2026,09:59:{int(t) + 10:02d};{round(1e3 * (t % 1.0)):03d} AM,{w * RPM!r},{c!r}"

    guess(tmp_path / "a.csv", csv(run, head, line))
    log = rw_ekf.read(tmp_path / "a.csv")
    assert log.time_s - log.time_s[0] == pytest.approx(run.time_s, abs=1e-3)
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s)


def test_an_oscilloscope_has_start_and_increment_behind_its_columns(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Names and rate are heard; how fast a volt of a tachometer is, nobody says, and the answer is one."""
    head = "X,CH1,CH2,Start,Increment,\nSequence,Volt,Ampere,-1.000000e+01,1.000000e-01"
    found = guess(tmp_path / "a.csv", csv(run, head, lambda i, t, w, c: f"{i},{0.01 * w:.6e},{c:.6e},,"))
    assert found.guess.options == {"rate_hz": pytest.approx(10.0)}
    chosen = rw_ekf.guess_columns(tmp_path / "a.csv", speed="CH1 [Volt]")
    assert [question.text for question in chosen.guess.questions] == [
        "column 'CH1 [Volt]' is in Volt: how fast is one? --set speed.unit=rpm --set speed.scale=RPM_OF_ONE."
    ]
    reported = rw_ekf.guess_columns(tmp_path / "a.csv", speed="CH1 [Volt]", speed__unit="rpm", speed__scale=100.0 * RPM)
    log = rw_ekf.read(tmp_path / "a.csv", columns=reported.column_map)
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s, abs=1e-3)


def test_a_remark_of_each_symbol_has_its_unit(tmp_path: Path, run: rw_ekf.Log) -> None:
    """TwinCAT's `SymbolComment`, its key above each time."""
    keys = {"Name": ("nAct", "iAct"), "SampleTime[ms]": ("100", "100"), "SymbolComment": ("speed [rpm]", "drive [mA]")}
    head = "\n".join(f"{key}\t{first}\t{key}\t{second}" for key, (first, second) in keys.items())
    guess(tmp_path / "a.csv", csv(run, head, lambda i, t, w, c: f"{100 * i}\t{w * RPM!r}\t{100 * i}\t{1e3 * c!r}"))
    assert rw_ekf.read(tmp_path / "a.csv").current_A == pytest.approx(run.current_A)


def test_messages_are_refused_as_what_they_are(tmp_path: Path) -> None:
    """And neither for a decimal comma nor for a line that is too long."""
    (tmp_path / "a.txt").write_text("Bench\n" + "Setting speed to 1200 rpm\nmotor ok, go on\n" * 9)
    with pytest.raises(LogError, match=r"no table.*`skip_rows`"):
        rw_ekf.guess_columns(tmp_path / "a.txt")
    found = guess(tmp_path / "b.csv", "Time,Event\n" + "".join(f"2026-03-04T10:10:{s}Z,on\n" for s in range(10, 20)))
    assert "messages and events" in found.text()


def test_a_map_keeps_what_was_said_of_the_file(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Rate, skipped rows and delimiter of the map that was given stand in the one that is written."""
    text = csv(run, "a;b\nn_rpm;I_A", lambda i, t, w, c: f"{w * RPM!r};{c!r}")
    (tmp_path / "a.csv").write_text(text)
    (tmp_path / "layout.yaml").write_text('rate_hz: 10\nskip_rows: 1\ndelimiter: ";"\n')
    found = rw_ekf.guess_columns(tmp_path / "a.csv", tmp_path / "layout.yaml")
    log = read_with(tmp_path / "a.csv", found.text())
    assert log.time_s == pytest.approx(run.time_s)
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s)


@pytest.mark.parametrize(
    "name",
    [
        "102 <IMOT> (VDC)", "I <A> (V)", "current (raw)", "I_mot (ADC)", "I_q15",
        "i_100",
    ],
)  # fmt: skip
def test_numbers_that_are_no_amperes_yet_are_asked_about(tmp_path: Path, run: rw_ekf.Log, name: str) -> None:
    """A sensor's volts; counts by their name or unit, with decimals, which no count has."""
    assert _wanted(tmp_path, run, "n [rpm]", name) == ["current"]


@pytest.mark.parametrize("name", ["101 <RPM> (VDC)", "rpm²", "erpm_100"])
def test_nor_a_speed_in_volts_or_hundreds(tmp_path: Path, run: rw_ekf.Log, name: str) -> None:
    """The last bracket is the unit."""
    assert _wanted(tmp_path, run, name, "I [A]")[0] == "speed"


@pytest.mark.parametrize(
    ("head", "mark"),
    [
        ("Zeit [s];Drehzahl [1/min];Motorstrom [A]\nMX840 SN:1;MX840;MX840", ";"),  # devices below the names: catman
        ("Drive\nTime (s);Motor speed used(01.01) [rpm];Motor current(01.07) [A]", ";"),  # numbers of parameters
        ("Kanal 1: C00051 Drehzahlistwert [1/min]\nKanal 2: C00054 Motorstrom [A]\nZeit [s];Kanal 1;Kanal 2", ";"),
        ("time_s,status.rpm[0],status.current_A[0]", ","),  # the first of several
    ],
)
def test_names_of_recorders_are_heard(tmp_path: Path, run: rw_ekf.Log, head: str, mark: str) -> None:
    """Whatever stands below, above or behind them."""
    guess(tmp_path / "a.txt", csv(run, head, lambda i, t, w, c: mark.join(map(repr, (t, w * RPM, c)))))
    log = rw_ekf.read(tmp_path / "a.txt")
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s)
    assert log.current_A == pytest.approx(run.current_A)


def test_a_word_before_each_number_is_its_name(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`t,0.1,n_rpm,58.5,I_A,0.2` in every row; one word alone is a mark of the row."""
    guess(tmp_path / "a.csv", csv(run, "", lambda i, t, w, c: f"t,{t!r}, n_rpm,{w * RPM!r}, I_A,{c!r}"))
    log = rw_ekf.read(tmp_path / "a.csv")
    assert log.time_s == pytest.approx(run.time_s)
    assert log.current_A == pytest.approx(run.current_A)
    marked = guess(tmp_path / "b.csv", csv(run, "", lambda i, t, w, c: f"DATA,{t!r},{w * RPM!r},{c!r}"))
    assert "its columns have no names" in marked.text()


@pytest.mark.parametrize("stated", ["采样周期(us),100000", "Sampling time [ms];100", "Log interval: 100 ms"])
def test_the_rate_of_rows_has_its_unit_before_or_behind_it(tmp_path: Path, run: rw_ekf.Log, stated: str) -> None:
    """In brackets, or behind a comma."""
    found = guess(tmp_path / "a.csv", csv(run, f"{stated}\nn_rpm,I_A", lambda i, t, w, c: f"{w * RPM!r},{c!r}"))
    assert found.guess.options == {"rate_hz": pytest.approx(10.0)}


def test_a_log_of_points_needs_no_names(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`stamp|path|value|type`, as CODESYS keeps data, and `stamp;path;value;path;value`, as a panel does."""

    def stamp(t: float) -> str:
        return f"2026-03-04T10:10:{10 + t:06.3f}"

    points = csv(run, "", lambda i, t, w, c: f"{stamp(t)}|P.n_rpm|{w * RPM!r}|REAL\n{stamp(t)}|P.i_A|{c!r}|REAL")
    panel = csv(run, "", lambda i, t, w, c: f"{stamp(t)};plc.n_rpm;{w * RPM!r};plc.i_A;{c!r};")
    for text in (points, panel):
        guess(tmp_path / "a.csv", text)
        log = rw_ekf.read(tmp_path / "a.csv")
        assert log.time_s - log.time_s[0] == pytest.approx(run.time_s, abs=1e-3)
        assert log.speed_rad_s == pytest.approx(run.speed_rad_s)


@pytest.mark.parametrize(
    "head",
    [
        "Bench;7;;\nTIMESTAMP;WHEEL SPEED;MOTOR CURRENT;GAIN\n-;rpm;A;-",  # a dash is no number of a row
        "Date;1;2;3\n;nWheel;iMotor;k\n;COM1;COM1;COM1\n;DT100;DT101;DT102\n;INT;INT;INT\ns;rpm;A;-",
        "時間(秒);电机转速(转/分);电机电流(A);k",
    ],
)
def test_names_and_units_stand_apart(tmp_path: Path, run: rw_ekf.Log, head: str) -> None:
    """Registers and types of numbers between them say nothing of a column."""
    clock = "0:00:{:06.3f}" if "STAMP" in head else "{!r}"
    guess(tmp_path / "a.csv", csv(run, head, lambda i, t, w, c: f"{clock.format(t)};{w * RPM!r};{c!r};1"))
    assert rw_ekf.read(tmp_path / "a.csv").speed_rad_s == pytest.approx(run.speed_rad_s)


def test_a_unit_that_is_set_is_no_answer_to_the_pole_pairs(tmp_path: Path, run: rw_ekf.Log) -> None:
    """An electrical speed without a unit: first what it is in, then by how many it is still to be divided."""
    text = csv(run, "time_s,omega_electrical,I [A]", lambda i, t, w, c: f"{t!r},{4.0 * w!r},{c!r}")
    assert guess(tmp_path / "a.csv", text).guess.questions
    (question,) = rw_ekf.guess_columns(tmp_path / "a.csv", speed__unit="rad/s").guess.questions
    assert "pole pairs" in question.text
    found = rw_ekf.guess_columns(tmp_path / "a.csv", speed__unit="rad/s", speed__scale="0.25")
    assert not found.guess.questions
    assert rw_ekf.read(tmp_path / "a.csv", found).speed_rad_s == pytest.approx(run.speed_rad_s)
