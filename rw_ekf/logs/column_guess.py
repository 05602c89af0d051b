"""What the columns of a foreign log are, as far as names, units and numbers say; what stays open becomes a question.

A guess is made only where nothing else fits. Names say which column is what (`column_names`), a unit says how large one
of it is, the numbers say whether a column can be that (a time rises, an angle begins anew after a turn). Two columns
that fit as well, or a unit that may be either of two, are a question: no number is taken in a wrong meaning in silence.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.column_answers import Answers
from rw_ekf.logs.column_doubts import ask_what_is_open
from rw_ekf.logs.column_drive import find_drive
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.column_records import LEAST_SHARE, Column, Guess, best_of, columns_of
from rw_ekf.logs.column_speed import find_speed, rad_of_one
from rw_ekf.logs.column_time import find_time
from rw_ekf.logs.column_units import Unit
from rw_ekf.logs.raw_table import RawTable

_NOTHING_GIVEN = ColumnMap()
_WARM_DEGC = 10.0  # T_C alone is below it: a Coulomb torque, in whatever unit, or of no use to know
_UPWARD = 0.01  # of the rows at most: late ones, where the newest stands first
_NOT_OF_THE_WHEEL = (
    "cpu", "mcu", "pcb", "board", "ambient", "amb", "room", "raum", "env", "chamber", "delta", "rise", "barometric",
    "set", "setpoint", "yaw", "pitch", "roll", "pendulum", "pend",
)  # fmt: skip
_ELECTRONICS = (
    "mos", "mosfet", "mosfets", "fet", "fets", "igbt", "esc", "inverter", "driver", "bat", "battery", "batt", "bms",
    "gpu", "coolant",
)  # fmt: skip
_SLIPS = (1.0, 180.0 / math.pi, 30.0 / math.pi, 2.0 * math.pi, 6.0, 60.0, 360.0, 1e3, 1e6)  # of mistaken units
_NEAR = 0.1  # of the logarithm of a ratio
_EXTRA = {"temperature": "temperature_degC", "pressure": "pressure_Pa", "bus_voltage": "bus_voltage_V"}


def needs_guess(columns: Sequence[str]) -> bool:
    """Whether the names of columns lack, under the log's own names, what a log needs."""
    names = set(columns)
    return not (
        "time_s" in names and names & {"speed_rad_s", "speed_rpm"} and names & {"current_A", "current_command_A"}
    )


def guess_columns(table: RawTable, answers: dict[str, str] | None = None, given: ColumnMap = _NOTHING_GIVEN) -> Guess:
    """Guess what the columns of a table are.

    answers: of `--set`: a column, or of NAME.unit a value; given: a map without columns, whose options stay.
    """
    reported = Answers(answers or {}, table)
    if reported.rate is None and given.rate_hz is not None:
        reported.rate = given.rate_hz, f"rate_hz: {given.rate_hz:g}"
    guess = Guess(options=given.options())
    if reported.only is not None:
        guess.options["only"] = {"column": reported.only[0], "value": reported.only[1]}
        table = table.of_only(*reported.only)
    columns = columns_of(table)
    if _newest_first(columns):
        guess.options["reverse"] = True
        table = table.reversed()
        columns = columns_of(table)
    clock = find_time(table, columns, reported, guess)
    time_s = None if clock is None else clock.time_s
    left = [column for column in columns if clock is None or column.number != clock.number]
    speed = find_speed(table, left, time_s, reported, guess)
    left = [column for column in left if column is not speed]
    find_drive(left, speed, reported, guess)
    _find_further(left, speed, None if clock is None else clock.time_s, reported, guess)
    taken = [line.entry.get("column") for line in guess.lines]
    for column in (each for each in columns if each.turn is not None and each.key in taken):
        guess.notes.append(f"{column.shown}: what lies just below {column.turn:g} is negative, and read as unsigned")
    if not any(table.names):
        guess.notes.append(f"its columns have no names: COLUMN is a number from 0 to {len(table.names) - 1}")
    reported.add_certain(guess)
    ask_what_is_open(table, columns, reported, guess)
    return guess


def _newest_first(columns: list[Column]) -> bool:
    """Whether all times fall from row to row, as in what a web page exports; what counts down the motion shows."""
    clocks = [c for c in columns if c.role == "time" and not c.stated.has("countdown")]
    times = [c.values for c in clocks if np.isfinite(c.values).all() and np.ptp(c.values) > 0.0]
    return bool(times) and all(values[-1] < values[0] and np.mean(np.diff(values) > 0.0) < _UPWARD for values in times)


def _find_further(
    columns: list[Column], speed: Column | None, time_s: Float64Array | None, reported: Answers, guess: Guess
) -> None:
    """Add what a log may have beside, where one column fits and says its unit."""
    for role, name in _EXTRA.items():
        best = best_of([c for c in columns if c.role == role and np.isfinite(c.values).mean() > LEAST_SHARE])
        if len(best) != 1 or (best[0].stated.words == {"t"} and np.nanmedian(best[0].values) < _WARM_DEGC):
            continue
        elsewhere = _NOT_OF_THE_WHEEL + (_ELECTRONICS if role == "temperature" else ())
        if (best[0].unit or best[0].name == name) and not best[0].stated.any_of(*elsewhere):
            entry = reported.with_more(name, best[0].entry(best[0].unit))
            guess.take(name, entry, f"its name says {best[0].unit or 'so'}")
    angles = [c for c in columns if c.role == "angle" and c.moves]
    unit = angles[0].stated.unit if len(angles) == 1 else None
    turning = speed is not None and unit is not None and not unit.per and not angles[0].stated.has("temperature")
    if turning and not angles[0].stated.any_of(*_NOT_OF_THE_WHEEL) and _turns(angles[0], unit):
        if (ratio := _of_another(angles[0], speed, time_s)) is not None:
            guess.notes.append(f"{angles[0].shown} turns {ratio:.3g} times as fast as the speed says: it is left out")
            return
        guess.take("angle_rad", angles[0].entry(angles[0].unit), f"its name says {angles[0].unit}")


def _of_another(angle: Column, speed: Column | None, time_s: Float64Array | None) -> float | None:
    """How many times as fast as a speed an angle turns that begins anew nowhere; None where it may be the speed's.

    By a factor that a mistaken unit has, the motion shows what is mistaken (`rw_ekf.identify.misread`).
    """
    unit = None if speed is None else speed.stated.unit
    if speed is None or unit is None or unit.per or angle.stated.unit is None:
        return None
    turned = rad_of_one(speed, angle, time_s)
    if (
        not turned
        or float(np.nanmax(angle.values) - np.nanmin(angle.values)) * angle.stated.unit.factor <= 2.0 * math.pi
    ):
        return None
    ratio = abs(turned) / unit.factor
    return None if any(abs(abs(math.log(ratio)) - math.log(slip)) < _NEAR for slip in _SLIPS) else ratio


def _turns(angle: Column, unit: Unit | None) -> bool:
    """Whether an angle goes through a turn, or half of one: a pendulum's beside a wheel does not."""
    return unit is not None and float(np.nanmax(angle.values) - np.nanmin(angle.values)) * unit.factor > math.pi
