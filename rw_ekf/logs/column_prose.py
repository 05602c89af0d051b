"""What lines above a table, remarks and attributes say against taking its numbers as they stand.

Prose is not understood, only heard: a line that has one of these words is quoted in a question. What it says is done
already, or is not so ("no gear", "1:1", "applied"), hints at nothing.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from rw_ekf.logs.column_names import role_of, stated_by
from rw_ekf.logs.column_records import Column, Line
from rw_ekf.logs.column_units import unit_of
from rw_ekf.logs.raw_table import RawTable

_LONGEST = 90  # signs of a line that is quoted
_SETTLED = re.compile(
    r"(?<!not )(?<!yet )(?<!be )\bappl(y|ied)|\balready|\bno gear|without gear|ohne getriebe|(?<!\d)1:1(?!\d)|"
    r"direct(ly)? (on|coupled|driven|drive|mounted)|not electrical|\bdivided by the",
    re.IGNORECASE,
)


class _Hint(NamedTuple):
    """Words that hint at something, of which column, and the question."""

    of: tuple[str, ...]  # how the log calls it begins so
    words: re.Pattern[str]
    wanted: str
    is_named: bool = False  # whether the line has to speak of that column
    is_factor: bool = False  # whether the words end in a `number`, of which 1 hints at nothing


def _words(text: str) -> re.Pattern[str]:
    return re.compile(text, re.IGNORECASE)


_NUMBER = r"(?P<number>\d+(?:[.,]\d+)?(?:e[+-]?\d+)?|[.,]\d+)"
_OF_UNIT = r"(?:rpm|rad/s|deg/s|m?A|mN ?m|N ?m|V)"
_FACTOR = r"scale[ds]?|scale[_ ]?factor|scaling|factor|faktor|multipl\w*|divided|gain|lsb|skalier\w*|\w+_scale"
_HINTS = (
    _Hint(("speed",), _words(r"\b(e-?rpm|electrical|elektrisch\w*|pole ?pairs?|polpaar\w*|\d+ poles?)\b"),
          "is it the wheel's own speed, or how many pole pairs divide it?"),
    _Hint(("speed",), _words(r"\b(gear(box|head|ed)?|getriebe\w*|belt|riemen|reduction|reductor)\b|\b[2-9]\d*:1\b"),
          "is it the wheel's own speed, or the other side's of a gear?"),
    _Hint(("speed",), _words(r"\b(strips?|marks? per|not halved|halved|doubled)\b"),
          "how many pulses are a turn, and has that been divided out?", True),
    _Hint(("current",), _words(r"\b(turns? through|windings? through|clamp)\b"), "is it the current of one turn?",
          True),
    _Hint(("current",), _words(r"\b(supply|netzteil|battery|bus line|electronics included)\b"),
          "is it the motor's current, or the supply's?", True),
    _Hint(("current", "speed"), _words(rf"\b({_FACTOR})(?![a-z])[^\d\n]{{0,25}}{_NUMBER}"), "is that applied?",
          True, True),
    _Hint(("current", "speed"), _words(rf"\b(1|one) (count|digit|lsb|bit|inc\w*|step)\s*(=|is|:)\s*{_NUMBER}"),
          "are these counts still?", True),
    _Hint(("current", "speed"), _words(rf"{_NUMBER}\s*{_OF_UNIT}\s*(/|per|pro)\s*(bit|count|lsb|digit|inc)"),
          "is that applied?"),
    _Hint(("current", "speed"), _words(r"\b(tenths|hundredths|zehntel|hundertstel) (of|rpm|[1A])"), "are they still?"),
    _Hint(("current", "speed"), _words(r"\b(divide|multiply|teile|value)\b[^\n]{0,25}(\bby\b|[x×*]) ?\d"),
          "is that done?"),
    _Hint(("current", "speed"), _words(r"\b(not corrected|uncorrected|uncalibrated|raw|not subtracted)\b"),
          "is it corrected?", True),
    _Hint(("current", "speed"), _words(r"\b(zero|offset|delay(ed)?|lags?|late)\b[^\d\n]{0,25}[\d.,]*[1-9]|motor off"),
          "has that been taken out?", True),
)  # fmt: skip
_ONE = re.compile(r"1(?:[.,]0*)?")
_NO_FACTOR = re.compile(
    r"vertical|horizontal|full.?scale|time.?scale|[xy][- ]axis|axis (scale|limits)|plot|\bcontroller (gain|scale)|"
    r"\bP?ID\b|(current|speed) (control|regler)",
    re.IGNORECASE,
)
_STOPPED = re.compile(
    r"\b(brak(e[ds]?|ing)|short(ed|.?circuit)|gebremst|kurzgeschlossen|constant (motor )?(current|torque)|drive torque|"
    r"resistor|widerstand)\b",
    re.IGNORECASE,
)
_SENSITIVITY = re.compile(r"\d\s*(m?V\s*(/|per|pro)\s*m?A|m?A\s*(/|per|pro)\s*m?V)\b")  # of a probe, a shunt
_IN_MA = r"(?i:\b(?:in|all|currents?|strom|ströme)\b[^\n]{0,12})\b(mA)\b"
_TIME_UNIT = re.compile(
    r"\b(minutes?|hours?|ticks?|hundredths|100 ?ns|centiseconds?|every \d+(?!\d*(st|nd|rd|th)))\b", re.I
)


def hint_about(line: Line, column: Column | None, table: RawTable, words: Sequence[str]) -> str:
    """What a text beside the numbers hints at of what was taken, as a question; empty where nothing does.

    words: what stands in columns of words.
    """
    if column is None:
        return (
            _quoted(_STOPPED, (*table.preamble, *table.names, *words), "did the wheel coast freely?")
            if line.name.startswith("current")
            else ""
        )
    if line.name == "time_s":
        of_time = (text for text in table.preamble if stated_by(text).says_time or " row" in text)
        return _quoted(_TIME_UNIT, of_time, "what are the steps of the time?") if line.assumed else ""
    counted = column.stated.unit is not None and bool(column.stated.unit.per)  # by what was found or answered already
    hints = [hint for hint in (_HINTS[1:] if counted else _HINTS) if line.name.startswith(hint.of)]
    lines = (*table.preamble, *words)
    naming = [text for text in lines if _names(text, column)] if hints else []
    for hint in hints:
        texts = (column.remark, *(naming if hint.is_named else lines))
        kept = (text for text in texts if not (hint.is_factor and _is_no_factor(text, hint)))
        if found := _quoted(hint.words, kept, hint.wanted):
            return found
    probed = table.preamble if line.assumed and line.name.startswith("current") else ()
    if found := _quoted(_SENSITIVITY, probed, "are its numbers amperes by now?"):
        return found
    if found := _formula(column, table.preamble):
        return found
    return _other_unit(line, table.preamble)


def _quoted(words: re.Pattern[str], texts: Iterable[str], wanted: str) -> str:
    for text in texts:
        if text and words.search(text) and not _SETTLED.search(text):
            return f"beside it stands {' '.join(text.split())[:_LONGEST]!r}: {wanted}"
    return ""


def _is_no_factor(text: str, hint: _Hint) -> bool:
    match = hint.words.search(text)
    return match is not None and (_NO_FACTOR.search(text) is not None or _ONE.fullmatch(match["number"]) is not None)


def _names(text: str, column: Column) -> bool:
    """Whether a line speaks of a column: by a word of its name, or of what it is."""
    stated = stated_by(text)
    words = {word for word in stated_by(column.name).words if len(word) > 1}
    return bool(words & stated.words) or role_of(stated._replace(unit=None)) == column.role


def _formula(column: Column, preamble: Iterable[str]) -> str:
    """A line that has the column's name in an equation with a number."""
    if len(column.name) < 2:
        return ""
    name = re.escape(column.name)
    equation = re.compile(rf"=.*(?<!\w){name}(?!\w).*[*/+-]\s*\d|=.*\d\s*[*/].*(?<!\w){name}(?!\w)")
    return _quoted(equation, preamble, "are its numbers before or after that?")


def _other_unit(line: Line, preamble: Iterable[str]) -> str:
    """A unit that a line above has, where the column's own was concluded from its name or numbers."""
    speed = line.name.startswith("speed")
    if not line.assumed:
        return ""
    own = unit_of("rpm" if line.name == "speed_rpm" else str(line.entry.get("unit", "rad/s" if speed else "A")))
    spellings = r"\b(?:deg/s|rad/s|rpm|rev/s|SI|1/min)(?!\w)" if speed else _IN_MA
    for text in preamble:
        for spelt in re.findall(spellings, text):
            if unit_of("rad/s" if spelt == "SI" else spelt) != own:
                return f"above stands {' '.join(text.split())[:_LONGEST]!r}: are its numbers in {spelt}?"
    return ""
