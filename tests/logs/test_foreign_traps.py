"""Logs that tempt a reader to a wrong meaning: each is read in the right one, or asked about."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

import rw_ekf
from rw_ekf.errors import LogError
from rw_ekf.logs.column_names import role_of, stated_by
from rw_ekf.logs.column_units import unit_of
from rw_ekf.logs.time_text import seconds_of
from rw_ekf.units import RAD_S_PER_RPM
from tests.foreign_logs import csv, guess

RPM = 1.0 / RAD_S_PER_RPM
Rows = list[tuple[float, float, float]]


def test_a_number_in_a_name_scales_nothing() -> None:
    """`current_2_A` is the second current, `speed [0.1 rpm]` a tenth of one."""
    for name in ("current_2_A", "current_10_A", "i_1_A"):
        unit = stated_by(name).unit
        assert unit is not None
        assert unit.factor == 1.0
    tenth = unit_of("0.1 rpm")
    assert tenth is not None
    assert tenth.factor == pytest.approx(0.1 * RAD_S_PER_RPM)
    assert unit_of("2 A") is None


def test_a_pwm_frequency_is_no_rate_of_rows(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Without a time, only a rate of the rows is one; a switching frequency, or a timer's, is asked past."""
    for text in ("# PWM frequency 20 kHz", "# timer interrupt 10 kHz", "# low-pass filter cut-off freq 50 Hz"):
        found = guess(tmp_path / "a.csv", csv(run, f"{text}\nrpm,current_A", lambda i, t, w, c: f"{w * RPM!r},{c!r}"))
        assert [question.name for question in found.guess.questions] == ["time_s"], text
    reported = guess(
        tmp_path / "b.csv", csv(run, "# sampling rate 10 Hz\nrpm,current_A", lambda i, t, w, c: f"{w * RPM!r},{c!r}")
    )
    assert reported.column_map.rate_hz == 10.0


def test_an_encoder_that_rises_is_no_clock(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A wheel that turns one way counts up, and a timer's rate stands above: it is no time all the same."""
    count = np.cumsum(np.abs(run.speed_rad_s) + 3.0).astype(int)
    text = csv(run, "# timer 1 kHz\nenc_count,rpm,current_A", lambda i, t, w, c: f"{count[i]},{w * RPM!r},{c!r}")
    assert "time_s" in [question.name for question in guess(tmp_path / "a.csv", text).guess.questions]


def test_the_part_of_a_second_is_no_clock(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Nanoseconds within a second begin anew each second; with the seconds beside them they are the time."""
    alone = csv(run, "nsec,rpm,current_A", lambda i, t, w, c: f"{round(1e9 * (t % 1.0))},{w * RPM!r},{c!r}")
    assert "time_s" in [question.name for question in guess(tmp_path / "a.csv", alone).guess.questions]
    both = csv(
        run, "sec,nsec,rpm,current_A", lambda i, t, w, c: f"{int(t)},{round(1e9 * (t - int(t)))},{w * RPM!r},{c!r}"
    )
    (tmp_path / "b.csv").write_text(both)
    log = rw_ekf.read(tmp_path / "b.csv")
    assert log.time_s == pytest.approx(run.time_s, abs=1e-6)


def test_a_reversed_sensor_is_turned_and_its_direction_column_heard(tmp_path: Path, run: rw_ekf.Log) -> None:
    """1 means backward where a dictionary says so; a remark that a sensor is reversed turns its sign."""
    header = (
        "# n   wheel speed, absolute [rpm]\n# d   direction (0 = forward ; 1 = backward)\n"
        "# i   motor current, sensor reversed [A]\nt_s,n,d,i"
    )
    text = csv(run, header, lambda i, t, w, c: f"{t!r},{abs(w) * RPM!r},{int(w < 0)},{-c!r}")
    (tmp_path / "a.csv").write_text(text)
    log = rw_ekf.read(tmp_path / "a.csv")
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s, abs=1e-6)
    assert log.current_A == pytest.approx(run.current_A, abs=1e-9)
    assert role_of(stated_by("direction of rotation")) == "direction"


def test_a_message_that_lacks_a_value_is_a_row_all_the_same(tmp_path: Path, run: rw_ekf.Log) -> None:
    """JSON lines of which some have no current: none is dropped, and no other row's current stands there."""
    rows = zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)
    lines = [
        json.dumps({"t_s": t, "speed_rad_s": w, "temp_degC": 20.0} | ({"current_A": c} if i % 7 else {}))
        for i, (t, w, c) in enumerate(rows)
    ]
    (tmp_path / "a.jsonl").write_text("\n".join(lines))
    log = rw_ekf.read(tmp_path / "a.jsonl")
    assert len(log) == len(run)
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s)


def test_a_decimal_comma_between_labels_is_no_separator(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`n= -1957,5 rpm` is a half more than 1957."""

    def comma(value: float) -> str:
        return f"{value:.6f}".replace(".", ",")

    text = csv(run, "start", lambda i, t, w, c: f"t={comma(t)} s; n= {comma(w * RPM)} rpm; i={comma(c)} A")
    (tmp_path / "a.txt").write_text(text)
    log = rw_ekf.read(tmp_path / "a.txt")
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s, abs=1e-5)
    assert log.current_A == pytest.approx(run.current_A, abs=1e-5)


def test_two_wheels_in_one_log_are_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Which speed and which current belong together, no name says."""
    text = csv(
        run, "t_s,rw1_rpm,rw2_rpm,rw1_A,rw2_A",
        lambda i, t, w, c: f"{t!r},{w * RPM!r},{1.3 * w * RPM + 5!r},{c!r},{0.8 * c!r}",
    )  # fmt: skip
    wanted = [question.name for question in guess(tmp_path / "a.csv", text).guess.questions]
    assert wanted == ["speed_rad_s", "current_A"]


@pytest.mark.parametrize(
    "header",
    [
        "t_s,n_el [rpm],current_A", "t_s,omega_e [rad/s],current_A", "t_s,we [rad/s],current_A",
        "t_s,speed_dem_rpm,current_A", "t_s,w_d [rad/s],current_A", "t_s,Profile_rpm,current_A",
        "t_s,fan_rpm,current_A", "t_s,gyro_z_rpm,current_A", "t_s,hall_freq_Hz,current_A", "t_s,omega [1/s],current_A",
        "t_s,rpm x10,current_A", "t_s,rpm/10,current_A", "t_s,rpm,I [1/10 A]", "t_s,rpm [rad/s],current_A",
        "# speed scale factor 0.1\nt_s,rpm,current_A", "t_s,rw1_rpm,rw2_current_A",
        "t_s,temp_degC,rpm,current_A", "t_s,rpm",
    ],
)  # fmt: skip
def test_what_no_motion_speaks_against_is_asked(tmp_path: Path, run: rw_ekf.Log, header: str) -> None:
    """Electrical, wanted, scaled or another machine's numbers move as a wheel's do: what names hint at is asked."""
    found = guess(tmp_path / "a.csv", csv(run, header, lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r}"))
    assert found.guess.questions, found.guess.mapping()


def test_a_factor_above_is_applied_to_counts_alone(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Numbers that are not whole may be products already, and an offset may be of either: both are asked."""
    head = "CH1.Name=Time\nCH1.Unit=s\nCH2.Name=Speed\nCH2.Unit=rpm\nCH2.Factor=0.1\nCH3.Name=Current\nCH3.Unit=A"
    done = csv(run, head, lambda i, t, w, c: f"{t!r};{w * RPM!r};{c!r}")
    shifted = csv(run, head + "\nCH2.Offset=500", lambda i, t, w, c: f"{t!r};{round(10.0 * w * RPM)};{c!r}")
    for text in (done, shifted):
        wanted = [question.text for question in guess(tmp_path / "a.txt", text).guess.questions]
        assert len(wanted) == 1
        assert "factor 0.1" in wanted[0]


def test_a_factor_of_each_signal_is_applied_or_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """In a table with a row a signal as in a column beside another: of counts it is applied, else it is a question."""
    for digits, certain in ((0, True), (3, False)):

        def line(i: int, t: float, w: float, c: float, digits: int = digits) -> str:
            speed, current = round(10.0 * w * RPM, digits or None), round(2e3 * c, digits or None)
            return f"{t!r},speed,{speed},rpm,0.1\n{t!r},current,{current},mA,0.5"

        found = guess(tmp_path / "a.csv", csv(run, "time_s,signal,value,unit,scale", line))
        assert found.guess.is_certain == certain
    beside = csv(run, "t_s,rpm,rpm_scale,current_A", lambda i, t, w, c: f"{t!r},{10.0 * w * RPM:.0f},0.1,{c!r}")
    guess(tmp_path / "b.csv", beside)
    assert rw_ekf.read(tmp_path / "b.csv").speed_rad_s == pytest.approx(run.speed_rad_s, abs=0.06 / RPM)


def test_a_step_without_a_unit_may_be_of_ms(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Of 10 it is asked, .1 is seconds; kHz are no Hz."""
    for stated, rate_hz in (({"dt": 100.0}, None), ({"dt": 0.1}, 10.0), ({"fs_kHz": 0.01}, 10.0)):
        np.savez(tmp_path / "a.npz", speed_rpm=run.speed_rad_s * RPM, current_A=run.current_A, **stated)  # type: ignore[arg-type]
        found = rw_ekf.guess_columns(tmp_path / "a.npz")
        assert found.guess.options.get("rate_hz") == rate_hz, stated
        assert found.guess.is_certain == (rate_hz is not None)


def test_counts_of_kelvin_become_degrees(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A unit with another zero is taken of what the factor makes of counts, not of the counts."""
    units = (("time", "s", ""), ("speed", "rpm", ""), ("current", "A", ""), ("temperature", "K", "\nFactor=0.1"))
    head = "\n".join(f"[Channel {n}]\nName={name}\nUnit={u}{more}" for n, (name, u, more) in enumerate(units, 1))
    (tmp_path / "a.txt").write_text(
        csv(run, f"{head}\n[Data]", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r},{2931 + i}")
    )
    log = rw_ekf.read(tmp_path / "a.txt")
    assert log.table["temperature_degC"].to_numpy() == pytest.approx(19.95 + 0.1 * np.arange(log.time_s.size))


def test_r_is_right_beside_l_and_reverse_beside_f(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A letter that means one way here and the other there is read by what stands beside it, and refused alone."""
    forward = {"FR": "F", "LR": "R"}
    for letters, ahead in forward.items():
        other = letters.replace(ahead, "")
        header = "t_s,dir,rpm,current_A"
        (tmp_path / "a.csv").write_text(
            csv(run, header, lambda i, t, w, c: f"{t!r},{ahead if w >= 0 else other},{abs(w) * RPM!r},{c!r}")  # noqa: B023
        )
        assert rw_ekf.read(tmp_path / "a.csv").speed_rad_s == pytest.approx(run.speed_rad_s)
    (tmp_path / "a.csv").write_text(
        csv(run, "t_s,dir,rpm,current_A", lambda i, t, w, c: f"{t!r},R,{abs(w) * RPM!r},{c!r}")
    )
    with pytest.raises(rw_ekf.Error, match="is to be a direction and says 'r'"):
        rw_ekf.read(tmp_path / "a.csv")


def test_streams_of_two_wheels_are_no_log(tmp_path: Path) -> None:
    """Lines that Loki has under different labels are refused, with the labels."""
    streams = [{"stream": {"wheel": w}, "values": [[f"{k}000000000", "rpm=1 A=2"] for k in range(9)]} for w in "xy"]
    (tmp_path / "a.json").write_text(json.dumps({"resultType": "streams", "result": streams}))
    with pytest.raises(rw_ekf.Error, match=r"2 streams of Loki \(wheel=x; wheel=y\): ask Loki for one"):
        rw_ekf.read(tmp_path / "a.json")


def test_a_signal_whose_unit_changes_is_no_column(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A column of units says one for each signal; where one has two, no number of it is taken."""
    text = csv(
        run, "time,signal,value,unit",
        lambda i, t, w, c: f"{t!r},speed,{w if i < 99 else w * RPM!r},{'rad/s' if i < 99 else 'rpm'}\n"
        f"{t!r},current,{c!r},A",
    )  # fmt: skip
    assert "speed_rad_s" in [question.name for question in guess(tmp_path / "a.csv", text).guess.questions]


def test_the_current_of_the_q_axis_goes_before_phases_with_a_word(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`iq` makes the torque, in its drive's convention, which is said; an armature has no phases."""
    text = csv(run, "t_s,ia,ib,iq,rpm", lambda i, t, w, c: f"{t!r},{c * (i % 2)!r},{-c!r},{c!r},{w * RPM!r}")
    found = guess(tmp_path / "a.csv", text)
    assert found.guess.mapping()["current_A"] == {"column": "iq"}
    assert any("per ampere of the q axis" in note for note in found.guess.notes)
    armature = csv(run, "t_s,armature current ia [A],rpm", lambda i, t, w, c: f"{t!r},{c!r},{w * RPM!r}")
    assert not guess(tmp_path / "b.csv", armature).guess.questions


def test_dates_beside_times_of_day_count(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A pause of two days in a log with a column of dates is one; dates with points are no times of day."""
    text = csv(
        run, "Datum;Zeit;n [rpm];I [A]",
        lambda i, t, w, c: f"{1 + 2 * (i >= 300):02d}.03.2026;10.{i // 10 % 30:02d}.{6 * (i % 10):02d};"
        f"{w * RPM!r};{c!r}",
    )  # fmt: skip
    (tmp_path / "a.csv").write_text(text)
    log = rw_ekf.read(tmp_path / "a.csv")
    assert log.time_s[300] - log.time_s[299] > 2 * 86400.0 - 3600.0
    assert seconds_of(["01.02.24", "02.02.24", "03.02.24"]) == pytest.approx(1706745600.0 + 86400.0 * np.arange(3))
    assert seconds_of(["10.05.48", "10.05.49", "10.05.50"]) == pytest.approx(36348.0 + np.arange(3))


def test_reading_says_what_the_motion_speaks_against(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A speed without its sign reads as it stands, and the log's own warnings say so; another wheel's current too."""
    (tmp_path / "a.csv").write_text(csv(run, "t_s,rpm,i_A", lambda i, t, w, c: f"{t!r},{abs(w) * RPM!r},{c!r}"))
    assert any("the log is misread" in text for text in rw_ekf.read(tmp_path / "a.csv").warnings)
    odd = np.random.default_rng(3).permutation(run.current_A)
    (tmp_path / "b.csv").write_text(csv(run, "t_s,rpm,i_A", lambda i, t, w, c: f"{t!r},{w * RPM!r},{float(odd[i])!r}"))
    found = rw_ekf.guess_columns(tmp_path / "b.csv")
    assert any("drive and friction explain" in text for text in found.doubts)
    assert any("drive and friction explain" in text for text in rw_ekf.read(tmp_path / "b.csv").warnings)


def test_a_set_point_beside_the_reading_is_passed_over(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`SV` is what was wanted and `PV` what came of it; a column `n` that counts the rows is no speed."""
    text = csv(run, "n,t_s,SV [rpm],PV [rpm],current_A", lambda i, t, w, c: f"{i},{t!r},100,{w * RPM!r},{c!r}")
    found = guess(tmp_path / "a.csv", text)
    assert found.guess.mapping()["speed_rpm"] == {"column": "PV [rpm]"}
    rows = csv(run, "n;t;current_A", lambda i, t, w, c: f"{i};{t!r};{c!r}")
    assert "speed_rad_s" in [question.name for question in guess(tmp_path / "b.csv", rows).guess.questions]


def test_what_was_set_is_not_asked_again(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Who names the column has looked at it."""
    text = csv(run, "t_s,spindle_rpm,current_A", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r}")
    assert guess(tmp_path / "a.csv", text).guess.questions
    assert rw_ekf.guess_columns(tmp_path / "a.csv", speed="spindle_rpm").is_certain


def test_the_rows_of_one_wheel_are_taken_where_an_id_tells_them_apart(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Two wheels in turn are asked about; `--set only=` takes one of them, and the map that is written does too."""
    text = csv(
        run, "t_s,wheel_id,rpm,current_A",
        lambda i, t, w, c: f"{t!r},1,{0.7 * w * RPM!r},{0.3 * c!r}\n{t!r},2,{w * RPM!r},{c!r}",
    )  # fmt: skip
    wanted = guess(tmp_path / "a.csv", text).guess.questions
    assert [question.name for question in wanted] == ["only"]
    chosen = rw_ekf.guess_columns(tmp_path / "a.csv", only="wheel_id:2")
    assert chosen.is_certain
    chosen.save(tmp_path / "map.yaml")
    log = rw_ekf.read(tmp_path / "a.csv", columns=tmp_path / "map.yaml")
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s, abs=1e-9)
    with pytest.raises(rw_ekf.errors.LogError, match="no row has '3' in column 'wheel_id', which holds 1, 2"):
        rw_ekf.guess_columns(tmp_path / "a.csv", only="wheel_id:3")


def test_clocks_of_two_signals_that_differ_are_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A current with a clock of its own was not measured when the speed beside it was."""
    text = csv(
        run, "t_speed_s,rpm,t_current_s,current_A", lambda i, t, w, c: f"{t!r},{w * RPM!r},{t - 1.7!r},{c!r}"
    )  # fmt: skip
    assert "time_s" in [question.name for question in guess(tmp_path / "a.csv", text).guess.questions]


def test_rates_that_are_of_something_else_or_differ_are_none(tmp_path: Path, run: rw_ekf.Log) -> None:
    """An excitation's, one before decimation, and two that contradict each other."""
    for text in (
        "# excitation rate 50 Hz",
        "# ADC sampling rate 1 kHz, decimated by 100",
        "# rate 10 Hz\n# rate 20 Hz",
    ):
        found = guess(tmp_path / "a.csv", csv(run, f"{text}\nrpm,current_A", lambda i, t, w, c: f"{w * RPM!r},{c!r}"))
        assert "time_s" in [question.name for question in found.guess.questions], text


def test_lines_of_a_disc_are_no_counts_of_a_turn(tmp_path: Path, run: rw_ekf.Log) -> None:
    """1024 lines have 4096 edges: whether they are counted is asked."""
    count = np.cumsum(run.speed_rad_s).astype(int)
    text = csv(
        run, "# encoder: 1024 lines per turn\nt_s,enc_counts,current_A", lambda i, t, w, c: f"{t},{count[i]},{c!r}"
    )
    assert "speed_rad_s" in [question.name for question in guess(tmp_path / "a.csv", text).guess.questions]
    reported = text.replace("1024 lines per turn", "1024 lines, x4 decoding = 4096 counts/rev")
    line = next(line for line in guess(tmp_path / "b.csv", reported).guess.lines if line.name == "speed_rad_s")
    assert line.entry["counts_per_turn"] == 4096.0


def test_a_point_that_may_be_between_thousands_is_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`1.234` beside `987`, and never another number of digits behind the point."""
    text = csv(
        run, "t_s;rpm;current_A",
        lambda i, t, w, c: f"{t:.1f};{f'{int(90 * w * RPM):,d}'.replace(',', '.')};{c:.3f}",
    )  # fmt: skip
    assert "layout" in [question.name for question in guess(tmp_path / "a.csv", text).guess.questions]


@pytest.mark.parametrize(
    "header",
    """
    # rpm as the ESC sends it, 14 poles|t_s,rpm,current_A   # encoder on the motor, wheel behind 4:1|t_s,rpm,current_A
    # rpm = 0.25 * rpm_raw - 8000|t_s,rpm_raw,current_A         # current: ten turns through the clamp|t_s,rpm,current_A
    # current of the bench supply|t_s,rpm,current_A             # rates in deg/s|t_s,omega,current_A
    t_s,Speed [0.25 rpm],current_A      t_s,Speed (thousands of rpm),current_A      t_s,rpm,I [dA]      t_s,rpm,I [%FS]
    t [cs],rpm,current_A        t_s,rpm,current_limit_A     t_s,rpm,I_mon [V]       t_s,rpm,ACS712 [V]
    t_s,rpm,humidity [%]        t_s,rpm,axial load [N]      t_s,rpm,reaction torque [mNm]
    t_s,motor speed (Hz),current_A      t_s,n* [rpm],current_A      t_s,yaw_rate_rad_s,rw_current_A
    t_s,n(A) [rpm],i_A      t_s,gearbox_output_rpm,current_A
    t_s,rpm1,current2_A     t_s,left_rpm,right_current_A        ,Load machine,Wheel motor|t_s,n [rpm],I [A]
    ;Sollwert;Istwert|t_s;n [rpm];i [A]     # speed scale factor 0.1, not yet applied|t_s,rpm,current_A
    # eRPM read directly from the ESC, 14 poles|t_s,rpm,current_A       # resolution 0.125 rpm per bit|t_s,rpm,current_A
    # speed in tenths of rpm|t_s,rpm,current_A      # all channels: value x 100|t_s,rpm,current_A
    # all currents in mA|t_s,rpm,current       t_s,rpm,I [App]        t_s,speed_cmd_V,current_limit_A
    # current: zero offset 0.06 A, not subtracted|t_s,rpm,current_A     t_s,wheel vibration [mV],speed command (%)
    # speed channel is delayed by 0.5 s against the current|t_s,rpm,current_A
    """.strip()
    .replace("\n", "   ")
    .split("   "),
)
def test_words_beside_a_column_are_heard(tmp_path: Path, run: rw_ekf.Log, header: str) -> None:
    """Prose above the names, rows of groups, brackets that are no unit, quantities that drive no wheel: all asked."""
    header = header.strip().replace("|", "\n")
    mark = ";" if ";" in header else ","
    text = csv(run, header, lambda i, t, w, c: mark.join((f"{t!r}", f"{w * RPM!r}", f"{c!r}")))
    found = guess(tmp_path / "a.csv", text)
    assert found.guess.questions, found.guess.mapping()


@pytest.mark.parametrize(
    ("header", "name", "unit"),
    [
        ("t_s,omega_deg_s_filt,current_A", "speed_rad_s", "deg/s"),
        ("t_s,rpm,motor_current_mA_mean", "current_A", "mA"),
        ("czas [s],pr\u0119dko\u015b\u0107 obrotowa [obr/min],pr\u0105d silnika [mA]", "current_A", "mA"),
        ("zaman_s,motor_hizi_dev_dk,motor_akimi_mA", "current_A", "mA"),
        ("\uc2dc\uac04 [s],\ud68c\uc804\uc18d\ub3c4 [rpm],\ubaa8\ud130 \uc804\ub958 [mA]", "current_A", "mA"),
        ("# 7 pole pairs\nt_s,erpm,current_mA", "current_A", "mA"),
        ("t_s,102 <tacho> (rpm),103 <shunt motor> (mA)", "current_A", "mA"),
    ],
)
def test_a_unit_is_found_wherever_it_stands(tmp_path: Path, run: rw_ekf.Log, header: str, name: str, unit: str) -> None:
    """In the middle of a name, behind another bracket, in other languages; pole pairs that a line says divide."""
    text = csv(run, header, lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r}")
    found = guess(tmp_path / "a.csv", text)
    assert not found.guess.questions, found.guess.questions
    assert next(line for line in found.guess.lines if line.name == name).entry["unit"] == unit


def test_steps_that_several_units_would_fit_are_asked_about(tmp_path: Path) -> None:
    """Readings by hand every 10 s, decimal minutes, hours, 100 ns, and minutes with seconds: no unit says which."""
    rows = np.arange(400.0)
    speed = 300.0 * np.exp(-0.002 * rows) + 1.0
    for name, steps in {
        "time": 10.0 * rows[:41], "Elapsed": rows / 600.0, "Time": rows / 3600.0, "Timestamp": 1e6 * rows,
    }.items():  # fmt: skip
        text = f"{name},rpm\n" + "".join(f"{t:.8g},{w:.3f}\n" for t, w in zip(steps, speed, strict=False))
        assert "time_s" in [question.name for question in guess(tmp_path / "a.csv", text).guess.questions], name
    stamps = "".join(
        f"{int(t // 1200):02d}:{int(t // 20 % 60):02d},{w:.3f}\n" for t, w in zip(rows, speed, strict=True)
    )
    assert "time_s" in [question.name for question in guess(tmp_path / "b.csv", f"t,rpm\n{stamps}").guess.questions]


def test_a_drive_that_never_changes_is_no_coast_down(tmp_path: Path) -> None:
    """A wheel that slows down under a constant current did not coast."""
    text = "t_s,rpm,current_A\n" + "".join(
        f"{0.1 * i:.1f},{300 * math.exp(-0.01 * i) + 50:.2f},0.05\n" for i in range(400)
    )
    assert "current_A" in [question.name for question in guess(tmp_path / "a.csv", text).guess.questions]


def test_a_decimal_comma_with_three_digits_is_none_of_thousands(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`0,005` begins with no thousand."""
    text = csv(run, "Zeit [s]\tomega [rad/s]\tStrom [A]",
                lambda i, t, w, c: "\t".join(f"{value:.3f}".replace(".", ",") for value in (t, w, c)))  # fmt: skip
    (tmp_path / "a.txt").write_text(text)
    assert rw_ekf.read(tmp_path / "a.txt").speed_rad_s == pytest.approx(run.speed_rad_s, abs=1e-3)


def test_durations_with_their_unit_in_the_cells_are_times(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`0.01 sec`, as MATLAB writes a timetable; the map that is written reads it as well."""
    text = csv(run, "Time,omega_rad_s,Im_A", lambda i, t, w, c: f"{t!r} sec,{w!r},{c!r}")
    found = guess(tmp_path / "a.csv", text)
    found.save(tmp_path / "map.yaml")
    log = rw_ekf.read(tmp_path / "a.csv", columns=tmp_path / "map.yaml")
    assert log.time_s == pytest.approx(run.time_s)


@pytest.mark.parametrize(
    ("cell", "wanted"),
    [
        ("{x!r} mA|{x!r}", "no column is known to be the current"),  # a number without a unit among others
        ("{x!r} mA|{x!r} V", "no column is known to be the current"),
        ("{x!r} furlongs|{x!r} furlongs", "no column is known to be the current"),
    ],
)
def test_cells_whose_units_do_not_fit_each_other_are_no_numbers(
    tmp_path: Path, run: rw_ekf.Log, cell: str, wanted: str
) -> None:
    """One unit for all of a column, or of one quantity: else what it measures is not known."""
    kinds = cell.split("|")
    found = guess(tmp_path / "a.csv", csv(
        run, "Time,speed,current", lambda i, t, w, c: f"{t!r} s,{w!r} rad/s," + kinds[i % 2].format(x=1e3 * c + 1.0)
    ))  # fmt: skip
    assert [question.text.startswith(wanted) for question in found.guess.questions] == [True]


def test_a_unit_in_a_cell_speaks_louder_than_the_one_above(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`current [A]` over `12.3 mA`: the cells are in mA."""
    found = guess(
        tmp_path / "a.csv", csv(run, "t [s],n,I [A]", lambda i, t, w, c: f"{t!r} s,{w * RPM!r} rpm,{1e3 * c!r} mA")
    )
    log = rw_ekf.read(tmp_path / "a.csv", columns=found.column_map)
    assert log.current_A == pytest.approx(run.current_A)


@pytest.mark.parametrize("remark", ["x 10", "in 0.1 rpm", "supply current", "scale 0.1", "pole pairs 7"])
def test_a_remark_below_the_units_that_speaks_against_them_is_asked_about(
    tmp_path: Path, run: rw_ekf.Log, remark: str
) -> None:
    """A factor, another unit, a supply, a gear: what stands in a row of comments counts as much as a name."""
    header = f"Time,Wheel speed,Current\ns,rpm,mA\nrun 7,{remark},{remark}"
    assert not guess(
        tmp_path / "a.csv", csv(run, header, lambda i, t, w, c: f"{t!r},{w * RPM!r},{1e3 * c!r}")
    ).is_certain


def test_cells_with_units_and_no_names_say_what_they_are(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Milliseconds, revolutions a minute with a mark between thousands, and milliamperes."""
    text = csv(run, "log", lambda i, t, w, c: f"{1e3 * t!r} ms;{30.0 * w * RPM:,.9f} rpm;{1e3 * c!r} mA")
    assert "," in text
    guess(tmp_path / "a.txt", text)
    log = rw_ekf.read(tmp_path / "a.txt")
    assert log.time_s == pytest.approx(run.time_s)
    assert log.speed_rad_s == pytest.approx(30.0 * run.speed_rad_s)
    assert log.current_A == pytest.approx(run.current_A)


@pytest.mark.parametrize(
    "header",
    [
        "X,Y1,Y2\nA,V,C\nt [s],speed [rpm],current [mA]",
        "Device 1,Device 2,Device 3\ns,rpm,mA\ntime,speed,current",
        "Time,Speed,Current\ns,rpm,mA\nData:,,",
    ],
)
def test_names_are_not_lost_below_units_or_above_a_heading(tmp_path: Path, run: rw_ekf.Log, header: str) -> None:
    """The letters of a sheet's columns are no units of the names below them, a heading is no name of the first."""
    guess(tmp_path / "a.csv", csv(run, header, lambda i, t, w, c: f"{t!r},{w * RPM!r},{1e3 * c!r}"))
    log = rw_ekf.read(tmp_path / "a.csv")
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s)
    assert log.current_A == pytest.approx(run.current_A)


def test_a_velocity_beside_less_than_moteus_has_keeps_its_question(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Names that are anybody's have a program's units only where all that it writes stand together."""
    header = "timestamp,mode,position,velocity,q_current,d_current,voltage"
    found = guess(tmp_path / "a.csv", csv(run, header, lambda i, t, w, c: f"{t!r},1,{w!r},{w!r},{c!r},0.1,24"))
    assert "rpm, rad/s or deg/s" in found.text()


def test_lines_of_two_tags_or_tasks_are_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """ESP-IDF's tag is who says a line; its level is not."""
    text = csv(run, "boot", lambda i, t, w, c: f"{'IW'[i % 2]} ({round(1e3 * t)}) rw{i % 2}: w={w!r} rad/s i={c!r} A")
    assert not guess(tmp_path / "a.log", text).is_certain


def test_series_of_two_wheels_are_asked_about_and_of_other_times_put_on_one_clock(
    tmp_path: Path, run: rw_ekf.Log
) -> None:
    """Labels that tell series apart are in their names; a series with a hole is held at the times of the others."""

    def series(name: str, values: np.ndarray, first: int = 0, **labels: str) -> dict[str, object]:
        rows = list(zip(run.time_s.tolist(), map(repr, values.tolist()), strict=True))[first:]
        return {"metric": {"__name__": name, "job": "rw", **labels}, "values": rows}

    def answer(*found: dict[str, object]) -> str:
        return json.dumps({"status": "success", "data": {"resultType": "matrix", "result": found}})

    current = series("current_amperes", run.current_A, 3)
    two = answer(*(series("speed_rpm", k * run.speed_rad_s * RPM, wheel=f"rw{k}") for k in (1, 2)), current)
    assert "'series 0.wheel=rw1 speed_rpm'" in guess(tmp_path / "a.json", two).text()
    guess(tmp_path / "b.json", answer(series("speed_rpm", run.speed_rad_s * RPM), current))
    log = rw_ekf.read(tmp_path / "b.json")
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s)
    assert log.current_A[3:] == pytest.approx(run.current_A[3:])


def test_a_line_that_names_another_wheel_between_the_rows_is_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Two logs put under each other, each with its wheel's number above it."""
    one = csv(run, "t_s,rpm,current_A", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r}")
    text = f"# wheel SN 12\n{one}# wheel SN 15\n{one}"
    assert "layout" in [question.name for question in guess(tmp_path / "a.csv", text).guess.questions]
    other = text.replace("# wheel SN 15\nt_s,rpm,current_A", "zeit,sollwert,strom")
    assert "layout" in [question.name for question in guess(tmp_path / "b.csv", other).guess.questions]
    footer = f"{one}# speed is electrical, 7 pole pairs\n"
    assert "speed_rpm" in [question.name for question in guess(tmp_path / "c.csv", footer).guess.questions]


def test_rows_of_one_time_that_differ_in_a_column_are_of_several_wheels(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Whatever the column is called that tells them apart."""
    text = csv(
        run, "t_s,which,rpm,current_A",
        lambda i, t, w, c: f"{t!r},left,{0.7 * w * RPM!r},{0.3 * c!r}\n{t!r},right,{w * RPM!r},{c!r}",
    )  # fmt: skip
    assert "only" in [question.name for question in guess(tmp_path / "a.csv", text).guess.questions]


def test_a_time_of_day_without_colons_is_no_count_of_seconds(tmp_path: Path, run: rw_ekf.Log) -> None:
    """hhmmss: behind 125959 comes 130000."""
    text = csv(
        run, "time,rpm,current_A", lambda i, t, w, c: f"{120030 + t + 40 * (t >= 30):.1f},{w * RPM!r},{c!r}"
    )  # fmt: skip
    assert "time_s" in [question.name for question in guess(tmp_path / "a.csv", text).guess.questions]
    by_hand = "".join(f"{i // 6}.{i % 6}0,{300 - 4 * i}\n" for i in range(40))
    found = guess(tmp_path / "b.csv", f"time,rpm\n{by_hand}")
    assert "time_s" in [question.name for question in found.guess.questions]


def test_units_in_a_column_beside_are_heard(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`omega`, `omega_unit`; a set-point that has the published unit of the reading is none."""
    text = csv(
        run, "t_s,omega,omega_unit,current,current_unit,input_vel",
        lambda i, t, w, c: f"{t!r},{math.degrees(w)!r},deg/s,{1e3 * c!r},mA,{w!r}",
    )  # fmt: skip
    (tmp_path / "a.csv").write_text(text)
    log = rw_ekf.read(tmp_path / "a.csv")
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s, abs=1e-9)
    assert log.current_A == pytest.approx(run.current_A, abs=1e-12)


def test_counts_of_each_row_are_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Increments are a speed already; differentiated again they would be an acceleration."""
    head = "# 4096 counts per turn\nt_s,delta_counts,current_A"
    text = csv(run, head, lambda i, t, w, c: f"{t!r},{round(65 * w)},{c!r}")
    assert "speed_rad_s" in [question.name for question in guess(tmp_path / "a.csv", text).guess.questions]


@pytest.mark.parametrize(
    ("reported", "name", "wanted"),
    [
        ("2048 counts/rev|dcnt = encoder counts since previous line, every 100 ms", "dcnt", ""),
        ("2048 counts/rev|dcnt: encoder counts per sample", "dcnt", ""),
        ("2048 counts/rev", "enc_counts_per_100ms", ""),
        ("2048 counts/rev", "enc [counts/100 ms]", ""),
        ("dcnt = encoder counts since previous line", "dcnt", "how many to a turn"),
        ("2048 lines/rev, quadrature|dcnt = encoder counts since previous line", "dcnt", "how many to a turn"),
        ("2048 counts/rev|dcnt = encoder counts since previous line, every 20 ms", "dcnt", "over how long"),
        ("2048 counts/rev|cnt = encoder counts, every 100 ms", "cnt", "since the beginning"),
    ],
)
def test_counts_of_an_interval_are_a_speed_where_the_file_says_all(
    tmp_path: Path, run: rw_ekf.Log, reported: str, name: str, wanted: str
) -> None:
    """Counts of a turn, the interval and that they are of one row alone: what is not said, or not so, is asked."""
    turns = np.concatenate([[0.0], np.cumsum(run.speed_rad_s[1:] * np.diff(run.time_s))]) / (2.0 * math.pi)
    counts = np.diff(np.round(2048.0 * turns), prepend=0.0).astype(int)
    reported = reported.replace("|", "\n")
    text = csv(run, f"{reported}\nt_ms,{name},I_A", lambda i, t, w, c: f"{1000 * t:.0f},{counts[i]},{c!r}")
    found = guess(tmp_path / "a.csv", text)
    assert any(wanted in question.text for question in found.guess.questions) == bool(wanted)
    if not wanted:
        quantum = 2.0 * math.pi / 2048.0 / 0.1
        log = rw_ekf.read(tmp_path / "a.csv")
        assert log.speed_rad_s[1:] == pytest.approx(run.speed_rad_s[1:], abs=1.01 * quantum)


@pytest.mark.parametrize("other", ["b3 rwd[813]:", "b4 rwd[812]:", "b3 rwd[812]: wheel 2"])
def test_lines_of_two_speakers_are_asked_about(tmp_path: Path, run: rw_ekf.Log, other: str) -> None:
    """Two daemons, machines or wheels whose lines come in turn have the same labels, and may be of two wheels."""
    first = "b3 rwd[812]: wheel 1" if "wheel" in other else "b3 rwd[812]:"
    line = "2026-03-29T10:00:{:06.3f}Z {} rpm={} i_A={}"
    rows = zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)
    text = "".join(line.format(t % 60.0, who, w, c) + "\n" for t, w, c in rows for who in (first, other) if t < 60.0)
    questions = guess(tmp_path / "a.log", text).guess.questions
    assert any("of the same wheel" in question.text for question in questions)


@pytest.mark.parametrize(("value", "is_temperature"), [(0.002, False), (21.5, True)])
def test_t_c_alone_is_a_temperature_where_it_is_warm(
    tmp_path: Path, run: rw_ekf.Log, value: float, is_temperature: bool
) -> None:
    """`T_C` may be a Coulomb torque: what is far below any room's temperature is left alone."""
    text = csv(run, "t_s,rw2_rpm,current_A,T_C", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r},{value}")
    found = guess(tmp_path / "a.csv", text)
    assert found.is_certain
    assert ("temperature_degC" in [line.name for line in found.guess.lines]) == is_temperature


@pytest.mark.parametrize(
    ("header", "wanted"),
    [
        ("__time,/state/rw/velocity,/driver/current_A", "rpm, rad/s or deg/s"),
        ("__time,/joint_states/rw1/velocity,/joint_states/rw2/velocity,/driver/current_A", "which of them"),
        ("T_C,rpm,i_A", "no column is known to be the time"),
        ("t_case,rpm,i_A", "no column is known to be the time"),
        ("t_s,rpm,T_C", "no column is known to be the current"),
        ("t_s,rpm_B,current_A", "seem to be of two wheels"),
        ("t_s,rw2_rpm,rw1_current_A", "seem to be of two wheels"),
    ],
)
def test_what_a_name_is_near_to_is_asked(tmp_path: Path, run: rw_ekf.Log, header: str, wanted: str) -> None:
    """A topic that is no JointState's, two joints of one, a temperature for a time or a drive, two wheels."""
    count = header.count(",") - 1
    text = csv(run, header, lambda i, t, w, c: f"{t!r},{','.join([repr(w * (1 + k)) for k in range(count)])},{c!r}")
    assert any(wanted in question.text for question in guess(tmp_path / "a.csv", text).guess.questions)


def test_a_coast_down_that_was_none_is_asked_about(tmp_path: Path) -> None:
    """A state that says so, a line that says so, a quantity beside it that hardly moves."""
    fall = [(0.1 * i, 300.0 * math.exp(-0.01 * i) + 1.0) for i in range(400)]
    for head, more in (
        ("t_s,rpm,state", ",BRAKE"), ("# spin-down at constant current -20 mA\nt_s,rpm", ""),
        ("# drive torque: 2 mNm\nt_s,rpm", ""),
    ):  # fmt: skip
        text = f"{head}\n" + "".join(f"{t:.1f},{w:.3f}{more}\n" for t, w in fall)
        found = guess(tmp_path / "a.csv", text).guess
        assert any(question.name.startswith("current") for question in found.questions), head
    text = "t_s,rpm,voltage [V]\n" + "".join(f"{t:.1f},{w:.3f},{12.05 + 1e-4 * w:.4f}\n" for t, w in fall)
    assert [question.name for question in guess(tmp_path / "b.csv", text).guess.questions] == ["current_A"]


def test_a_coast_down_beside_what_moves_like_a_drive_is_asked_about(tmp_path: Path) -> None:
    """A column `Power` that falls with the speed may be what lets it fall; a battery's charge is none."""
    fall = [(0.1 * i, 300.0 * math.exp(-0.01 * i) + 1.0) for i in range(400)]
    for name, wanted in (("Power", ["current_A"]), ("effort", ["current_A"]), ("pressure [Pa]", [])):
        text = f"t_s,rpm,{name}\n" + "".join(f"{t:.1f},{w:.3f},{45.0 - 0.04 * w:.3f}\n" for t, w in fall)
        assert [question.name for question in guess(tmp_path / "a.csv", text).guess.questions] == wanted, name


def test_a_wheel_that_speeds_up_without_a_drive_is_told_so(tmp_path: Path) -> None:
    """`--set current=none` of a motor that was driven by what the log has not."""
    text = "t_s,rpm\n" + "".join(f"{0.1 * i:.1f},{100.0 + i}\n" for i in range(100))
    (tmp_path / "a.csv").write_text(text)
    notes = rw_ekf.guess_columns(tmp_path / "a.csv", current=None).guess.notes
    assert any("something drives the wheel" in note for note in notes)


def test_a_rate_of_rows_is_answered_on_the_line(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Without a column of time; what is no rate is refused."""
    path = tmp_path / "a.csv"
    path.write_text(csv(run, "rpm,current_A", lambda i, t, w, c: f"{w * RPM!r},{c!r}"))
    assert rw_ekf.guess_columns(path, rate_hz=10).column_map.rate_hz == 10.0
    for wrong in ("0", "often"):
        with pytest.raises(rw_ekf.Error, match="rate_hz"):
            rw_ekf.guess_columns(path, rate_hz=wrong)


def test_why_a_column_of_time_is_none_is_said(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Seconds that are called us; that the column was given does not make its rows half a nanosecond apart."""
    path = tmp_path / "a.csv"
    path.write_text(csv(run, "time_us,rpm,current_A", lambda i, t, w, c: f"{t * 5.0e-3!r},{w * RPM!r},{c!r}"))
    for given in ({}, {"time": "time_us"}):
        wanted = rw_ekf.guess_columns(path, **given).guess.questions
        assert any("5e-10 s apart" in question.text for question in wanted if question.name == "time_s"), given
    text = csv(run, "time_s,rpm,current_A", lambda i, t, w, c: f"{t if i != 1 else -3.0!r},{w * RPM!r},{c!r}")
    assert "time_s" not in [q.name for q in guess(tmp_path / "b.csv", text).guess.questions]


def test_a_limit_is_no_current_and_a_measurement_tells_no_wheel(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`Burst Current Cutoff (A)` beside `Current (A)`; an acceleration that alternates at each time."""
    text = csv(
        run, "t_s,rpm,Current (A),Burst Current Cutoff (A)", lambda i, t, w, c: f"{t},{w * RPM},{c},{40 + i % 2}"
    )
    assert not guess(tmp_path / "a.csv", text).guess.questions
    text = csv(run, "t_s,rpm,current_A,accelX",
                lambda i, t, w, c: f"{t},{w * RPM},{c},.25\n{t},{w * RPM},{c},-.0622")  # fmt: skip
    assert "only" not in [question.name for question in guess(tmp_path / "b.csv", text).guess.questions]


def test_a_q_axis_current_is_no_supply_s(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Where voltage and power beside it are zero throughout, every current is the supply's by arithmetic."""
    text = csv(run, "t_s,erpm [rpm],q_axis_current [A],power,voltage_in",
                lambda i, t, w, c: f"{t},{w * RPM},{c},{12.0 * c},12.0")  # fmt: skip
    wanted = guess(tmp_path / "a.csv", text).guess.questions
    assert not any("supply" in question.text for question in wanted)


def test_a_probe_s_sensitivity_beside_a_current_without_a_unit_is_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Volts of a probe look like amperes; where the name says the unit, the line is about the probe alone."""
    for name, open_ in (("current", ["current_A"]), ("current [A]", [])):
        text = f"# current probe 100 mV/A, range 10 A\nt_s,speed_rpm,{name}"
        found = guess(tmp_path / "a.csv", csv(run, text, lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r}"))
        assert [question.name for question in found.guess.questions] == open_


def test_a_step_of_time_without_a_unit_is_a_recorder_s_or_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`dt: 10` may be in ms, and so may a recorder's whose axis is in ms."""
    for head in ("t0: 0\ndt: 10", "start times:\n10:00:00\t10:00:00\nstep:\n0.1\t0.1"):
        found = guess(
            tmp_path / "a.csv",
            csv(run, f"{head}\nspeed [rpm]\tcurrent [A]", lambda i, t, w, c: f"{w * RPM!r}\t{c!r}"),
        )
        assert [question.name for question in found.guess.questions] == ["time_s"]


def test_two_devices_that_speak_in_words_are_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Lines without `=` or `:` before the numbers, of two tags in turn; a supply's current, too."""
    for tags, current in ((("rw1", "rw2"), "current"), (("rw1", "rw1"), "supply current")):
        found = guess(
            tmp_path / "a.log",
            csv(
                run,
                "boot",
                lambda i, t, w, c, tags=tags, current=current: (  # type: ignore[misc]
                    f"[00:00:{t:06.3f},000] <inf> {tags[i % 2]}: speed {w * RPM:.6f} rpm, {current} {c * 1e3:.6f} mA"
                ),
            ),
        )
        assert not found.guess.is_certain


@pytest.mark.parametrize(
    ("header", "per_rpm", "per_ampere"),
    [
        ("t_s,speed_raw (0.5 rpm/bit),current_raw (10 mA/bit)", 2.0, 100.0),
        ('t_s,"speed [0,25 rpm/LSB]",current_cA', 4.0, 100.0),
        ("t_s,rpm,current (dA)", 1.0, 10.0),
    ],
)
def test_a_unit_says_how_large_a_count_is(
    tmp_path: Path, run: rw_ekf.Log, header: str, per_rpm: float, per_ampere: float
) -> None:
    """Whole numbers are counts of what their unit says; of others it is asked whether they are multiplied already."""
    counts = csv(run, header, lambda i, t, w, c: f"{t!r},{round(w * RPM * per_rpm)},{round(c * per_ampere)}")
    log = rw_ekf.read(_written(tmp_path / "a.csv", counts))
    assert np.abs(log.speed_rad_s - run.speed_rad_s).max() <= 0.51 / per_rpm / RPM
    assert np.abs(log.current_A - run.current_A).max() <= 0.51 / per_ampere
    products = csv(run, header, lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r}")
    assert "current_A" in [question.name for question in guess(tmp_path / "b.csv", products).guess.questions]


@pytest.mark.parametrize(("scale", "warnings"), [("0.1", 1), ("1", 0)])
def test_a_factor_beside_a_column_of_the_logs_own_name_is_warned_about(
    tmp_path: Path, run: rw_ekf.Log, scale: str, warnings: int
) -> None:
    """`speed_rpm` is taken as its name says, and `speed_scale` beside it is said, unless it is 1."""
    header = "time_s,speed_rpm,current_A,speed_scale"
    text = csv(run, header, lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r},{scale}")
    log = rw_ekf.read(_written(tmp_path / "a.csv", text))
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s)
    assert len(log.warnings) == warnings
    assert all("0.1 in speed_scale" in warning for warning in log.warnings)


def test_a_factor_beside_a_name_with_a_unit_is_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`wheel_scale` is what `wheel_rpm` is times, or was: whole numbers alone do not tell."""
    header = "t_s,wheel_rpm,current_A,wheel_scale"
    text = csv(run, header, lambda i, t, w, c: f"{t!r},{round(w * RPM)},{c!r},0.1")
    questions = guess(tmp_path / "a.csv", text).guess.questions
    assert [(question.name, "0.1 in wheel_scale" in question.text) for question in questions] == [("speed_rpm", True)]


def test_betaflight_counts_erpm_in_hundreds(tmp_path: Path, run: rw_ekf.Log) -> None:
    """As blackbox-log-viewer reads its logs: eRPM in hundreds, half the poles divide it, currents in hundredths."""
    head = '"Product","Blackbox flight data recorder"\n"motor_poles","14"\n'
    names = "loopIteration,time,eRPM[0],amperageLatest"
    text = csv(
        run, head + names,
        lambda i, t, w, c: f"{i},{round(1e6 * t)},{round(7 * w * RPM / 100)},{round(100 * c)}",
    )  # fmt: skip
    path = _written(tmp_path / "a.csv", text)
    log = rw_ekf.read(path, rw_ekf.guess_columns(path, current="amperageLatest"))  # which is the battery's
    assert np.abs(log.speed_rad_s - run.speed_rad_s).max() <= 51.0 / 7.0 / RPM
    assert np.abs(log.current_A - run.current_A).max() <= 0.0051


def test_the_last_part_of_a_path_that_says_nothing_hides_no_unit(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A message of one number calls it `data`: `/wheel/current_ma.data` is in mA."""
    text = csv(
        run,
        "t_s,/wheel/speed_rpm.data,/wheel/current_ma.data",
        lambda i, t, w, c: f"{t!r},{w * RPM!r},{round(1e3 * c)}",
    )
    log = rw_ekf.read(_written(tmp_path / "a.csv", text))
    assert np.abs(log.current_A - run.current_A).max() <= 0.00051


@pytest.mark.parametrize(
    ("per_turn", "wrap"),
    [*((per, per) for per in (1000, 2400, 4000, 4096, 8000, 8192, 20000)), (4096, 65536), (4000, 65536)],
)
def test_an_encoder_begins_anew_where_its_jumps_say(tmp_path: Path, per_turn: int, wrap: int) -> None:
    """4000 counts are not taken for 4096, nor a counter's 16 bits for a turn: what no line says is asked."""
    fast = rw_ekf.simulate("steps", duration_s=60.0, seed=6)
    time_s = np.arange(0.0, 59.0, 0.004)
    speed = np.interp(time_s, fast.time_s, fast.speed_rad_s)
    counts = np.floor(np.cumsum(speed) * 0.004 / (2.0 * math.pi) * per_turn).astype(int) % wrap
    current = np.interp(time_s, fast.time_s, fast.current_A)
    rows = "".join(
        f"{t:.3f},{n},{c:.4f}\n" for t, n, c in zip(time_s.tolist(), counts.tolist(), current.tolist(), strict=True)
    )
    stated = f"# encoder: {per_turn} counts per turn\ntime_s,enc_counts,current_A\n"
    log = rw_ekf.read(_written(tmp_path / "said.csv", stated + rows))
    assert np.nanmax(np.abs(log.speed_rad_s - speed)) < 1.1 * 2.0 * math.pi / per_turn / 0.004
    found = guess(tmp_path / "wordless.csv", "time_s,enc_counts,current_A\n" + rows).guess
    assert found.is_certain == (per_turn in (4000, 4096, 8192) and wrap == per_turn)


def _written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "name",
    ["rpm_1k", "rpm_thousands", "rpm_per_1000", "rpm_k", "k_rpm", "rpm_in_hundreds", "n_Tsd"],
)
def test_a_word_that_says_how_large_a_number_is_is_asked_about(tmp_path: Path, run: rw_ekf.Log, name: str) -> None:
    """Thousands of rpm are no rpm."""
    found = guess(tmp_path / "a.csv", csv(run, f"t_s,{name},I_A", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r}"))
    assert [question.name for question in found.guess.questions] == ["speed_rpm"]
    assert "scaled" in found.guess.questions[0].text


@pytest.mark.parametrize(
    "name", ["rpm", "rpm_filt", "e1_rpm", "rpm_in_2", "Var1_rpm", "rpm (offset corrected)", "der(theta) [rad/s]"]
)
def test_a_name_that_hints_at_nothing_is_not_asked_about(tmp_path: Path, run: rw_ekf.Log, name: str) -> None:
    """A number or a word that says which column it is says nothing of its size."""
    found = guess(tmp_path / "a.csv", csv(run, f"t_s,{name},I_A", lambda i, t, w, c: f"{t!r},{w!r},{c!r}"))
    assert not found.guess.questions


def test_a_factor_behind_the_unit_is_asked_about_with_its_answers(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Of `current_A_x100` mA or A was asked, and either answer was wrong."""
    text = csv(run, "t_s,rpm,current_A_x100", lambda i, t, w, c: f"{t!r},{w * RPM!r},{100 * c:.0f}")
    (question,) = guess(tmp_path / "a.csv", text).guess.questions
    assert [answer.entry.get("scale") for answer in question.answers] == [None, 0.01, 100.0]


@pytest.mark.parametrize("name", ["rpm_delta", "rpm_noise", "rpm_rated", "rpm_ratio", "rpm_limit", "rpm_prev"])
def test_what_is_told_of_a_speed_is_not_taken_for_it(tmp_path: Path, run: rw_ekf.Log, name: str) -> None:
    """Alone it is asked about, and beside the speed it is none."""
    alone = csv(run, f"t_s,{name},I_A", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r}")
    assert [question.name for question in guess(tmp_path / "a.csv", alone).guess.questions] == ["speed_rpm"]
    beside = csv(run, f"t_s,{name},rpm,I_A", lambda i, t, w, c: f"{t!r},{c!r},{w * RPM!r},{c!r}")
    (line,) = [line for line in guess(tmp_path / "b.csv", beside).guess.lines if line.name == "speed_rpm"]
    assert line.entry["column"] == "rpm"


@pytest.mark.parametrize("header", ["t [s],n [Skt],I [mA]", "t,n,I\n[s],[Skt],[mA]"])
def test_a_unit_that_no_one_knows_is_not_the_usual_one(tmp_path: Path, run: rw_ekf.Log, header: str) -> None:
    """What is called n is in 1/min where nothing stands beside it."""
    found = guess(tmp_path / "a.csv", csv(run, header, lambda i, t, w, c: f"{t!r},{w * RPM * 7.3!r},{1e3 * c!r}"))
    assert ["Skt" in question.text for question in found.guess.questions] == [True]


def test_a_unit_in_json_that_no_one_knows_is_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """The same where a file has units beside its columns, and of one whose factor is in front."""
    for unit, factor, wanted in (("Skt", 7.3, 1), ("10 1/min", 0.1, 0)):
        content = {
            "t_s": run.time_s.tolist(), "n": (run.speed_rad_s * RPM * factor).tolist(), "I_A": run.current_A.tolist(),
        }  # fmt: skip
        path = tmp_path / "a.json"
        path.write_text(json.dumps({**content, "n": {"unit": unit, "values": content["n"]}}))
        assert len(rw_ekf.guess_columns(path).guess.questions) == wanted
    assert rw_ekf.read(path).speed_rad_s == pytest.approx(run.speed_rad_s)


@pytest.mark.parametrize(("bits", "per_turn"), [(12, 1000), (15, 1440)])
def test_a_counter_that_begins_anew_is_taken_for_a_turn_with_a_word(tmp_path: Path, bits: int, per_turn: int) -> None:
    """No motion tells how many counts are a turn; an angle is a turn by its name, and needs no word."""
    time = np.arange(0.0, 60.0, 0.01)
    turns = np.cumsum(12.0 * np.sin(0.2 * time)) * 0.01
    for name, warned in (("encoder", True), ("angle", False)):
        rows = zip(time.tolist(), (np.floor(turns * per_turn).astype(int) % 2**bits).tolist(), strict=True)
        path = tmp_path / f"{name}.csv"
        path.write_text(f"t_s,{name},I_A\n" + "".join(f"{t:.2f},{n},{0.2 * math.cos(0.2 * t)!r}\n" for t, n in rows))
        stated = [text for text in rw_ekf.read(path).warnings if "taken for a turn" in text]
        assert bool(stated) == warned
    reported = rw_ekf.guess_columns(tmp_path / "encoder.csv", speed__counts_per_turn=per_turn)
    assert not reported.guess.warnings
    log = rw_ekf.read(tmp_path / "encoder.csv", reported)
    assert float(np.nanmax(log.speed_rad_s)) == pytest.approx(12.0 * 2.0 * math.pi, rel=0.02)


def test_a_part_of_a_second_stands_beside_dated_times(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A date, a time and ms in three columns: the ms were left out where the dates are of two days."""

    def line(row: int, t: float, w: float, c: float) -> str:
        ms = round(1000.0 * t) + 7 * (row % 3)  # as no clock that is spread evenly has it
        day, second = divmod(86370 + ms // 1000, 86400)
        clock = f"{second // 3600:02d}:{second // 60 % 60:02d}:{second % 60:02d}"
        return f"{3 + day:02d}.05.2024;{clock};{ms % 1000};{w * RPM!r};{c!r}"

    path = tmp_path / "a.csv"
    path.write_text(csv(run, "Date;Time;Millisec;Speed_rpm;Current_A", line))
    due = np.round(run.time_s, 3) + 0.007 * (np.arange(len(run.time_s)) % 3)
    time = rw_ekf.read(path).time_s
    assert time - time[0] == pytest.approx(due, abs=1e-5)


def test_a_time_that_counts_down_is_not_the_newest_row_first(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Rows that stand in order are not reversed because their column says what is left."""
    path = tmp_path / "a.csv"
    path.write_text(csv(run, "time_remaining_s,rpm,I_A", lambda i, t, w, c: f"{60.0 - t:.3f},{w * RPM!r},{c!r}"))
    log = rw_ekf.read(path)
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s)
    assert log.time_s - log.time_s[0] == pytest.approx(run.time_s, abs=1e-3)


def test_a_clock_of_twelve_hours_goes_on_at_one() -> None:
    """12:59:59 and 01:00:00 are a second apart; a run at two o'clock after one at eleven is another run."""
    assert seconds_of(["12:59:59.5", "01:00:00.0"]) == pytest.approx([46799.5, 46800.0])
    assert seconds_of(["11:00:00", "02:00:00"]) == pytest.approx([39600.0, 7200.0])


@pytest.mark.parametrize("bits", [30, 32])
def test_ticks_in_a_unit_of_time_are_a_clock(tmp_path: Path, run: rw_ekf.Log, bits: int) -> None:
    """MicroPython's `ticks_us()` begins anew after 2^30."""
    path = tmp_path / "a.csv"
    head = "ticks_us,rpm,I_A"
    path.write_text(csv(run, head, lambda i, t, w, c: f"{(round(1e6 * t) - 20_000_000) % 2**bits},{w * RPM!r},{c!r}"))
    log = rw_ekf.read(path)
    assert log.time_s - log.time_s[0] == pytest.approx(run.time_s, abs=2e-6)


def test_a_common_factor_above_a_matrix_is_asked_about(tmp_path: Path, run: rw_ekf.Log) -> None:
    """MATLAB prints `1.0e+03 *` above all numbers: also where every column was answered."""
    text = csv(run, "ans =\n\n   1.0e+03 *\n", lambda i, t, w, c: f"{t / 1e3:.6f} {w * RPM / 1e3:.6f} {c / 1e3:.8f}")
    (tmp_path / "a.txt").write_text(text)
    found = rw_ekf.guess_columns(tmp_path / "a.txt", time="0:s", speed="1:rpm", current="2:A")
    assert "multiplied" in found.guess.questions[0].text


@pytest.mark.parametrize(
    ("header", "line"),
    [
        ('"Time (s)","Speed (RPM)","I (A)"', '"{t:.2f}","{w:,.0f}","{c:.6f}"'),
        ("t [Âµs];Vitesse [Â°/s];I [mA]", "{us};{deg!r};{mA!r}"),
        ("時刻[ms],回転数[rpm],電流[mA]", "{ms},{w!r},{mA!r}"),
        ("Temps (s);Vitesse (tr/min);Sens;Courant (mA)", "{t!r};{size!r};{way};{mA!r}"),
    ],
)
def test_more_ways_of_writing_are_read(tmp_path: Path, run: rw_ekf.Log, header: str, line: str) -> None:
    """Marks between thousands that come late, degrees and µ of a wrong encoding, more words."""
    path = tmp_path / "a.csv"

    def row(i: int, t: float, w: float, c: float) -> str:
        return line.format(
            t=t, w=w * RPM, c=c, us=round(1e6 * t), ms=round(1e3 * t), deg=math.degrees(w), mA=1e3 * c,
            size=abs(w * RPM), way="horaire" if w >= 0.0 else "anti-horaire",
        )  # fmt: skip

    path.write_text(csv(run, header, row), encoding="utf-8")
    log = rw_ekf.read(path)
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s, abs=0.06)
    assert log.current_A == pytest.approx(run.current_A, abs=1e-6)
    assert log.time_s - log.time_s[0] == pytest.approx(run.time_s, abs=0.005)


def test_short_keys_of_value_and_unit_are_heard(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`{"v": 12.3, "u": "rev/s"}`."""
    rows = zip(run.time_s.tolist(), run.speed_rad_s.tolist(), run.current_A.tolist(), strict=True)
    spelt = (
        {"t_s": t, "spd": {"v": w / (2.0 * math.pi), "u": "rev/s"}, "cur": {"v": 1e3 * c, "u": "mA"}}
        for t, w, c in rows
    )
    path = tmp_path / "a.jsonl"
    path.write_text("".join(f"{json.dumps(row)}\n" for row in spelt))
    log = rw_ekf.read(path)
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s)
    assert log.current_A == pytest.approx(run.current_A)


@pytest.mark.parametrize("name", ["I_heater_A", "led_current_mA", "I_3v3_A", "I_offset_A", "I_sim"])
def test_a_current_of_something_else_is_asked_about(tmp_path: Path, run: rw_ekf.Log, name: str) -> None:
    """The only current of a file need not be the motor's."""
    found = guess(tmp_path / "a.csv", csv(run, f"t_s,rpm,{name}", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r}"))
    assert [question.name for question in found.guess.questions] == ["current_A"]
    both = csv(run, f"t_s,rpm,{name},I_motor_A", lambda i, t, w, c: f"{t!r},{w * RPM!r},{-c!r},{c!r}")
    (line,) = [line for line in guess(tmp_path / "b.csv", both).guess.lines if line.name == "current_A"]
    assert line.entry["column"] == "I_motor_A"


def test_current_may_mean_the_present_one(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`current_speed` and `current_time` are no currents."""
    path = tmp_path / "a.csv"
    path.write_text(
        csv(run, "current_time,current_speed_rpm,amps", lambda i, t, w, c: f"{t + 0.013:.3f},{w * RPM!r},{c!r}")
    )
    log = rw_ekf.read(path)
    assert log.current_A == pytest.approx(run.current_A)
    assert role_of(stated_by("current_speed")) == "speed"
    assert role_of(stated_by("current_sense")) == "current"


def test_a_count_of_ms_may_be_as_large_as_seconds_since_1970(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Rows 100 s apart: a counter of ms that has run for some days."""
    text = csv(run, "stamp,rpm,I_A", lambda i, t, w, c: f"{1_070_000_000 + round(1e3 * t)},{w * RPM!r},{c!r}")
    (question,) = guess(tmp_path / "a.csv", text).guess.questions
    assert [answer.entry["unit"] for answer in question.answers] == ["s", "ms"]
    stated = csv(run, "time_ms,rpm,I_A", lambda i, t, w, c: f"{round(1e6 * t)},{w * RPM!r},{c!r}")
    assert "100 s apart" in guess(tmp_path / "b.csv", stated).guess.warnings[0]


def test_a_minus_of_typography_is_one(tmp_path: Path, run: rw_ekf.Log) -> None:
    """As word processors and plots write it."""
    text = csv(run, "t_s;rpm;I_A", lambda i, t, w, c: f"{t!r};{w * RPM!r};{c!r}".replace("-", "\u2212"))
    (tmp_path / "a.csv").write_text(text)
    log = rw_ekf.read(tmp_path / "a.csv")
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s)
    assert log.current_A == pytest.approx(run.current_A)


def test_commas_between_thousands_come_late_in_whole_numbers(tmp_path: Path) -> None:
    """The first of them stands behind what is looked at; that decimals have a point is seen there."""
    rows = "".join(f'"{0.05 * k:.2f}","{2 * k:,}","{0.1 + 0.001 * (k % 9):.3f}"\n' for k in range(900))
    (tmp_path / "a.csv").write_text('"Time (s)","Speed (RPM)","Current (A)"\n' + rows)
    assert rw_ekf.read(tmp_path / "a.csv").speed_rad_s * RPM == pytest.approx(2.0 * np.arange(900))


@pytest.mark.parametrize(("name", "scale"), [("t_ds", 10.0), ("t_cs", 100.0), ("time_ksec", 1e-3)])
def test_tenths_of_a_second_are_asked_about(tmp_path: Path, run: rw_ekf.Log, name: str, scale: float) -> None:
    """By its steps alone such a time would be in s."""
    text = csv(run, f"{name},rpm,I_A", lambda i, t, w, c: f"{t * scale:.6f},{w * RPM!r},{c!r}")
    assert [question.name for question in guess(tmp_path / "a.csv", text).guess.questions] == ["time_s"]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"speed": "rpm", "current": "rpm"}, "the speed already"),
        ({"time": "rpm", "speed": "rpm"}, "the time already"),
        ({"time": "t_s", "current": "t_s"}, "the time already"),
    ],
)
def test_one_column_is_not_taken_for_two(tmp_path: Path, given: dict[str, str], words: str) -> None:
    """What was answered for the time, the speed and the current are different columns, or it is said."""
    path = tmp_path / "log.csv"
    path.write_text("t_s,rpm,I_A\n" + "".join(f"{0.1 * i},{100 + i},{0.1 + 0.001 * i}\n" for i in range(50)), "utf-8")
    with pytest.raises(LogError, match=words):
        rw_ekf.guess_columns(path, **given)
