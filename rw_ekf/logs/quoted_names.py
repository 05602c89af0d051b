"""Names of columns that have an end of line within their quotes, as a sheet writes a header that is broken."""

from __future__ import annotations

import itertools
import re

from rw_ekf.logs.log_text import LogText

_NAME_LINES = 12  # in which the names of all columns end, where some of them have several
_OPENED = re.compile(rb"""(?:^|[,;\t|])[ ]*"[^",;\t|]*\r?$""")  # the last cell of a line, and continues
_CLOSED = re.compile(rb"""[^",;\t|]*"[ ]*(?:[,;\t|]|\r?$)""")  # where the first cell of the next one ends
_OF_NUMBERS = re.compile(rb"""[ ]*"?[+-]?[.]?\d""")


def names_in_one_line(text: LogText, head: bytes) -> bytes | None:
    """The text with names that have an end of line within their quotes, as a sheet writes them, in one; else None.

    A quote counts where it begins a cell. Empty lines stand where names ended, so that every row is in its own line.
    """
    if b'"' not in head or b"\0" in head[:4096]:
        return None
    lines = head.split(b"\n", _NAME_LINES)[:_NAME_LINES]
    lines = list(itertools.takewhile(lambda line: not _OF_NUMBERS.match(line), lines))
    first = next((at for at, line in enumerate(lines) if _OPENED.search(line)), None)
    if first is None:
        return None
    last, is_open = first, True
    while is_open and last + 1 < len(lines):
        last += 1
        if _CLOSED.match(lines[last]):
            is_open = _OPENED.search(lines[last]) is not None
        elif b'"' in lines[last]:
            return None
    if is_open:
        return None
    names = b" ".join(line.strip(b"\r") for line in lines[first : last + 1])
    with text.open() as stream:
        everything = stream.read().split(b"\n")
    everything[first : last + 1] = [names, *[b""] * (last - first)]
    return b"\n".join(everything)
