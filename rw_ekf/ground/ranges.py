"""What an item of a packet can hold: bits, kind of number, ends of its range."""

from __future__ import annotations

import math

from rw_ekf.driver import WireItem

_LARGEST_FLOAT = math.ldexp(2.0 - 2.0**-23, 127)


def bits_of(item: WireItem) -> int:
    """Bits on the wire."""
    return int(item.type[1:])


def is_plain(item: WireItem) -> bool:
    """Whether the number on the wire is the value."""
    return item.scale == 1.0 and item.offset == 0.0


def value_of(item: WireItem, number: float) -> float:
    """Value of a number on the wire, to the digits that a count has."""
    return float(f"{number * item.scale + item.offset:.15g}")


def range_of(item: WireItem) -> tuple[float, float]:
    """The lowest and the highest value that it carries."""
    size = bits_of(item)
    if item.type[0] == "f":
        ends = (-_LARGEST_FLOAT, _LARGEST_FLOAT)
    elif item.type[0] == "i":
        ends = (-(2.0 ** (size - 1)), 2.0 ** (size - 1) - 1.0)
    else:
        ends = (0.0, 2.0**size - 1.0)
    values = (value_of(item, ends[0]), value_of(item, ends[1]))
    return min(values), max(values)


def number_text(value: float) -> str:
    """A number without a needless .0."""
    return repr(float(value)).removesuffix(".0")
