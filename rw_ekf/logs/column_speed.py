"""Which column is the speed, in which unit, or of which angle it is the rate."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.column_answers import Answers
from rw_ekf.logs.column_brackets import without_unit
from rw_ekf.logs.column_counts import interval_of, is_since_last, per_turn, pole_pairs
from rw_ekf.logs.column_records import LEAST_SHARE, Column, Guess, Line, chosen
from rw_ekf.logs.column_units import OF_COLUMN, unit_of
from rw_ekf.logs.odd_columns import COUNTERS, turn_of
from rw_ekf.logs.raw_table import RawTable

_TURNING = 20.0  # largest speed called n that is in 1/min; no wheel turns at less than that and no more
_TURN_UNITS: dict[float | None, str] = {360.0: "deg", 2.0 * math.pi: "rad"}
_ANGLES = ("angle", "angolo", "angulo", "drehwinkel", "mechangle", "phi", "rotorangle", "theta", "winkel")
_INERTIAL = ("gyro", "gyrox", "gyroy", "gyroz", "gx", "gy", "gz", "imu")  # which turn with what carries the wheel
_FAR, _OFTEN = 0.4, 0.95  # of a turn between rows, which is no longer sure to be the shorter way; in how many rows
_APART, _LEAST = 0.05, 1.0e-300  # of its square: so much of a speed is no multiple of another that turns with it
_NAMES = ("speed_rad_s", "speed_rpm")
_SAME = 0.03  # relative: a rate of an angle, and a speed, are the same


@dataclass(frozen=True, eq=False)
class _Offered:
    """What may be the speed; are_angles: none is a speed, but an angle of which it is the rate."""

    speeds: list[Column]
    angles: list[Column]
    is_given: bool

    @property
    def are_angles(self) -> bool:
        return bool(self.angles) and not self.speeds


def find_speed(
    table: RawTable, columns: list[Column], time_s: Float64Array | None, reported: Answers, guess: Guess
) -> Column | None:
    """Choose the speed, or the angle of which it is the rate."""
    offered = _offered(columns, reported)
    column = _choice(table, columns, offered, guess)
    if column is None:
        return None
    sign = _direction(columns, column)
    if not reported.unit(*_NAMES) and (column.unit == "" or offered.are_angles) and is_since_last(column):
        _take_counts(table, column, time_s, sign, reported, guess)
    elif offered.are_angles:
        _take_rate_of_angle(table, column, reported, guess)
    else:
        _take_speed(table, column, offered.angles, time_s, sign, reported, guess)
    return column


def _offered(columns: list[Column], reported: Answers) -> _Offered:
    """What may be the speed: the column that was answered, else those that are one by their names."""
    given = reported.of(*_NAMES)
    speeds = [c for c in columns if c.role == "speed" and c.moves]
    angles = [c for c in columns if c.role == "angle" and c.moves]
    if given is None or given[1] is None:
        own = [c for c in speeds if c.stated.has("machine") or not c.stated.any_of(*_INERTIAL)]
        return _Offered(own, angles, given is not None)
    answered = [c for c in columns if c.number == given[1]]
    known = unit_of(reported.unit(*_NAMES))
    if answered[0].role == "angle" and (known is None or known.quantity in ("angle", "length")):
        return _Offered([], answered, True)
    return _Offered(answered, angles, True)


def _choice(table: RawTable, columns: list[Column], offered: _Offered, guess: Guess) -> Column | None:
    """The best of what is offered; None, and a question, where that is in doubt."""
    what = "angle" if offered.are_angles else "speed"
    candidates = offered.angles if offered.are_angles else offered.speeds
    bad = next((c for c in columns if _is_spoilt(c, table)), None)
    if bad is not None and offered.are_angles and not offered.is_given:
        gaps = table.rows - int(np.isfinite(bad.values).sum())
        text = f"{bad.shown} is no number in {gaps} of {table.rows} rows: is the speed another's rate?"
        guess.ask("speed_rad_s", f"{text} --set speed=COLUMN.", *filter(None, map(_known_line, offered.angles)))
        return None
    still = next((c for c in columns if c.role == "speed" and not c.moves and not c.stated.has("linear")), None)
    if still is not None and not offered.are_angles and all(c.stated.has("linear") for c in offered.speeds):
        candidates = []  # gyros, or the vehicle's speed over ground
    asked = len(guess.questions)
    column = chosen(candidates, f"{what} of the wheel", "speed_rad_s", guess, _known_line)
    if not offered.is_given and (doubt := _doubt(column, columns, offered)):
        guess.ask("speed_rad_s", *doubt)
        return None
    if column is None and len(guess.questions) == asked:
        why = "" if still is None else f"{still.shown} never changes, and "
        if not any(c.moves for c in columns):
            why = "no column beside the time has numbers that change, as messages and events have none; "
        guess.ask("speed_rad_s", f"{why}no column is known to be the speed: --set speed=COLUMN.")
    return column


def _doubt(column: Column | None, columns: list[Column], offered: _Offered) -> tuple[str, *tuple[Line, ...]] | None:
    """Why what was chosen may not be the speed of the wheel, and what else could be written; None where nothing is."""
    other = next((c for c in offered.speeds if _is_electrical(c)), None)
    if column and other and not _is_electrical(column) and not _go_together(column, other):
        text = f"{column.shown} and {other.shown} do not turn together: which of them is the speed of the wheel?"
        return f"{text} --set speed=COLUMN.", *filter(None, [_known_line(column)])
    spoilt = next((c for c in columns if c.role == "speed" and c.spoilt), None)
    if spoilt is not None and (column is None or column.role == "angle" or spoilt.rank > column.rank):
        return (f"{spoilt.shown} {spoilt.spoilt}; or --set speed=COLUMN.",)
    return None


def _take_speed(
    table: RawTable,
    column: Column,
    angles: list[Column],
    time_s: Float64Array | None,
    sign: Column | None,
    reported: Answers,
    guess: Guess,
) -> None:
    """Add the speed with its unit, or ask for what of the unit is open."""
    given = reported.of(*_NAMES)
    answered = reported.unit(*_NAMES) or ("rpm" if given and given[0] == "speed_rpm" else "")
    unit, why = _speed_unit(column, angles, time_s, answered)
    assumed = not (answered or (column.unit and not column.by_habit) or _unit_in_words(column))
    if unit is None:
        text = f"{column.shown} {without_unit(column)}, and goes to {column.top:.4g}: rpm, rad/s or deg/s?"
        lines = (_speed_line(column, each, "", sign, reported) for each in ("rpm", "rad/s", "deg/s"))
        guess.ask("speed_rad_s", text, *lines)
        return
    known, more = unit_of(unit), {}
    if known is not None and known.quantity not in OF_COLUMN["speed_rad_s"]:
        text = f"{column.shown} is in {unit}: how fast is one? --set speed.unit=rpm --set speed.scale=RPM_OF_ONE."
        guess.ask("speed_rad_s", text)
        return
    if known is not None and known.per and known.per not in reported.more.get("speed_rad_s", {}):
        per = (per_turn if known.per == "counts_per_turn" else pole_pairs)(table, column)
        if per is None:
            text = f"{column.shown} is in {unit}: how many {known.per.replace('_', ' ')}? --set speed.{known.per}=N."
            guess.ask("speed_rad_s", text, _speed_line(column, unit, "", sign, reported))
            return
        more = {known.per: per}
    if known is not None and known.quantity == "linear_speed":
        guess.notes.append(f"{column.shown} is in {unit}: metres stand where radians would, and nothing here turns")
    guess.lines.append(replace(_speed_line(column, unit, why, sign, reported, **more), assumed=assumed))


def _is_electrical(column: Column) -> bool:
    """Whether a speed is a motor's by its unit: nothing else has pole pairs."""
    return column.stated.unit is not None and column.stated.unit.per == "pole_pairs"


def _go_together(one: Column, other: Column) -> bool:
    """Whether a speed is a multiple of another, but for noise and filters."""
    known = np.isfinite(one.values) & np.isfinite(other.values)
    x, y = np.abs(one.values[known]), np.abs(other.values[known])  # a VESC's has no sign
    left = y - x * float(x @ y) / max(float(x @ x), _LEAST)
    return float(left @ left) < _APART * float(y @ y)


def _is_spoilt(column: Column, table: RawTable) -> bool:
    """Whether a column is a speed by its name, and hardly any of what stands in it is a number."""
    known = np.isfinite(column.values)
    if column.role != "speed" or float(known.mean()) > LEAST_SHARE:
        return False
    return bool(known.any()) or (table.is_text(column.number) and any(filter(None, table.cells(column.number))))


def _speed_line(column: Column, unit: str, why: str, sign: Column | None, reported: Answers, **more: object) -> Line:
    """The line of a speed: under the name that says rpm where that is its unit, unless the unit was answered."""
    if sign is not None:
        more |= {"sign_of": sign.key, "backward": sign.says_backward}
        why = f"{why}; without a sign, which {sign.shown} has"
    if unit_of(unit) == unit_of("rpm") and "unit" not in reported.more.get("speed_rad_s", {}):
        entry = reported.with_more("speed_rad_s", reported.with_more("speed_rpm", column.entry("", **more)))
        return Line("speed_rpm", entry, why)
    return Line("speed_rad_s", reported.with_more("speed_rad_s", column.entry(unit, **more)), why)


def _known_line(column: Column) -> Line | None:
    """The line of a speed or angle where its name says all that it needs: None where a question remains."""
    unit = column.unit or _unit_in_words(column)
    known = unit_of(unit)
    if known is None or known.per:
        return None
    if column.role == "angle":
        turn = _turn_of(column)
        entry: dict[str, object] = {
            "derivative_of": column.key,
            **({} if turn is None else {"wrap": turn}),
            "unit": unit,
        }
        return Line("speed_rad_s", entry, "")
    return (
        Line("speed_rpm", column.entry(), "")
        if known == unit_of("rpm")
        else Line("speed_rad_s", column.entry(unit), "")
    )


def _speed_unit(
    column: Column, angles: list[Column], time_s: Float64Array | None, reported: str
) -> tuple[str | None, str]:
    """The speed's unit, and what says so; None where nothing does."""
    stated = column.stated
    if reported:
        return reported, "as it was set"
    if column.name in {"speed_rad_s", "speed_rpm"}:
        return ("rpm" if column.name == "speed_rpm" else "rad/s"), "its name is the log's own"
    if column.unit:
        return column.unit, f"its name says {column.unit}"
    if word := _unit_in_words(column):
        return word, f"its name says {word}"
    for angle in angles:
        found = _by_angle(column, angle, time_s)
        if found is not None:
            return found, f"{angle.shown} turns as fast as that"
    if (
        stated.any_of("n", "nm", "drehzahl", "motordrehzahl", "istdrehzahl", "raddrehzahl", "giri", "tours", "regime")
        and column.top > _TURNING
    ):
        return "1/min", "what is called so is counted per minute"
    if stated.any_of(
        "omega", "w", "thetadot", "dtheta", "qdot", "qd", "dq", "phidot", "omg", "winkelgeschwindigkeit"
    ) and (not column.is_whole and column.top < 300.0):
        return "rad/s", "what is called so is in rad/s"
    return None, ""


def _unit_in_words(column: Column) -> str:
    """A unit that is one of the words of a name; empty for none."""
    return next((word for word in ("erpm", "krpm", "rpm", "dps") if column.stated.any_of(word, f"rpm{word}")), "")


def _by_angle(column: Column, angle: Column, time_s: Float64Array | None) -> str | None:
    """The unit in which a speed is the rate of an angle of a known unit."""
    ratio = rad_of_one(column, angle, time_s)
    for unit in ("rpm", "rad/s", "deg/s", "rev/s"):
        known = unit_of(unit)
        if ratio is not None and known is not None and abs(ratio / known.factor - 1.0) < _SAME:
            return unit
    return None


def rad_of_one(column: Column, angle: Column, time_s: Float64Array | None) -> float | None:
    """How many rad/s an angle of a known unit turns where a speed is one; None where that cannot be determined."""
    of_angle = angle.stated.unit
    if of_angle is None and (turn := _turn_of(angle)) in _TURN_UNITS:
        of_angle = unit_of(_TURN_UNITS[turn])
    if time_s is None or of_angle is None or of_angle.per:
        return None
    turn = 2.0 * math.pi / of_angle.factor
    change = np.diff(angle.values)
    if float(np.ptp(angle.values[np.isfinite(angle.values)])) <= turn * (1.0 + 1e-9):
        change -= turn * np.round(change / turn)
    mean = 0.5 * (column.values[1:] + column.values[:-1]) * np.diff(time_s)
    sure = np.isfinite(mean) & np.isfinite(change) & (np.abs(mean) > 0.3 * np.nanmax(np.abs(mean), initial=0.0))
    if int(sure.sum()) < 20:
        return None
    return float(np.median(change[sure] / mean[sure])) * of_angle.factor


def _take_counts(
    table: RawTable,
    column: Column,
    time_s: Float64Array | None,
    sign: Column | None,
    reported: Answers,
    guess: Guess,
) -> None:
    """Add a column that has, in each row, an encoder's counts since the row before; ask for what is open of it."""
    per = per_turn(table, column) or reported.more.get("speed_rad_s", {}).get("counts_per_turn")
    interval_s = interval_of(table, column, time_s)
    scale = None if interval_s is None else float(f"{1.0 / interval_s:.9g}")
    why = "counts from row to row"
    line = _speed_line(column, "counts/s", why, sign, reported, counts_per_turn=per or 4096, scale=scale)
    open_of_it = ""
    if not per:
        open_of_it = "how many to a turn? --set speed.counts_per_turn=N."
    elif "scale" not in line.entry:
        open_of_it = "over how long? --set speed.scale=INTERVALS-A-SECOND."
    elif not column.is_whole:
        open_of_it = "its numbers are not whole: what are they?"
    if open_of_it:
        guess.ask("speed_rad_s", f"{column.shown} counts from row to row: {open_of_it}", line)
    else:
        guess.lines.append(line)


def _take_rate_of_angle(table: RawTable, column: Column, reported: Answers, guess: Guess) -> None:
    """Add the speed as the rate of an angle, or ask for what is open of it."""
    unit = column.unit or reported.unit("angle_rad", "speed_rad_s")
    more = reported.more.get("speed_rad_s", {})
    stated = more.get("counts_per_turn") or per_turn(table, column)
    turn = _turn_of(column, stated)
    unit = unit or ("counts" if turn is not None and (stated or turn in COUNTERS) else "")
    known = unit_of(unit)
    entry: dict[str, object] = {"derivative_of": column.key}
    entry |= {} if column.missing is None else {"missing": column.missing}
    entry |= {} if turn is None else {"wrap": turn}
    if known is not None and known.per:
        per = stated or (None if turn in COUNTERS else turn)
        entry |= {"unit": unit, known.per: per or 4096}
        if per is None:
            text = f"{column.shown} is in {unit}: how many to a turn? --set speed.counts_per_turn=N."
            guess.ask("speed_rad_s", text, Line("speed_rad_s", entry, ""))
            return
    elif known is not None:
        entry["unit"] = unit
    elif turn is not None:
        entry["scale"] = 1.0 if abs(turn - 2.0 * math.pi) < 1e-6 else float(f"{2.0 * math.pi / turn:.12g}")
        if turn not in _TURN_UNITS and not column.stated.any_of(*_ANGLES):
            # No motion shows it: a wheel of another size moves as this one does.
            guess.warnings.append(
                f"{column.shown} begins anew after {turn:.6g}, and that was taken for a turn, which no word "
                "of the file says: a counter may hold more turns, or less than one: --set speed.counts_per_turn=N"
            )
    else:
        text = f"{column.shown} is an angle without a unit: rad, deg, turns or counts?"
        answers = (Line("speed_rad_s", entry | {"unit": unit}, "") for unit in ("rad", "deg", "turns"))
        guess.ask("speed_rad_s", text, *answers)
        return
    if turn is not None and not reported.has("speed_rad_s") and _goes_too_far(column.values, turn):
        text = f"{column.shown} goes nearly half a turn and more from row to row: which way, and how often around?"
        guess.ask("speed_rad_s", text, Line("speed_rad_s", entry, ""))
        return
    why = f"there is no speed: it is the rate of {column.shown}"
    why += f", which begins anew after {turn:.6g}" if turn is not None else ""
    guess.take("speed_rad_s", entry | {key: value for key, value in more.items() if key != "unit"}, why)


def _turn_of(column: Column, counts: object = None) -> float | None:
    """After how much an angle begins anew; None where it does not. counts: of a turn, where somebody says so."""
    unit = column.stated.unit
    if unit is not None and not unit.per:
        return turn_of(column.values, (2.0 * math.pi / unit.factor,), only=True)
    return turn_of(column.values, (counts,) if isinstance(counts, float) else ())


def _goes_too_far(angle: Float64Array, turn: float) -> bool:
    """Whether an angle (n,) that begins anew goes so far between rows that the shorter way may be the wrong one."""
    change = np.diff(angle[np.isfinite(angle)])
    return float(np.quantile(np.abs(change - turn * np.round(change / turn)), _OFTEN)) > _FAR * turn


def _direction(columns: list[Column], speed: Column) -> Column | None:
    """The column that has the sign of a speed that has none, in each row: what was marked here and there is none."""
    if float(np.nanmin(speed.values)) < 0.0:
        return None
    others = (c for c in columns if c.role == "direction" and c.number != speed.number)
    known = ((c, np.isfinite(c.values[np.isfinite(speed.values)])) for c in others)  # words are no numbers
    return next((c for c, is_number in known if is_number.all() or not is_number.any()), None)
