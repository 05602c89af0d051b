"""One run of a wheel, written as labs write theirs: read without a map, in the right meaning, or asked about."""

from __future__ import annotations

import datetime
import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

import rw_ekf
from rw_ekf.cli import main
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.column_names import stated_by
from rw_ekf.logs.column_units import unit_of
from rw_ekf.logs.reader import read_table
from rw_ekf.units import RAD_S_PER_RPM
from tests.contract import check_document

RPM, MA = 1.0 / RAD_S_PER_RPM, 1e3
_SETTINGS = ("Record Length,600", "Sample Interval,1e-1", "Vertical Units,V", "Serial Number,C012389", ",", "J,2e-4")
BEGIN = datetime.datetime(2026, 3, 29, 23, 59, 50, tzinfo=datetime.UTC)
Rows = list[tuple[float, float, float]]


@pytest.fixture(scope="module")
def run() -> rw_ekf.Log:
    """60 s of a simulated wheel at 10 Hz, in both directions."""
    return rw_ekf.simulate("steps", duration_s=60.0, seed=5)


def _rows(log: rw_ekf.Log) -> Rows:
    return [tuple(map(float, row)) for row in zip(log.time_s, log.speed_rad_s, log.current_A, strict=True)]  # type: ignore[misc]


def _table(rows: Rows, header: str, line: Callable[[int, float, float, float], str], end: str = "\n") -> str:
    return header + end + "".join(line(i, *row) + end for i, row in enumerate(rows))


def _comma(value: float, digits: int = 9) -> str:
    return f"{value:.{digits}f}".replace(".", ",")


def _at(t: float) -> datetime.datetime:
    return BEGIN + datetime.timedelta(seconds=t)


def _clock(t: float) -> str:
    return (BEGIN + datetime.timedelta(hours=-12, seconds=t)).strftime("%H:%M:%S.%f")[:-3]


def _midnight(t: float) -> str:
    return _at(t).strftime("%H:%M:%S,%f")[:-3]


DIALECTS: dict[str, Callable[[Rows], bytes]] = {
    "iso": lambda r: _table(
        r, "timestamp,wheel speed [rpm],current [mA]",
        lambda i, t, w, c: f"{_at(t).isoformat(timespec='microseconds')},{w * RPM!r},{c * MA!r}",
    ).encode(),
    "german excel": lambda r: _table(
        r, "Zeit [s];Drehzahl [1/min];Strom [A]",
        lambda i, t, w, c: f"{_comma(t)};{_comma(w * RPM)};{_comma(c)}", "\r\n",
    ).encode("cp1252"),
    "epoch ms": lambda r: _table(
        r, "time,rpm,current_A", lambda i, t, w, c: f"{1774828790000 + round(1e3 * t)},{w * RPM!r},{c!r}"
    ).encode(),
    "hashed": lambda r: _table(
        r, "# wheel 3, bearing A\n# t[s] omega[rad/s] i[A]", lambda i, t, w, c: f"{t!r} {w!r} {c!r}"
    ).encode(),
    "utf-16": lambda r: _table(
        r, "Time (s)\tSpeed (RPM)\tMotor Current (A)", lambda i, t, w, c: f"{t!r}\t{w * RPM!r}\t{c!r}", "\r\n"
    ).encode("utf-16"),
    "latin-1, preamble, units row": lambda r: _table(
        r, "Prüfstand 2;;;\nBediener: Müller;;;\nZeit;Drehzahl;Strom;Temperatur\ns;U/min;A;°C",
        lambda i, t, w, c: f"{_comma(t)};{_comma(w * RPM)};{_comma(c)};21,5",
    ).encode("latin-1"),
    "times of day past midnight": lambda r: _table(
        r, "Uhrzeit;n [1/min];I [mA]", lambda i, t, w, c: f"{_midnight(t)};{_comma(w * RPM)};{_comma(c * MA)}"
    ).encode(),
    "ragged % header": lambda r: _table(
        r, "% t (s)\tspeed (rad/s)\tcurrent (A)\t29-Mar-2026", lambda i, t, w, c: f"{t!r}\t{w!r}\t{c!r}\t"
    ).encode(),
    "date as one header cell more": lambda r: _table(
        r, "time,omega_rad_s,current_A,2026-03-29", lambda i, t, w, c: f"{t!r},{w!r},{c!r}"
    ).encode(),
    "index without a name": lambda r: _table(
        r, ",time,speed_rpm,iq_A", lambda i, t, w, c: f"{i},{t!r},{w * RPM!r},{c!r}"
    ).encode(),
    "microseconds that wrap": lambda r: _table(
        r, "micros,velocity (deg/s),current_mA",
        lambda i, t, w, c: f"{(4294000000 + round(1e6 * t)) % 2**32},{math.degrees(w)!r},{c * MA!r}",
    ).encode(),
    "excel serial days": lambda r: _table(
        r, "Datum;Drehzahl (U/min);Strom (A)",
        lambda i, t, w, c: f"{_comma(46110.5 + t / 86400.0, 12)};{_comma(w * RPM)};{_comma(c)}",
    ).encode(),
    "quoted, with trailing delimiters": lambda r: _table(
        r, '"t [ms]","n [rpm]","I [A]",', lambda i, t, w, c: f'"{1e3 * t!r}","{w * RPM!r}","{c!r}",'
    ).encode(),
    "names again in the middle": lambda r: _table(
        r, "t_s,speed_rpm,current_A",
        lambda i, t, w, c: ("t_s,speed_rpm,current_A\n" if i == 100 else "") + f"{t!r},{w * RPM!r},{c!r}",
    ).encode(),
    "lines of syslog": lambda r: _table(
        r, "2026-03-29T23:59:29+01:00 b3 systemd[1]: Started the wheel's daemon.",
        lambda i, t, w, c: f"{_at(t).isoformat(timespec='microseconds')} b3 rwd[{812 + i // 300}]: TLM seq={i} "
        f"rpm={abs(w) * RPM!r} dir={'CW' if w >= 0.0 else 'CCW'} iq_mA={c * MA!r} temp_C=28.5 err=0x00",
    ).encode(),
    "lines of ESP-IDF, in colours": lambda r: _table(
        r, "ets Jul 29 2019 12:21:46\n\x1b[0;33mW (355) rw: no calibration\x1b[0m",
        lambda i, t, w, c: f"\x1b[0;3{2 + i % 2}m{'IW'[i % 2]} ({1402 + round(1e3 * t)}) rw: w={w!r} rad/s "
        f"i={c * MA!r} mA T=23.9 C\x1b[0m" + "\nI (13910) wifi: bcn_timout" * (i == 99),
    ).encode(),
    "lines of Python's logging": lambda r: _table(
        r, "starting", lambda i, t, w, c: f"{_at(t).strftime('%Y-%m-%d %H:%M:%S,%f')[:-3]} - rw - "
        f"{'WARNING' if i % 7 == 0 else 'INFO'} - rpm={w * RPM!r} i_mA={c * MA!r}",
    ).encode(),
    "a table of Fortran": lambda r: _table(
        r, " RUN   1   MOMENTUM WHEEL SN 004   JW = 1.270D-02 KG-M**2\n"
        f"{'TIME':>22s}{'WHEEL RATE':>22s}{'CURRENT':>22s}\n{'(S)':>22s}{'(RAD/S)':>22s}{'(AMPS)':>22s}",
        lambda i, t, w, c: "".join(f"{x:22.13E}" for x in (t, w, c)).replace("E", "D"),
    ).encode(),
    "indices and kinds of amperes in brackets": lambda r: _table(
        r, "Time [ms];DRIVE.r61[0] Speed actual value, encoder [rpm];DRIVE.r78[0] Current, torque-generating [Arms]",
        lambda i, t, w, c: f'"{_comma(t * MA)}";"{_comma(w * RPM)}";"{_comma(c)}"',
    ).encode(),
    "topics of a JointState": lambda r: _table(
        r, "__time,/rw1/joint_states/wheel/velocity,/driver/motor_current_A,/driver/temperature",
        lambda i, t, w, c: f"{1774828790.0 + t:.9f},{w!r},{c!r},{'25' if i % 9 == 0 else ''}",
    ).encode(),
    "temperatures called T and t": lambda r: _table(
        r, "T_C,t_case_C,t_housing,t,rpm,i_A",
        lambda i, t, w, c: f"{20 + 0.01 * t:.1f},{21 + 0.01 * t:.2f},{22 + 0.01 * t},{t!r},{w * RPM!r},{c!r}",
    ).encode(),
    "magnitude and direction": lambda r: _table(
        r, "time_ms,rpm,dir,current_A",
        lambda i, t, w, c: f"{1e3 * t!r},{abs(w) * RPM!r},{'CW' if w > 0 else 'CCW'},{c!r}"
    ).encode(),
    "label in the comment, blanks": lambda r: _table(
        r, "% run 7\n% columns:   t [s]     omega [rad/s]    I_meas [A]\n%",
        lambda i, t, w, c: f"   {t!r}   {w!r}   {c!r}",
    ).encode(),
    "symbols over units, hexadecimal status": lambda r: _table(
        r, "   t/ms   n/Hz   I/mA   St",
        lambda i, t, w, c: f"  {1e3 * t!r} {w / (2.0 * math.pi)!r} {c * MA!r} 0x4{i % 8}",
    ).encode(),
    "remarks in few rows": lambda r: _table(
        r, "Zeit [s];Drehzahl [1/min];Motorstrom [A];Bemerkung",
        lambda i, t, w, c: f"{_comma(t)};{_comma(w * RPM)};{_comma(c)};" + ("Start" if i == 0 else ""),
    ).encode(),
    "a status in words": lambda r: _table(
        r, "timestamp;speed_rpm;current_A;status",
        lambda i, t, w, c: f"{_at(t).isoformat()};{w * RPM!r};{c!r};{'WARN' if i % 9 else 'OK'}",
    ).encode(),
    "a terminal's time in front": lambda r: _table(
        r, "12:00:00.000 -> boot\n12:00:00.001 -> t_ms,vel_rpm,corriente_mA",
        lambda i, t, w, c: f"{_clock(t)} -> {1e3 * t!r},{w * RPM!r},{c * MA!r}"
    ).encode(),
    "only a terminal's time": lambda r: _table(
        r, "[12:00:00.001] rpm,current_A", lambda i, t, w, c: f"[{_clock(t)}] {w * RPM!r},{c!r}"
    ).encode(),
    "labelled, with units": lambda r: _table(
        r, "boot\nok", lambda i, t, w, c: f"[{1e3 * t:9.1f} ms] n={w * RPM: 18.12f} rpm  i={c:.12f} A  st=RUN"
    ).encode(),
    "printed dictionaries": lambda r: _table(
        r, "connected", lambda i, t, w, c: str({"t": t, "speed_rpm": w * RPM, "cur_mA": c * MA, "e": None})
    ).encode(),
    "keys and values, decimal points, hexadecimal": lambda r: _table(
        r, "# fw 1.2", lambda i, t, w, c: f"t_us={1e6 * t:.1f} st=RUN omega_rad_s={w!r} iq_A={c!r} flag=0x4{i % 8}"
    ).encode(),
    "settings as wide as the rows": lambda r: _table(
        r, "Model,X1\nSample Interval,2.0e-2,,\nRecord,300,,\nVertical Units,rpm,A,\n"
        "Label,wheel speed,I motor,\nTIME,CH1,CH2,",
        lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r},"
    ).encode(),
    "settings at the left of the rows": lambda r: _table(
        r, "Settings,,,Time,Speed,Current\n,,,s,rpm,A",
        lambda i, t, w, c: f"{_SETTINGS[i] if i < len(_SETTINGS) else ','},,{t!r},{w * RPM!r},{c!r}",
    ).encode(),
    "settings at the right of the rows": lambda r: _table(
        r, "Time (s);Speed (1/min);Current (mA);;Setting;Value",
        lambda i, t, w, c: f"{_comma(t)};{_comma(w * RPM)};{_comma(c * MA)}"
        + (f";;{_SETTINGS[i].replace(',', ';')}" if i < len(_SETTINGS) else ""),
    ).encode(),
    "each row ended as a statement": lambda r: _table(
        r, "%run 7\n%t,omega,i\n%[s],[rad/s],[A]", lambda i, t, w, c: f"{t!r},{w!r},{c!r};"
    ).encode(),
    "a block that describes": lambda r: _table(
        r, '"name","x-axis","Out1","In1"\n"description","","wheel angular rate","motor current measured"\n'
        '"unit","s","rad/s","A"\n\n"trace_values"',
        lambda i, t, w, c: f'"",{t!r},{w!r},{c!r}'
    ).encode(),
    "a time for each channel": lambda r: _table(
        r, "Name\tfActVelo\tName\tfActCurrent\nSampleTime[ms]\t20\tSampleTime[ms]\t20\n"
        "Unit\t°/s (AngularVelocity)\tUnit\tA (Current)\n",
        lambda i, t, w, c: f"{1e3 * t!r}\t{math.degrees(w)!r}\t{1e3 * t!r}\t{c!r}"
    ).encode("cp1252"),
    "chinese of the mainland, in its own encoding": lambda r: _table(
        r, "飞轮电机测试,,,\n时间(ms),实际转速(r/min),q轴电流(A),d轴电流(A)",
        lambda i, t, w, c: f"{1e3 * t!r},{w * RPM!r},{c!r},{0.01 * (i % 3)!r}"
    ).encode("gb18030"),
    "japanese remarks, in its own encoding": lambda r: _table(
        r, '"CH","A1","A2","P1"\n"Comment","モータ電流","電源電流","ホイール回転"\n"Time","1-1[A]","1-2[A]","P-1[r/s]"',
        lambda i, t, w, c: f"{t!r},{c!r},{0.3 + 0.01 * (i % 7)!r},{w / (2.0 * math.pi)!r}"
    ).encode("cp932"),
    "a counter whose rate stands above": lambda r: _table(
        r, "# timer 10 kHz\ntick,omega [rad/s],I [A]", lambda i, t, w, c: f"{40021 + round(1e4 * t)},{w!r},{c!r}"
    ).encode(),
    "a row a signal": lambda r: _table(
        r, "ts,signal,value",
        lambda i, t, w, c: f"{t!r},W1_SPEED_RPM,{w * RPM!r}\n{t!r},W1_CUR_MA,{c * MA!r}"
        + f"\n{t!r},TMP_C,21" * (i % 9 == 0)
    ).encode(),
    "json lines, two kinds of packets": lambda r: _table(
        r, '{"event": "boot"}',
        lambda i, t, w, c: json.dumps({"ts": _at(t).isoformat(), "wheel": {
            "rate": {"value": math.degrees(w), "unit": "deg/s"}, "current": {"value": c * MA, "unit": "mA"}}})
        + '\n{"ts": "2026-03-30T01:02:03Z", "eps": {"vbat": 8.1}}' * (i % 10 == 5)
    ).encode(),
    "json lines, a slow value in some": lambda r: "\n".join(
        json.dumps({"t_s": t, "rpm": w * RPM, "current": {"value": c * MA, "unit": "mA"},
                    "temp": None if i % 10 else {"value": 21.0, "unit": "degC"}}) for i, (t, w, c) in enumerate(r)
    ).encode(),
    "json by column, units beside": lambda r: json.dumps({
        "units": {"t": "s", "speed": "rpm", "i": "A"}, "data": {
            "t": [row[0] for row in r], "speed": [row[1] * RPM for row in r], "i": [row[2] for row in r]}
    }).encode(),
    "a range that Prometheus answers": lambda r: json.dumps({"status": "success", "data": {"resultType": "matrix",
        "result": [
            {"metric": {"__name__": name, "job": "rw"},
             "values": [[1700491320.0 + row[0], repr(size * row[column])] for row in r]}
            for name, column, size in (("rw_wheel_speed_rpm", 1, RPM), ("rw_motor_current_amperes", 2, 1.0))]}}
    ).encode(),
    "lines that Loki answers, the newest first": lambda r: json.dumps({"data": {"resultType": "streams", "result": [
        {"stream": {"job": "rw"}, "values": [
            [f"{1700491320 * 10**9 + round(1e9 * t)}", f"rpm={w * RPM!r} current_mA={c * MA!r}"] for t, w, c in r[::-1]
        ]}]}}).encode(),
    "objects that Loki answers": lambda r: json.dumps({"data": {"resultType": "streams", "result": [
        {"stream": {"level": level}, "values": [
            [f"{1700491320 * 10**9 + round(1e9 * t)}", json.dumps({"rpm": w * RPM, "current_mA": c * MA})]
            for t, w, c in part]} for level, part in (("info", r[:300]), ("warn", r[300:]))]}}).encode(),
    "a line for each signal": lambda r: "\n".join(
        ";".join([name, unit, *(_comma(size * row[at]) for row in r)])
        for at, name, unit, size in ((0, "Zeit", "s", 1.0), (1, "Drehzahl", "1/min", RPM), (2, "Strom", "mA", MA))
    ).encode(),
    "blanks between thousands": lambda r: _table(
        r, "Zeit [s];Drehzahl [1/min];Strom [mA]",
        lambda i, t, w, c: f"{t:.3f};{w * RPM:,.9f};{c * MA:,.9f}".replace(",", " ").replace(".", ","),
    ).encode(),
    "a direction in the cell": lambda r: _table(
        r, "t_ms,rpm,current_mA",
        lambda i, t, w, c: f"{1e3 * t!r},{'CW' if w >= 0.0 else 'CCW'} {abs(w) * RPM!r},{c * MA!r}",
    ).encode(),
    "a direction without a unit, by letters": lambda r: _table(
        r, "Time,Dir,Speed,I_meas\ns,-,rpm,mA",
        lambda i, t, w, c: f"{t!r},{'F' if w >= 0.0 else 'R'},{abs(w) * RPM!r},{c * MA!r}",
    ).encode(),
    "ticks of .NET": lambda r: _table(
        r, "Ticks,SpeedRpm,CurrentA",
        lambda i, t, w, c: f"{639080000000000000 + round(1e7 * t)},{w * RPM!r},{c!r}",
    ).encode(),
    "a time since the begin, of pandas": lambda r: _table(
        r, ",omega_rad_s,current_A",
        lambda i, t, w, c: f"0 days 00:{int(t) // 60:02d}:{t % 60:09.6f},{w!r},{c!r}",
    ).encode(),
    "pandas, split": lambda r: json.dumps({
        "columns": ["time_s", "omega (rad/s)", "iq (A)"], "index": list(range(len(r))),
        "data": [list(row) for row in r]
    }).encode(),
    "two runs with a heading each": lambda r: "".join(
        f"Messung {n}\nDatum;12.03.2022\n\n"
        "Zeit [s];Sollstrom [A];Drehzahl [1/min];Motorstrom [A];Netzteilstrom [A]\n"
        + "".join(f"{_comma(t)};{_comma(c)};{_comma(w * RPM)};{_comma(c)};0,035\n" for t, w, c in part)
        for n, part in enumerate((r[:200], r[200:]))
    ).encode("cp1252"),
    "scope of a PLC, units last": lambda r: _table(
        r, "Name\tfActVelo\tnActCurrent\tName\tfTemp\nSampleTime[ms]\t20\t20\tSampleTime[ms]\t20\n"
        "BitMask\t0xFF\t0xFF\tBitMask\t0xFF\nUnit\t\u00b0/s\tmA\tUnit\t\u00b0C\n",
        lambda i, t, w, c: f"{1e3 * t!r}\t{math.degrees(w)!r}\t{c * MA!r}\t{1e3 * t!r}\t20",
    ).encode(),
    "levels of pandas, the index below them": lambda r: _table(
        r, "group,wheel,motor,motor\nsignal,speed,current,current_cmd\nunit,deg/s,mA,mA\nt [ms],,,",
        lambda i, t, w, c: f"{1e3 * t!r},{math.degrees(w)!r},{c * MA!r},0.0",
    ).encode(),
    "two levels of pandas without names of their own": lambda r: _table(
        r, ",omega,iq\n,rad/s,A\ntime_s,,", lambda i, t, w, c: f"{t!r},{w!r},{c!r}"
    ).encode(),
    "remarks below the units": lambda r: _table(
        r, "Time\tWheel speed\tMotor current\ns\trpm\tmA\nrun 7, 2e-5 mbar\tHall, signed\tLEM LTS 6-NP",
        lambda i, t, w, c: f"{t!r}\t{w * RPM!r}\t{c * MA!r}", "\r\n",
    ).encode(),
    "a key at each cell": lambda r: _table(
        r, "time,Wheel speed,Motor current\n,Unit: deg/s,Unit: mA\n,Type: double,Type: double\n"
        ",BlockPath: rig/Enc,BlockPath: rig/ADC\n,PortIndex: 1,PortIndex: 2",
        lambda i, t, w, c: f"{t!r},{math.degrees(w)!r},{c * MA!r}",
    ).encode(),
    "units in the cells, of another size in each row": lambda r: _table(
        r, '"Time","RW1 wheel speed","RW1 motor current"',
        lambda i, t, w, c: f"{_at(t).isoformat(sep=' ', timespec='milliseconds')[:23]},{w * RPM!r} rpm,"
        + (f"{c * 1e6!r} µA" if abs(c) < 1e-3 else f"{c * MA!r} mA" if abs(c) < 0.1 else f"{c!r} A"),
    ).encode(),
    "units in the cells, decimal comma": lambda r: _table(
        r, "Zeit;Drehzahl;Strom",
        lambda i, t, w, c: f"{_comma(t)} s;{_comma(w * RPM)} 1/min;{_comma(c, 12)} A" if abs(c) > 0.1
        else f"{_comma(t)} s;{_comma(w * RPM)} 1/min;{_comma(c * MA)} mA",
    ).encode(),
    "counts beside what they are converted to": lambda r: _table(
        r, "TARGET,TIMEFORMATTED,SEQ,RW1_SPEED(RAW),RW1_SPEED(U),RW1_MOT_CUR(RAW),RW1_MOT_CUR(U),RW1_MODE",
        lambda i, t, w, c: f"SIM,{_at(t).strftime('%Y/%m/%d %H:%M:%S.%f')[:-3]},{i},{round(w * RPM * 5)},"
        f"{w * RPM!r} RPM,{round(2048 + c * 2000)},{c!r} A,IDLE",
    ).encode(),
    "set-point beside it": lambda r: _table(
        r, "t [s],speed_ref [rpm],speed [rpm],i_ref [A],i_q [A],i_d [A],v_bus [V],status",
        lambda i, t, w, c: f"{t!r},{w * RPM + 3!r},{w * RPM!r},{c!r},{c!r},0.01,24.1,0",
    ).encode(),
    "labels in lines of their own, a step for each channel": lambda r: _table(
        r, "channel names:\nMod1_Wheel speed [deg/s]\tMod2_Motor current [mA]\nstart times:\n"
        "03/29/2026 11:59:50 PM\t03/29/2026 11:59:50 PM\ndt:\n0.100000\t0.100000\ndata:",
        lambda i, t, w, c: f"{math.degrees(w)!r}\t{c * MA!r}", "\r\n",
    ).encode(),
    "blocks of a recorder, rows below an empty cell": lambda r: _table(
        r, '"Header Size",16\n"TraceName","Speed","Current"\n"BlockSize",600,600\n"VUnit","rpm","A"\n'
        '"SampleRate",1.0E+01,1.0E+01\n"HResolution",1.0E-01,1.0E-01\n"HOffset",0.0E+00,0.0E+00\n'
        '"HUnit","s","s"\n"DisplayPointNo.",1,1\n"Date","2026/03/29","2026/03/29"\n',
        lambda i, t, w, c: f",{w * RPM!r},{c!r}",
    ).encode(),
    "ruled names, blanks within the stamps": lambda r: _table(
        r, f"{'29 Mar 2026 23:59:50':>70}\nSatellite-Sat1-Wheel-RW1\n\n\n       Time (UTCG)       Wheel Speed (rev/min)"
        "  Wheel Current (amp)\n------------------------  ---------------------  -------------------",
        lambda i, t, w, c: f"{_at(t):%d %b %Y %H:%M:%S.%f}  {w * RPM!r:>23}  {c!r:>23}",
    ).encode(),
    "an inertia above the columns, in Fortran": lambda r: _table(
        r, "     INERTIA(KG-M2)          KT(N-M/A)\n         0.1200D-03         0.1200D-01\n"
        "         TIME               RATE               CURRENT\n         SEC              RAD/SEC               AMP",
        lambda i, t, w, c: "".join(f"{x:23.14E}".replace("E", "D") for x in (t, w, c)),
    ).encode(),
    "comments of Fortran 77": lambda r: _table(
        r, "C     RUN 17    INERTIA   1.2000E-04\nC     TIME      OMEGA    CURRENT\nC     S         RAD/S    A",
        lambda i, t, w, c: f"  {t!r}  {w!r}  {c!r}",
    ).encode(),
    "two currents of a drive, by what they build": lambda r: _table(
        r, "Index;Zeit [ms];r63: Drehzahlistwert [1/min];r76: Stromistwert feldbildend [A];"
        "r78: Stromistwert momentenbildend [A]",
        lambda i, t, w, c: f"{i};{_comma(1e3 * t)};{_comma(w * RPM)};{_comma(0.01 + 0.001 * (i % 3))};{_comma(c)}",
    ).encode(),
    "derivatives beside it, rows of events twice": lambda r: _table(
        r, "time,wheel.phi,wheel.w,der(wheel.phi),der(wheel.w),emf.i [A]",
        lambda i, t, w, c: "\n".join([f"{t!r},{3.0 * t!r},{w!r},{w!r},{c!r},{c!r}"] * (1 + (i % 50 == 0))),
    ).encode(),
    "words before the numbers, units behind them": lambda r: _table(
        r, "*** Booting Zephyr OS ***",
        lambda i, t, w, c: f"[00:{int(t) // 60:02d}:{int(t) % 60:02d}.{round(t * 1e3) % 1000:03d},000] <inf> rw: "
        f"wheel speed {w * RPM:.9f} rpm, motor current {c * MA:.9f} mA, duty 0.25",
    ).encode(),
    "units of two words in the cells": lambda r: _table(
        r, "t,\u03c9,i", lambda i, t, w, c: f"{t!r} s,{w!r} rad s^-1,{c!r} A"
    ).encode(),
    "minutes and seconds, the hour left out": lambda r: _table(
        r, "Time,Speed,Current\nmm:ss.0,rpm,A", lambda i, t, w, c: f"{_at(t):%M:%S.%f},{w * RPM!r},{c!r}"
    ).encode(),
    "days of the year": lambda r: _table(
        r, "Time (UTC),RW1_SPEED,RW1_CURRENT\n,RPM,A",
        lambda i, t, w, c: f"{_at(t):%Y-%jT%H:%M:%S.%f}Z,{w * RPM!r},{c!r}",
    ).encode(),
    "days of the year between points": lambda r: _table(
        r, "Time,RW1 SPD [rpm],RW1 CUR [A]", lambda i, t, w, c: f"{_at(t):%Y.%j.%H.%M.%S.%f},{w * RPM!r},{c!r}"
    ).encode(),
    "the newest row first": lambda r: _table(
        r[::-1], "timestamp,rw_speed_rpm,rw_current_mA,remark",
        lambda i, t, w, c: f"{_at(t).isoformat(timespec='microseconds')},{w * RPM!r},{c * MA!r},nominal",
    ).encode(),
    "counts, and what they are times in a block for each channel": lambda r: _table(
        r, "[Header]\nCount=3\nCH1.Name=Time\nCH1.Unit=s\nCH1.Factor=0.001\nCH2.Name=Wheel speed\nCH2.Unit=rpm\n"
        "CH2.Factor=1e-9\nCH3.Name=Motor current\nCH3.Unit=mA\nCH3.Factor=1e-9\nCH3.Offset=0\n[Data]",
        lambda i, t, w, c: f"{round(1e3 * t)};{round(w * RPM * 1e9)};{round(c * MA * 1e9)}",
    ).encode(),
    "a section for each channel, and a rate": lambda r: _table(
        r, "[General]\nSampleRate=10 Hz\n[Channel 1]\nName=Motor current\nUnit=A\n[Channel 2]\nName=n\n"
        "Unit=1/min\n[Data]",
        lambda i, t, w, c: f"{c!r}\t{w * RPM!r}",
    ).encode(),
    "columns described in a label of the Planetary Data System": lambda r: _table(
        r, "PDS_VERSION_ID = PDS3\n" + "".join(
            f'OBJECT = COLUMN\n  NAME = "{name}"\n  UNIT = "{unit}"\n  START_BYTE = 1\nEND_OBJECT = COLUMN\n'
            for name, unit in (("TIME", "SECOND"), ("WHEEL_SPEED", "RPM"), ("MOTOR_CURRENT", "AMPERE"))
        ) + "END", lambda i, t, w, c: f"{t:12.6f} {w * RPM:20.9f} {c:20.12f}",
    ).encode(),
    "a date beside a time with points, past midnight": lambda r: _table(
        r, "Datum;Uhrzeit;Drehzahl [U/min];Strom [A]",
        lambda i, t, w, c: f"{_at(t):%d.%m.%Y;%H.%M.%S,%f};{_comma(w * RPM)};{_comma(c)}",
    ).encode(),
    "whole seconds beside their ms, and signs apart from the numbers": lambda r: _table(
        r, "Number,Date&Time,ms,CH1,CH2\nNO.,Time,ms,rpm,A",
        lambda i, t, w, c: f"{i:6d},{_at(t):%Y/%m/%d %H:%M:%S},{_at(t).microsecond // 1000},"
        + ",".join(f"{'-' if x < 0 else '+'}  {abs(x):.9f}" for x in (w * RPM, c)),
    ).encode(),
    "columns of a fixed width that touch": lambda r: _table(
        r, "   TIME[S]   SPEED[RPM]   CUR[A]", lambda i, t, w, c: f"{t:10.3f}{w * RPM:15.9f}{c:13.10f}"
    ).encode(),
    "a header as pandas writes one of two levels": lambda r: _table(
        r, "time_s,\"('rw1', 'speed_rpm')\",\"('rw1', 'current_mA')\"",
        lambda i, t, w, c: f"{t!r},{w * RPM!r},{c * MA!r}"
    ).encode(),
    "a row a signal, words among the values": lambda r: _table(
        r, "Timestamp [s],Key,Value",
        lambda i, t, w, c: f'{t!r},/Robot/Project,"bench, flat"\n' * (i == 0)
        + f"{t!r},/Flywheel/VelocityRadPerSec,{w!r}\n{t!r},/Flywheel/CurrentAmps,{c!r}\n{t!r},/Robot/Enabled,true",
    ).encode(),
    "a row a signal, its unit beside it": lambda r: _table(
        r, "timestamp;parameter;value;unit",
        lambda i, t, w, c: f"{t!r};RW_SPEED;{w * RPM!r};rpm\n{t!r};RW_CURR;{c * MA!r};mA\n{t!r};RW_MODE;IDLE;",
    ).encode(),
    "logfmt": lambda r: _table(
        r, "", lambda i, t, w, c: f'ts={_at(t).isoformat(timespec="milliseconds")} level=info msg="rw telemetry" '
        f"wheel.speed={w * RPM:.9f}rpm motor.current={c:.12f}A seq={i}",
    ).encode(),
    "ms since 1970 in a column that is called otherwise": lambda r: json.dumps({
        "columns": ["utc", "wheel_rpm", "motor_mA"],
        "data": [[round(1e3 * (BEGIN.timestamp() + t)), w * RPM, c * MA] for t, w, c in r],
    }).encode(),
    "messages as rostopic echo prints them": lambda r: "".join(
        f"header: \n  seq: {i}\n  stamp: \n    secs: {1743292790 + int(t)}\n    nsecs: {round(1e9 * (t % 1.0))}\n"
        f"name: [wheel]\nposition: [0.0]\nvelocity: [{w!r}]\neffort: [{c!r}]\n---\n" for i, (t, w, c) in enumerate(r)
    ).encode(),
    "a terminal's time before labels, of which one could be a time as well": lambda r: _table(
        r, "", lambda i, t, w, c: f"{_at(t):%H:%M:%S.%f}"[:-3] + f" -> rpm:{w * RPM:.9f},I_mA:{c * MA:.9f},T:24.5",
    ).encode(),
    "an object for each signal, with its unit beside its values": lambda r: json.dumps({
        "meta": {"wheel": "RW-03"}, "signals": {
            "time": {"unit": "s", "values": [t for t, _, _ in r]},
            "wheel_rate": {"unit": "rpm", "values": [w * RPM for _, w, _ in r]},
            "motor_current": {"unit": "mA", "values": [c * MA for _, _, c in r]},
        },
    }).encode(),
    "a row of remarks that is no row of groups": lambda r: _table(
        r, "# bench = 3, wheel = RW-03, time = a counter of 16 bits\nms,speed [rpm],I [mA]",
        lambda i, t, w, c: f"{(round(1e3 * t) + 60000) % 65536},{w * RPM!r},{c * MA!r}",
    ).encode(),
    "rows of a dump of SQLite": lambda r: _table(
        r, "PRAGMA foreign_keys=OFF;\nBEGIN TRANSACTION;\nCREATE TABLE log(id INTEGER PRIMARY KEY, stamp TEXT, "
        "rpm REAL CHECK (rpm < 9e9), motor_ma REAL, note TEXT);",
        lambda i, t, w, c: f"INSERT INTO log VALUES({i},'{_at(t):%Y-%m-%d %H:%M:%S.%f}',{w * RPM!r},{c * MA!r},"
        "'it''s, (ok)');",
    ).encode(),
    "rows of a dump of MySQL": lambda r: (
        "-- MySQL dump 10.13\nCREATE TABLE `log` (\n  `id` int NOT NULL,\n  `ts` datetime(3) NOT NULL,\n"
        "  `rpm` double,\n  `motor_ma` decimal(20,12),\n  PRIMARY KEY (`id`)\n);\nINSERT INTO `log` VALUES " + ",".join(
            f"({i},'{_at(t):%Y-%m-%d %H:%M:%S.%f}',{w * RPM!r},{c * MA!r})" for i, (t, w, c) in enumerate(r)
        ) + ";\nUNLOCK TABLES;\n"
    ).encode(),
    "rows of a dump of PostgreSQL": lambda r: _table(
        r, "--\n-- PostgreSQL database dump\n--\nCREATE TABLE public.log (ts timestamp, rpm real, motor_ma real);\n"
        "COPY public.log (ts, rpm, motor_ma) FROM stdin;",
        lambda i, t, w, c: f"{_at(t):%Y-%m-%d %H:%M:%S.%f}+00\t{w * RPM!r}\t{c * MA!r}",
    ).encode() + b"\\.\n",
    "a prompt above names that are units": lambda r: _table(
        r, "RW bench, firmware 1.4\ntype 's' to start\n> s\nms,rpm,mA", lambda i, t, w, c:
        f"{round(1e3 * t)},{w * RPM!r},{c * MA!r}",
    ).encode(),
    "a terminal's stamp before each line, that of the names too": lambda r: _table(
        r, f"{_at(0.0):%Y-%m-%d %H:%M:%S.%f}\tmillis\tspeed (rad/s)\tcurrent (A)",
        lambda i, t, w, c: f"{_at(t + 0.2):%Y-%m-%d %H:%M:%S.%f}\t{812 + 1e3 * t:.0f}\t{w!r}\t{c!r}",
    ).encode(),
    "sentences of a logger, whose stamps have a comma": lambda r: _table(
        r, "2026-03-29 23:59:49,900 DEBUG bench: port /dev/ttyUSB0 opened", lambda i, t, w, c:
        f"{_at(t):%Y-%m-%d %H:%M:%S,%f}"[:-3] + f" INFO bench.loop: omega={w:.9f} rad/s i_meas={c:.12f} A T=23.4 degC",
    ).encode(),
    "the units of all columns in a line above their names": lambda r: _table(
        r, "Bench 3\nUnits: ms, rad/s, mA\nTime;Velocity;Current", lambda i, t, w, c: f"{1e3 * t!r};{w!r};{c * MA!r}",
    ).encode(),
    "ticks of a length that is said": lambda r: _table(
        r, "# 1 tick = 100 us\nticks,speed_rpm,current_mA", lambda i, t, w, c: f"{1e4 * t:.0f},{w * RPM!r},{c * MA!r}",
    ).encode(),
    "negative numbers as registers have them": lambda r: _table(
        r, "time_ms,velocity_rpm,current_mA",
        lambda i, t, w, c: f"{1e3 * t:.0f},0x{round(w * RPM) % 2**32:08X},{round(c * MA) % 65536}",
    ).encode(),
    "units of several columns in a sentence": lambda r: _table(
        r, "# time in ms; speed in 0.1 rpm, current: mA\ntime,speed,current",
        lambda i, t, w, c: f"{1e3 * t!r},{10.0 * w * RPM!r},{c * MA!r}",
    ).encode(),
    "apostrophes between thousands": lambda r: _table(
        r, "Zeit [ms];Drehzahl [1/min];Strom [uA]",
        lambda i, t, w, c: ";".join(f"{x:,.9f}".replace(",", "'") for x in (1e3 * t, w * RPM, c * 1e6)),
    ).encode(),
    "thin blanks between thousands": lambda r: _table(
        r, "Temps [ms];Vitesse [tr/min];Courant [uA]", lambda i, t, w, c: ";".join(
            f"{x:,.9f}".replace(",", "\u202f").replace(".", ",") for x in (1e3 * t, w * RPM, c * 1e6)
        ),
    ).encode(),
    "a unit at each number without a blank": lambda r: _table(
        r, "time,speed,current", lambda i, t, w, c: f"{t!r}s,{w * RPM!r}rpm,{c * MA!r}mA"
    ).encode(),
    "a clock that is called x, in ms": lambda r: _table(
        r, "x [ms];Actual Velocity [rpm];Actual Current [mA]",
        lambda i, t, w, c: f"{1e3 * t!r};{w * RPM!r};{c * MA!r}",
    ).encode(),
    "Chinese units": lambda r: _table(
        r, "时间(秒),转速(转/分),电流(毫安)", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c * MA!r}"
    ).encode("gb18030"),
    "Julian dates": lambda r: _table(
        r, "JD,speed_rpm,current_A", lambda i, t, w, c: f"{2460381.9 + t / 86400.0:.10f},{w * RPM!r},{c!r}"
    ).encode(),
    "topics of other times in one table": lambda r: _table(
        r, "__time,/wheel/speed_rpm,/cmd/current_A,/case/degC",
        lambda i, t, w, c: f"{t!r},{w * RPM!r},,\n{t + 0.0011!r},,{c!r},\n{t + 0.03!r},,,{20.0 + i!r}",
    ).encode(),
}  # fmt: skip


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_dialect_is_read_in_its_meaning(tmp_path: Path, run: rw_ekf.Log, dialect: str) -> None:
    """Times from the first on, speeds and currents are those of the run, to the digits that the dialect has."""
    path = tmp_path / "lab.csv"
    path.write_bytes(DIALECTS[dialect](_rows(run)))
    log = rw_ekf.read(path)
    assert len(log) == len(run)
    assert log.time_s - log.time_s[0] == pytest.approx(run.time_s - run.time_s[0], abs=6e-4)
    whole = dialect == "negative numbers as registers have them"
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s, abs=0.53 * RAD_S_PER_RPM if whole else 1e-6)
    assert log.current_A == pytest.approx(run.current_A, abs=5.1e-4 if whole else 1e-7)
    assert any("read as" in text for text in log.warnings)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_the_map_that_columns_writes_reads_the_same(tmp_path: Path, run: rw_ekf.Log, dialect: str) -> None:
    """`columns` then `--columns`: the numbers that are read without a map, to the bit."""
    path, out = tmp_path / "lab.csv", tmp_path / "map.yaml"
    path.write_bytes(DIALECTS[dialect](_rows(run)))
    assert main(["columns", str(path), "--out", str(out)]) == 0
    guessed, mapped = rw_ekf.read(path), rw_ekf.read(path, out)
    assert np.array_equal(guessed.time_s, mapped.time_s)
    assert np.array_equal(guessed.speed_rad_s, mapped.speed_rad_s)
    assert np.array_equal(guessed.current_A, mapped.current_A)


def test_runs_beside_each_other_are_numbered_before_their_units(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`t1 [s];n1 [rpm];I1 [A];t2 [s];...` are two runs, each a segment, and no second wheel to ask about."""
    path = tmp_path / "lab.csv"
    path.write_text(_table(
        _rows(run), ";".join(f"t{k} [s];n{k} [rpm];I{k} [A]" for k in (1, 2)),
        lambda i, t, w, c: f"{t!r};{w * RPM!r};{c!r};{t!r};{2.0 * w * RPM!r};{c!r}",
    ))  # fmt: skip
    log = rw_ekf.read(path)
    assert np.unique(log.segment).size == 2
    assert log.speed_rad_s == pytest.approx(np.concatenate([run.speed_rad_s, 2.0 * run.speed_rad_s]), abs=1e-6)


def test_an_amount_above_the_names_is_no_unit_of_a_column(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`limits: speed: 6000 rpm, current: 2000 mA` says nothing of the numbers: their units are asked for."""
    path = tmp_path / "lab.csv"
    for line in (
        "# limits: time: 60 s, speed: 6000 rpm, current: 2000 mA",
        "# speed (held at 500 rpm), current (0 to 2 A)",
    ):
        path.write_text(_table(_rows(run), f"{line}\nt_s,speed,current", lambda i, t, w, c: f"{t!r},{w!r},{c!r}"))
        wanted = {question.name for question in rw_ekf.guess_columns(path).guess.questions}
        assert "speed_rad_s" in wanted


def test_a_drive_that_stands_in_every_row_is_not_thinned(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A command in all rows and a speed in a tenth of them: nothing of the command is dropped in silence."""
    path = tmp_path / "lab.csv"
    path.write_text(_table(
        _rows(run), "t_s,wheel_rpm,cmd_A", lambda i, t, w, c: f"{t!r},{w * RPM if i % 10 == 0 else ''},{c!r}"
    ))  # fmt: skip
    assert read_table(path, ColumnMap()).rows == len(run)


def test_the_third_of_several_sensors_is_no_celsius(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`temp_c` beside `temp_a` says which sensor, and a command that is 0 or 65535 is no -1."""
    path = tmp_path / "lab.csv"
    path.write_text(_table(
        _rows(run), "t_s,wheel_rpm,current_A,temp_a,temp_c,dac_current_cmd",
        lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r},20,90,{65535 if c > 0 else 0}",
    ))  # fmt: skip
    entries = {line.name: line.entry for line in rw_ekf.guess_columns(path).guess.lines}
    assert "temperature_degC" not in entries
    assert not any("wrap" in entry for entry in entries.values())


def test_a_slow_channel_is_held_where_it_has_values_all_through(tmp_path: Path, run: rw_ekf.Log) -> None:
    """A temperature in a row of eight goes on from row to row; one whose sensor ended early is left as it stands."""
    for name, most in (("slow", len(run)), ("ended", len(run) // 4)):
        warmth = [f"{20 + i}" if i % 8 == 0 and i < most else "" for i in range(len(run))]
        lines = (f"{t!r},{w * RPM!r},{c!r},{warmth[i]}\n" for i, (t, w, c) in enumerate(_rows(run)))
        (tmp_path / f"{name}.csv").write_text("t_s,wheel_rpm,current_A,case_temp_c\n" + "".join(lines))
    held = rw_ekf.read(tmp_path / "slow.csv").channels["temperature_degC"]
    assert np.array_equal(held, 20.0 + 8 * (np.arange(len(run)) // 8))
    assert "temperature_degC" not in rw_ekf.read(tmp_path / "ended.csv").channels


def test_words_where_nothing_was_measured_are_gaps(tmp_path: Path, run: rw_ekf.Log) -> None:
    """`ERR` and `N/A` among numbers, be it late in a file, take no column away; the readings around them stay."""
    rows = [[f"{t!r}", f"{w * RPM!r}", f"{c!r}"] for t, w, c in _rows(run)]
    for row, cell in ((9, "ERR"), (300, "N/A"), (301, "overflow")):
        rows[row][1] = cell
        path = tmp_path / "lab.csv"
        path.write_text("Time (s),RPM,Current (A)\n" + "".join(",".join(cells) + "\n" for cells in rows))
        rows[row][1] = f"{float(run.speed_rad_s[row]) * RPM!r}"
        log = rw_ekf.read(path)
        assert np.flatnonzero(np.isnan(log.speed_rad_s)).tolist() == [row]
        assert np.delete(log.speed_rad_s, row) == pytest.approx(np.delete(run.speed_rad_s, row), abs=1e-6)


def test_a_line_of_thousands_of_cells_takes_no_longer_than_its_length(tmp_path: Path) -> None:
    """A table that lies on its side, a row a channel, is asked about at once; it took minutes."""
    path = tmp_path / "lies.csv"
    path.write_text("".join(f"{name},{','.join(['0.125'] * 4000)}\n" for name in ("time_s", "n_rpm", "i_A")))
    assert "no column is known to be the time" in rw_ekf.guess_columns(path).text()


def test_thousands_are_marked_late_in_a_file(tmp_path: Path) -> None:
    """A point between thousands that comes first far below what is looked at is no decimal point, and no text."""
    path = tmp_path / "lab.csv"
    speed = [f"{i % 1000},5" for i in range(900)] + [f"1.{i:03d},5" for i in range(100)]
    path.write_text(
        "Zeit [s];Drehzahl [1/min];Strom [A]\n"
        + "".join(f"{_comma(0.1 * i, 1)};{n};0,{i % 7}\n" for i, n in enumerate(speed))
    )
    assert rw_ekf.read(path).speed_rad_s[-1] * RPM == pytest.approx(1099.5)


@pytest.mark.parametrize(
    "name", ["Overall Efficiency (gf/W)", "power_w", "slip s", "Electrical Power (W)", "accel_m_s2"]
)
def test_what_only_looks_like_a_quantity_is_not_taken_for_it(tmp_path: Path, run: rw_ekf.Log, name: str) -> None:
    """A letter within a longer name, or within a unit that is none of ours, names no speed, time or drive."""
    path = tmp_path / "lab.csv"
    path.write_text(_table(_rows(run), f"x,{name}", lambda i, t, w, c: f"{i},{0.1 * i!r}"))
    assert not rw_ekf.guess_columns(path).guess.lines


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("speed_m_s", "m/s"), ("omega_rad_s", "rad/s"), ("wRadS", "rad/s"), ("speed_deg_s", "deg/s"),
        ("speed_deg_per_s", "deg/s"),
        ("t_ms", "ms"), ("I/mA", "mA"), ("n in 1/min", "rpm"), ("acc_m_s2", "m/s2"), ("temp_deg_C", "degC"),
        ("i_A", "A"), ("micros", "us"), ("ms_today", "ms"),
        ("Drehzahl [U/min]", "rpm"), ("\u03c9 (rad\u00b7s\u207b\u00b9)", "rad/s"), ("\u8f49\u901frpm", "rpm"),
    ],
)  # fmt: skip
def test_a_unit_is_known_in_every_way_that_a_name_has_it(name: str, unit: str) -> None:
    """The unit is that which was meant, and what a map writes for it means the same."""
    stated = stated_by(name)
    assert stated.unit == unit_of(unit)
    assert unit_of(stated.unit_text) == stated.unit


def test_two_runs_in_one_file_are_two_segments(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Where the time falls back to its beginning a segment begins, and no row is lost."""
    path = tmp_path / "lab.csv"
    rows = _rows(run)[:200]
    path.write_text(_table([*rows, *rows], "t [s],n [rpm],I [A]", lambda i, t, w, c: f"{t!r},{w * RPM!r},{c!r}"))
    log = rw_ekf.read(path)
    assert len(log) == 400
    assert int(log.segment.max()) == 1
    assert int(log.segment[200]) == 1


def test_runs_of_gnuplot_are_segments_and_a_comment_on_one_is_no_name(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Blank lines and comments between runs that begin at zero each: a segment each, and `t/s` is the time's name."""
    rows = _rows(run)
    (tmp_path / "lab.dat").write_text("\n\n\n".join(
        f"# disc, bearing cleaned\n# Run {n}\n# t/s{'n/min^-1':>27s}{'I/A':>20s}\n"
        + "".join(f"{t - part[0][0]:9.2f}{w * RPM:24.12f}{c:22.14f}\n" for t, w, c in part)
        for n, part in enumerate((rows[:201], rows[201:]))
    ))  # fmt: skip
    assert rw_ekf.guess_columns(tmp_path / "lab.dat").document()["map"]["time_s"]["column"] == "t/s"
    log = rw_ekf.read(tmp_path / "lab.dat")
    assert np.bincount(log.segment).tolist() == [201, 399]
    assert log.time_s[201] == 0.0
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s)


def test_stamps_of_whole_seconds_are_spread(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Ten rows of one stamp each are a tenth of a second apart, as they were."""
    path = tmp_path / "lab.csv"
    path.write_text(_table(
        _rows(run), "time,rpm,current_A", lambda i, t, w, c: f"{_at(t).strftime('%d.%m.%Y %H:%M:%S')},{w * RPM!r},{c!r}"
    ))  # fmt: skip
    log = rw_ekf.read(path)
    assert np.diff(log.time_s) == pytest.approx(np.diff(run.time_s), abs=0.02)


def test_an_angle_that_begins_anew_gives_the_speed(tmp_path: Path, run: rw_ekf.Log) -> None:
    """Degrees from 0 to 360 and no speed: the rate, by the shorter way, is the mean speed since the row before."""
    path = tmp_path / "lab.csv"
    angle = np.concatenate([[0.0], np.cumsum(0.2 * run.speed_rad_s[:-1] * np.diff(run.time_s))])
    rows = [(float(t), float(a), float(c)) for t, a, c in zip(run.time_s, angle, run.current_A, strict=True)]
    path.write_text(
        _table(rows, "t [s],angle [deg],I [A]", lambda i, t, a, c: f"{t!r},{math.degrees(a) % 360.0!r},{c!r}")
    )
    log = rw_ekf.read(path)
    assert log.speed_rad_s[1:] == pytest.approx(0.2 * run.speed_rad_s[:-1], abs=1e-6)


@pytest.mark.parametrize(
    ("header", "wanted"),
    [
        ("t [s],speed,I [A]", "rpm, rad/s or deg/s"),
        ("t [s],n [rpm],I1 [A],I2 [A]", "which of them is the current of the motor"),
        ("t [s],rpm_1,rpm_2,I [A]", "which of them is the speed of the wheel"),
        ("t [s],n [rpm],battery current [A]", "what the supply gives"),
        ("t [s],position [counts],I [A]", "how many to a turn"),
        ("t [s],erpm,I [A]", "how many pole pairs"),
        ("t [s],Motor Electrical Speed (rpm),I [A]", "divided by the pole pairs"),
        ("a,n [rpm],I [A]", "no column is known to be the time"),
        ("t [s],n [rpm],x", "no column is known to be the current"),
        ("t [s],n [rpm],Ia [A]", "seems to be of one phase"),
        ("t [s],n [rpm],motor phase current [A]", "seems to be of one phase"),
        ("t [s],n [rpm],Strangstrom U [A]", "seems to be of one phase"),
    ],
)
def test_what_a_file_does_not_say_is_asked(tmp_path: Path, run: rw_ekf.Log, header: str, wanted: str) -> None:
    """No meaning is taken in silence: the log is refused with the question, and the map holds it as a comment."""
    path = tmp_path / "lab.csv"
    width = header.count(",") + 1
    line = "{t!r},{a!r},{c!r}" if width == 3 else "{t!r},{a!r},{c!r},{d!r}"
    path.write_text(_table(_rows(run), header, lambda i, t, w, c: line.format(t=t, a=300.5 + w * RPM, c=c, d=c * 1.01)))
    with pytest.raises(rw_ekf.Error, match=wanted):
        rw_ekf.read(path)
    found = rw_ekf.guess_columns(path)
    assert not found.is_certain
    check_document({**found.document(), "out": None})
    assert "# ASKED: " in found.text()
    with pytest.raises(rw_ekf.Error, match=wanted):
        _ = found.column_map


def test_answers_settle_what_was_asked(tmp_path: Path, run: rw_ekf.Log, capsys: pytest.CaptureFixture[str]) -> None:
    """--set names a column, a unit or a number; the document says that nothing is left open, and the log reads so."""
    path, out = tmp_path / "lab.csv", tmp_path / "map.yaml"
    path.write_text(_table(_rows(run), "a,b,c", lambda i, t, w, c: f"{t!r},{w * RPM * 7!r},{c * MA!r}"))
    reported = ["time=a:s", "speed=1:erpm", "speed.pole_pairs=7", "current=c", "current.unit=mA"]
    assert main(["columns", str(path), "--out", str(out), "--json", *(w for t in reported for w in ("--set", t))]) == 0
    document = json.loads(capsys.readouterr().out)
    check_document(document)
    assert document["certain"]
    assert document["questions"] == []
    log = rw_ekf.read(path, out)
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s, abs=1e-9)
    assert log.current_A == pytest.approx(run.current_A, abs=1e-12)


def test_a_sign_that_no_machine_has_is_doubted(tmp_path: Path) -> None:
    """The names are plain, and the motion says that drive and speed are counted in opposite directions."""
    run = rw_ekf.simulate("identification", duration_s=200.0, seed=6)
    path = tmp_path / "lab.csv"
    path.write_text(_table(_rows(run), "t [s],n [rpm],I [A]", lambda i, t, w, c: f"{t!r},{w * RPM!r},{-c!r}"))
    found = rw_ekf.guess_columns(path)
    assert not found.is_certain
    assert "opposite directions" in found.text()


def test_a_coast_down_without_a_current_is_one(tmp_path: Path) -> None:
    """A speed that only falls, and nothing that could drive: the current is zero throughout."""
    path = tmp_path / "lab.csv"
    speed = 3000.0 * np.exp(-0.01 * np.arange(300) * 0.1)
    path.write_text("t [s],n [rpm]\n" + "".join(f"{0.1 * i!r},{n!r}\n" for i, n in enumerate(speed.tolist())))
    assert not rw_ekf.read(path).current_A.any()


def test_a_name_over_several_lines_is_one_line_of_a_map(tmp_path: Path, run: rw_ekf.Log) -> None:
    """What a sheet's header breaks, and a file's name, become no further lines of the YAML that is read back."""
    rate = np.tile([0.0, 0.5, 1.0], len(run))[: len(run)]
    table = {"t\n[s]": run.time_s, "speed\n[mm/s]": run.speed_rad_s * MA, "duty\ncycle": rate}
    path, out = tmp_path / "lab\n: [.parquet", tmp_path / "map.yaml"
    parquet.write_table(pa.table({name: pa.array(values) for name, values in table.items()}), path)
    found = rw_ekf.guess_columns(path)
    found.save(out)
    assert rw_ekf.read(path, out).speed_rad_s == pytest.approx(run.speed_rad_s)


def test_tables_in_memory_are_read_as_files_are(run: rw_ekf.Log) -> None:
    """A mapping of arrays, and whatever arrow takes as a table, with names of one's own."""
    table = {"t [s]": run.time_s, "n [rpm]": run.speed_rad_s * RPM, "I [A]": run.current_A}
    log = rw_ekf.read(table)
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s)
    assert np.array_equal(rw_ekf.read(run.table).speed_rad_s, run.speed_rad_s)
    words = np.array(["forward" if speed > 0 else "reverse" for speed in run.speed_rad_s])
    turned = {"t [s]": run.time_s, "n [rpm]": np.abs(run.speed_rad_s) * RPM, "direction": words, "I [A]": run.current_A}
    assert rw_ekf.read(turned).speed_rad_s == pytest.approx(run.speed_rad_s)
    stamps = np.array([_at(t).replace(tzinfo=None) for t in run.time_s], dtype="datetime64[us]")
    assert np.diff(
        rw_ekf.read({"time": stamps, **{name: table[name] for name in list(table)[1:]}}).time_s
    ) == pytest.approx(np.diff(run.time_s), abs=1e-5)
    with pytest.raises(rw_ekf.Error, match="found int"):
        rw_ekf.read(5)


def test_a_damaged_row_gives_no_value_to_another_column(tmp_path: Path) -> None:
    """Of rows that are nearly all whole, one that lost a cell is left out and counted; a sign that is none is a gap."""
    rows = [f"{20 * i},{i % 50},{10 * math.sin(0.02 * i):.3f},11.9" for i in range(600)]
    rows[100], rows[200], rows[300] = (
        "2000,-\N{REPLACEMENT CHARACTER},.89",
        "4000,7\N{REPLACEMENT CHARACTER},3,11.9",
        "6000,-1",
    )
    (tmp_path / "a.log").write_text("capture\ntime_ms,pwm_percent,rpm,vbat_V\n" + "\n".join(rows) + "\n")
    table = read_table(tmp_path / "a.log", ColumnMap())
    assert table.rows == 598
    assert any("2 lines, first line 103," in text for text in table.warnings)
    assert np.flatnonzero(np.isnan(table.floats(1))).tolist() == [199]


@pytest.mark.parametrize(
    ("header", "factor"),
    [
        ("%time,field.header.stamp,field.velocity0,field.effort0", 1.0),
        (
            "timestamp,fault,velocity,q_current,mode,position,torque,d_current,voltage,temperature",
            0.5 / math.pi,
        ),
        ("t_ns,t2_ns,axis0.encoder.vel_estimate,axis0.motor.current_control.Iq_measured", 0.5 / math.pi),
    ],
)
def test_a_program_s_own_names_have_the_units_that_it_publishes(
    tmp_path: Path, run: rw_ekf.Log, header: str, factor: float
) -> None:
    """ROS's JointState as `rostopic echo -p` prints it, moteus's registers and ODrive's estimates in turns a second."""

    def line(i: int, t: float, w: float, c: float) -> str:
        stamp = 1652967301000000000 + round(1e9 * t)
        return f"{stamp},{stamp},{factor * w!r},{c!r}" + ",10,0.5,0,0,24,28" * ("fault" in header)

    (tmp_path / "a.csv").write_text(_table(_rows(run), header, line))
    log = rw_ekf.read(tmp_path / "a.csv")
    assert log.speed_rad_s == pytest.approx(run.speed_rad_s, abs=1e-9)
    assert log.current_A == pytest.approx(run.current_A, abs=1e-9)
