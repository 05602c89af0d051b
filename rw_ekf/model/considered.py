"""What a filter takes for known of its effects although a fit left it open: shape constants and curves of laws.

A filter learns coefficients. Where a bump lies, how wide it is and how a law bends are constants to it, fitted to one
record and known no better than that record showed. They are *considered* (S. F. Schmidt 1966): not learned, but their
uncertainty counts (docs/filter.md eq. 7a).
"""

from __future__ import annotations

from typing import NamedTuple

from rw_ekf.model.effect import NO_SHAPE, Shape

CURVE_POINTS = 17  # of a law's curve, even over its range: what a record leaves open of one is smooth


class Off(NamedTuple):
    """What of one term is off."""

    shape: Shape = NO_SHAPE  # its shape constants
    curve: tuple[float, ...] = ()  # (CURVE_POINTS,) its law, even over its range; () of a term without one


class Direction(NamedTuple):
    """One way, a standard deviation long, in which they may be off together, and what the learned numbers do then."""

    numbers: tuple[float, ...]  # (4 + m,) parameters, then coefficients of the state
    terms: tuple[Off, ...]  # one for each term, in order of use
