"""What stays open though a guess fits: a word, a factor or a second wheel that no number of the log can speak against.

A motor of another size moves as this one does, so a speed that is electrical, ten times too large or another machine's
passes every test of motion. What hints at that in a name or beside it is a question, each answered with `--set`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import BoolArray
from rw_ekf.logs.column_answers import Answers
from rw_ekf.logs.column_brackets import BRACKETED, unread
from rw_ekf.logs.column_counts import SINCE_LAST
from rw_ekf.logs.column_names import stated_by, unit_in_prose, words_unknown
from rw_ekf.logs.column_prose import hint_about
from rw_ekf.logs.column_records import Column, Guess, Line, are_counts, stated_in_columns
from rw_ekf.logs.column_units import size_of_count, unit_of
from rw_ekf.logs.column_words import WORDS
from rw_ekf.logs.raw_table import RawTable

_TWICE = 0.3  # of the rows have the time of the row before, where several wheels are reported at each
_MOST_WHEELS = 16  # in one file
_ELECTRICAL = ("elec", "elek", "elect", "el", "we", "ne", "omegae", "thetae", "phie")
_ELECTRIC = ("electri", "elektri", "elettri")  # so begins the word in most languages
_SYMBOLS = frozenset(["omega", "w", "n", "theta", "phi", "q", "speed", "vel", "velocity", "rate", "rpm"])
_LETTERS = {
    "e": "electrical",
    "d": "a difference, desired, or of the d axis",
    "s": "of the stator's field",
    "c": "commanded",
    **dict.fromkeys("xyz", "of an axis of what carries the wheel"),
}
_NOT_SUMMED = re.compile(
    r"delta|\bdiff|increments?\b|inkremente|per (row|sample)|\b(every|each)\b|\bsince (the )?(last|prev)", re.IGNORECASE
)
_TURNING = (
    "rev", "revs", "turns", "rotations", "rotation", "mechanical", "mech", "n", "drehzahl", "umdrehungen", "tours",
    "giri",
)  # fmt: skip
_OF_A_VEHICLE = ("km/h", "kmh", "kmph", "kph", "км/ч", "mph", "mi/h")
_PER_SECOND = ("1/s", "s-1", "rps")  # radians or turns, by who writes it
_TURNS_BY_NAME = ("drehzahl", "n", "tours", "giri", "turns", "revolutions")  # which are counted in turns
_FACTOR = re.compile(
    r"_(?:x|div|by)_?\d+(?!\w)|(?<=[A-Za-z])_?10+$|(?<=[A-Za-z])(?:\^2|²)(?![\w/])|_(?:per|in|of)_?10+k?(?!\w)|[x×*·/]\s*(?:10+|0?[.,]0*1|1e-?\d+|10\^-?\d+)"
    r"(?![\d.,]|\s*(?:[a-z]?Hz|[mun]?s\b)|[a-z])|"
    # as a word: rpm_1k, rpm in thousands, k_rpm, n_Tsd
    r"(?<![^\W_])(?:1k|q(?:8|1[0-6]|24|3[01])|1e[+-]?\d|e[+-]\d|kilo|thousands?|tausend\w*|tsd|hundreds?|tens|tenths?|hundredths?|thousandths?|"
    r"deci|centi|milli|k(?=[ _]rpm)|(?<=rpm[ _])k)(?![^\W_])",
    re.IGNORECASE,
)
_OF_A_SECOND = re.compile(r"(?<=[_ .])(?:[cdk]|centi|deci|kilo)s(?:ec\w*)?$", re.IGNORECASE)  # t_ds
_TAKEN_OUT = re.compile(r"correct|compens|remov|korrig|subtract", re.IGNORECASE)  # current (offset corrected)
_SPEEDS = ("speed_rad_s", "speed_rpm")
_FASTEST_RAD_S = 2.0e4  # 190,000 rpm: no wheel and no motor of one turns faster
_SELDOM = 0.01  # of the rows go so fast: no other unit makes these readings
_LEAST_UNITS = 2  # in brackets at other columns, where a word there is to be one
_TAIL = re.compile(r"[\W_].*")
_IDS = frozenset((
    "id", "wheel", "rw", "unit", "motor", "axis", "node", "device", "dev", "serial", "sn", "name", "address", "addr",
    "wheelid", "motorid", "rwid", "instance", "canid", "can", "dut", "bearing", "specimen", "esc",
))  # fmt: skip
_BESIDE_IDS = frozenset(["no", "nr", "num", "number", "index", "idx", "of", "the"])
_INDEXED = re.compile(r"\[\d{1,3}\]$")  # motor[2], one of several, and what distinguishes none
_INSTANCE = re.compile(
    r"(?:wheel|rw|motor|axis|unit|rad|roue|rueda|rpm|speed|omega|torque|current|cur|drive|esc|joint|servo)[\W_]?"
    r"(?P<which>\d{1,2}|[A-D]|[xyz])(?![A-Za-z0-9])|(?<![A-Za-z])m(?P<motor>\d{1,2})(?![A-Za-z0-9])|"
    r"(?P<side>left|right|links|rechts)",
    re.IGNORECASE,
)


class _Taken(NamedTuple):
    """A line of the map, and the column that it takes."""

    line: Line
    column: Column


def ask_what_is_open(table: RawTable, columns: Sequence[Column], reported: Answers, guess: Guess) -> None:
    """Add the questions to a guess that has none yet; what was answered with `--set` is no longer asked."""
    for text in table.doubts:
        guess.ask("layout", f"{text} Mend the file, or write a map by hand.")
    _ask_which_wheel(table, columns, guess)
    by_key = {column.key: column for column in columns}
    lines = [(line, by_key.get(_key(line))) for line in guess.lines]
    words = table.words()
    for line, column in lines:
        if column is None and (text := hint_about(line, None, table, words)) and not reported.has(line.name):
            guess.lines.remove(line)
            guess.ask(line.name, f"no column is a drive, and {text}", line)
    taken = [_Taken(line, column) for line, column in lines if column is not None and not reported.has(line.name)]
    for one in taken:
        doubt = next(_doubts(one, table, words, reported), None)
        if doubt is not None:
            guess.lines.remove(one.line)
            guess.ask(one.line.name, doubt[0], *doubt[1])
    _ask_whose_current(taken, guess)


def _key(line: Line) -> str | int:
    key = line.entry.get("column", line.entry.get("derivative_of", -1))
    return key if isinstance(key, str | int) else -1


def _doubts(
    one: _Taken, table: RawTable, words: Sequence[str], reported: Answers
) -> Iterator[tuple[str, tuple[Line, ...]]]:
    """Texts and answers of what is open of one column."""
    line, column = one
    if text := hint_about(line, column, table, words):
        yield f"{column.shown}: {text}", (line,)
    if line.name == "time_s" and column.stated.unit is None and (text := _odd_stamp(column, table)):
        yield f"{column.shown}: {text}", (line,)
    if line.name not in ("speed_rad_s", "speed_rpm", "current_A", "current_command_A"):
        return
    if (factor := _FACTOR.search(column.name) or _FACTOR.search(column.remark)) is not None:
        text = f"{column.shown}: by {factor[0].strip()!r} its numbers are scaled; are they still?"
        yield text, (line, *_scaled(line, factor[0]))
    unit_was_set = reported.unit(*(_SPEEDS if line.name in _SPEEDS else (line.name,)))
    if not unit_was_set and (text := unread(column)):
        yield f"{column.shown}: what does {text!r} mean?", (line,)
    if (size := size_of_count(column.unit)) is not None and not are_counts(column.values, size[0]):
        yield f"{column.shown}: its numbers are no counts of {column.unit!r}: what are they in?", (line,)
    bare = column.bare_name or column.name
    aside = sorted(stated_by(bare).words & WORDS["aside"]) if unit_of(bare) is None else []  # the min of `U/min`
    if aside and not _TAKEN_OUT.search(column.name):
        yield f"{column.shown}: '{aside[0]}' may say that it is something else: is it the reading itself?", (line,)
    if part := stated_by(bare).odd_part:
        yield f"{column.shown}: '{part}' may say that it is of something else: is it the wheel's?", (line,)
    if not unit_was_set and (beside := _unknown_unit(column, table)):
        yield f"{column.shown}: what does the unit beside it, {beside!r}, mean?", (line,)
    contradicting = _contradicting_unit(column, table)
    if contradicting and not reported.unit(line.name):
        yield f"{column.shown} says one unit, and {contradicting!r} beside it another: which?", (line,)
    if line.entry.get("derivative_of") is not None and (
        _NOT_SUMMED.search(f"{column.name} {column.remark}") or any(map(SINCE_LAST.search, table.preamble))
    ):
        yield f"{column.shown}: counts since the row before, or since the beginning?", (line,)
    if _may_be_a_heading(line, column) and {"x", "y"} <= {_TAIL.sub("", name.lower()) for name in table.names}:
        yield f"{column.shown}: x and y stand beside it: is it the wheel's, or the heading of a vehicle?", (line,)
    if line.name.startswith("speed"):
        yield from _doubts_of_speed(one, table, bool(reported.unit("speed_rad_s", "speed_rpm")))
    if part := _word_of_another(column, table):
        yield f"{column.shown}: '{part}' may say that it is of something else: is it the wheel's?", (line,)


def _word_of_another(column: Column, table: RawTable) -> str:
    """A word of a name that is in no list and in no other name of the table, as a device's would be; empty for none."""
    others = " ".join(name.lower() for name in table.names if name != column.name)
    words = (
        []
        if column.stated.has("machine", "torque_axis", "torque") or column.by_habit
        else words_unknown(column.bare_name or column.name)
    )
    return next((word for word in words if word not in others), "")


def _may_be_a_heading(line: Line, column: Column) -> bool:
    """Whether a line is of an angle or of a speed that no word and no unit makes a machine's."""
    bare = column.role == "speed" and not column.stated.has("machine") and column.unit in ("", "rad/s", "deg/s")
    return line.entry.get("derivative_of") is not None or (line.name == "speed_rad_s" and bare)


def _scaled(line: Line, factor: str) -> Iterator[Line]:
    """A line with its numbers divided and multiplied by a factor that is a power of ten in digits: `_x100`."""
    if (ten := re.search(r"10+(?=k?$)", factor.strip())) is None or "scale" in line.entry:
        return
    size = float(ten[0]) * (1.0 if factor[-1] != "k" else 1e3)
    for scale in (1.0 / size, size):
        yield replace(line, entry=line.entry | {"scale": float(f"{scale:.12g}")})


def _doubts_of_speed(one: _Taken, table: RawTable, unit_was_set: bool) -> Iterator[tuple[str, tuple[Line, ...]]]:
    line, column = one
    stated, unit = column.stated, column.stated.unit
    per = unit is not None and bool(unit.per)
    letters = [
        letter
        for letter in _LETTERS
        if letter in stated.words
        and (stated.words & _SYMBOLS or stated.words == {letter})
        and not (per and letter == "e")
        if letter not in "xyz" or not (stated.has("machine") or unit == unit_of("rpm"))  # no gyro counts so
    ]
    electrical = stated.any_of(*_ELECTRICAL) or any(word.startswith(_ELECTRIC) for word in stated.words)
    # A unit that is set where the name has one is an answer to this; where it has none it is one to what it is in.
    taken = unit_of(str(line.entry.get("unit", "")))
    is_answered = "scale" in line.entry or (taken is not None and bool(taken.per))
    if not (per or is_answered or (unit_was_set and unit is not None)) and (electrical or "e" in letters):
        divided = {"scale": 0.25} if unit_was_set else {"unit": "erpm", "pole_pairs": 7}
        text = f"{column.shown} may be electrical: has it been divided by the pole pairs, and by how many if not?"
        reported = " --set speed.scale=1, or 0.25 of four pole pairs." if unit_was_set else ""
        yield f"{text}{reported}", (line, Line("speed_rad_s", line.entry | divided, ""))
    elif letters:
        yield (
            f"{column.shown}: '{letters[0]}' may be {_LETTERS[letters[0]]}: is it the wheel's measured speed?",
            (line,),
        )
    of_another = stated.has("other_machine") or stated_by(column.remark).has("other_machine")
    if of_another and not stated.any_of("wheel", "rw", "flywheel", "schwungrad"):
        yield f"{column.shown} may be another machine's: is it the wheel's speed?", (line,)
    over_ground = (
        unit is not None and unit.quantity == "linear_speed" and stated.has("linear") and not stated.any_of("linear")
    )
    if not unit_was_set and (over_ground or stated.unit_text.lower() in _OF_A_VEHICLE):
        yield f"{column.shown} is in {stated.unit_text}, as a vehicle's is: is it what the drive moves?", (line,)
    if unit is None or unit_was_set or unit.quantity != "speed":
        return
    if column.name.lower() in ("drpm", "mrpm"):
        yield f"{column.shown}: tenths or thousandths of 1/min, a difference, or the motor's?", (line,)
    fast = np.abs(column.values) > _FASTEST_RAD_S / unit.factor
    if not unit.per and fast.any():
        rest = float(np.nanmax(np.abs(column.values[~fast]), initial=0.0))
        if float(np.mean(fast)) < _SELDOM and np.isfinite(column.top):
            text = f"goes to {column.top:.10g} in {int(fast.sum())} of {table.rows} rows, else to {rest:.4g}"
            marks = np.unique(column.values[fast]) if column.factor == 1.0 else ()
            gaps = (replace(line, entry=line.entry | {"missing": float(mark)}) for mark in marks)
            yield f"{column.shown} {text}: readings, or gaps?", (line, *(gaps if len(marks) == 1 else ()))
        elif np.isfinite(column.top):  # else its reader says where
            fastest = unit.factor * column.top
            yield f"{column.shown} would go to {fastest:.3g} rad/s in {stated.unit_text}: in which unit is it?", (line,)
    if stated.unit_text.lower() == "hz" and not stated.any_of(*_TURNING):
        pulses = replace(line, entry=line.entry | {"unit": "pulses/s", "counts_per_turn": 7})
        yield f"{column.shown} may count pulses or electrical periods: how many are a turn?", (line, pulses)
    bare = stated.unit_text.replace("^", "").replace(" ", "").strip("[]()").lower()
    if bare in _PER_SECOND and not stated.any_of(*_TURNS_BY_NAME):
        answers = (replace(line, entry=line.entry | {"unit": spelt}) for spelt in ("rad/s", "rev/s"))
        yield f"{column.shown}: radians or turns a second?", tuple(answers)


def _odd_stamp(column: Column, table: RawTable) -> str:
    """What a clock's name or cells leave open: brackets that are no unit, two numbers at a colon."""
    if not table.is_plain_number(column.number):
        return "hours and minutes, or minutes and seconds?" if not np.any(column.values % 60.0) else ""
    tail = _OF_A_SECOND.search(column.name)
    text = unread(column) or (tail[0] if tail else "")
    return f"what does {text!r} mean?" if text else ""


def _unknown_unit(column: Column, table: RawTable) -> str:
    """What a file has beside a column for its unit and is none that is known: then the name's habit is not its unit.

    In brackets it stands for one where all others there are units: `t [s],n [Skt],I [mA]`.
    """
    beside = {**stated_in_columns(table)[0], **table.units}.get(column.name, "").strip(" []()")
    if beside.strip("-–—?") and unit_of(beside) is None:
        return beside
    last = {name: found[-1] for name in table.names if (found := BRACKETED.findall(name))}
    text = last.pop(column.name, "")
    if column.stated.unit is not None or len(last) < _LEAST_UNITS or not all(map(unit_of, last.values())):
        return ""
    return text if text.isalpha() and not stated_by(text).has(*WORDS) else ""


def _contradicting_unit(column: Column, table: RawTable) -> str:
    """A unit beside a column that is not the one in its name."""
    beside = table.units.get(column.name, "")
    known, spelt = unit_of(beside) if beside else None, stated_by(column.name)
    if known is not None and spelt.unit is not None and known != spelt.unit:
        return beside
    remarked = unit_in_prose(column.remark)
    known = unit_of(remarked) if remarked else None
    if known is not None and spelt.unit not in (None, known) and spelt.unit.quantity == known.quantity:
        return remarked
    another = spelt.unit is not None and spelt.unit.quantity == "speed"
    others = (word for word in ("rpm", "erpm", "krpm") if word not in spelt.unit_text.lower())  # the rpm of eRPM
    words = (word for word in others if spelt.any_of(word) and spelt.unit != unit_of(word))
    return next(words, "") if another else ""


def _ask_which_wheel(table: RawTable, columns: Sequence[Column], guess: Guess) -> None:
    """Ask where a column distinguishes several wheels: by its name, or because rows of one time differ in it."""
    times = {_key(line) for line in guess.lines if line.name == "time_s"}
    clock = next((column for column in columns if column.key in times), None)
    twice = np.zeros(0, dtype=np.bool_) if clock is None else np.diff(clock.values) == 0.0
    often = twice.size > 0 and float(np.mean(twice)) >= _TWICE
    for column in columns:
        words = {word for word in column.stated.words if "_" not in word} - _BESIDE_IDS
        if column.stated.unit is not None or _INDEXED.search(column.name):
            continue
        named = bool(words) and words <= _IDS
        found = table.distinct(column.number, _MOST_WHEELS) if named or often else []
        if len(found) > 1 and not any(map(_is_measured, found)) and (named or _alternates(table, column, twice)):
            shown = ", ".join(found[:8])
            text = f"{column.shown} tells {len(found)} of them apart ({shown}), and a log is of one"
            guess.ask("only", f"{text}: --set only={column.name}:{found[0]}.")


def _is_measured(text: str) -> bool:
    """Whether a cell is a number with decimals, which distinguishes no wheel from another."""
    try:
        return not float(text).is_integer()
    except ValueError:
        return False


def _alternates(table: RawTable, column: Column, twice: BoolArray) -> bool:
    """Whether rows of one time always have different values in a column of few."""
    held = table.cells(column.number)
    return all(a != b for a, b, same in zip(held[:-1], held[1:], twice.tolist(), strict=True) if same)


def _ask_whose_current(taken: Sequence[_Taken], guess: Guess) -> None:
    """Ask where speed and current are of wheels of different numbers, letters or sides."""
    columns = {one.line.name.split("_")[0]: one.column for one in taken}
    if not {"speed", "current"} <= columns.keys():
        return
    speed, current = columns["speed"], columns["current"]
    first, second = map(_instances, (speed.name, current.name))
    if not any(which.isalpha() and len(which) == 1 for which in first):
        second.discard(current.stated.unit_text.lower())  # the A of current_A, beside rw2: its unit
    sides = [{"input", "output"} & column.stated.words for column in (speed, current)]
    if current.role == "torque" and all(sides):  # of a gear, or of a bench
        first, second = sides
    if first and second and not first & second:
        guess.ask("current_A", f"{speed.shown} and {current.shown} seem to be of two wheels: do they go together?")


def _instances(name: str) -> set[str]:
    """Which of several wheels a name says: its number, letter or side."""
    return {next(filter(None, match.groups())).lower() for match in _INSTANCE.finditer(name)}
