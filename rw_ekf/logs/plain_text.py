"""Rewrites the text of a foreign table as the plain CSV that readers take, line for line, so that places stay right."""

from __future__ import annotations

import itertools
import re
from typing import NamedTuple

from rw_ekf.logs.text_cells import TextLayout, is_stated_gap
from rw_ekf.logs.text_forms import who_says
from rw_ekf.logs.text_layout import lines_of

_NEARLY_ALL = 0.9  # of the rows are whole where a shorter one is a damaged one, and no row whose last cells are empty
_WHEEL = re.compile(r"\b(wheel|motor|rw|unit|serial|s/?n|rad|rueda|roue|disc|disk)\b\D{0,15}\d+", re.IGNORECASE)
_COUNTED = re.compile(r"(?<![\w.])\d[\d.]*(?![\w.])")
_CHANGED = re.compile(
    r"\b(second|another|other|new|changed?|from here|swapped|exchanged|put on|removed)\b", re.IGNORECASE
)
_STATED = 40  # lines
_UNREADABLE = "\N{REPLACEMENT CHARACTER}"


class Gap(NamedTuple):
    """What stands in a cell of a column (from 0) in place of a number, and in which line."""

    column: int
    text: str
    line: int


class PlainText(NamedTuple):
    """UTF-8 text with commas, points and a row of names; what is no row of the table has become a blank line."""

    text: bytes
    left_out: tuple[int, ...]  # physical lines behind the first row that hold no row
    another: str | None = None  # the first of them that names a wheel, or other columns
    words: tuple[str, ...] = ()  # those of them that say something
    gaps: tuple[Gap, ...] = ()  # what stood in cells that are empty now


def rewritten(text: bytes, layout: TextLayout) -> PlainText:
    """Rewrite a text. Lines behind the first row that are no data (a footer, the names again) are left out."""
    lines = lines_of(text.decode(layout.encoding, "replace"))
    while lines and not lines[-1].strip():
        lines.pop()
    out = [""] * (layout.first_line - 1)
    if layout.names and out:
        out[-1] = _row(list(layout.names))
    left_out = []
    gaps: list[Gap] = []
    rows = [_cells(line, layout) for line in lines[layout.first_line - 1 :]]
    whole = sum(len(cells) >= layout.width for cells in rows)
    least = layout.width if whole > _NEARLY_ALL * sum(map(bool, rows)) else 1
    for number, cells in enumerate(rows, layout.first_line):
        last = number == len(lines)  # it may be torn, which its reader sees by its width
        if len(cells) < least and not (last and cells):
            if lines[number - 1].strip():
                left_out.append(number)
            out.append("")
            continue
        filled = cells if last else [*cells, *[""] * (layout.width - len(cells))]
        numbers = layout.numbers(["" if _UNREADABLE in cell else cell for cell in filled])
        if "nan" in numbers:
            found = zip(filled, numbers, strict=True)
            gaps += [
                Gap(at, cell, number) for at, (cell, it) in enumerate(found) if it == "nan" and is_stated_gap(cell)
            ]
        out.append(_row(numbers))
    ended = "\n" if text[-4:].translate(None, b"\0").endswith((b"\n", b"\r")) else ""
    before = {match[0] for line in layout.preamble for match in _WHEEL.finditer(line)}
    named = ((lines[number - 1], match[0]) for number in left_out for match in _WHEEL.finditer(lines[number - 1]))
    seen = {line.strip() for line in lines[: layout.first_line - 1]}  # heads of pages
    new = (line for number in left_out if (line := lines[number - 1]).strip() not in seen)
    stated = [line for line in new if re.search(r"[^\W\d]{3}", line)]
    other = (line for line in stated if _CHANGED.search(line) or _other_names(layout.filled(line), layout))
    another = next((line for line, wheel in named if wheel not in before), next(other, None))
    if another is None and layout.form.labels:
        another = _of_another([line for line, cells in zip(lines[layout.first_line - 1 :], rows, strict=True) if cells])
    words = tuple(dict.fromkeys(stated))[:_STATED]
    return PlainText(("\n".join(out) + ended).encode(), tuple(left_out), another, words, tuple(gaps))


def _of_another(lines: list[str]) -> str | None:
    """The first of labelled lines that another program or machine says than the first, or two processes in turn."""
    heads = [(_by_name(who), process) for who, process in map(who_says, lines)]
    turns = [head for head, _ in itertools.groupby(heads)]
    if len({who for who, _ in turns}) > 1 or len(turns) > len(set(turns)):
        return next(line for line, head in zip(lines, heads, strict=True) if head != heads[0])
    return None


def _by_name(who: str) -> str:
    """Who says a line without what changes from line to line: numbers, but that of a wheel."""
    wheel = _WHEEL.search(who)
    return f"{' '.join(_COUNTED.sub('', who).split())} {wheel[0] if wheel else ''}"


def _other_names(cells: list[str], layout: TextLayout) -> bool:
    """Whether a line is a row of names, and one of them none of those above the first row: its unit may be another."""
    known = {name.split(" [")[0] for name in layout.names}
    names = len(cells) == layout.width and not any(map(layout.is_value, cells))
    return names and not set(cells) <= known | {*layout.names} and all(re.search(r"[^\W\d]", cell) for cell in cells)


def _cells(line: str, layout: TextLayout) -> list[str]:
    """The cells of a row of data; none of any other line."""
    cells = layout.cells(line) if line.strip() else []
    while len(cells) > layout.width and not cells[-1]:
        cells.pop()
    return cells if layout.is_data(cells) else []


def _row(cells: list[str]) -> str:
    return ",".join(f'"{cell.replace(chr(34), chr(34) * 2)}"' if "," in cell or '"' in cell else cell for cell in cells)
