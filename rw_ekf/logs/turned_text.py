"""Texts that hold a table in another way than line by line: a line for each signal, a row for each byte of a line.

time [s],0.00,0.01,0.02                    name,type,start_time,duration,data,error
speed [rpm],1203.1,1203.4,1203.9           "Async Serial",data,0.0123,0.0000868,0x72,
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence

from rw_ekf.logs.column_names import role_of, said_by
from rw_ekf.logs.column_units import with_unit
from rw_ekf.logs.log_text import LogText
from rw_ekf.logs.text_cells import TextLayout, split_cells, without_trailing
from rw_ekf.logs.text_layout import NEARLY_ALL, encoding_of, lines_of

_DELIMITERS = ("\t", ";", ",", "|")
_MOST_SIGNALS = 60  # lines
_LEAST_VALUES = 20  # of a signal: fewer may be a short log of many columns
_BYTES = {"name", "type", "start_time", "data"}  # what Saleae's Logic 2 exports of a decoder of serial lines
_ESCAPES = {"\\r": "\r", "\\n": "\n", "\\t": "\t"}
_LABELLED = re.compile(r"[A-Za-z]\w*\s*[=:]")
_STRAIGHT = re.compile(r"[,;\t| ]")


def turned(text: LogText, head: bytes, delimiter: str | None) -> bytes | None:
    """The text of a table with a row for each sample, of a text that is none; None for any other.

    head: its beginning.
    """
    encoding = encoding_of(head)
    first = lines_of(head.decode(encoding, "replace"), 1)[0]
    if {cell.strip('" ') for cell in first.split(",")} >= _BYTES:
        return "\n".join(_of_bytes(_whole(text, encoding))).encode()
    if head.count(b"\n") > _MOST_SIGNALS or max(map(first.count, _DELIMITERS)) == 0:
        return None
    for mark in (delimiter,) if delimiter else _DELIMITERS:
        if len(head.split(mark.encode(), _LEAST_VALUES)) > _LEAST_VALUES:
            rows = [without_trailing(split_cells(line, mark)) for line in lines_of(_whole(text, encoding))]
            if (found := _upright(rows)) is not None:
                out = io.StringIO()
                csv.writer(out, delimiter=mark, lineterminator="\n").writerows(found)
                return out.getvalue().encode()
    return None


def stamped(time_s: str, line: str) -> str:
    """A line with the time [s] at which it came, so that it is read as the lines of a terminal are."""
    if _LABELLED.match(line.lstrip(" {[<")):
        return f"[{time_s} s] {line}"
    mark = next(iter(_STRAIGHT.findall(line)), ",")
    return f"{'received [s]' if line[:1].isalpha() else time_s}{mark}{line}"


def _whole(text: LogText, encoding: str) -> str:
    with text.open() as stream:
        return stream.read().decode(encoding, "replace")


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
    if not {"time", "speed"} <= {role_of(said_by(name)) for name in names}:
        return None
    return [names, *zip(*(row[1 + units :] for row in signals), strict=True)]


def _of_bytes(text: str) -> list[str]:
    """The lines that were sent over a serial line, each with the time of its first byte."""
    rows = [row for row in csv.DictReader(lines_of(text)) if row.get("type") == "data" and row.get("data")]
    lines, begun, said = list[str](), "", ""
    for row in rows if len({row["name"] for row in rows}) == 1 else ():  # of both ways of a line, one
        cell = row["data"]
        sign = chr(int(cell, 16)) if cell[:2].lower() == "0x" else _ESCAPES.get(cell, cell)
        if sign in "\r\n":
            lines += [stamped(begun, said)] if said else []
            said = ""
            continue
        begun = begun if said else row["start_time"]
        said += sign
    return lines
