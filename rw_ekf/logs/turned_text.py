"""A text on its side, a line for each signal, made a table with a row for each sample.

time [s],0.00,0.01,0.02
speed [rpm],1203.1,1203.4,1203.9
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence

from rw_ekf.logs.column_names import role_of, stated_by
from rw_ekf.logs.column_units import with_unit
from rw_ekf.logs.log_text import LogText
from rw_ekf.logs.text_cells import MARKS, TextLayout, split_cells, without_trailing
from rw_ekf.logs.text_layout import NEARLY_ALL, encoding_of, lines_of

_MOST_SIGNALS = 60  # lines
_LEAST_VALUES = 20  # of a signal: fewer may be a short log of many columns


def turned(text: LogText, head: bytes, delimiter: str | None) -> bytes | None:
    """The text with a row for each sample; None for one that is not on its side. head: its beginning."""
    encoding = encoding_of(head)
    first = lines_of(head.decode(encoding, "replace"), 1)[0]
    marks = [mark for mark in MARKS if delimiter in (None, mark) and first.count(mark) > _LEAST_VALUES]
    if not marks or head.count(b"\n") > _MOST_SIGNALS:
        return None
    with text.open() as stream:
        lines = lines_of(stream.read().decode(encoding, "replace"))
    for mark in marks:
        if (found := _upright([without_trailing(split_cells(line, mark)) for line in lines])) is not None:
            out = io.StringIO()
            csv.writer(out, delimiter=mark, lineterminator="\n").writerows(found)
            return out.getvalue().encode()
    return None


def _upright(rows: Sequence[Sequence[str]]) -> Iterable[Sequence[str]] | None:
    """Lines of signals as rows of samples below their names; None unless one of them is a time and one a speed."""
    points, commas = TextLayout(), TextLayout(decimal=",")

    def values(cells: Sequence[str]) -> int:
        return sum(not cell or points.is_value(cell) or commas.is_value(cell) for cell in cells)

    signals = [row for row in rows if len(row) > _LEAST_VALUES and re.search(r"[^\W\d]", row[0])]
    signals = [row for row in signals if not values(row[:1]) and values(row[2:]) >= NEARLY_ALL * len(row[2:])]
    widths = {len(row) for row in signals}
    if len(signals) < 2 or len(widths) > 1 or len(signals) >= max(widths):
        return None
    units = sum(not values(row[1:2]) for row in signals) > 0.5 * len(signals)
    names = [with_unit(row[0], row[1]) if units else row[0] for row in signals]
    if not {"time", "speed"} <= {role_of(stated_by(name)) for name in names}:
        return None
    return [names, *zip(*(row[1 + units :] for row in signals), strict=True)]
