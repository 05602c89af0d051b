"""A law as it was found, of many coefficients, as a filter carries it on: its curve, and one amplitude.

Of coefficients v with covariance V the amplitude a of their own curve is what generalised least squares makes of them,

    a = w'v,   w = V^-1 v / (v' V^-1 v),   var a = 1 / (v' V^-1 v),            (docs/likelihood.md eq. 18)

with the covariances that it has with all else; what else the coefficients leave open is in the law's own spread.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.model.effect import Term
from rw_ekf.model.law import Law
from rw_ekf.model.state import PARAMETER_COUNT
from rw_ekf.wheel.effect_table import EffectSet


def carried(model: Model, covariance: Float64Array) -> tuple[EffectSet, Float64Array]:
    """Effects with each law that was found as one curve, and the covariance (4 + m, 4 + m) of what is left to learn.

    covariance: of parameters and coefficients, in the model's order. Columns of the log get the slots of those in use.
    """
    used = [term.law.column for term in model.effects.terms if term.law is not None and term.law.column]
    slots = {name: slot for slot, name in enumerate(dict.fromkeys(used))}
    rows = list(np.eye(covariance.shape[0])[:PARAMETER_COUNT])
    terms: list[Term] = []
    for term, at in model.placed:
        law = term.law if term.law is None or not term.law.column else replace(term.law, slot=slots[term.law.column])
        if law is not None and law.prior_std and not any(term.values):
            continue  # a law that is nothing throughout
        if law is None or not law.prior_std:
            terms.append(replace(term, law=law))
            rows += list(np.eye(covariance.shape[0])[at])
            continue
        row, values = np.zeros(covariance.shape[0]), np.array(term.values)
        row[at] = 1.0
        if values.size > 1:
            weights = np.linalg.solve(covariance[at, at], values)
            row[at] = weights / float(weights @ values)
            law, values = _one_curve(law, term, covariance[at, at]), np.ones(1)
        rows.append(row)
        terms.append(replace(term, values=(float(values[0]),), stds=(0.0,), law=replace(law, prior_std=())))
    rest = [term for term in model.effects.terms if not term.effect.in_state]
    turn = np.array(rows)
    turned: Float64Array = turn @ covariance @ turn.T
    return EffectSet((*terms, *rest)), turned


def _one_curve(law: Law, term: Term, covariance: Float64Array) -> Law:
    curve = tuple(float(value) for value in law.values(term.values))
    return replace(law, functions=(curve,), spread=tuple(float(std) for std in law.std(covariance)))
