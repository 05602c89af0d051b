"""Arguments of a printed function as bytes, and what it returns back from them: the layout that C gives its structures.

The types are those of an example: bool, int, float, arrays, and tuples of these. An array is its address and its sizes.
"""

from __future__ import annotations

import struct
import weakref
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

_SIGNS = {bool: "?", int: "i", float: "d"}
_WIDEST_FIRST = "dPi?"


class ScatteredError(TypeError):
    """An array whose elements do not lie one behind the other, in the order that C has."""


def in_order(value: Any, copies: list[tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]]) -> Any:
    """The same with copies of what is scattered; each array that was copied, with its copy, goes on a list."""
    if isinstance(value, np.ndarray) and not value.flags.c_contiguous:
        copies.append((value, np.ascontiguousarray(value)))
        return copies[-1][1]
    if not isinstance(value, tuple):
        return value
    parts = [in_order(part, copies) for part in value]
    return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)


class Layout:
    """Of the arguments of one function, packed one behind the other; those that are None in the example are left out.

    Raises TypeError, as it packs, for an array of another kind, and ScatteredError for one whose elements do not lie
    one behind the other.
    """

    def __init__(self, example: Sequence[Any], *, sizes_known: bool = False) -> None:
        """sizes_known: see `c_kernel.kernel_text`."""
        rows: list[_Row] = []
        places = _places_of(tuple(example), "given", rows, sizes_known)
        self._struct = struct.Struct("@" + _format_of(tuple(example), sizes_known))
        source = f"lambda given: ({''.join(f'{place}, ' for place in places)})"
        self._words: Callable[[Sequence[Any]], tuple[Any, ...]] = eval(source, {"rows": rows})

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
        self._struct = struct.Struct("" if example is None else "@" + _format_of(example, False))

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


def is_sized(array: np.ndarray[Any, Any], sizes_known: bool) -> bool:
    """Whether an array of an example has its size in every call, so that only its address is handed over."""
    return sizes_known and array.size > 0 and array.dtype == np.float64


def _format_of(value: Any, sizes_known: bool) -> str:
    """The signs of `struct`; what is a structure in C begins, and ends, where its widest member may stand."""
    if value is None:
        return ""
    if isinstance(value, np.ndarray):
        return "P" if is_sized(value, sizes_known) else "0P" + "P" + "l" * value.ndim + "0P"
    if isinstance(value, tuple):
        signs = "".join(_format_of(part, sizes_known) for part in value)
        aligned = f"0{next(sign for sign in _WIDEST_FIRST if sign in signs)}"
        return aligned + signs + aligned
    return _SIGNS[type(value)]


def _places_of(value: Any, path: str, rows: list[_Row], sizes_known: bool) -> list[str]:
    """How each word of a value is read, in Python; rows: to which those of its arrays are added."""
    if value is None:
        return []
    if isinstance(value, np.ndarray):
        rows.append(_Row(value.dtype.char, value.ndim, value.shape if is_sized(value, sizes_known) else ()))
        return [f"*rows[{len(rows) - 1}]({path})"]
    if isinstance(value, tuple):
        if value and all(type(part) in _SIGNS for part in value):
            return [f"*{path}"]  # fifty parameters at once, not one by one
        parts = [_places_of(part, f"{path}[{i}]", rows, sizes_known) for i, part in enumerate(value)]
        return [place for part in parts for place in part]
    return [path]


class _Row:
    """Where the array at one place of the arguments lies, and its sizes where those are not known.

    Querying an array takes a microsecond, a whitening that is called a thousand times in a row as long: what was
    queried last is kept.
    """

    def __init__(self, kind: str, axes: int, shape: tuple[int, ...]) -> None:
        self._kind, self._axes, self._shape = kind, axes, shape
        self._last: tuple[Callable[[], Any], tuple[int, ...]] = (lambda: None), ()  # one, for threads

    def __call__(self, array: np.ndarray[Any, Any]) -> tuple[int, ...]:
        last, words = self._last
        if last() is not array:
            is_odd = array.dtype.char != self._kind or array.ndim != self._axes
            if is_odd or (self._shape and array.shape != self._shape):
                raise TypeError(
                    f"an array of {array.dtype} {array.shape} where C reads {np.dtype(self._kind)} "
                    f"{self._shape or f'with {self._axes} axes'}"
                )
            if not array.flags.c_contiguous:
                raise ScatteredError(f"an array {array.shape} with strides {array.strides}")
            words = (array.__array_interface__["data"][0], *(() if self._shape else array.shape))
            self._last = weakref.ref(array), words
        return words
