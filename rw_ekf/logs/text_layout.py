"""How the text of a table is laid out: found from its head, for whoever did not write it the way this program does.

Encoding, delimiter, decimal comma, and where the numbers begin; then what stands above them (`header_rows`). The
delimiter is the one by which most lines fall into the same number of cells that are numbers.
"""

from __future__ import annotations

import itertools
import re
from collections import Counter
from dataclasses import replace

from rw_ekf.logs.column_names import role_of, stated_by
from rw_ekf.logs.column_units import unit_of, with_unit
from rw_ekf.logs.header_rows import is_comment, with_names
from rw_ekf.logs.text_cells import BLANKS, MARKS, TextLayout, has_units, is_number, is_stamp
from rw_ekf.logs.text_forms import MARK, NO_FORM, labelled_form, stamped_form

_DELIMITERS = (*MARKS, BLANKS)
_OTHER_ENCODINGS = ("gb18030", "cp932", "cp1251", "koi8-r", "cp866", "big5", "euc-kr", "cp1250")
_LOOKED_AT = 400  # lines
NEARLY_ALL = 0.9  # of the rows begin with a value where each does
_AGREE = 3  # lines of one width in a row begin the data
_DECIMAL = re.compile(r"[+-]?\d*\.\d+")
_COMMON = re.compile(r"\d(?:\.\d+)?e[+-]?\d+ ?\*", re.IGNORECASE)
_LINE_END = re.compile(r"\r\n|\n|\r")
_THOUSAND = re.compile(r"[+-]?[1-9]\d{0,2}(\.\d{3})+")


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
        known = sum(role_of(stated_by(name)._replace(unit=None)) != "other" for name in words)
        if known > most:
            best, most = encoding, known
    return best


def lines_of(text: str, most: int | None = None) -> list[str]:
    """Physical lines, without their ends; the first `most` of them."""
    if most is not None:
        return _LINE_END.split(text, most)[:most]
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")  # the same, and ten times as fast


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
    form, united = stamped_form(lines[:_LOOKED_AT]), has_units(lines[:_LOOKED_AT])
    if lines and lines[0].lower().startswith("sep=") and delimiter is None:
        delimiter = lines[0][4:5] or None
    found: list[tuple[float, TextLayout, int, int]] = []
    for mark in (delimiter,) if delimiter else _DELIMITERS:
        for comma in (decimal,) if decimal else (".", ","):
            if mark == comma == "," and '"' not in head[:4000].decode(known, "replace"):
                continue
            own = NO_FORM if mark == "|" else form  # which stands behind a terminal's time too
            begins, layout, score, count = _rows(
                lines, TextLayout(known, mark, comma, form=own, united=united), skip_rows
            )
            if layout.width:
                found.append((score, replace(layout, first_line=begins + 1), begins, count))
    labelled, rows, first = labelled_form(lines[skip_rows:_LOOKED_AT])
    # What has more words than numbers is no table but sentences that a mark happens to cut alike.
    if rows > max((count if score > 0.0 else count // 2 for score, *_, count in found), default=0):
        layout = TextLayout(known, MARK, form=labelled, names=labelled.names, width=len(labelled.names))
        before = tuple(line for line in lines[: skip_rows + first] if line.strip())
        return replace(layout, first_line=skip_rows + first + 1, preamble=before)
    if not found:
        return None
    best = max(score for score, *_ in found)
    _, layout, begins, _ = next(item for item in found if item[0] == best)
    layout = _with_its_mark(layout, lines[begins:_LOOKED_AT])
    lines = [form.row(line, layout.delimiter) for line in lines] if layout.form.stamped else lines
    data = lines[begins:_LOOKED_AT]
    layout = replace(
        layout, thousands=_has_thousands(data, layout), doubts=_points_of_thousands(lines[begins:], layout)
    )
    layout = with_names(lines[:begins], data, layout, skip_rows)
    layout = replace(layout, doubts=(*layout.doubts, *_common_factor(layout.preamble)))
    return _with_units(data, layout) if united else layout


def _rows(lines: list[str], layout: TextLayout, skip_rows: int) -> tuple[int, TextLayout, float, int]:
    """Index of the first row of data, the layout with their width (0: there is none), how well and how many agree."""
    widths: list[int] = []
    begun: list[bool] = []  # whether a line begins with a value, or an empty cell
    firsts: list[str] = []  # its first cell
    wordy: list[int] = []  # cells of a line that begins with a value though most of it is words
    numbers = 0
    for index, line in enumerate(lines[:_LOOKED_AT]):
        cells = layout.filled(line) if index >= skip_rows else []
        firsts.append(cells[0] if cells else "")
        begun.append(bool(cells) and (not cells[0] or layout.is_value(cells[0])))
        is_data = layout.is_data(cells)
        has_number = any(is_number(cell, layout.decimal) and re.search(r"\d", cell) for cell in cells)  # `-` is a gap
        a_row = begun[-1] and not is_data and has_number
        wordy.append(len(cells) if a_row and cells[0] else 0)
        widths.append(len(cells) if is_data else 0)
        if not is_data:
            continue
        numbers += sum(1 if layout.is_value(cell) else -2 for cell in cells if cell) - _stamps_cut(cells, layout)
    counted = Counter(width for width in widths if width > 1)
    if not counted:
        return 0, layout, 0.0, 0
    width, lines_of_it = max(counted.items(), key=lambda item: (item[1] * item[0], item[0]))
    first = [(value, cell) for value, cell, number in zip(begun, firsts, widths, strict=True) if number == width]
    if not layout.begins_with_value and _begin_with_values(first):
        return _rows(lines, replace(layout, begins_with_value=True), skip_rows)
    near = [number > 0 and abs(number - width) <= max(2, width // 3) for number in map(max, widths, wordy)]
    need = min(_AGREE, lines_of_it)
    kept = [at for at, line in enumerate(lines[: len(widths)]) if widths[at] or not is_comment(line, layout)]
    runs = (kept[place : place + need] for place in range(len(kept) - need + 1))
    begins = next((run[0] for run in runs if widths[run[0]] and all(near[at] for at in run)), None)
    if begins is None:
        return 0, layout, 0.0, 0
    while begins and wordy[begins - 1] == width:
        begins -= 1
    return (
        begins,
        replace(layout, width=width),
        numbers * lines_of_it / max(sum(value > 0 for value in widths), 1),
        lines_of_it,
    )


def _with_its_mark(layout: TextLayout, rows: list[str]) -> TextLayout:
    """The layout with the mark that stands between all cells of all rows, where blanks would cut them alike.

    Names and units may have blanks: `V (Voltage)`.
    """
    if layout.delimiter != BLANKS or not rows:
        return layout
    cells = [layout.cells(line) for line in rows if line.strip()]
    for mark in MARKS:
        marked = replace(layout, delimiter=mark)
        if [marked.cells(line) for line in rows if line.strip()] == cells:
            return marked
    return layout


def _begin_with_values(rows: list[tuple[bool, str]]) -> bool:
    """Whether rows, of each whether it does and its first cell, begin with a value: nearly all, or all below keys.

    Each of these rows that say something of the columns (`Unit`, `Offset`, of TwinCAT) has another key.
    """
    keys = [cell for value, cell in rows if not value]
    below = [value for value, _ in rows[len(keys) :]]
    by_key = len(below) >= _AGREE and all(below) and len({*keys}) == len(keys)
    return by_key or len(rows) - len(keys) > NEARLY_ALL * len(rows)


def _stamps_cut(cells: list[str], layout: TextLayout) -> int:
    """How many dates of a row were cut from their time of day by a blank, which makes no number more."""
    pairs = itertools.pairwise(cells) if layout.delimiter == BLANKS else ()
    return sum(is_stamp(f"{day} {time}") and is_stamp(day) and is_stamp(time) for day, time in pairs)


def _with_units(rows: list[str], layout: TextLayout) -> TextLayout:
    """The layout with the unit that most cells of a column have, where all have one, in its name too."""
    cells = [row for line in rows if layout.is_data(row := layout.filled(line))]
    units = []
    for column in itertools.zip_longest(*cells, fillvalue=""):
        found = [layout.with_unit(cell) for cell in column if layout.number(cell) not in ("", "0", "nan")]
        counted = Counter(each[1] for each in found if each is not None)
        units.append(counted.most_common(1)[0][0] if counted.total() == len(found) > 0 else "")
    named = itertools.zip_longest(layout.names, units[: layout.width], fillvalue="")
    names = (name if stated_by(name).unit == unit_of(unit) else with_unit(name, unit).strip() for name, unit in named)
    return replace(layout, units=tuple(units), names=tuple(names) if any(units) else layout.names)


def _has_thousands(rows: list[str], layout: TextLayout) -> bool:
    """Whether the numbers have a mark between thousands."""
    mark, grouped = layout.grouping
    cells = (cell for line in rows for cell in layout.cells(line) if mark in cell)
    if any(grouped.fullmatch((layout.with_unit(cell) or (cell,))[0]) for cell in cells):
        return True
    # Where decimals have a point, a comma that comes late in a file stands between thousands.
    return mark == "," and any(_DECIMAL.fullmatch(cell) for line in rows for cell in layout.cells(line))


def _common_factor(preamble: tuple[str, ...]) -> tuple[str, ...]:
    """A sentence where all numbers have one factor above them, as MATLAB prints a matrix: `1.0e+03 *`."""
    found = (text.strip() for text in preamble if _COMMON.fullmatch(text.strip()))
    return tuple(f"Above the numbers stands {text!r}: are they still to be multiplied by it?" for text in found)


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
