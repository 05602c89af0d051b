"""A law without a formula, read: the few formulas that lie within its band, as a hint (docs/likelihood.md).

A formula is taken to the law's own functions, what the parameters follow taken off as it is off them, and held against
the coefficients with their covariance; its numbers are the likeliest of a grid. One that misses the law by more than
noise would one time in a hundred is none; of the others those with fewer numbers go first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.filter.tails import chi_square_tail
from rw_ekf.model.law import OF_SPEED, Law

_LEAST_P = 0.01
_NUMBER_COSTS = 2.0  # log, of each number that is fitted: as far apart as a grid's neighbours are
_LEAST_REPORTED = 0.05
_MOST_REPORTED = 3
_LETTERS = {
    "speed": "omega", "speed_size": "|omega|", "current_along_motion": "current", "current_size": "|current|",
    "time": "t",
}  # fmt: skip


class Formula(NamedTuple):
    """A formula that comes near, with its likeliest numbers."""

    text: str
    probability: float  # among those that come near


def readings(law: Law, values: tuple[float, ...], covariance: Float64Array) -> list[Formula]:
    """Formulas within a law's band, the most probable first; values (m,), covariance (m, m) of its coefficients."""
    if len(values) < 2:
        return []
    functions = np.array(law.functions)
    inverse = np.linalg.inv(covariance)
    found = np.array(values)
    best: dict[str, tuple[float, str]] = {}
    for family, text, curves, numbers in _formulas(law):
        own = np.linalg.lstsq(functions.T, curves.T - _level(law, curves).T, rcond=None)[0]  # (m, c)
        normal = own.T @ inverse @ own
        size = np.linalg.lstsq(normal, own.T @ inverse @ found, rcond=None)[0]
        missed = found - own @ size
        chi_square = float(missed @ inverse @ missed)
        p = chi_square_tail(chi_square, max(found.size - numbers - size.size, 1))
        weight = -0.5 * chi_square - _NUMBER_COSTS * (numbers + size.size)
        if p >= _LEAST_P and (family not in best or weight > best[family][0]):
            best[family] = weight, _written(text, size)
    if not best:
        return []
    top = max(weight for weight, _ in best.values())
    shares = {family: math.exp(weight - top) for family, (weight, _) in best.items()}
    total = sum(shares.values())
    ranked = sorted(best, key=lambda family: -shares[family])[:_MOST_REPORTED]
    return [
        Formula(best[family][1], shares[family] / total)
        for family in ranked
        if shares[family] >= _LEAST_REPORTED * total
    ]


def _written(text: str, size: Float64Array) -> str:
    """A formula with its size; of a wave also its phase."""
    if size.size == 1:
        return text.format(f"{size[0]:.3g}")
    return text.format(f"{math.hypot(*size):.3g}", f"{math.atan2(size[1], size[0]):.2g}")


def _level(law: Law, curves: Float64Array) -> Float64Array:
    """What of curves (c, knots) the law's own functions have not: a constant, and a line where friction has one."""
    at = np.abs(law.knots) if law.quantity == "speed" else law.knots
    powers = {"angle": (), "current_along_motion": (1,)}.get(law.quantity, (0,))
    if law.acts_as == "drag" and law.quantity in OF_SPEED:
        powers = (0, 1)
    functions = np.array(law.functions)
    F = np.column_stack([*(at**power for power in powers), *functions])
    fitted = np.linalg.lstsq(F, curves.T, rcond=None)[0][: len(powers)]
    level: Float64Array = (F[:, : len(powers)] @ fitted).T
    return level


def _formulas(law: Law) -> Iterator[tuple[str, str, Float64Array, int]]:
    """Family, text with places for the sizes, curves (c, knots) of size 1, how many numbers were chosen."""
    at, z = law.knots, _LETTERS.get(law.quantity, law.name)
    span = float(np.ptp(at))
    if law.quantity == "angle":
        for order in range(1, 17):
            waves = np.array([np.sin(order * at), np.cos(order * at)])
            yield "wave", f"{{}} sin({order} angle + {{}})", waves, 1
        return
    size = np.abs(at)
    if law.quantity in {"temperature", "column", "time"}:
        middle = 0.5 * (law.first + law.last)
        yield "line", f"{{}} ({z} - {middle:.4g})", (at - middle)[None, :], 0
    else:
        for power in np.round(np.arange(0.3, 4.01, 0.1), 1):
            yield "power", f"{{}} |{z.strip('|')}|^{power:g}".removesuffix("^1"), (size**power)[None, :], 1
    for length in span * np.geomspace(0.03, 1.0, 40):
        yield "exponential", f"{{}} exp(-{z}/{length:.3g})", np.exp(-(at - law.first) / length)[None, :], 1
    for place in law.first + span * np.linspace(0.05, 0.95, 37):
        for width in span * np.geomspace(0.03, 0.3, 9):
            bump = np.exp(-(((at - place) / width) ** 2))
            yield "bump", f"{{}} exp(-(({z} - {place:.3g})/{width:.2g})^2)", bump[None, :], 2
            step = np.tanh((at - place) / width)
            yield "step", f"{{}} tanh(({z} - {place:.3g})/{width:.2g})", step[None, :], 2
    for length in span / np.arange(1.0, 8.01, 0.25):
        turns = 2.0 * math.pi * at / length
        waves = np.array([np.sin(turns), np.cos(turns)])
        yield "wave", f"{{}} sin(2 pi {z}/{length:.3g} + {{}})", waves, 1
