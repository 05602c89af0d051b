"""Arguments of a printed function as bytes, and what it returns back from them: the layout that C gives its structures.

The types are those of an example: bool, int, float, arrays, and tuples of these. An array is its address and its sizes.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

_SIGNS = {bool: "?", int: "i", float: "d"}
_ALIGNED = "0q"  # a structure begins, and ends, where its widest member may stand


class Layout:
    """Of the arguments of one function, packed one behind the other; those that are None in the example are left out.

    Raises TypeError, as it packs, for an array of another kind or in no order that C knows.
    """

    def __init__(self, example: Sequence[Any]) -> None:
        signs, places = "@", []
        for i, value in enumerate(example):
            signs += _format_of(value)
            places += _places_of(value, f"given[{i}]")
        self._struct = struct.Struct(signs + _ALIGNED)
        source = f"lambda given: ({''.join(f'{place}, ' for place in places)})"
        self._words: Callable[[Sequence[Any]], tuple[Any, ...]] = eval(source, {"_row": _row})

    @property
    def size(self) -> int:
        """Bytes."""
        return self._struct.size

    def pack(self, given: Sequence[Any]) -> bytes:
        """The arguments of one call; arrays stay where they are, and must live as long as it lasts."""
        return self._struct.pack(*self._words(given))


class Result:
    """Of what a function returns: a number, a tuple of numbers, or a named tuple of them."""

    def __init__(self, example: Any) -> None:
        self._kind = type(example) if isinstance(example, tuple) else None
        self._struct = struct.Struct("" if example is None else "@" + _format_of(example))

    @property
    def size(self) -> int:
        """Bytes."""
        return self._struct.size

    def unpack(self, given: Any) -> Any:
        """The number or the tuple."""
        found = self._struct.unpack(given)
        if self._kind is None:
            return found[0] if found else None
        return self._kind(*found) if hasattr(self._kind, "_fields") else found


def _format_of(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, np.ndarray):
        return _ALIGNED + "P" + "l" * value.ndim
    if isinstance(value, tuple):
        return _ALIGNED + "".join(_format_of(part) for part in value) + _ALIGNED
    return _SIGNS[type(value)]


def _places_of(value: Any, path: str) -> list[str]:
    """How each word of a value is asked for, in Python."""
    if value is None:
        return []
    if isinstance(value, np.ndarray):
        return [f"*_row({path}, '{value.dtype.char}', {value.ndim})"]
    if isinstance(value, tuple):
        return [place for i, part in enumerate(value) for place in _places_of(part, f"{path}[{i}]")]
    return [path]


def _row(array: np.ndarray[Any, Any], kind: str, axes: int) -> tuple[int, ...]:
    """Where an array lies, and its sizes."""
    if array.dtype.char != kind or array.ndim != axes or not array.flags.c_contiguous:
        raise TypeError(
            f"an array of {array.dtype} {array.shape} with strides {array.strides} where C reads {np.dtype(kind)} "
            f"with {axes} axes, one element behind the other"
        )
    return (array.__array_interface__["data"][0], *array.shape)
