"""Which column is the speed, in which unit, or of which angle it is the rate."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.column_answers import Answers
from rw_ekf.logs.column_records import Column, Guess, Line, chosen
from rw_ekf.logs.column_time import rate_in
from rw_ekf.logs.column_units import unit_of
from rw_ekf.logs.raw_table import RawTable

_TURNING = 20.0  # largest speed called n that is in 1/min; no wheel turns at less than that and no more
_TURNS = (2.0 * math.pi, 360.0, 1.0, *(2.0**bits for bits in range(8, 25)), 4000.0, 3600.0)
_TURN_UNITS: dict[float | None, str] = {360.0: "deg", 2.0 * math.pi: "rad"}
_FULL = 0.97  # of a turn, which an angle that begins anew covers
_SAME = 0.03  # relative: a rate of an angle, and a speed, are the same


_TIMED = r"(\d+(?:[.,]\d+)?)[ _]?([mu]?s)(?![a-z])"
_A_ROW = r"(?:row|sample|print\w*|record|message|reading|loop|interval|update|poll|zeile|abtast\w*|intervall)"
# Counts of one row alone: since the one before, or in its own interval of time. Lines and cycles are the encoder's too.
SINCE_LAST = re.compile(
    r"(?:counts?|cnts?|ticks?|inc\w*|inkr\w*|pulses|edges)\b.{0,30}?(?:"
    rf"\b(?:since|seit)\b.{{0,12}}\b(?:last|previous|prior|letzte\w*) (?:line|{_A_ROW})\b|"
    rf"(?:\bper|\bpro|/|\bin)[ _]?(?:the |each |last )*(?:{_A_ROW}\b|{_TIMED}))",
    re.IGNORECASE,
)
_INTERVAL = re.compile(
    rf"(?:per|pro|/|\bin|each|every|alle|of|interval|period)\W{{0,3}}(?:the )?(?:last )?{_TIMED}", re.IGNORECASE
)
_EVEN, _NEARLY_ALL = 0.1, 0.9  # of a step and of the steps: where rows come as evenly, their interval is one


def find_speed(
    table: RawTable, columns: list[Column], time_s: Float64Array | None, told: Answers, guess: Guess
) -> Column | None:
    """Choose the speed, or the angle of which it is the rate."""
    given = told.of("speed_rad_s", "speed_rpm")
    speeds = [c for c in columns if c.role == "speed" and c.moves]
    angles = [c for c in columns if c.role == "angle" and c.moves]
    if given is not None and given[1] is not None:
        speeds = [c for c in columns if c.number == given[1]]
    if not speeds and angles:
        return _rate_of_angle(table, columns, angles, time_s, told, guess)
    asked = len(guess.questions)
    column = chosen(speeds, "speed of the wheel", "speed_rad_s", guess)
    if column is None:
        if len(guess.questions) == asked:
            guess.ask("speed_rad_s", "no column is known to be the speed: --set speed=COLUMN.")
        return None
    told_unit = told.unit("speed_rad_s", "speed_rpm")
    if column.said.unit is None and not told_unit and _is_since_last(column):
        return _counts_per_interval(table, columns, column, time_s, told, guess)
    if column.said.any_of("electrical", "elec") and not told_unit:
        text = f"{column.shown} is electrical: has it been divided by the pole pairs, and by how many if not?"
        as_it_is = _speed_line(column, column.unit or "rpm", "", None, told)
        guess.ask("speed_rad_s", text, as_it_is, Line("speed_rad_s", column.entry("erpm", pole_pairs=7), ""))
        return column
    told_unit = told_unit or ("rpm" if given and given[0] == "speed_rpm" else "")
    unit, why = _speed_unit(column, angles, time_s, told_unit)
    assumed = unit is not None and not (told_unit or (column.unit and not column.by_habit) or _unit_in_words(column))
    sign = _direction(columns, column)
    if unit is None:
        text = f"{column.shown} has no unit, and goes to {column.top:.4g}: rpm, rad/s or deg/s?"
        guess.ask(
            "speed_rad_s", text, *(_speed_line(column, unit, "", sign, told) for unit in ("rpm", "rad/s", "deg/s"))
        )
        return column
    known, more = unit_of(unit), {}
    if known is not None and known.per and known.per not in told.more.get("speed_rad_s", {}):
        per = (_per_turn if known.per == "counts_per_turn" else _pole_pairs)(table, column)
        if per is None:
            text = f"{column.shown} is in {unit}: how many {known.per.replace('_', ' ')}? --set speed.{known.per}=N."
            guess.ask("speed_rad_s", text, _speed_line(column, unit, "", sign, told))
            return column
        more = {known.per: per}
    if known is not None and known.quantity == "linear_speed":
        guess.notes.append(f"{column.shown} is in {unit}: metres stand where radians would, and nothing here turns")
    guess.lines.append(replace(_speed_line(column, unit, why, sign, told, **more), assumed=assumed))
    return column


def _speed_line(column: Column, unit: str, why: str, sign: Column | None, told: Answers, **more: object) -> Line:
    """The line of a speed: under the name that says rpm where that is its unit, unless the unit was answered."""
    if sign is not None:
        more |= {"sign_of": sign.key, "backward": sign.says_backward}
        why = f"{why}; without a sign, which {sign.shown} has"
    if unit_of(unit) == unit_of("rpm") and "unit" not in told.more.get("speed_rad_s", {}):
        entry = told.with_more("speed_rad_s", told.with_more("speed_rpm", column.entry("", **more)))
        return Line("speed_rpm", entry, why)
    return Line("speed_rad_s", told.with_more("speed_rad_s", column.entry(unit, **more)), why)


def _speed_unit(column: Column, angles: list[Column], time_s: Float64Array | None, told: str) -> tuple[str | None, str]:
    """The speed's unit, and what says so; None where nothing does."""
    said = column.said
    if told:
        return told, "as it was set"
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
        said.any_of("n", "nm", "drehzahl", "motordrehzahl", "istdrehzahl", "raddrehzahl", "giri", "tours", "regime")
        and column.top > _TURNING
    ):
        return "1/min", "what is called so is counted per minute"
    if said.any_of(
        "omega", "w", "thetadot", "dtheta", "qdot", "qd", "dq", "phidot", "omg", "winkelgeschwindigkeit"
    ) and (not column.is_whole and column.top < 300.0):
        return "rad/s", "what is called so is in rad/s"
    return None, ""


def _unit_in_words(column: Column) -> str:
    """A unit that is one of the words of a name; empty for none."""
    if column.name in {"speed_rad_s", "speed_rpm"}:
        return column.name
    return next((word for word in ("erpm", "krpm", "rpm", "dps") if column.said.any_of(word, f"rpm{word}")), "")


def _by_angle(column: Column, angle: Column, time_s: Float64Array | None) -> str | None:
    """The unit in which a speed is the rate of an angle of a known unit."""
    of_angle = angle.said.unit
    if of_angle is None and (turn := _turn_of(angle)) in _TURN_UNITS:
        of_angle = unit_of(_TURN_UNITS[turn])
    if time_s is None or of_angle is None or of_angle.per:
        return None
    turn = 2.0 * math.pi / of_angle.factor
    change = np.diff(angle.values)
    if float(np.ptp(angle.values[np.isfinite(angle.values)])) <= turn * (1.0 + 1e-9):
        change -= turn * np.round(change / turn)
    mean = 0.5 * (column.values[1:] + column.values[:-1]) * np.diff(time_s)
    sure = np.isfinite(mean) & np.isfinite(change) & (np.abs(mean) > 0.3 * np.nanmax(np.abs(mean)))
    if int(sure.sum()) < 20:
        return None
    ratio = float(np.median(change[sure] / mean[sure])) * of_angle.factor
    for unit in ("rpm", "rad/s", "deg/s", "rev/s"):
        known = unit_of(unit)
        if known is not None and abs(ratio / known.factor - 1.0) < _SAME:
            return unit
    return None


def _counts_per_interval(
    table: RawTable,
    columns: list[Column],
    column: Column,
    time_s: Float64Array | None,
    told: Answers,
    guess: Guess,
) -> Column:
    """The speed of a column that has, in each row, the counts of an encoder since the row before."""
    per, interval_s = _per_turn(table, column), _interval_s(table, column, time_s)
    told_of = told.more.get("speed_rad_s", {})
    per = per or told_of.get("counts_per_turn")
    scale = None if interval_s is None else float(f"{1.0 / interval_s:.9g}")
    line = _speed_line(
        column, "counts/s", "", _direction(columns, column), told, counts_per_turn=per or 4096, scale=scale
    )
    if per is None:
        text = f"{column.shown} counts from row to row: how many to a turn? --set speed.counts_per_turn=N."
    elif scale is None and "scale" not in told_of:
        text = f"{column.shown} counts from row to row: over how long? --set speed.scale=INTERVALS-A-SECOND."
    elif not column.is_whole:
        text = f"{column.shown} counts from row to row, and its numbers are not whole: what are they?"
    else:
        why = f"counts of {1.0 / float(str(line.entry['scale'])):.6g} s each, {per:g} to a turn"
        guess.lines.append(replace(line, why=why))
        return column
    guess.ask("speed_rad_s", text, line)
    return column


def _is_since_last(column: Column) -> bool:
    return any(SINCE_LAST.search(text.replace("_", " ")) is not None for text in (column.name, column.remark))


def _interval_s(table: RawTable, column: Column, time_s: Float64Array | None) -> float | None:
    """How long an encoder is counted for a row, as the file says and the clock bears out; None where they do not."""
    said = {
        float(match[1].replace(",", ".")) * unit.factor
        for match in _INTERVAL.finditer(f"{column.name} {column.remark}".replace("_", " "))
        if (unit := unit_of(match[2])) is not None
    }
    if not said and (rate := rate_in(table.preamble)) is not None:
        said = {1.0 / rate[0]}
    step = np.diff(time_s) if time_s is not None else np.empty(0)
    usual = float(np.median(step)) if step.size else 0.0
    if not said and usual > 0.0 and float(np.mean(np.abs(step - usual) < _EVEN * usual)) > _NEARLY_ALL:
        return usual
    interval = said.pop() if len(said) == 1 else None
    fits = interval is not None and (not step.size or abs(interval - usual) < _SAME * usual)
    return interval if fits else None


def _rate_of_angle(
    table: RawTable,
    columns: list[Column],
    angles: list[Column],
    time_s: Float64Array | None,
    told: Answers,
    guess: Guess,
) -> Column | None:
    """The speed as the rate of an angle."""
    column = chosen(angles, "angle of the wheel", "speed_rad_s", guess)
    if column is None:
        return None
    if _is_since_last(column):
        return _counts_per_interval(table, columns, column, time_s, told, guess)
    turn = _turn_of(column)
    unit = column.unit or told.unit("angle_rad", "speed_rad_s")
    known = unit_of(unit)
    more = told.more.get("speed_rad_s", {})
    entry: dict[str, object] = {"derivative_of": column.key}
    if known is not None and known.per:
        per = _per_turn(table, column) or more.get(known.per) or turn
        entry |= {"unit": unit, known.per: per or 4096}
        if per is None:
            text = f"{column.shown} is in {unit}: how many to a turn? --set speed.counts_per_turn=N."
            guess.ask("speed_rad_s", text, Line("speed_rad_s", entry, ""))
            return column
    elif known is not None:
        entry["unit"] = unit
    elif turn is not None:
        entry["scale"] = 1.0 if abs(turn - 2.0 * math.pi) < 1e-6 else float(f"{2.0 * math.pi / turn:.12g}")
    else:
        text = f"{column.shown} is an angle without a unit: rad, deg, turns or counts?"
        answers = (Line("speed_rad_s", entry | {"unit": unit}, "") for unit in ("rad", "deg", "turns"))
        guess.ask("speed_rad_s", text, *answers)
        return column
    why = f"there is no speed: it is the rate of {column.shown}"
    if turn is not None:
        entry["wrap"] = turn
        why += f", which begins anew after {turn:.6g}"
    guess.take("speed_rad_s", entry | {key: value for key, value in more.items() if key != "unit"}, why)
    return column


def _turn_of(column: Column) -> float | None:
    """After how much an angle begins anew; None where it does not."""
    values = column.values[np.isfinite(column.values)]
    spread, change = float(np.ptp(values)), np.diff(values)
    unit = column.said.unit
    turns = _TURNS if unit is None or unit.per else (2.0 * math.pi / unit.factor,)
    for turn in turns:
        jumps = np.abs(change) > 0.5 * turn
        if _FULL * turn <= spread <= turn * (1.0 + 1.0e-9) and jumps.any():
            return turn
    return None


_PER_TURN = tuple(
    re.compile(pattern, re.IGNORECASE)
    for pattern in (
        r"(\d{2,8})\s*(?:counts?|cpr|ppr|ticks?|inc\w*|pulses|lines|steps)?\s*(?:/|per\s|pro\s)\s*(?:turn|rev|u\b|umdr)",
        r"(?:cpr|ppr|(?:counts?|ticks|inc\w*|steps|pulses)[ _-]*(?:per|pro|/)[ _-]*(?:turn|rev\w*|umdr\w*))"
        r"\D{0,4}(\d{2,8})",
        r"(\d{2,8})\s*(?:cpr|ppr)\b",
        r"(\d{2,8})\W{0,3}(?:\w+ ){0,2}(?:counts?|ticks?|inc\w*|pulses|lines|steps) (?:per|pro) (?:turn|rev|umdr)",
    )
)


_PAIRS = re.compile(r"pole[_ ]?pairs?\W{0,4}(\d{1,3})(?![\d.])|(?<![\d.])(\d{1,3}) ?pole[_ ]?pairs?", re.IGNORECASE)
_COUNTS = re.compile(r"(\d{2,8})\s*(?:counts?|cnts?|inc\w*)\s*(?:/|per\s|pro\s)\s*(?:turn|rev|u\b|umdr)", re.IGNORECASE)
_QUADRATURE = re.compile(
    r"quadratur|\b(x4|4x)\b|\blines?\b|\bppr\b|\d+ppr\b|\bslots?\b|strich|cycles per", re.IGNORECASE
)


def _per_turn(table: RawTable, column: Column) -> float | None:
    """How many counts a turn has, where a name or a line above the names says so."""
    texts = (column.name, column.remark, *table.preamble, *table.names)
    told = next((found for text in texts if (found := _COUNTS.search(text))), None)
    if told is None and any(_QUADRATURE.search(text) for text in texts):
        return None  # lines of a disc, or their four edges?
    patterns = (_COUNTS,) if told is not None else _PER_TURN
    found_numbers = {float(found[1]) for text in texts for pattern in patterns for found in pattern.finditer(text)}
    return found_numbers.pop() if len(found_numbers) == 1 else None  # several are of several encoders


def _pole_pairs(table: RawTable, column: Column) -> float | None:
    """How many pole pairs the motor has, where the file says one number."""
    texts = (column.name, column.remark, *table.preamble)
    found = {float(match[1] or match[2]) for text in texts for match in _PAIRS.finditer(text)}
    return found.pop() if len(found) == 1 else None


def _direction(columns: list[Column], speed: Column) -> Column | None:
    """The column that has the sign of a speed that has none."""
    if float(np.nanmin(speed.values)) < 0.0:
        return None
    return next((c for c in columns if c.role == "direction" and c.number != speed.number), None)
