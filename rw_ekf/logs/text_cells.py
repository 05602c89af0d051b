"""The cells of a text: how its lines are cut, which cells are numbers or stamps, and what plain numbers they are."""

from __future__ import annotations

import csv
import functools
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest

from rw_ekf.logs.column_units import unit_of
from rw_ekf.logs.column_words import BACKWARD, FORWARD
from rw_ekf.logs.raw_table import Factor
from rw_ekf.logs.text_forms import NO_FORM, LineForm
from rw_ekf.logs.time_text import is_odd_stamp

MARKS = ("\t", ";", ",", "|")  # that stand between cells
BLANKS = " "  # as a delimiter: any run of blanks and tabs
CELL = "\x1f"  # as a delimiter: cells stood apart from each other, as those of a sheet, and none can be missing
_REMEMBERED = 4096  # cells: while a layout is sought, each is looked up some ten times
MOSTLY = 0.5  # of a line's cells are numbers or stamps where it is one of data
_NUMBER = re.compile(
    r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?0[xX][0-9a-fA-F]+|[+-]?(nan|inf|infinity)|[+-]?1?\.?#(IND|QNAN|INF)0*",
    re.IGNORECASE,
)
_FORTRAN = re.compile(r"([+-]?(?:\d+\.\d*|\.\d+))(?:[dD]|(?=[+-]\d{3}$))([+-]?\d+)")  # 1.5D-02; 1.5-102
_COMMA_NUMBER = re.compile(r"[+-]?(\d{1,3}(\.\d{3})+|\d+|)(,\d+)?([eE][+-]?\d+)?")
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d+)?")
STAMP = re.compile(
    r"(\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{2,4}|\d{1,2}[- ]?[A-Za-z]{3}[- ]?\d{2,4})?[T ]?"
    r"(\d{1,3}:\d{2}(:\d{2}([.,:;]\d+)?)?( ?[AaPp][Mm])?)?(Z| ?[+-]\d{2}(:?\d{2})?| ?UTC)?"
)
_WORDS = frozenset({
    "true", "false", "on", "off", "ok", "cw", "ccw", "fwd", "rev", "forward", "reverse", "n/a", "null", "none", "na",
})  # fmt: skip
_WITH_UNIT = re.compile(
    r"(?P<value>[+-]?(?=[.,]*\d)[\d.,]{1,30}+(?:[eE][+-]?\d+)?)\s?(?P<unit>(?:[^\s\d\"',;]|1/)[^\s\"',;]*(?: s\^?-1)?)"
)
_UNIT_IN_CELL = re.compile(rf"(?<![^,;\t\"])\s*{_WITH_UNIT.pattern}\s*(?![^,;\t\"])")
_MOST_LINES = 0.6  # have a unit in a cell where cells of the file do
_DIRECTED = re.compile(r"(?P<way>[^\W\d_]{2,})[ :]+(?P<size>\d[\d.,]*(?:[eE][+-]?\d+)?)")  # CCW 512
_GAPS = frozenset({
    "n/a", "na", "null", "none", "inf", "-inf", "+inf", "err", "error", "ovf", "ovl", "ovld", "overflow", "overrange",
    "invalid", "timeout", "nodata", "no data", "n.a.", "n.a", "n/d", "ovr", "ol", "o.l", "o.l.", "over", "over range",
    "over-range", "overload", "bad", "bad value", "no reading", "missing", "out of range",
})  # fmt: skip
_QUIET = frozenset({"n/a", "na", "null", "none", "nan", "+nan", "-nan"})  # gaps that need no report
_NO_VALUE = re.compile(r"[-–—]*|\**|[+-]?∞")  # `---`: not measured; an oscilloscope's reading over its range
_DATED = re.compile(r"(?<!\S)(\d{1,2}) ([A-Z][a-z]{2}) (\d{4}) (?=\d{1,2}:\d{2})")  # 14 Mar 2023 10:58:12.250
_TOUCHING = re.compile(r"(\.\d+)(?=[+-]\d*\.\d)")  # 1023.500-0.2500000, in columns of a fixed width
_BETWEEN_THOUSANDS = re.compile("(?<=[0-9])['’\u00a0\u202f](?=[0-9]{3})")
_MINUS = re.compile(r"(?<![\w.])[−–](?=[.,]?\d)|(?<=\d[eE])−(?=\d)")  # of typography
_BLANKED = re.compile(r"[+-]?[1-9]\d{0,2}( \d{3})+(?:[.,]\d+)?")  # 1 234,50
_SIGN_APART = re.compile(r"(?<![^,;|\t\"])([ ]*[+-])[ ]+(?=[\d.])")  # +  1023.5, of recorders


@dataclass(frozen=True)
class TextLayout:
    """What it takes to cut a text into cells, and cells into numbers."""

    encoding: str = "utf-8-sig"
    delimiter: str = ","
    decimal: str = "."
    thousands: bool = False  # a mark between thousands was seen
    names: tuple[str, ...] = ()  # with their units, where a row below has these; empty where no row has names
    first_line: int = 1  # physical line (from 1) where the data begin
    width: int = 0  # cells of a row of data
    preamble: tuple[str, ...] = ()  # lines before the names
    remarks: tuple[str, ...] = ()  # of each column, where a row above has them
    factors: tuple[Factor, ...] = ()  # of each column and its offset, where blocks above have them
    form: LineForm = NO_FORM  # what makes its lines rows of cells
    begins_with_value: bool = False  # whether each row does, or has an empty cell there: none begins with a word
    doubts: tuple[str, ...] = ()  # what of it could be otherwise
    united: bool = False  # cells have their units with them: `0.01 sec`, `89.9 µA`
    units: tuple[str, ...] = ()  # of each column then, in which its numbers are written out

    @property
    def grouping(self) -> tuple[str, re.Pattern[str]]:
        """The mark that would stand between thousands, and a number that may have it."""
        return (".", _COMMA_NUMBER) if self.decimal == "," else (",", _GROUPED)

    def cells(self, line: str) -> list[str]:
        """The cells of a line, without the blanks around them; none of what cannot be cut."""
        line = self.form.row(line, self.delimiter)
        if "'" in line or not line.isascii():  # else it has neither, and looking for them takes half of the time
            line = _MINUS.sub("-", _BETWEEN_THOUSANDS.sub("", line))
        if self.delimiter != ";" and line.endswith(";"):
            line = line.rstrip("; ")  # the end of a statement, or of a matrix's row
        return split_cells(line, self.delimiter)

    def filled(self, line: str) -> list[str]:
        """The same up to the last that is not empty."""
        return without_trailing(self.cells(line))

    def is_data(self, cells: Sequence[str]) -> bool:
        """Whether most of what stands in a line is numbers or stamps."""
        if self.begins_with_value and cells and cells[0] and not self.is_value(cells[0]):
            return False  # a setting: `Horizontal Scale,20`; `Date;12.03.2022`
        filled = [cell for cell in cells if cell]
        values = [cell for cell in filled if self.is_value(cell)]
        return len(values) >= MOSTLY * len(filled) and not all(map(_NO_VALUE.fullmatch, values))  # `-;rpm;A;-`

    def is_value(self, cell: str) -> bool:
        """Whether a cell is a number or a stamp."""
        known = is_number(cell, self.decimal) or is_stamp(cell)
        return known or self.with_unit(cell) is not None or self.directed(cell) is not None

    def with_unit(self, cell: str) -> tuple[str, str] | None:
        """Number and unit of a cell that has both, in a file of such cells; None for any other."""
        match = _WITH_UNIT.fullmatch(cell) if self.united else None
        known = match is not None and is_number(match["value"], self.decimal) and unit_of(match["unit"]) is not None
        return (match["value"], match["unit"]) if match is not None and known else None

    def directed(self, cell: str) -> str | None:
        """The number with its sign of a cell that has a direction before its size, `CCW 512`; None for any other."""
        match = _DIRECTED.fullmatch(cell)
        if match is None or (way := match["way"].lower()) not in FORWARD | BACKWARD:
            return None
        return f"{'-' * (way in BACKWARD)}{match['size']}" if is_number(match["size"], self.decimal) else None

    def numbers(self, cells: Sequence[str]) -> list[str]:
        """The same of a row: where cells have units, each in its column's; what is in none of that kind stays."""
        if not self.units:
            return list(map(self.number, cells))
        return [self._in_unit(cell, unit) for cell, unit in zip_longest(cells, self.units[: len(cells)], fillvalue="")]

    def _in_unit(self, cell: str, unit: str) -> str:
        found = self.with_unit(cell)
        if not unit or found is None:
            plain = self.number(cell)
            return plain if not unit or plain in {"", "0", "nan"} else f"{cell} ?"  # a number of no unit among others
        own, other = unit_of(unit), unit_of(found[1])
        if own == other or own is None or other is None:
            return self.number(found[0])
        alike = own.quantity == other.quantity and own.per == other.per and not (own.offset or other.offset)
        try:
            return f"{float(self.number(found[0])) * other.factor / own.factor:.12g}" if alike else cell
        except ValueError:  # a mark between thousands that comes too late in a file to be known as one
            return cell

    def number(self, cell: str) -> str:
        """A cell's number as the readers of plain text take it; what is none stays as it is."""
        mark, grouped = self.grouping
        cell = self.directed(cell) or (cell.replace(" ", "") if _BLANKED.fullmatch(cell) else cell)
        if (self.thousands or ("." in cell and "," in cell)) and grouped.fullmatch(cell):
            cell = cell.replace(mark, "")
        if self.decimal == "," and "," in cell and _COMMA_NUMBER.fullmatch(cell):
            cell = cell.replace(",", ".")
        elif cell[:2].lower() == "0x" or cell[1:3].lower() == "0x":
            return str(int(cell, 16)) if _NUMBER.fullmatch(cell) else cell
        elif (fortran := _FORTRAN.fullmatch(cell)) is not None:
            return f"{fortran[1]}e{fortran[2]}"
        elif "#" in cell or _NO_VALUE.fullmatch(cell) or cell.lower() in _GAPS:
            return "nan"
        return cell


def is_stated_gap(cell: str) -> bool:
    """Whether a cell that is taken for a gap says that there was something: `OVR`, `Inf`, `#DIV/0!`."""
    return cell.lower() not in _QUIET and _NO_VALUE.fullmatch(cell) is None


@functools.lru_cache(_REMEMBERED)
def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number, or a word that stands where one may."""
    if not cell:
        return False
    cell = cell.replace(" ", "") if _BLANKED.fullmatch(cell) else cell
    if _NUMBER.fullmatch(cell) or cell.lower() in _WORDS or _FORTRAN.fullmatch(cell) or _NO_VALUE.fullmatch(cell):
        return True
    return bool(_COMMA_NUMBER.fullmatch(cell)) if decimal == "," else bool(_GROUPED.fullmatch(cell))


@functools.lru_cache(_REMEMBERED)
def is_stamp(cell: str) -> bool:
    """Whether a cell is a date or a time of day."""
    plain = bool(STAMP.fullmatch(cell)) and not cell.replace(".", "").isdigit()
    return len(cell) > 3 and (plain or is_odd_stamp(cell))


def has_units(lines: Sequence[str]) -> bool:
    """Whether most lines have a cell that is a number with its unit."""
    filled = [line for line in lines if line.strip()]
    found = sum(any(unit_of(match["unit"]) for match in _UNIT_IN_CELL.finditer(line)) for line in filled)
    return found >= max(3, _MOST_LINES * len(filled))


def split_cells(line: str, delimiter: str) -> list[str]:
    """Cut a line at its delimiters; no cells of what cannot be cut."""
    if delimiter == BLANKS:
        line = _TOUCHING.sub(r"\1 ", _DATED.sub(r"\1-\2-\3T", line))
        if '"' not in line:
            return line.split()
        line = re.sub(r"[ \t]+", " ", line.strip())
    elif "+ " in line or "- " in line:
        line = _SIGN_APART.sub(r"\1", line)
    if '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]
    except csv.Error:
        return []


def without_trailing(cells: list[str]) -> list[str]:
    """Cells up to the last that is not empty."""
    while cells and not cells[-1]:
        cells.pop()
    return cells
