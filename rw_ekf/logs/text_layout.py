"""How the text of a table is laid out: found from its head, for whoever did not write it the way this program does.

Encoding, delimiter, decimal comma, the row of names, a row of units, and where the numbers begin. The delimiter is the
one by which most lines fall into the same number of cells that are numbers.
"""

from __future__ import annotations

import csv
import itertools
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from rw_ekf.logs.column_names import role_of, said_by
from rw_ekf.logs.column_units import unit_of, with_unit
from rw_ekf.logs.text_forms import MARK, NO_FORM, LineForm, labelled_form, lasting_form, stamped_form

BLANKS = " "  # as a delimiter: any run of blanks and tabs
_DELIMITERS = ("\t", ";", ",", "|", BLANKS)
_OTHER_ENCODINGS = ("gb18030", "cp932", "cp1251", "koi8-r", "cp866", "big5", "euc-kr", "cp1250")
_HEADER_LINES = 6  # above a table of fixed columns that may be names of several lines
_LOOKED_AT = 400  # lines
_MOSTLY = 0.5  # of a line's cells are numbers or stamps where it is one of data
_NEARLY_ALL = 0.9  # of the rows begin with a value where each does
_AGREE = 3  # lines of one width in a row begin the data
_LINE_END = re.compile(r"\r\n|\n|\r")
_NUMBER = re.compile(
    r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?0[xX][0-9a-fA-F]+|[+-]?(nan|inf|infinity)|[+-]?1?\.?#(IND|QNAN|INF)0*",
    re.IGNORECASE,
)
_FORTRAN = re.compile(r"([+-]?(?:\d+\.\d*|\.\d+))(?:[dD]|(?=[+-]\d{3}$))([+-]?\d+)")  # 1.5D-02; 1.5-102
_COMMA_NUMBER = re.compile(r"[+-]?(\d{1,3}(\.\d{3})+|\d+|)(,\d+)?([eE][+-]?\d+)?")
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+(\.\d+)?")
_THOUSAND = re.compile(r"[+-]?[1-9]\d{0,2}(\.\d{3})+")
_STAMP = re.compile(
    r"(\d{4}[-/.]\d{1,2}[-/.]\d{1,2}|\d{1,2}[-/.]\d{1,2}[-/.]\d{2,4}|\d{1,2}[- ]?[A-Za-z]{3}[- ]?\d{2,4})?[T ]?"
    r"(\d{1,3}:\d{2}(:\d{2}([.,:]\d+)?)?( ?[AaPp][Mm])?)?(Z| ?[+-]\d{2}:?\d{2}| ?UTC)?"
)
_WORDS = frozenset({
    "true", "false", "on", "off", "ok", "cw", "ccw", "fwd", "rev", "forward", "reverse", "n/a", "null", "none", "na",
    "-",
})  # fmt: skip
_GAPS = frozenset({"n/a", "na", "null", "none", "inf", "-inf", "+inf"})
_ROW_KEYS = {
    "units": re.compile(r"((vertical|y) )?(units?|einheit(en)?|unités?|unidad(es)?)|y_unit_label", re.IGNORECASE),
    "names": re.compile(r"(signal|channel|trace|column|kanal)?[ _]?(names?|labels?|bezeichnung)", re.IGNORECASE),
    "remarks": re.compile(r"desc\w*|comments?|remarks?|kommentar|beschreibung|long[ _]?names?", re.IGNORECASE),
}
_SAMPLED = re.compile(r"sample ?time ?\[(\w+)\]", re.IGNORECASE)  # TwinCAT Scope
_LABEL = re.compile(r"^\s*(columns?|spalten|colonnes|fields?|names?|header|format)\s*:\s*", re.IGNORECASE)
_COMMENT = re.compile(r"^\s*(#+|%+|//+|--+|;+|!)\s*")


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
    form: LineForm = NO_FORM  # what makes its lines rows of cells
    begins_with_value: bool = False  # whether each row does
    doubts: tuple[str, ...] = ()  # what of it could be otherwise
    seconds: str = ""  # which column has durations in s, by its cells

    @property
    def grouping(self) -> tuple[str, re.Pattern[str]]:
        """The mark that would stand between thousands, and a number that may have it."""
        return (".", _COMMA_NUMBER) if self.decimal == "," else (",", _GROUPED)

    def cells(self, line: str) -> list[str]:
        """The cells of a line, without the blanks around them; none of what cannot be cut."""
        return split_cells(self.form.row(line, self.delimiter), self.delimiter)

    def filled(self, line: str) -> list[str]:
        """The same up to the last that is not empty."""
        return without_trailing(self.cells(line))

    def is_data(self, cells: Sequence[str]) -> bool:
        """Whether most of what stands in a line is numbers or stamps."""
        if self.begins_with_value and cells and not self.is_value(cells[0]):
            return False  # a setting: `Horizontal Scale,20`; `Date;12.03.2022`
        filled = [cell for cell in cells if cell]
        values = sum(map(self.is_value, filled))
        return values > 0 and values >= _MOSTLY * len(filled)

    def is_value(self, cell: str) -> bool:
        """Whether a cell is a number or a stamp."""
        return is_number(cell, self.decimal) or is_stamp(cell)

    def number(self, cell: str) -> str:
        """A cell's number as the readers of plain text take it; what is none stays as it is."""
        mark, grouped = self.grouping
        if (self.thousands or ("." in cell and "," in cell)) and grouped.fullmatch(cell):
            cell = cell.replace(mark, "")
        if self.decimal == "," and "," in cell and _COMMA_NUMBER.fullmatch(cell):
            cell = cell.replace(",", ".")
        elif cell[:2].lower() == "0x" or cell[1:3].lower() == "0x":
            return str(int(cell, 16)) if _NUMBER.fullmatch(cell) else cell
        elif (fortran := _FORTRAN.fullmatch(cell)) is not None:
            return f"{fortran[1]}e{fortran[2]}"
        elif "#" in cell or cell in {"-", "*" * len(cell)} or cell.lower() in _GAPS:
            return "nan"
        return cell


def is_number(cell: str, decimal: str) -> bool:
    """Whether a cell is a number, or a word that stands where one may."""
    if not cell:
        return False
    if _NUMBER.fullmatch(cell) or cell.lower() in _WORDS or _FORTRAN.fullmatch(cell):
        return True
    return bool(_COMMA_NUMBER.fullmatch(cell)) if decimal == "," else bool(_GROUPED.fullmatch(cell))


def is_stamp(cell: str) -> bool:
    """Whether a cell is a date or a time of day."""
    return len(cell) > 3 and bool(_STAMP.fullmatch(cell)) and not cell.replace(".", "").isdigit()


def split_cells(line: str, delimiter: str) -> list[str]:
    """Cut a line at its delimiters; no cells of what cannot be cut."""
    if delimiter == BLANKS:
        if '"' not in line:
            return line.split()
        line = re.sub(r"[ \t]+", " ", line.strip())
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


def encoding_of(head: bytes) -> str:
    """Which encoding a text has, by its first bytes."""
    for mark, encoding in (
        (b"\xff\xfe\0\0", "utf-32"),
        (b"\xff\xfe", "utf-16"),
        (b"\xfe\xff", "utf-16"),
        (b"\xef\xbb\xbf", "utf-8-sig"),
    ):
        if head.startswith(mark):
            return encoding
    pairs = head[: len(head) // 2 * 2]
    if pairs and b"\0" in pairs[:64]:
        even, odd = pairs[0::2], pairs[1::2]
        if odd.count(0) > 0.4 * len(odd) and not even.count(0):
            return "utf-16-le"
        if even.count(0) > 0.4 * len(even) and not odd.count(0):
            return "utf-16-be"
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        return "utf-8-sig" if error.start >= len(head) - 3 else "cp1252"
    return "utf-8-sig"


def _by_its_words(head: bytes, delimiter: str | None, decimal: str | None, skip_rows: int) -> str:
    """Of the encodings that a text may have, the one in which most names of columns say what they are."""
    whole = head[: head.rfind(b"\n") + 1]
    best, most = "cp1252", 0
    for encoding in ("cp1252", *_OTHER_ENCODINGS):
        try:
            whole.decode(encoding)
        except UnicodeDecodeError:
            continue
        found = layout_of(head, delimiter=delimiter, decimal=decimal, encoding=encoding, skip_rows=skip_rows)
        words = (*found.names, *found.remarks) if found else ()
        known = sum(role_of(said_by(name)._replace(unit=None)) != "other" for name in words)
        if known > most:
            best, most = encoding, known
    return best


def lines_of(text: str, most: int | None = None) -> list[str]:
    """Physical lines, without their ends; the first `most` of them."""
    return _LINE_END.split(text) if most is None else _LINE_END.split(text, most)[:most]


def layout_of(
    head: bytes,
    *,
    delimiter: str | None = None,
    decimal: str | None = None,
    encoding: str | None = None,
    skip_rows: int = 0,
) -> TextLayout | None:
    """The layout of a text that begins with `head`; what is given is taken as it is. None where it is no table."""
    known = encoding or encoding_of(head)
    if known == "cp1252" and encoding is None:
        known = _by_its_words(head, delimiter, decimal, skip_rows)
    lines = lines_of(head.decode(known, "replace"))
    if len(lines) > 3:
        lines = lines[:-1]  # perhaps cut
    form, timed = lasting_form(lines[:_LOOKED_AT])
    form = form if form.lasting else stamped_form(lines[:_LOOKED_AT])
    if lines and lines[0].lower().startswith("sep=") and delimiter is None:
        delimiter = lines[0][4:5] or None
    found: list[tuple[float, TextLayout, int, int]] = []
    for mark in (delimiter,) if delimiter else _DELIMITERS:
        for comma in (decimal,) if decimal else (".", ","):
            if mark == comma == "," and '"' not in head[:4000].decode(known, "replace"):
                continue
            begins, layout, score, count = _rows(lines, TextLayout(known, mark, comma, form=form), skip_rows)
            if layout.width:
                found.append((score, replace(layout, first_line=begins + 1), begins, count))
    labelled, rows, first = labelled_form(lines[skip_rows:_LOOKED_AT])
    if rows > max((count - (score <= 0.0) for score, *_, count in found), default=0):
        layout = TextLayout(known, MARK, form=labelled, names=labelled.names, width=len(labelled.names))
        before = tuple(line for line in lines[: skip_rows + first] if line.strip())
        return replace(layout, first_line=skip_rows + first + 1, preamble=before)
    if not found:
        return None
    best = max(score for score, *_ in found)
    _, layout, begins, _ = next(item for item in found if item[0] == best)
    lines = [form.row(line, layout.delimiter) for line in lines] if form.stamped or form.lasting else lines
    data = lines[begins:_LOOKED_AT]
    layout = replace(
        layout, thousands=_has_thousands(data, layout), doubts=_points_of_thousands(lines[begins:], layout)
    )
    layout = _with_names(lines[:begins], data, layout, skip_rows)
    return replace(layout, seconds=layout.names[timed]) if form.lasting and timed < len(layout.names) else layout


def _rows(lines: list[str], layout: TextLayout, skip_rows: int) -> tuple[int, TextLayout, float, int]:
    """Index of the first row of data, the layout with their width (0: there is none), how well and how many agree."""
    widths: list[int] = []
    begun: list[bool] = []  # whether the first cell of a line is a value
    numbers = 0
    for index, line in enumerate(lines[:_LOOKED_AT]):
        cells = layout.filled(line) if index >= skip_rows else []
        begun.append(bool(cells) and layout.is_value(cells[0]))
        if not layout.is_data(cells):
            widths.append(0)
            continue
        widths.append(len(cells))
        numbers += sum(1 if layout.is_value(cell) else -2 for cell in cells if cell)
    counted = Counter(width for width in widths if width > 1)
    if not counted:
        return 0, layout, 0.0, 0
    width, lines_of_it = max(counted.items(), key=lambda item: (item[1] * item[0], item[0]))
    first = [value for value, number in zip(begun, widths, strict=True) if number == width]
    if not layout.begins_with_value and sum(first) > _NEARLY_ALL * len(first):
        return _rows(lines, replace(layout, begins_with_value=True), skip_rows)
    near = [number > 0 and abs(number - width) <= max(2, width // 3) for number in widths]
    need = min(_AGREE, lines_of_it)
    begins = next(
        (i for i in range(len(widths)) if widths[i] and all(near[i : i + need]) and len(near[i : i + need]) == need),
        None,
    )
    if begins is None:
        return 0, layout, 0.0, 0
    return (
        begins,
        replace(layout, width=width),
        numbers * lines_of_it / max(sum(value > 0 for value in widths), 1),
        lines_of_it,
    )


def _has_thousands(rows: list[str], layout: TextLayout) -> bool:
    """Whether the numbers have a mark between thousands."""
    mark, grouped = layout.grouping
    return any(mark in cell and grouped.fullmatch(cell) for line in rows for cell in layout.cells(line))


def _points_of_thousands(rows: list[str], layout: TextLayout) -> tuple[str, ...]:
    """A sentence where a point may stand between thousands: behind it are three digits, or there is none at all."""
    if layout.decimal == "," or layout.thousands:
        return ()
    cells = [row for line in rows if layout.is_data(row := layout.filled(line))]
    for number, column in enumerate(itertools.zip_longest(*cells, fillvalue="")):
        filled = [cell for cell in column if cell]
        pointed = [cell for cell in filled if _THOUSAND.fullmatch(cell)]
        whole = [cell for cell in filled if cell.lstrip("+-").isdigit()]
        if len(pointed) >= _AGREE and len(whole) >= _AGREE and len(pointed) + len(whole) == len(filled):
            return (
                f"In column {number}, numbers have three digits behind a point ({pointed[0]}) or none ({whole[0]}): "
                "is the point between thousands? `decimal: ','` in a map says so.",
            )
    return ()


def _odd_header(names: tuple[str, ...], rows: list[str], layout: TextLayout) -> tuple[str, ...]:
    """A sentence where the names are more or fewer than a row's cells; a date behind the names is none of them."""
    count = len(names)
    while count and (not names[count - 1] or layout.is_value(names[count - 1]) or _STAMP.fullmatch(names[count - 1])):
        count -= 1
    widths = Counter(
        (len(cells), len(without_trailing(list(cells)))) for line in rows if layout.is_data(cells := layout.cells(line))
    )
    if not count or any(filled <= count <= whole for whole, filled in widths):
        return ()
    (_, usual), _ = widths.most_common(1)[0]
    lacks = "cell" if count > usual else "name"
    return (f"The names are {count} and a row has {usual} cells: which of them has no {lacks}?",)


def _of_groups(cells: list[str], names: tuple[str, ...], layout: TextLayout) -> tuple[str, ...]:
    """What a row above the names says of several columns each: `;set-point;;measured`."""
    if len(cells) != len(names) or any(map(layout.is_value, cells)) or sum(map(bool, cells)) < 2:
        return ()
    return tuple(itertools.accumulate(cells, lambda before, cell: cell or before))


def _with_names(before: list[str], rows: list[str], layout: TextLayout, skip_rows: int) -> TextLayout:
    """Add the names and units that stand above the rows."""
    described = _described(before[skip_rows:], layout)
    above = [(i, line) for i, line in enumerate(before) if i >= skip_rows and _COMMENT.sub("", line).strip()]
    units: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    taken = len(above)
    if above and (cells := _header_cells(above[-1][1], layout)) and _are_units(cells) and len(above) > 1:
        units = tuple(cells)
        taken -= 1
    if taken and (cells := _header_cells(above[taken - 1][1], layout)) and _are_names(cells, layout):
        names = tuple(cells)
        taken -= 1
    if described.get("names") and (not names or any(key.fullmatch(names[0]) for key in _ROW_KEYS.values())):
        names, units = described["names"], described.get("units", units)
    if units and not names:
        names, units = units, ()
    columned = _by_position(before[skip_rows:], rows, layout)
    if columned is not None:
        names, units = columned
        taken = max(0, len(above) - 1)
    if described and not units:
        units = described.get("units", ())
    remarks = described.get("remarks", ())
    if described and names != described.get("names"):
        remarks = remarks or described.get("names", ())
    if not remarks and names and taken:
        remarks = _of_groups(layout.cells(above[taken - 1][1]), names, layout)
    preamble = tuple(line for i, line in enumerate(before) if line.strip())[: taken + skip_rows]
    layout = replace(layout, width=max(layout.width, min(len(names), _widest(rows, layout))))
    ragged = _shift(names, rows, layout)
    doubts = layout.doubts if ragged or not names else (*layout.doubts, *_odd_header(names, rows, layout))
    if ragged:
        names, units = ("", *names), ("", *units) if units else ()
    names, units = _fitted(names, layout.width), _fitted(units, layout.width)
    if units:
        names = tuple(map(with_unit, names, units))
    return replace(layout, names=names, preamble=preamble, remarks=remarks, doubts=doubts)


def _by_position(
    before: list[str], rows: list[str], layout: TextLayout
) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
    """Names and units over columns of a fixed width, each above its own, over several lines; None where none are."""
    if layout.delimiter != BLANKS:
        return None
    ends = {tuple(match.end() for match in re.finditer(r"\S+", line)) for line in rows[:20] if line.strip()}
    if len(ends) != 1 or len(at := next(iter(ends))) != layout.width:
        return None
    lines: list[list[str]] = []
    for line in reversed(before[-_HEADER_LINES:]):
        bare = line.expandtabs()
        if not re.search(r"\w", bare):
            if lines:
                break
            continue
        if any(bare[end - 1 : end + 1].strip() and " " not in bare[end - 1 : end + 1] for end in at if end < len(bare)):
            break
        lines.insert(0, [bare[begin:end].strip() for begin, end in zip((0, *at[:-1]), at, strict=True)])
    units = lines.pop() if lines and _are_units(lines[-1]) else []
    names = tuple(" ".join(filter(None, parts)) for parts in zip(*lines, strict=True)) if lines else ()
    return (names, tuple(units)) if len(names) > 1 and all(names) else None


def _described(before: list[str], layout: TextLayout) -> dict[str, tuple[str, ...]]:
    """Rows above the data that begin with what they have of each column: its unit, its name, a remark."""
    found: dict[str, tuple[str, ...]] = {}
    for line in before:
        cells = layout.filled(line)
        if not 1 < len(cells) <= layout.width + 1:
            continue
        key = next((kind for kind, words in _ROW_KEYS.items() if words.fullmatch(cells[0].strip(" #%:"))), "")
        if key and not (key == "names" and key in found):
            found[key] = ("", *cells[1:])
        elsewhere = len(cells) > 2  # the key stands above each time, of which there may be several: Name, a, b, Name, c
        if elsewhere and key and len(cells) >= len(found.get(key, ())):
            found[key] = tuple("" if cell == cells[0] else cell for cell in cells)
        elif elsewhere and (sampled := _SAMPLED.fullmatch(cells[0])):
            found["times"] = tuple(f"time [{sampled[1]}]" if cell == cells[0] else "" for cell in cells)
    if "times" in found and "names" in found:
        found["names"] = tuple(
            map(_either, _fitted(found.pop("times"), layout.width), _fitted(found["names"], layout.width))
        )
    return found


def _either(first: str, second: str) -> str:
    return first or second


def _widest(rows: list[str], layout: TextLayout) -> int:
    """Cells of the longest row: one whose last column is nearly always empty has more than is usual."""
    rows_of_data = (cells for line in rows if layout.is_data(cells := layout.filled(line)))
    return max(map(len, rows_of_data), default=0)


def _fitted(cells: tuple[str, ...], width: int) -> tuple[str, ...]:
    return (*cells, *[""] * (width - len(cells)))[:width] if cells else ()


def _header_cells(line: str, layout: TextLayout) -> list[str]:
    """The names in a line above the rows: cut as these are, or as it is usual behind a comment's mark."""
    bare = _COMMENT.sub("", line) if not (layout.delimiter == ";" and line.startswith(";")) else line
    bare = _LABEL.sub("", bare)
    best: list[str] = []
    for mark in dict.fromkeys((layout.delimiter, "\t", ";", ",", "|", BLANKS)):
        cells = split_cells(bare, mark)
        if mark == BLANKS:
            wide = [cell for cell in re.split(r"\s{2,}|\t", bare.strip()) if cell]
            cells = wide if abs(len(wide) - layout.width) < abs(len(cells) - layout.width) else cells
        cells = without_trailing(cells)
        if len(cells) in (layout.width, layout.width - 1) or (
            mark == layout.delimiter and len(cells) > layout.width > 1
        ):
            return cells
        if not best or abs(len(cells) - layout.width) < abs(len(best) - layout.width):
            best = cells
    return best if len(best) > 1 and abs(len(best) - layout.width) <= max(2, layout.width // 2) else []


def _are_names(cells: list[str], layout: TextLayout) -> bool:
    filled = [cell for cell in cells if cell]
    return bool(filled) and sum(map(layout.is_value, filled)) < _MOSTLY * len(filled)


def _are_units(cells: list[str]) -> bool:
    """Whether a row holds units: most cells are known ones, or all stand in brackets."""
    filled = [cell for cell in cells if cell]
    bracketed = [bool(re.fullmatch(r"[\[({].*[\])}]", cell)) for cell in filled]
    known = [unit_of(cell) is not None for cell in filled]
    if not filled:
        return False
    return all(bracketed) or (
        sum(known) > _MOSTLY * len(filled) and any(unit_of(cell) not in (None, unit_of("rpm")) for cell in filled)
    )


def _shift(names: tuple[str, ...], rows: list[str], layout: TextLayout) -> bool:
    """Whether the first column has no name: one name fewer than cells, above a count of the rows (pandas, R)."""
    if len(names) != layout.width - 1:
        return False
    try:
        first = [layout.cells(line)[0] for line in rows[:20] if line.strip()]
        numbers = [int(cell) for cell in first]
    except (ValueError, IndexError):
        return False
    return all(b - a == 1 for a, b in itertools.pairwise(numbers))
