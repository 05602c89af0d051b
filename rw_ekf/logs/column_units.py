"""Units as people write them at a column, and what one of each is in the log's own.

Spellings are compared without case, blanks and the marks of a power or a product: `min^-1`, `1/min`, `U/min` and `rpm`
are one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from typing import Literal, NamedTuple

from rw_ekf.units import RAD_S_PER_RPM

Quantity = Literal[
    "time", "speed", "angle", "current", "torque", "force", "voltage", "temperature", "pressure", "share",
    "acceleration", "linear_speed", "length", "other",
]  # fmt: skip
Per = Literal["", "counts_per_turn", "pole_pairs", "gear_ratio"]
_DEGREE = math.radians(1.0)
_TURN = 2.0 * math.pi


class Unit(NamedTuple):
    """One of it is `factor` of the log's own unit, `offset` more where zero is elsewhere."""

    quantity: Quantity
    factor: float = 1.0
    offset: float = 0.0
    per: Per = ""  # a number that the column does not say, by which it is divided


def _all(unit: Unit, spellings: str) -> dict[str, Unit]:
    return dict.fromkeys(spellings.split(), unit)


_SPELLINGS: dict[str, Unit] = {
    **_all(Unit("time"), "s с 秒 сек sn saniye 초 sec secs second seconds sekunde sekunden sek seconde secondes "
        "segundos secondi"),
    **_all(Unit("time", 1e-3), "ms мс 毫秒 ミリ秒 밀리초 millisecondi milisegundos msn msec msecs millis millisec "
        "millisecs millisecond milliseconds millisekunden"),
    **_all(Unit("time", 1e-6), "us usec 微秒 マイクロ秒 мкс usecs micros microsec microsecond microseconds mus"),
    **_all(Unit("time", 1e-9), "ns nsec nanos nanosec nanosecond nanoseconds"),
    **_all(Unit("time", 60.0), "min mins minute minutes minuten 分 分钟 мин minutos minuti"),
    **_all(Unit("time", 3600.0), "h hr hrs hour hours std stunden"),
    **_all(Unit("time", 86400.0), "d day days tage"),
    **_all(Unit("speed"), "rad/s рад/с rad/秒 弧度/秒 ラジアン/秒 rads rad.s rad/sec radps rads-1 rad.s-1 rads/s "
        "rad/second radian/s radians/s radians/sec radians/second radianspersecond"),
    **_all(Unit("speed", 1e-3), "mrad/s"),
    **_all(Unit("speed", RAD_S_PER_RPM), "rpm rpms 转/分 转/分钟 回転/分 1/min об/мин мин-1 /min min-1 u/min upm umin "
        "umdr/min tr/min tr/mn trs/min r/min rev/min r.p.m rev./min vueltas/min voltas/min rotacoes/min rotações/min "
        "revs/min 转每分 转/min kierr/min 1/perc fordulat/perc obr/min dev/dk devir/dk devir/dak d/dk d/dak omw/min "
        "toeren/min varv/min ot/min turn/min turns/min giri/min rot/min revolutionsperminute rotations/min "
        "rotations/minute revolutions/min rev/minute omdr/min vòng/phút vrt/min aps/min"),
    **_all(Unit("speed", 1e3 * RAD_S_PER_RPM), "krpm"),
    **_all(Unit("speed", RAD_S_PER_RPM, per="pole_pairs"), "erpm"),
    **_all(Unit("speed", 1e-1 * RAD_S_PER_RPM), "drpm"),
    **_all(Unit("speed", 1e-3 * RAD_S_PER_RPM), "mrpm"),
    **_all(Unit("speed", _DEGREE), "deg/s °/s °/秒 deg/秒 度/秒 °/sec deg/sec degs-1 dps degree/s degrees/s "
        "degrees/sec degps degrees/second grad/s gradsec degreespersecond"),
    **_all(Unit("speed", _TURN), "hz rps 转/秒 回転/秒 об/с rev/s rev/sec revs/s turn/s turns/s turns/sec u/s u/sec "
        "tr/s tr/sec r/s r/sec 1/s s-1 cyclespersecond rotations/s rotations/sec rotations/second rev/second"),
    **_all(Unit("speed", _TURN, per="counts_per_turn"), "counts/s count/s cps "
        "counts/sec count/sec cnt/s cnt/sec cnts/s pulses/sec ticks/sec inc/sec ticks/s tick/s pulses/s inc/s steps/s"),
    **_all(Unit("angle"), "rad radian radians bogenmass"),
    **_all(Unit("angle", 1e-3), "mrad"),
    **_all(Unit("angle", _DEGREE), "deg degs degree degrees grad °"),
    **_all(Unit("angle", _TURN), "turn turns rev revs revolution revolutions umdrehung umdrehungen umdr tour tours"),
    **_all(Unit("angle", _TURN, per="counts_per_turn"), "counts count cnt cnts ticks tick inc increments inkremente "
        "pulses lsb steps"),
    **_all(Unit("current"), "a а 安 安培 amp amps ampere amperes"),
    **_all(Unit("current"), "arms aeff apk apeak ampsrms amprms ampererms amppk ampspk amppeak ampspeak"),  # stated so
    **_all(Unit("current", 1e-3), "marms maeff mapk mapeak"),
    **_all(Unit("current", 1e-3), "ma ма 毫安 milliamp milliamps milliampere milliamperes"),
    **_all(Unit("current", 1e-6), "ua µa"),
    **_all(Unit("current", 1e-2), "centiamp centiamps centiampere centiamperes"),
    **_all(Unit("current", 1e-1), "deciamp deciamps deciampere deciamperes"),
    **_all(Unit("current", 1e3), "ka"),
    **_all(Unit("torque"), "nm n.m n-m newton-meter newton-meters newtonmeter newtonmeters nmeter"),
    **_all(Unit("torque", 1e-3), "mnm nmm n.mm"),
    **_all(Unit("torque", 1e-6), "unm"),
    **_all(Unit("torque", 1e-2), "ncm"),
    **_all(Unit("torque", 1.3558179483), "lbft lbfft ft-lb lb-ft lbf-ft ftlb ftlbs ft-lbs ft-lbf"),
    **_all(Unit("torque", 0.1129848290), "lbin inlb in-lb lb-in lbfin lbf-in lbf.in"),
    **_all(Unit("torque", 7.0615518e-3), "ozin oz-in ozfin ozf-in ozf.in oz.in"),
    **_all(Unit("torque", 9.80665), "kgfm kgf.m kgf-m"),
    **_all(Unit("torque", 9.80665e-2), "kgfcm kgf.cm kgf-cm"),
    **_all(Unit("torque", 9.80665e-5), "gfcm gf.cm gf-cm"),
    **_all(Unit("torque", 1e-7), "dyncm dyn.cm dyn-cm dynecm"),
    **_all(Unit("force"), "n newton newtons"),
    **_all(Unit("force", 1e3), "kn"),
    **_all(Unit("voltage"), "v в volt volts vdc vac"),
    **_all(Unit("voltage", 1e-3), "mv millivolt millivolts mvdc mvac"),
    **_all(Unit("temperature"), "degc °c °с 摄氏度 celsius c degreescelsius degreec"),
    **_all(Unit("temperature", 5.0 / 9.0, -160.0 / 9.0), "degf °f fahrenheit f"),
    **_all(Unit("temperature", 1.0, -273.15), "k kelvin degk"),
    **_all(Unit("temperature", 1e-3), "mdegc"),
    **_all(Unit("pressure"), "pa pascal"),
    **_all(Unit("pressure", 1e2), "hpa mbar"),
    **_all(Unit("pressure", 1e3), "kpa"),
    **_all(Unit("pressure", 1e5), "bar"),
    **_all(Unit("pressure", 133.322368), "torr mmhg"),
    **_all(Unit("pressure", 101325.0), "atm"),
    **_all(Unit("share", 1e-2), "% percent prozent pct"),
    **_all(Unit("share"), "-1..1 0..1 pu p.u"),
    **_all(Unit("acceleration"), "rad/s2 rad/s/s m/s2 g deg/s2 rpm/s"),
    **_all(Unit("linear_speed"), "m/s"),
    **_all(Unit("linear_speed", 1e-2), "cm/s"),
    **_all(Unit("linear_speed", 1e-3), "mm/s"),
    **_all(Unit("linear_speed", 1.0 / 60.0), "m/min"),
    **_all(Unit("linear_speed", 1.0 / 3.6), "km/h kmh kmph kph км/ч"),
    **_all(Unit("linear_speed", 0.44704), "mph mi/h"),
    **_all(Unit("length"), "m meter meters metre metres"),
    **_all(Unit("length", 1e-3), "mm"),
    **_all(Unit("length", 1e-6), "um"),
    **_all(Unit("other"), "w kw mw kg gf kgf j wh ah mah ohm ohms mohm db khz mhz kv kq utc gmt kgm2 kg.m2 nm/a s2 "
        "none - n/a"),
}  # fmt: skip

# What programs publish for the columns of their own logs, which these do not repeat, each with where it is published.
_JOINT_STATES, _OF_JOINT = r"(?:.*/)?joint_states?[/.](?:.+[/.])?", r"(?:[/.\[].*)?"
_PUBLISHED = (
    # ODrive, firmware 0.5 and later (docs.odriverobotics.com, "Upgrading to 0.5": turns in place of counts)
    (re.compile(r"(.*[._])?(vel_estimate|vel_setpoint|input_vel)"), "turns/s"),
    (re.compile(r"(.*[._])?(pos_estimate|pos_setpoint|input_pos)"), "turns"),
    (re.compile(r"(.*[._])?i[qd]_(measured|setpoint)", re.IGNORECASE), "A"),
    # VESC Tool, real-time data: the position in sixths of an electrical turn, the speed in electrical turns a minute
    (re.compile(r"tacho(_?meter)?(_value|_abs(_value)?)?"), "steps"),
    (re.compile(r"(.*[._])?erpm"), "erpm"),
    # ROS, sensor_msgs/JointState of a joint that turns, as `rostopic echo -p` names its columns
    # and PlotJuggler its curves
    (re.compile(rf"field\.velocity\d*|{_JOINT_STATES}velocity{_OF_JOINT}"), "rad/s"),
    (re.compile(rf"field\.effort\d*|{_JOINT_STATES}effort{_OF_JOINT}"), "N m"),
    (re.compile(rf"field\.position\d*|{_JOINT_STATES}position{_OF_JOINT}"), "rad"),
    # mjbots moteus, its telemetry (the fields of its high-rate plots; a register's unit)
    (re.compile(r"(.*[./])?servo_stats\.velocity"), "rev/s"),
    (re.compile(r"(.*[./])?servo_stats\.position"), "rev"),
    # PX4, EscReport.msg
    (re.compile(r"(.*\.)?(esc\[\d+\]\.)?esc_rpm"), "rpm"),
    (re.compile(r"(.*\.)?(esc\[\d+\]\.)?esc_current"), "A"),
)

# The same of a program whose names are anybody's, by what stands beside them: all registers requested of moteus
# (mjbots.github.io/moteus/protocol/registers: revolutions, revolutions a second, N m, A).
_PUBLISHED_TOGETHER = {
    frozenset(
        {"mode", "position", "velocity", "torque", "q_current", "d_current", "voltage", "temperature", "fault"}
    ): {
        "position": "rev", "velocity": "rev/s", "torque": "N m", "q_current": "A", "d_current": "A", "voltage": "V",
    },
    # VESC: what it answers as rpm is electrical (commands.c, COMM_GET_VALUES), which VescUart, pyvesc and the ROS
    # driver (VescState.msg) pass on.
    frozenset({"avgMotorCurrent", "dutyCycleNow", "inpVoltage"}): {
        "rpm": "erpm", "avgMotorCurrent": "A", "avgInputCurrent": "A", "inpVoltage": "V",
    },
    frozenset({"avg_motor_current", "duty_cycle_now"}): {
        "rpm": "erpm", "avg_motor_current": "A", "avg_input_current": "A", "v_in": "V",
    },
    frozenset({"current_motor", "duty_cycle", "charge_drawn"}): {
        "speed": "erpm", "current_motor": "A", "current_input": "A", "voltage_input": "V",
    },
    # Betaflight's log of flights, by its viewer (blackbox-log-viewer, flightlog_fields_presenter.js): erpm in hundreds,
    # and hundredths as blackbox_decode leaves them where the name has no unit.
    frozenset({"loopIteration", "eRPM[0]"}): {f"eRPM[{motor}]": "100 erpm" for motor in range(8)},
    frozenset({"loopIteration", "amperageLatest"}): {"amperageLatest": "0.01 A", "vbatLatest": "0.01 V"},
    **{  # of a JointState as `rostopic echo` prints it, with the stamp of ROS 1 or of ROS 2
        frozenset({f"header.stamp.{whole}", f"header.stamp.{part}", "position", "velocity", "effort"}): {
            "position": "rad", "velocity": "rad/s", "effort": "N m",
        }
        for whole, part in (("secs", "nsecs"), ("sec", "nanosec"))
    },
}  # fmt: skip

# The log's own columns, by what a unit measures.
OF_COLUMN: dict[str, tuple[Quantity, ...]] = {
    "time_s": ("time",),
    "speed_rad_s": ("speed", "linear_speed"),
    "angle_rad": ("angle", "length"),
    "current_A": ("current", "torque", "force", "voltage", "share"),
    "current_command_A": ("current", "torque", "force", "voltage", "share"),
    "command_delay_s": ("time",),
    "temperature_degC": ("temperature",),
    "pressure_Pa": ("pressure",),
    "bus_voltage_V": ("voltage",),
}


_SCALED = re.compile(r"x?(0?\.0*1|10+|1e[+-]?\d+)[x.]?([^\d.].*|1/.*)")  # a power of ten: 2 is the number of something
_FRACTION = re.compile(r"1/(10+)([^\d.].*)")  # 1/100 s
_PER_COUNT = re.compile(r"(\d*\.?\d+(?:e-?\d+)?)([^\d.].*?)(?:/|per)(?:lsb|bit|digit|count|cnt)s?")
_PREFIXED = {"cA": (0.01, "a"), "dA": (0.1, "a"), "cV": (0.01, "v"), "dV": (0.1, "v")}  # MAVLink's; `ca` is a word


def unit_of(spelling: str) -> Unit | None:
    """What a unit means; None where it is none that is known. `0.1 rpm` is a tenth of one."""
    plain = plain_spelling(spelling)
    if plain == "mrpm" and spelling.strip(" [(")[0] == "M":  # a motor's, or thousandths
        return None
    if (scaled := size_of_count(spelling)) is None and plain not in _SPELLINGS and "_" not in spelling:
        match = _SCALED.fullmatch(plain)  # not of current_10_A: the tenth
        scaled = None if match is None else (float(match[1]), match[2])
        if (part := _FRACTION.fullmatch(plain)) is not None:
            scaled = 1.0 / float(part[1]), part[2]
    if scaled is None or (unit := _SPELLINGS.get(scaled[1])) is None or unit.offset:
        return _SPELLINGS.get(plain)
    return unit._replace(factor=unit.factor * scaled[0])


def size_of_count(spelling: str) -> tuple[float, str] | None:
    """How many of which unit a count is, where its unit says so: `0.5 rpm/bit`, `10 mA per LSB`, `cA`."""
    match = _PER_COUNT.fullmatch(plain_spelling(spelling))
    return _PREFIXED.get(spelling) if match is None else (float(match[1]), match[2])


def plain_spelling(spelling: str) -> str:
    """A unit without what people write in different ways."""
    text = re.sub(r"(?<=\d),(?=\d)", ".", spelling.strip().lower()).translate(_PLAIN)
    text = re.sub(r"(?<![\d.])10\s*(?:\^|\*\*)\s*[({]?([+-]?\d+)[)}]?", r"1e\1", text)
    return re.sub(r"[\s*·⋅×^_\[\](){}<>\"']|\*\*", "", text).rstrip(".")


def habitual_unit(name: str, beside: Collection[str] = ()) -> str:
    """The unit that a program publishes for what it calls so; empty for none. beside: the names of the whole table.

    A name is compared from its end, in whole words of a path: `axis0.encoder.vel_estimate` and `vel_estimate` are one.
    """
    return unit_among(name, beside) or next((unit for pattern, unit in _PUBLISHED if pattern.fullmatch(name)), "")


def unit_among(name: str, beside: Collection[str]) -> str:
    """The same where the names of the table show which program it is, whatever the name alone would say."""
    return next((held[name] for names, held in _PUBLISHED_TOGETHER.items() if name in held and names <= {*beside}), "")


def with_unit(name: str, unit: str) -> str:
    """A name with the unit that stood in a row below it: `n [rpm]`."""
    bare = re.sub(r"\s*\(.*\)$", "", unit) if unit[:1] not in "[({" else unit  # `A (Current)`
    return f"{name} [{bare.strip('[](){} ')}]" if unit else name


def units_known(column: str) -> str:
    """For a message: some units that a column may have."""
    wanted = OF_COLUMN.get(column, ())
    shown = [
        next(name for name in _SPELLINGS if _SPELLINGS[name] is unit) for unit in _distinct() if unit.quantity in wanted
    ]
    return ", ".join(shown)


def _distinct() -> list[Unit]:
    return list({id(unit): unit for unit in _SPELLINGS.values()}.values())


_PLAIN = str.maketrans(
    {
        "⁻": "-",
        "−": "-",
        "¹": "1",
        "²": "2",
        "µ": "u",
        "μ": "u",
        "º": "°",
        "ω": "w",
        "∙": "",
        "â": "",
        "℃": "°c",
        "℉": "°f",
    }
)
