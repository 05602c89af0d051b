"""What stands above the rows of a text or sheet: names, units and remarks of its columns, and what is neither."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from dataclasses import replace
from typing import NamedTuple

from rw_ekf.logs.channel_blocks import called_by_number, channels_above
from rw_ekf.logs.column_names import role_of, stated_by
from rw_ekf.logs.column_units import with_unit
from rw_ekf.logs.labels import are_units, held_to_the_right
from rw_ekf.logs.raw_table import Factor
from rw_ekf.logs.text_cells import (
    BLANKS,
    CELL,
    MARKS,
    MOSTLY,
    STAMP,
    TextLayout,
    is_number,
    is_stamp,
    split_cells,
    without_trailing,
)
from rw_ekf.logs.text_forms import RECEIVED
from rw_ekf.logs.which_wheel import named_by_device

_HEADER_LINES = 6  # above a table of fixed columns that may be names of several lines
_ROW_KEYS = {
    "units": re.compile(r"((vertical|[yv]) ?)?(units?|einheit(en)?|unités?|unidad(es)?)|y_unit_label", re.IGNORECASE),
    "names": re.compile(r"(signal|channel|trace|column|kanal)?[ _]?(names?|labels?|bezeichnung)", re.IGNORECASE),
    "remarks": re.compile(
        r"(?:symbol|signal|channel)?[ _]?(?:desc\w*|comments?|remarks?|kommentar|beschreibung|long[ _]?names?)",
        re.IGNORECASE,
    ),
}
_UNITS = re.compile(r"[\W_]*(?:units?|einheit(?:en)?|unités?|unidad(?:es)?)\s*[:=]\s*", re.IGNORECASE)  # of all columns
_SAMPLED = re.compile(r"sample ?time ?\[(\w+)\]", re.IGNORECASE)  # TwinCAT Scope
_MOST_REMARKS = 3  # lines of them below the units
_KEYED = re.compile(r"([^\W\d][\w ]*?): *(.*)")
_LABEL = re.compile(r"^\s*(columns?|spalten|colonnes|fields?|names?|header|format)\s*:\s*", re.IGNORECASE)
_RULE = re.compile(r"(?=.*[-=_]{3})[-=_+|:,;\s]+")  # drawn below the names
_COMMENT = re.compile(r"^\s*(#+|%+|//+|--+|;+|!)\s*|^C(?=\s{2})\s*")  # the last in Fortran
_SETTING = re.compile(r"=|\d\.\d|\d[DE][+-]?\d|\b\d{3,}\b", re.IGNORECASE)  # no name: an inertia above the columns


class _Header(NamedTuple):
    """Names and units of the columns, empty where none are found, and how many of the lines above the rows precede."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    at: int


def with_names(before: list[str], rows: list[str], layout: TextLayout, skip_rows: int) -> TextLayout:
    """Add the names and units that stand above the rows."""
    before = _with_their_labels(["" if _RULE.fullmatch(line) else line for line in before], layout)
    before = [*before[:skip_rows], *_comments_first(_without_settings(before[skip_rows:], layout), layout)]
    channels, used = channels_above(before[skip_rows:], layout.width)
    before = ["" if at - skip_rows in used else line for at, line in enumerate(before)]
    described = _described(before[skip_rows:], layout)
    above = [
        line
        for line in before[skip_rows:]
        if _COMMENT.sub("", line).strip() and not ("units" in described and _keyed(layout.filled(line)))
    ]
    above, devices = _without_devices(above, layout)
    levels = _by_level(above, layout)
    while levels is None and len(above) > 1 and _is_mark(above[-1], layout):
        above.pop()
    above, prose = (above, ()) if levels else _without_remarks(above, layout)
    if channels:
        names, units = tuple(channel.name for channel in channels), tuple(channel.unit for channel in channels)
        layout = replace(layout, factors=tuple(Factor(channel.factor, channel.offset) for channel in channels))
        header = _Header(names, units, len(above))
    elif levels is not None:
        header = levels
    elif columned := _by_position(before[skip_rows:], rows, layout):
        header = _Header(*columned, max(0, len(above) - 1))
    else:
        header = _in_last_lines(above, layout, described)
    names, units = called_by_number(header.names, before), header.units or described.get("units", ())
    line = above[header.at - 1] if names and header.at else ""
    names, remarks = _with_remarks(names, line, described, prose or devices, layout)
    preamble = tuple(filter(str.strip, before))[: header.at + skip_rows]
    layout = replace(layout, width=max(layout.width, min(len(names), _widest(rows, layout))))
    return _cut_to_rows(names, units, rows, replace(layout, preamble=preamble, remarks=remarks))


def _in_last_lines(above: list[str], layout: TextLayout, described: dict[str, tuple[str, ...]]) -> _Header:
    """The header in the last lines above the rows, of names and units or of one of them, or in rows with a key."""
    units: tuple[str, ...] = ()
    names: tuple[str, ...] = ()
    at = len(above)
    if len(above) > 1 and are_units(cells := _header_cells(above[-1], layout)):
        units = tuple(cells)
        at -= 1
    if at and _are_names(cells := _header_cells(above[at - 1], layout), layout, above[at - 1]):
        names = (RECEIVED if is_stamp(cells[0]) else cells[0], *cells[1:])  # a terminal stamps the names too
        if is_comment(above[at - 1], layout) and len(names) == layout.width + 1 and not _roles([names[0]]):
            names = names[1:]  # `#COLS,t_us,rpm`: what the comment is
        at -= 1
    marks = [layout.delimiter in line for line in above[at : at + 2]]
    uncut = marks == [False, True] and layout.delimiter != BLANKS and _roles([*units]) > 1
    if (uncut and names and not _roles([*names])) or 0 < len(names) < len(
        units
    ):  # a prompt or a title: the units are the names
        names, units, at = units, (), at + 1
    if described.get("names") and (not names or any(key.fullmatch(names[0]) for key in _ROW_KEYS.values())):
        names, units = described["names"], described.get("units", units)
    return _Header(names, units, at) if names else _Header(units, (), at)


def _with_remarks(
    names: tuple[str, ...],
    line: str,
    described: dict[str, tuple[str, ...]],
    prose: tuple[str, ...],
    layout: TextLayout,
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names, and what the file says of each column besides; line: the one above the names, which may group them."""
    remarks = described.get("remarks", prose)
    if names != described.get("names"):
        remarks = remarks or described.get("names", ())
    groups = layout.cells(line) if line and "=" not in line else []
    whole = layout.delimiter == CELL or len(groups) == len(names)
    if remarks or not whole or any(map(layout.is_value, groups)):
        return names, remarks
    remarks = held_to_the_right(groups)
    return named_by_device(names, remarks), remarks


def _cut_to_rows(names: tuple[str, ...], units: tuple[str, ...], rows: list[str], layout: TextLayout) -> TextLayout:
    """Add names, as many as a row has cells; a doubt where they are more or fewer."""
    exact = layout.delimiter == CELL
    ragged = not exact and _shift(names, rows, layout)
    doubts = layout.doubts if exact or ragged or not names else (*layout.doubts, *_odd_header(names, rows, layout))
    if ragged:
        names, units = ("", *names), ("", *units) if units else ()
    names, units = _fitted(names, layout.width), _fitted(units, layout.width)
    return replace(layout, names=tuple(map(with_unit, names, units)) if units else names, doubts=doubts)


def _without_settings(before: list[str], layout: TextLayout) -> list[str]:
    """Lines above the rows, numbers that stand below names behind the columns as lines of their own: `Start: -0.5`.

    Oscilloscopes have `X,CH1,CH2,Start,Increment` and `Sequence,Volt,Volt,-0.5,0.001` above rows of three cells.
    """
    if len(before) < 2:
        return before
    names, values = map(layout.filled, before[-2:])
    behind = list(zip(names[layout.width :], values[layout.width :], strict=False))
    apart = len(names) == len(values) and not any(is_number(name, layout.decimal) for name in names)
    if not behind or not apart or not all(is_number(value, layout.decimal) for _, value in behind):
        return before
    settings = [f"{name}: {value}" for name, value in behind]
    return [*before[:-2], *settings, *(layout.delimiter.join(row[: layout.width]) for row in (names, values))]


def _comments_first(before: list[str], layout: TextLayout) -> list[str]:
    """Lines above the rows, comments that stand between the names and the rows in front of the names.

    A comment that has units, or says of more columns what they are than a line without its mark, stays where it is.
    """
    stated = [line for line in before if line.strip()]
    behind = list(itertools.takewhile(lambda line: is_comment(line, layout), reversed(stated)))[::-1]
    if not behind or len(behind) == len(stated):
        return before
    header = stated[-len(behind) - 1]
    names = layout.filled(header)
    if len(names) != layout.width or not all(names) or not _are_names(names, layout):
        return before
    bare = {line: layout.filled(_COMMENT.sub("", line)) for line in behind}
    stay = [line for line in behind if are_units(_header_cells(line, layout)) or _roles(bare[line]) > _roles(names)]
    if any(len(bare[line]) == len(names) and not are_units(bare[line]) for line in stay):
        return before
    moved = [line for line in behind if line not in stay]
    return [*stated[: -len(behind) - 1], *moved, header, *stay]


def is_comment(line: str, layout: TextLayout) -> bool:
    """Whether a line begins with the mark of a comment, and that mark stands between no cells."""
    mark = _COMMENT.match(line)
    return mark is not None and not (layout.delimiter == ";" and line.startswith(";"))


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
        bare = _COMMENT.sub(lambda mark: " " * len(mark[0]), line.expandtabs())
        if not re.search(r"\w", bare):
            if lines:
                break
            continue
        if any(bare[end - 1 : end + 1].strip() and " " not in bare[end - 1 : end + 1] for end in at if end < len(bare)):
            break
        if _SETTING.search(bare):
            break
        cells = [bare[begin:end].strip() for begin, end in zip((0, *at[:-1]), at, strict=True)]
        if bare != line.expandtabs() and not all(cells):  # a comment on the run, and not on its columns
            break
        lines.insert(0, cells)
    units = lines.pop() if lines and are_units(lines[-1]) else []
    names = tuple(" ".join(filter(None, parts)) for parts in zip(*lines, strict=True)) if lines else ()
    return (names, tuple(units)) if len(names) > 1 and all(names) else None


def _without_devices(above: list[str], layout: TextLayout) -> tuple[list[str], tuple[str, ...]]:
    """Lines without those between names and units, or the rows, that say nothing of a column; and what these say.

    Devices, registers and types of numbers: of no cell of theirs is known what it is, of names it is.
    """
    rows = [layout.cells(_COMMENT.sub("", line) if is_comment(line, layout) else line) for line in above]
    end = len(rows) - (bool(rows) and are_units(rows[-1]))
    begin = end
    while begin and len(rows[begin - 1]) == layout.width > 1 and not _roles(rows[begin - 1]):
        begin -= 1
    whole = 0 < begin < end and len(rows[begin - 1]) == layout.width and _roles(rows[begin - 1]) > 1
    if not whole or any(map(are_units, rows[begin:end])):
        return above, ()
    return [*above[:begin], *above[end:]], tuple(
        "; ".join(filter(None, column)) for column in zip(*rows[begin:end], strict=True)
    )


def _without_remarks(above: list[str], layout: TextLayout) -> tuple[list[str], tuple[str, ...]]:
    """Lines up to the units where remarks stand below these, as Origin has them, and the remarks by column.

    A row that says of more columns what they are than the one above the units is no remark but the names.
    """
    rows = [layout.cells(_COMMENT.sub("", line)) for line in above[-_MOST_REMARKS - 2 :]]
    for below in range(1, len(rows) - 1):
        names, units, *remarks = rows[-below - 2 :]
        whole = all(len(row) == layout.width > 1 for row in (names, units, *remarks))
        if not whole or not all(names) or not are_units(units) or any(map(are_units, (names, *remarks))):
            continue
        if _roles(names) >= max(map(_roles, remarks)) and not any(map(layout.is_value, names)):
            return above[:-below], tuple("; ".join(filter(None, column)) for column in zip(*remarks, strict=True))
    return above, ()


def _is_mark(line: str, layout: TextLayout) -> bool:
    """Whether a line as wide as the rows has nothing but a first word, as what marks the begin of a run: `START,,,`."""
    first, *others = layout.cells(line) or [""]
    return len(others) >= layout.width - 1 > 1 and bool(first) and not any(others)


def _roles(cells: list[str]) -> int:
    """How many cells say what a column is."""
    return sum(role_of(stated_by(cell)) != "other" for cell in cells)


def _by_level(above: list[str], layout: TextLayout) -> _Header | None:
    """A header of several levels (pandas); None where there is none.

    Its last line has the names of the index alone, and the cells above these those of the levels, or nothing.
    """
    rows = [layout.cells(line) for line in above]
    if not rows or len(rows[-1]) != layout.width or layout.width < 2:
        return None
    index = without_trailing(rows.pop())
    first = len(index)
    levels = list(
        itertools.takewhile(
            lambda row: len(row) == layout.width and any(row[first:]) and not any(row[1:first]), reversed(rows)
        )
    )
    if not 0 < first < layout.width or not all(index) or len(levels) < 2:
        return None
    if any(role_of(stated_by(row[0])) == "time" for row in levels):  # a header as usual, above a mere heading
        return None
    units = next((row for row in levels if are_units(row[first:])), None)
    parts = [row[first:] for row in reversed(levels) if row is not units]
    parts[:-1] = [list(held_to_the_right(row)) or row for row in parts[:-1]]  # cells of a sheet that were merged
    names = [" ".join(dict.fromkeys(filter(None, column))) for column in zip(*parts, strict=True)]
    of_all = ("",) * first + tuple(units[first:]) if units else ()
    return _Header((*index, *names), of_all, len(above) - len(levels) - 1) if all(names) else None


def _keyed(cells: list[str]) -> tuple[str, ...]:
    """Key and cells of a row that has the key at each but the first, as Simulink writes them: `,Unit: A,Unit: rpm`."""
    found = [_KEYED.fullmatch(cell) for cell in cells if cell]
    keys = {match[1] if match else "" for match in found}
    if len(keys) != 1 or "" in keys or cells[0]:
        return ()
    return (keys.pop(), *(cell.partition(":")[2].strip() for cell in cells[1:]))


def _described(before: list[str], layout: TextLayout) -> dict[str, tuple[str, ...]]:
    """Rows above the data that begin with what they have of each column: its unit, its name, a remark."""
    found: dict[str, tuple[str, ...]] = {}
    for line in before:
        reported = _UNITS.match(line)
        if reported is not None and len(cells := _header_cells(line[reported.end() :], layout)) == layout.width:
            found |= {"units": tuple(cells)} if are_units(cells) else {}
        cells = layout.filled(line)
        cells = list(_keyed(cells)) or cells
        if not 1 < len(cells) <= layout.width + 1:
            continue
        key = next((kind for kind, words in _ROW_KEYS.items() if words.fullmatch(cells[0].strip(" #%:"))), "")
        if key and not (key == "names" and key in found):
            found[key] = tuple(cells[1:]) if len(cells) > layout.width else ("", *cells[1:])
        elsewhere = 2 < len(cells) <= layout.width  # the key stands above each time: Name, a, b, Name, c
        if elsewhere and key and len(cells) >= len(found.get(key, ())):
            found[key] = tuple("" if cell == cells[0] else cell for cell in cells)
        elif elsewhere and (sampled := _SAMPLED.fullmatch(cells[0])):
            found["times"] = tuple(f"time [{sampled[1]}]" if cell == cells[0] else "" for cell in cells)
    if "times" in found and "names" in found:
        found["names"] = tuple(
            map(_either, _fitted(found.pop("times"), layout.width), _fitted(found["names"], layout.width))
        )
    return found


def _with_their_labels(before: list[str], layout: TextLayout) -> list[str]:
    """Lines above the rows, a label that has a line of its own (`dt:`, SignalExpress) in front of what it labels."""
    lines = list(before)
    for at, (line, after) in enumerate(itertools.pairwise(before)):
        if re.fullmatch(r"[^\W\d][^:=]*:\s*", line) and len(layout.filled(after)) == layout.width:
            lines[at : at + 2] = ["", f"{line.strip()}{layout.delimiter}{after}"]
    if lines and re.fullmatch(r"\w+:\s*", lines[-1]):  # of the rows
        lines[-1] = ""
    return lines


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
    bare = _COMMENT.sub("", line) if is_comment(line, layout) else line
    bare = _LABEL.sub("", bare)
    if layout.delimiter == CELL:
        cells = without_trailing(split_cells(bare, CELL))
        return cells if len(cells) > 1 or layout.width == 1 else []
    best: list[str] = []
    for mark in dict.fromkeys((layout.delimiter, *MARKS, BLANKS)):
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


def _are_names(cells: list[str], layout: TextLayout, line: str = "") -> bool:
    """Whether cells may be names; of a comment, `# wheel RW-02 run 17`, no number is one."""
    filled = [cell for cell in cells if cell]
    if is_comment(line, layout) and _roles(filled) < 2 and any(is_number(cell, layout.decimal) for cell in filled):
        return False
    return bool(filled) and sum(map(layout.is_value, filled)) < MOSTLY * len(filled)


def _odd_header(names: tuple[str, ...], rows: list[str], layout: TextLayout) -> tuple[str, ...]:
    """A sentence where the names are more or fewer than a row's cells; a date behind the names is none of them."""
    count = len(names)
    while count and (not names[count - 1] or layout.is_value(names[count - 1]) or STAMP.fullmatch(names[count - 1])):
        count -= 1
    widths = Counter(
        (len(cells), len(without_trailing(list(cells)))) for line in rows if layout.is_data(cells := layout.cells(line))
    )
    if not count or any(filled <= count <= whole for whole, filled in widths):
        return ()
    (_, usual), _ = widths.most_common(1)[0]
    lacks = "cell" if count > usual else "name"
    return (f"The names are {count} and a row has {usual} cells: which of them has no {lacks}?",)


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
