"""Checks the skeleton of a MATLAB v5-v7 file before scipy reads it: on damaged ones scipy's C code ends the process.

Only what keeps the reader in bounds is looked at: every element's type is known, lies inside its parent, and numeric
arrays hold numbers. Layout: MathWorks, "MAT-File Format", chapter 1 (tags of 8 bytes; small ones hold the data).
"""

from __future__ import annotations

import struct
import zlib

_HEADER_BYTES = 128
_MATRIX, _COMPRESSED = 14, 15
_NUMBERS = frozenset({1, 2, 3, 4, 5, 6, 7, 9, 12, 13})  # int8 ... uint64
_TEXTS = frozenset({16, 17, 18})  # UTF-8, UTF-16, UTF-32
_NUMERIC_CLASSES = range(6, 16)
_LAST_CLASS = 17
_DEEPEST = 20  # of cells in structs in cells ...


def check_skeleton(data: bytes) -> None:
    """Raise ValueError if the v5 file in `data` is not built as it must be."""
    if len(data) < _HEADER_BYTES:
        raise ValueError("it ends within its header")
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if order is None:
        raise ValueError("its byte order mark is neither IM nor MI")
    body, position = memoryview(data), _HEADER_BYTES
    while position < len(body):
        kind, start, end, following = _element(body, position, order)
        if kind == _COMPRESSED:
            _check_compressed(body[start:end], order)
            following = end  # the one kind of element that is not padded
        elif kind == _MATRIX:
            _check_matrix(body[start:end], order, 0)
        else:
            raise ValueError(f"an element at byte {position} has type {kind}, which is not a variable")
        position = following


def _check_compressed(data: memoryview, order: str) -> None:
    try:
        inner = memoryview(zlib.decompress(data))
    except zlib.error as error:
        raise ValueError(f"a compressed variable is damaged ({error})") from None
    kind, start, end, _ = _element(inner, 0, order)
    if kind != _MATRIX:
        raise ValueError(f"a compressed element has type {kind}, which is not a variable")
    _check_matrix(inner[start:end], order, 0)


def _check_matrix(body: memoryview, order: str, depth: int) -> None:
    """Check one array: flags, dimensions, name, then its contents."""
    if depth > _DEEPEST:
        raise ValueError("its cells and structs are nested too deeply")
    if len(body) == 0:
        return  # an empty cell is written so
    kinds: list[int] = []
    spans: list[tuple[int, int]] = []
    position = 0
    while position < len(body):
        kind, start, end, position = _element(body, position, order)
        if kind == _MATRIX:
            _check_matrix(body[start:end], order, depth + 1)
        elif kind not in _NUMBERS and kind not in _TEXTS:
            raise ValueError(f"an element within a variable has the unknown type {kind}")
        kinds.append(kind)
        spans.append((start, end))
    if len(kinds) < 3 or kinds[0] != 6 or spans[0][1] - spans[0][0] != 8:
        raise ValueError("a variable has no proper flags")
    flags = struct.unpack_from(order + "I", body, spans[0][0])[0]
    matlab_class = flags & 0xFF
    if not 1 <= matlab_class <= _LAST_CLASS:
        raise ValueError(f"a variable has the unknown class {matlab_class}")
    if matlab_class in _NUMERIC_CLASSES:
        _check_numeric(kinds, spans, complex_too=bool(flags & 0x0800))


def _check_numeric(kinds: list[int], spans: list[tuple[int, int]], complex_too: bool) -> None:
    dimensions = spans[1][1] - spans[1][0]
    if kinds[1] not in (5, 6) or dimensions % 4 or dimensions < 8:
        raise ValueError("a variable has no proper dimensions")
    if len(kinds) < (5 if complex_too else 4) or not _NUMBERS.issuperset(kinds[2:]):
        raise ValueError("a numeric variable does not hold numbers")


def _element(body: memoryview, position: int, order: str) -> tuple[int, int, int, int]:
    """Type, start and end of the data, and start of what follows, of the element at `position`."""
    if position + 8 > len(body):
        raise ValueError("it ends within an element")
    first, size = struct.unpack_from(order + "II", body, position)
    if first >> 16:  # a small element: size in the upper half, data in the second half of the tag
        kind, size, start, following = first & 0xFFFF, first >> 16, position + 4, position + 8
        if size > 4:
            raise ValueError("a small element is too large")
    else:
        kind, start = first, position + 8
        following = start + (size + 7) // 8 * 8
    if start + size > len(body):
        raise ValueError("an element is longer than the file" if kind in (_MATRIX, _COMPRESSED) else "it is cut off")
    return kind, start, start + size, following
