"""Effects as they were fitted, and as a filter carries them on: what it learns of them, and what it considers.

A law of many coefficients becomes its curve and one amplitude. Of coefficients v with covariance V the amplitude a of
their own curve is what generalised least squares makes of them,

    a = w'v,   w = V^-1 v / (v' V^-1 v),   var a = 1 / (v' V^-1 v),            (docs/likelihood.md eq. 18)

with the covariances that it has with all else. What else the coefficients leave open, r = v - a v^, and the shape
constants that were fitted are no states of a filter. With x what it learns, and C what the fit knows of all,

    C_rr = sum_k m_k m_k',   x_k = C_xr C_rr^+ m_k                             (docs/filter.md eq. 7a)

are the directions in which they may be off, a standard deviation each, and what the learned numbers do then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.model.considered import CURVE_POINTS, Direction, Off
from rw_ekf.model.effect import NO_SHAPE, Term
from rw_ekf.model.law import Law
from rw_ekf.model.state import PARAMETER_COUNT
from rw_ekf.wheel.effect_table import EffectSet

_LEAST_SHARE = 1.0e-3  # of the largest variance of a direction: a smaller one is left out
_DIGITS = 6


def carried(model: Model, covariance: Float64Array) -> tuple[EffectSet, Float64Array]:
    """Effects as a filter carries them on, and the covariance (4 + m, 4 + m) of what is left to learn.

    covariance (p, p): of parameters, coefficients and refined shapes, in the order of the model's vector. Columns of
    the log get the slots of those in use.
    """
    used = [term.law.column for term in model.effects.terms if term.law is not None and term.law.column]
    slots = {name: slot for slot, name in enumerate(dict.fromkeys(used))}
    one = np.eye(covariance.shape[0])
    rows = list(one[:PARAMETER_COUNT])
    terms: list[Term] = []
    considered = _Considered()
    for number, (term, at) in enumerate(model.placed):
        law = term.law if term.law is None or not term.law.column else replace(term.law, slot=slots[term.law.column])
        if law is not None and law.prior_std and not any(term.values):
            continue  # a law that is nothing throughout
        for place, (i, constant) in enumerate(model.refined, start=model.known):
            if i == number:
                considered.add_constant(len(terms), constant, one[place], covariance)
        if law is None or not law.prior_std:
            terms.append(replace(term, law=law))
            rows += list(one[at])
            continue
        row, values = np.zeros(covariance.shape[0]), np.array(term.values)
        row[at] = 1.0
        if values.size > 1:
            weights = np.linalg.solve(covariance[at, at], values)
            row[at] = weights / float(weights @ values)
            rest = one[at] - np.outer(values, row)
            considered.add_curve(len(terms), _points_of(law).T @ rest, covariance)
            law, values = _one_curve(law, term, covariance[at, at]), np.ones(1)
        rows.append(row)
        terms.append(replace(term, values=(float(values[0]),), stds=(0.0,), law=replace(law, prior_std=())))
    terms += [term for term in model.effects.terms if not term.effect.in_state]
    turn = np.array(rows)
    turned: Float64Array = turn @ covariance @ turn.T
    return EffectSet(tuple(terms), considered.directions(turn, covariance, len(terms))), turned


def _one_curve(law: Law, term: Term, covariance: Float64Array) -> Law:
    curve = tuple(float(value) for value in law.values(term.values))
    return replace(law, functions=(curve,), spread=tuple(float(std) for std in law.std(covariance)))


def _points_of(law: Law) -> Float64Array:
    """Its functions at the points of a curve that is considered, (m, points)."""
    points = np.linspace(law.first, law.last, CURVE_POINTS)
    return np.array([np.interp(points, law.knots, function) for function in law.functions])


@dataclass(eq=False)
class _Considered:
    """Rows that make of a model's vector what no filter learns, with a scale each, and where each belongs."""

    rows: list[Float64Array] = field(default_factory=list)
    scales: list[float] = field(default_factory=list)
    places: list[tuple[int, int | None]] = field(default_factory=list)  # the term, and which constant; None of a curve

    def add_constant(self, term: int, constant: int, row: Float64Array, covariance: Float64Array) -> None:
        self._add([row], float(np.sqrt(row @ covariance @ row)), (term, constant))

    def add_curve(self, term: int, rows: Float64Array, covariance: Float64Array) -> None:
        variance = np.einsum("ij,jk,ik->i", rows, covariance, rows)
        self._add(rows, float(np.sqrt(max(variance.max(), 0.0))), (term, None))

    def _add(self, rows: Sequence[Float64Array] | Float64Array, scale: float, place: tuple[int, int | None]) -> None:
        if scale > 0.0:
            self.rows += list(rows)
            self.scales += [scale] * len(rows)
            self.places += [place] * len(rows)

    def directions(self, learned: Float64Array, covariance: Float64Array, terms: int) -> tuple[Direction, ...]:
        """The principal ones in which they may be off; learned (n, p): the rows of what is learned."""
        if not self.rows:
            return ()
        scale, turn = np.array(self.scales), np.array(self.rows)
        turn /= scale[:, None]
        variances, ways = np.linalg.eigh(turn @ covariance @ turn.T)
        kept = variances > _LEAST_SHARE * variances[-1]
        roots, ways = np.sqrt(variances[kept]), ways[:, kept]
        follows = learned @ covariance @ turn.T @ (ways / roots)
        return tuple(
            Direction(_rounded(follows[:, k]), self._by_terms(scale * ways[:, k] * roots[k], terms))
            for k in reversed(range(roots.size))
        )

    def _by_terms(self, off: Float64Array, terms: int) -> tuple[Off, ...]:
        shapes = [list(NO_SHAPE) for _ in range(terms)]
        curves: list[list[float]] = [[] for _ in range(terms)]
        for (term, constant), by in zip(self.places, _rounded(off), strict=True):
            if constant is None:
                curves[term].append(by)
            else:
                shapes[term][constant] = by
        return tuple(
            Off((shape[0], shape[1], shape[2]), tuple(curve)) for shape, curve in zip(shapes, curves, strict=True)
        )


def _rounded(values: Float64Array) -> tuple[float, ...]:
    return tuple(float(f"{value:.{_DIGITS}g}") for value in values)
