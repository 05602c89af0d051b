"""Which column drives the wheel: currents, else what stands for one, else nothing did."""

from __future__ import annotations

import re
from functools import partial

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.column_answers import Answers
from rw_ekf.logs.column_brackets import without_unit
from rw_ekf.logs.column_names import Role
from rw_ekf.logs.column_records import Column, Guess, Line, chosen
from rw_ekf.logs.column_units import unit_of
from rw_ekf.logs.log_columns import READABLE_COLUMNS

_AMPERES = (0.02, 20.0)  # largest current that, with decimals and no unit, is in amperes: less moves no motor
_FED = ("supply", "battery", "batt", "bus", "hv", "netzteil", "versorgung", "alimentation", "alim", "fuente")
_NOTHING: tuple[str, dict[str, object]] = ("current_command_A", {"constant": 0.0})
_FREE = Line(*_NOTHING, "if it coasted all the time")
_CURRENTS: tuple[tuple[Role, str, str], ...] = (
    ("current", "current_A", "current of the motor"),
    ("current_set", "current_command_A", "current that was commanded"),
)
_DRIVES: tuple[tuple[Role, str], ...] = (
    ("torque", "a torque stands where a current would: motor_gain is then per newton metre"),
    ("force", "a force stands where a current would: motor_gain is then per newton"),
    ("voltage", "a voltage stands where a current would: motor_gain is then per volt, and viscous has the back-EMF"),
    ("share", "a share of the full drive stands where a current would: motor_gain is then at full drive"),
)  # fmt: skip
_UNKNOWN = ("other", "neither")
_MAY_DRIVE = ("current", "current_set", "torque", "force", "voltage", "share")
_DRIVEN = (
    "drive", "ctrl", "control", "cmd", "command", "output", "out", "input", "u", "actuation", "power", "set", "effort",
    "leistung", "throttle", "duty", "pwm",
)  # fmt: skip
_MEASURED_WITH = (
    "shunt", "mon", "monitor", "sensor", "acs", "adc", "accelerometer", "strain", "thermistor", "axial", "preload",
    "normal", "weight", "soc", "humidity", "load", "thrust", "lift", "tacho", "tachometer", "hall",
)  # fmt: skip
_NO_TORQUE_OF_DRIVE = (
    "reaction", "disturbance", "friction", "fric", "drag", "brake", "load", "external", "ext", "cogging", "reibung",
    "carga", "resistant", "frottement", "carico",
)  # fmt: skip
_KIND_OF_AMPERE = re.compile(r"rms|eff|pk|peak", re.IGNORECASE)
_HARDLY = 0.05  # of itself: a supply's voltage moves by so much under load
_STEADY = 0.1  # of itself: so little scatters the voltage of a supply, and not that of a motor
_SAME_POWER = 0.02  # of the largest: a power and the product that it is, in so many of the rows at least
_PARTS = 12  # of a record, of which the medians are compared
_RISES = 0.2  # of the largest of them: a wheel that nothing drives is not faster later
_FULL_SHARE = 1.05  # of a drive: more is a count of something
_HALF_PERCENT = 40.0  # never below it: a bridge whose zero is at 50 %
_UNITS_OF_DRIVE = {"torque": ("N m", "mN m"), "voltage": ("V", "mV")}
_RAIL = re.compile(r"(?<![A-Za-z0-9])\d{1,2}v\d?(?![A-Za-z0-9])", re.IGNORECASE)  # I_3v3, current_24V


def find_drive(columns: list[Column], speed: Column | None, reported: Answers, guess: Guess) -> None:
    """Choose what drives the wheel: what was answered, else currents, else what stands for one, else nothing did."""
    given = reported.of("current_A", "current_command_A")
    if given is not None:
        _take_answered(given, columns, speed, reported, guess)
        return
    spoilt = next((c for c in columns if c.role in ("current", "current_set") and c.spoilt), None)
    if spoilt is not None and not any(c.role == spoilt.role and c.moves and c.rank >= spoilt.rank for c in columns):
        guess.ask("current_A", f"{spoilt.shown} {spoilt.spoilt}; or --set current=COLUMN.")
        return
    asked = len(guess.questions)
    if _find_currents(columns, reported, guess) or len(guess.questions) > asked:
        return
    if not _find_stand_in(columns, reported, guess):
        _without_drive(columns, speed, guess)


def _take_answered(
    given: tuple[str, int | None], columns: list[Column], speed: Column | None, reported: Answers, guess: Guess
) -> None:
    """Add the column that was answered, or no current."""
    name, number = given
    if number is not None:
        _take_current(next(c for c in columns if c.number == number), name, reported, guess)
        return
    guess.take(name, {"constant": 0.0}, "as it was set: no current")
    if speed is not None and (rise := _speeds_up(speed.values)) is not None:
        guess.notes.append(
            f"{speed.shown} goes from {rise[0]:.4g} to {rise[1]:.4g}: something drives the wheel, and a model "
            "that is driven by nothing will not explain it"
        )


def _find_stand_in(columns: list[Column], reported: Answers, guess: Guess) -> bool:
    """Add what stands for a current, or ask about it; whether there is anything."""
    asked = len(guess.questions)
    for role, note in _DRIVES:
        column = chosen([c for c in columns if c.role == role and c.moves], "drive", "current_A", guess, _in_its_unit)
        if column is not None and (text := _no_drive(column, role)):
            guess.ask("current_A", f"{column.shown} {text}", Line("current_A", column.entry(column.unit), ""), _FREE)
        elif column is not None and role in _UNITS_OF_DRIVE and not (column.unit or reported.unit("current_A")):
            text = f"{column.shown} {without_unit(column)}: a {role}, or the current?"
            lines = (Line("current_A", column.entry(unit), "") for unit in (*_UNITS_OF_DRIVE[role], "A"))
            guess.ask("current_A", text, *lines)
        elif column is not None:
            guess.take("current_A", reported.with_more("current_A", column.entry(column.unit)), note)
            guess.notes.append(f"{column.shown}: {note}")
        if column is not None or len(guess.questions) > asked:
            return True
    return False


def _without_drive(columns: list[Column], speed: Column | None, guess: Guess) -> None:
    """Where no column is a drive: ask about what comes near; nothing drove a wheel that only slows down."""
    term = next((c for c in columns if c.role == "term" and c.moves), None)
    held = next((c for c in columns if c.role in _MAY_DRIVE and np.nanmax(np.abs(c.values), initial=0.0) > 0.0), None)
    if term is not None:
        text = (
            f"{term.shown} seems to be what a controller has integrated: is it the current? Else --set current=COLUMN."
        )
        guess.ask("current_A", text, *(Line("current_A", term.entry(unit), "") for unit in ("mA", "A")), _FREE)
    elif held is not None and not held.stated.has("supply", "bus"):
        text = f"{held.shown} never changes: did it drive the wheel all the time?"
        guess.ask("current_A", text, Line("current_A", held.entry(held.unit), ""), _FREE)
    elif speed is None or not _coasts(speed.values):
        text = "no column is known to be the current: --set current=COLUMN, or --set current=none."
        guess.ask("current_A", text, _FREE)
    elif other := next((c for c in columns if c.moves and c.role in _UNKNOWN and c.stated.any_of(*_DRIVEN)), None):
        share = Line("current_A", other.entry(), "a share of the full drive")
        guess.ask("current_A", f"the speed only falls, but {other.shown} moves: does it drive it?", share, _FREE)
    else:
        guess.take(*_NOTHING, "no column is a drive, and the speed only falls: a coast-down")


def _no_drive(column: Column, role: Role) -> str:
    """Why a column that could be a drive may be none, or not as it stands; empty where nothing says so."""
    stated = column.stated
    named = stated.has(role) or stated.any_of(*_DRIVEN) or column.name == "current_A"
    if stated.has("set") and stated.has("speed"):
        return "seems to be the speed that was wanted: is it what drives the wheel?"
    if (
        stated.any_of(*_MEASURED_WITH)
        or (role == "voltage" and stated.has("current"))
        or (stated.unit is not None and not named)
    ):
        return f"is in {column.unit or 'what nobody says'}: is it what drives the wheel, and not another measurement?"
    if role == "torque" and stated.any_of(*_NO_TORQUE_OF_DRIVE):
        return "may be no torque of the motor: is it what drives the wheel?"
    low, high = float(np.nanmin(column.values)), float(np.nanmax(column.values))
    if role != "share" and high - low < _HARDLY * max(abs(low), abs(high)):
        return "hardly changes: is it what drives the wheel?"
    if role == "share" and stated.unit is None and high > _FULL_SHARE:
        return f"goes to {high:g}: of how much (255, 1023, 2000?), and where is zero? `scale` and `offset` in a map"
    if role == "share" and stated.unit is not None and low >= _HALF_PERCENT:
        return f"is never below {low:g} %: is zero in the middle? `offset: -0.5` in a map"
    return ""


def _find_currents(columns: list[Column], reported: Answers, guess: Guess) -> bool:
    """Add the measured current and the commanded one; whether there is one."""
    found = False
    for role, name, what in _CURRENTS:
        column = chosen(
            [c for c in columns if c.role == role and c.moves], what, name, guess, partial(_amperes_of, name)
        )
        if column is None:
            continue
        fed = column.stated.any_of(*_FED) or not column.stated.has("machine")  # "motor supply current" is the supply's
        if role == "current" and column.is_of_a_phase:
            text = f"{column.shown} seems to be of one phase, which goes up and down as the rotor turns"
            guess.ask(name, f"{text}: is it what makes the torque?", Line(name, column.entry(column.unit), ""))
        elif role == "current" and column.stated.any_of("limit", "peak", "max", "min"):
            guess.ask(name, f"{column.shown}: is it the current that flows?", Line(name, column.entry(column.unit), ""))
        elif (column.stated.has("other_load") or _RAIL.search(column.name)) and not column.stated.has("machine"):
            text = f"{column.shown} may be of something else than the motor: is it the motor's current?"
            guess.ask(name, text, Line(name, column.entry(column.unit), ""))
        elif (
            role == "current"
            and not column.stated.has("torque_axis")
            and ((column.stated.has("supply", "bus") and fed) or _feeds(column, columns))
        ):
            text = f"{column.shown} seems to be what the supply gives: is it the motor's current?"
            guess.ask(name, text, Line(name, column.entry(column.unit), ""))
        else:
            found = True
            _take_current(column, name, reported, guess)
    return found


def _take_current(column: Column, name: str, reported: Answers, guess: Guess) -> None:
    """Add a current, with its unit; a question where that is not known."""
    unit = reported.unit(name, "current_A", "current_command_A")
    why, assumed = "as it was set" if unit else "its name says so", False
    if not unit and column.name not in READABLE_COLUMNS:
        if column.unit:
            unit, why = column.unit, f"its name says {column.unit}"
        elif _in_amperes(column):
            unit, assumed = "A", True
            why = f"it goes to {column.top:.3g}, with decimals: in mA that would move nothing"
        else:
            text = f"{column.shown} {without_unit(column)}, and goes to {column.top:.4g}: mA or A?"
            guess.ask(name, text, *(Line(name, column.entry(unit), "") for unit in ("mA", "A")))
            return
    if column.stated.has("torque_axis"):
        guess.notes.append(f"{column.shown}: motor_gain is then per ampere of the q axis, in its drive's convention")
    if _KIND_OF_AMPERE.search(unit):
        guess.notes.append(f"{column.shown}: motor_gain is then per ampere of that kind ({unit})")
    unit = "" if unit_of(unit) == unit_of("A") else unit
    guess.take(name, reported.with_more(name, column.entry(unit)), why, assumed=assumed)


def _feeds(column: Column, columns: list[Column]) -> bool:
    """Whether a current stands with a voltage that hardly changes, as a motor's does with its speed: the supply's.

    With one that is called as plainly as the current, or times which it is the power of another column.
    """
    controlled = any(c.role == "current_set" and c.moves for c in columns)  # which only a motor's is
    if controlled or column.stated.has("machine", "torque_axis") or column.name in READABLE_COLUMNS:
        return False
    volts = [c for c in columns if c.role in ("voltage", "bus_voltage") and np.isfinite(c.values).any()]
    held = [c for c in volts if np.nanstd(c.values) < _STEADY * abs(np.nanmean(c.values))]
    plain = [c for c in volts if c.role == "voltage" and c.moves]
    if plain and all(c in held for c in plain):
        return True
    steady = [c.values for c in held]
    powers = [c.values for c in columns if c.role == "other" and c.moves and np.nanmax(np.abs(c.values)) > 0.0]
    products = ((power, values * column.values) for power in powers for values in steady)
    found = (
        np.abs(np.abs(power) - np.abs(product)) < _SAME_POWER * np.nanmax(np.abs(power)) for power, product in products
    )
    return any(np.mean(same) > 1.0 - _SAME_POWER for same in found)


def _in_amperes(column: Column) -> bool:
    """Whether numbers without a unit are amperes by their size."""
    converted = not column.stated.any_of("raw", "adc")
    return converted and not column.is_whole and _AMPERES[0] < column.top < _AMPERES[1]


def _in_its_unit(column: Column) -> Line | None:
    """The line of a drive that says its unit, or has none."""
    return Line("current_A", column.entry(column.unit), "") if column.unit or column.role == "share" else None


def _amperes_of(name: str, column: Column) -> Line | None:
    """The line of a current whose unit is known."""
    known = column.unit or column.name in READABLE_COLUMNS or _in_amperes(column)
    return Line(name, column.entry(column.unit), "") if known else None


def _speeds_up(speed: Float64Array) -> tuple[float, float] | None:
    """From where to where the size of a speed (n,) rises most, beyond its noise; None where it hardly does."""
    size = np.abs(speed[np.isfinite(speed)])
    if size.size < _PARTS:
        return None
    parts = np.array([float(np.median(part)) for part in np.array_split(size, _PARTS)])
    lowest = np.minimum.accumulate(parts)
    at = int(np.argmax(parts - lowest))
    return (float(lowest[at]), float(parts[at])) if parts[at] - lowest[at] > _RISES * parts.max() else None


def _coasts(speed: Float64Array) -> bool:
    """Whether the size of a speed (n,) falls all the way, but for its noise."""
    size = np.abs(speed[np.isfinite(speed)])
    if size.size < 20:
        return False
    parts = np.array([float(np.median(part)) for part in np.array_split(size, _PARTS)])
    return bool(np.all(np.diff(parts) <= 1.0e-3 * parts[0])) and parts[-1] < 0.9 * parts[0]
