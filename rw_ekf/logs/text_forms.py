"""Lines that are no rows of cells yet: with a terminal's time in front, or with a label at each number.

    12:34:56.102 -> 58,-810.0,-410.0            a serial monitor's
    [   312 ms] n= -1957 rpm  i=-0.484 A        labelled, with units
    <inf> rw: speed -195.7 rpm, current 484 mA  by words, with units
    {'t': 0.097, 'spd': 59.4, 'cur': 238}       a printed dictionary

Both are made rows of cells here, line by line, so that all else proceeds as with any table.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from rw_ekf.logs.column_units import unit_of, with_unit

MARK = "\t"  # between the cells of what was labelled
RECEIVED = "received"  # what the terminal's time is called
_MOSTLY = 0.6  # of the lines have a form where it is the file's
_LEAST = 3  # lines
_OFTEN = 0.5  # of the labelled lines have a label that becomes a column
_DAY = r"\d{4}[-/.]\d{1,2}[-/.]\d{1,2}[T _]"
_TIME = r"\d{1,2}:\d{2}:\d{2}(?:[.,:]\d{1,9})?"
_IN_FRONT = re.compile(rf"\s*\[?(?P<stamp>(?:{_DAY})?{_TIME}Z?)(?:\]|\]?\s*(?:->|=>|>{{1,3}}|\||:))\s*(?P<rest>\S.*)")
_ZONE = r"(?:Z| ?[+-]\d{2}:?\d{2})?"
_SYSLOG = r"(?:<\d{1,3}>\d?\s*)?(?:[A-Z][a-z]{2} +\d{1,2} +)?"  # a priority; month and day without a year
_ANY_STAMP = re.compile(
    rf"\s*{_SYSLOG}[\[(]?(?P<stamp>(?:{_DAY})?{_TIME}{_ZONE})[\])]?\s*(?:->|>|\||:|,|-)?\s+(?P<rest>\S.*)"
)
_NUMBER = r"[+-]?(?:0[xX][0-9A-Fa-f]+|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|nan|NaN|None|null"
_WAY = r"c?cw|fwd|rev|forward|reverse|on|off|true|false"  # words that stand where a number may
_DECIMAL_COMMA = re.compile(r"([=:][+-]?\d+),(?=\d)")
_STAMP_LABEL = re.compile(
    r"\s*[\w@]+=\"?(?=\d{4}-\d\d-\d\d[T ]\d\d:)([^\"\s]+(?: \d[^\"\s]*)?)\"?"
)  # logfmt: `ts=2023-...`
_COUNTED = re.compile(rf"\s*(?:[A-Z] )?[\[(]\s*(?P<value>{_NUMBER})\s*(?P<unit>[mun]?s|sec)?\s*[\])]\s*(?P<rest>.*)")
_ESP_IDF = re.compile(r"([EWIDV] \(\d+)(\) [\w.-]+: )")  # its levels, and ms since the start, without a unit
_COLOUR = re.compile(r"\x1b\[[\d;]*[A-Za-z]")
_PIECES = re.compile(r"[,;|\t{}]|\s{2,}")
_UNIT = r"[A-Za-zµ°%][\w/%°^.\-]*"
_SPOKEN = re.compile(rf"\W*(?P<key>[^\W\d][^=:]*?)[\"']?\s*[=:]\s*(?P<value>{_NUMBER})\s*(?P<unit>{_UNIT})?\s*")
_TERSE = re.compile(
    rf"(?P<key>[^\W\d][\w.%/°\[\]()\-]*)\s*[=:]\s*(?P<value>{_NUMBER}|(?i:{_WAY}))"
    rf"(?:\s?(?P<unit>{_UNIT})(?![\w.]*\s*[=:]))?(?![\w.]|[-:/]\d)"
)


_BY_WORDS = re.compile(rf"(?P<key>[^\W\d][\w ]*?) (?P<value>{_NUMBER}) ?(?P<unit>{_UNIT})")
_PROSE = re.compile(rf"(?:.*[:>\]]\s*)?{_BY_WORDS.pattern}")
_MICROSECONDS = re.compile(r"^(\W*\d+:\d\d:\d\d\.\d{3}),(\d{3})(?!\d)")  # Zephyr's stamp
_PROCESS = re.compile(r"\[\d+\]:?")
_LEVEL = re.compile(r"\b(?:debug|info|notice|warn(?:ing)?|error)\b|^\W*\d+\.\d+", re.IGNORECASE)  # or an uptime


class LineForm(NamedTuple):
    """How lines become rows of cells."""

    stamped: bool = False
    labels: tuple[str, ...] = ()
    names: tuple[str, ...] = ()  # the labels with their units

    def row(self, line: str, mark: str) -> str:
        """A line as a row of cells between marks; a row stays as it is."""
        if self.labels:
            found = {label: value for label, value, _ in _labelled(line)}
            held = [found.get(label, "") for label in self.labels]
            return MARK.join(held) if sum(map(bool, held)) > 0.5 * len(held) else ""
        match = _IN_FRONT.fullmatch(line) if self.stamped else None
        if match is None:
            return line
        first = match["stamp"] if re.match(r"\W*[\d.]", match["rest"]) else RECEIVED
        return f"{first}{mark}{match['rest']}"


NO_FORM = LineForm()


def stamped_form(lines: Sequence[str]) -> LineForm:
    """Whether most lines have a terminal's time in front."""
    filled = [line for line in lines if line.strip()]
    count = sum(_IN_FRONT.fullmatch(line) is not None for line in filled)
    return LineForm(stamped=count >= max(_LEAST, _MOSTLY * len(filled)))


def labelled_form(lines: Sequence[str]) -> tuple[LineForm, int, int]:
    """The labels of lines that have them at each number, how many lines have, and the first of these (from 0)."""
    found = [(index, _labelled(line)) for index, line in enumerate(lines)]
    found = [(index, parts) for index, parts in found if len(parts) > 1]
    counts = Counter(label for _, parts in found for label in dict.fromkeys(label for label, _, _ in parts))
    labels = tuple(label for label, count in counts.items() if count > _OFTEN * len(found))
    rows = [(index, parts) for index, parts in found if sum(label in labels for label, _, _ in parts) > 1]
    if len(labels) < 2 or len(rows) < _LEAST:
        return LineForm(), 0, 0
    stated = Counter((label, unit) for _, parts in rows for label, _, unit in parts)
    units = {label: unit for (label, unit), _ in reversed(stated.most_common())}
    names = tuple(with_unit(label, units[label] if unit_of(units[label]) else "") for label in labels)
    return LineForm(labels=labels, names=names), len(rows), rows[0][0]


def who_says(line: str) -> tuple[str, str]:
    """What stands between the time and the first label of a line: who says it, and which process of that is."""
    line = _STAMP_LABEL.sub(r"\1", _ESP_IDF.sub(r"\2", _COLOUR.sub("", line), 1), 1)
    stamp = _ANY_STAMP.fullmatch(line)
    rest = line if stamp is None else stamp["rest"]
    masked = _PROCESS.sub(lambda match: "\0" * len(match[0]), rest)
    label = _TERSE.search(masked) or _BY_WORDS.search(masked)
    head = rest[: label.start()] if label else ""
    process = _PROCESS.search(head)
    return _LEVEL.sub("", _PROCESS.sub("", head)), process[0] if process else ""


def _labelled(line: str) -> list[tuple[str, str, str]]:
    """Label, number and unit of what a line says; its time in front goes by `time` or `received`."""
    found: list[tuple[str, str, str]] = []
    line = _COLOUR.sub("", line)
    if (match := _ESP_IDF.match(line)) is not None:
        line = f"{match[1]} ms{line[match.end(1) :]}"
    line = _STAMP_LABEL.sub(r"\1", _MICROSECONDS.sub(r"\1\2", line), 1)
    stamp = _ANY_STAMP.fullmatch(line)
    if stamp is not None:
        found.append((RECEIVED, stamp["stamp"], ""))
        line = stamp["rest"]
    counted = _COUNTED.fullmatch(line)
    if counted is not None:
        found.append(("time", counted["value"], counted["unit"] or ""))
        line = counted["rest"]
    line = _DECIMAL_COMMA.sub(r"\1.", re.sub(r"([=:])\s+", r"\1", line))
    for piece in filter(None, map(str.strip, _PIECES.split(line))):
        whole = _SPOKEN.fullmatch(piece)
        spelt = None if whole else _PROSE.fullmatch(piece)  # `speed -12.5 rpm`: a unit that is known, or it is prose
        whole = spelt if spelt is not None and unit_of(spelt["unit"]) is not None else whole
        for match in [whole] if whole else _TERSE.finditer(piece):
            value = "nan" if match["value"] in ("None", "null") else match["value"]
            found.append((match["key"].strip(" '\"([<"), value, match["unit"] or ""))
    return found
