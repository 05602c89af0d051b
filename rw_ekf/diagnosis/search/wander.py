"""Dry friction that wanders with time in no particular shape: a broken line, if nothing else will do.

Tried last, where the residual still depends on time or on what goes with it, and only as a whole: its pieces are one
effect with as many degrees of freedom (docs/diagnosis.md, "Friction that wanders").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.search.candidates import INFLATION
from rw_ekf.diagnosis.search.selection import Trial
from rw_ekf.effects.catalogue import CATALOGUE, WANDERING
from rw_ekf.filter.consistency import chi_square_tail
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import Term

_MOST_PIECES = 12


@dataclass(frozen=True)
class Wander:
    """A model with a friction that wanders, fitted to the searched part."""

    fit: Fit
    trial: Trial


def pieces(prepared: Prepared) -> list[Term]:
    """Terms of a broken line with its knots where blocks meet, as few as 12 between.

    A piece over a held-out block leads from where the block before it ends to where the next begins, so that the blocks
    that are searched know it. After the last of those the line goes on level. None without two of them.
    """
    block, searched = prepared.split.block, prepared.split.fit
    time = prepared.course.time_s
    numbers = np.unique(block[searched])
    if numbers.size < 2:
        return []
    inner = [number for number in np.unique(block) if numbers[0] <= number <= numbers[-1]]
    edges = [*(float(time[block == number][0]) for number in inner), float(time[block == numbers[-1]][-1])]
    count = min(len(edges) - 1, _MOST_PIECES)
    knots = np.interp(np.linspace(0.0, len(edges) - 1.0, count + 1), np.arange(len(edges)), edges)
    return [Term.of(WANDERING, WANDERING.piece(float(a), float(b))) for a, b in pairwise(knots)]


def wandering(prepared: Prepared, final: Fit) -> Wander | None:
    """The final model with wandering friction instead of a drift of any other shape; None where it has no room."""
    terms = pieces(prepared)
    if not terms:
        return None
    less = final
    for name in final.model.effects.ids:  # a spike or a drift may be but a piece of it
        if CATALOGUE[name].of_one_record and name not in prepared.base.model.effects.ids:
            less = less.without(name)
    fit = less.refitted(less.model.with_terms(*terms))
    statistic = 2.0 * (fit.likelihood.value - less.likelihood.value)
    p = chi_square_tail(statistic / INFLATION, len(terms)) if statistic > 0.0 else 1.0
    most, at = max(
        ((term, at) for term, at in fit.model.placed if term.id == WANDERING.id), key=lambda item: item[0].size
    )
    trial = Trial(
        WANDERING,
        statistic,
        p,
        0.5 * (statistic - len(terms) * math.log(final.likelihood.count)),
        most.size,
        float(fit.std[at][0]),
        tuple(fit.model.of(WANDERING.id)),
    )
    return Wander(fit, trial)
