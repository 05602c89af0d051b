"""Dry friction that walks at random with time: a broken line whose pieces are drawn from one distribution.

Tried last, where the residual still depends on time or on what goes with it, or nothing was found. That friction walks
is one number more, its variance per second, not one for every piece (docs/likelihood.md, "Friction that wanders").
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.hypotheses.candidates import analytic
from rw_ekf.diagnosis.hypotheses.joint_regressors import evidence_of_random, score_random
from rw_ekf.diagnosis.hypotheses.noise_ratios import Profiled
from rw_ekf.diagnosis.hypotheses.selection import Trial
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.thresholds import INFLATION
from rw_ekf.effects.catalogue import CATALOGUE, WANDERING
from rw_ekf.filter.tails import chi_square_tail
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.structure import hats, slopes_by_torque
from rw_ekf.model.effect import Candidate, Term
from rw_ekf.model.state import STATE_SIZE

_PIECE_S, _MOST_PIECES = 10.0, 30
_FINE_S, _MOST_FINE = 8.0, 80


@dataclass(frozen=True)
class Wander:
    """A model with a friction that wanders."""

    fit: Fit
    trial: Trial
    gain: float  # of twice the log-likelihood, beside what was left out for it


def pieces(prepared: Prepared) -> list[Term]:
    """Terms of a broken line over the whole record with even knots."""
    time = prepared.course.time_s
    count = min(max(int((time[-1] - time[0]) / _PIECE_S), 2), _MOST_PIECES)
    knots = np.linspace(time[0], time[-1], count + 1)
    return [Term.of(WANDERING, WANDERING.piece(float(a), float(b))) for a, b in pairwise(knots)]


@dataclass(frozen=True)
class Walk:
    """A dry friction that walks, as it is carried on: nobody foretells the line that it took."""

    rate: float  # rad/s^2 per sqrt(s)
    model: Model  # without it, dry friction as it was on average over the record
    spread: float  # by which it was off that [rad/s^2]


def walk_of(fit: Fit) -> Walk | None:
    """The walk of a fit that has pieces of one; None of any other."""
    terms = [term for term in fit.model.of(WANDERING.id) if not term.settled]
    if len(terms) < 2:
        return None
    lengths = np.array([term.shape[2] for term in terms])
    steps = np.array([term.values[0] for term in terms]) * lengths
    if fit.prior is not None and WANDERING.id in fit.prior.effect_ids:
        at = STATE_SIZE + fit.prior.effect_ids.index(WANDERING.id)
        rate = float(fit.prior.std[at]) * math.sqrt(lengths[0])
    else:
        rate = math.sqrt(float(np.mean(steps**2 / lengths)))
    middle = np.cumsum(steps) - 0.5 * steps
    level = float(np.average(middle, weights=lengths))
    spread = math.sqrt(float(np.average((middle - level) ** 2, weights=lengths)))
    dry = fit.model.parameters
    usual = dry._replace(coulomb=dry.coulomb + level, static=dry.static + level)
    return Walk(rate, replace(fit.model.without(WANDERING.id), parameters=usual), spread)


def without_walk(fit: Fit) -> Fit:
    """A fit without its walk, if it has one."""
    return fit if walk_of(fit) is None else fit.without(WANDERING.id)


def followed_finely(fit: Fit) -> Float64Array | None:
    """Slopes (n, m) by a dry friction that follows time more finely than the pieces of a model; None without such.

    A friction that walks does so within its pieces too. Along a record whose speed goes with time for a while that
    would look like a dependence on anything.
    """
    if len(fit.model.of(WANDERING.id)) < 2:
        return None
    record = fit.linearised.record
    time = record.course.time_s
    count = min(max(int((time[-1] - time[0]) / _FINE_S), 2), _MOST_FINE)
    _, dry = slopes_by_torque(fit)
    return np.where(record.follows[:, None], dry[:, None] * hats(time, count, float(time[0]), float(time[-1])), 0.0)


def wandering(prepared: Prepared, final: Fit, enough: float) -> Wander | None:
    """The final model with wandering friction instead of a drift of any other shape; None where friction does not walk.

    enough: the p-value at which it does.
    """
    less = final
    for name in final.model.effects.ids:  # a spike or a drift may be but a piece of it
        if CATALOGUE[name].of_one_record and name not in prepared.base.model.effects.ids:
            less = less.without(name)
    terms = pieces(prepared)
    statistic, density = score_random(Profiled(less), _regressors(less, terms))
    p = 0.5 * chi_square_tail(statistic / INFLATION, 1)
    if p >= enough:
        return None
    prior = less.prior
    for term in terms:
        std = density / math.sqrt(term.shape[2])
        prior = None if prior is None else prior.with_coefficient(WANDERING.id, 0.0, std)
    fit = replace(less, prior=prior).refitted(less.model.with_terms(*terms))
    most, at = max(fit.model.placed_of(WANDERING.id), key=lambda item: item[0].size)
    trial = Trial(
        WANDERING,
        statistic,
        p,
        0.5 * (statistic / INFLATION - math.log(final.likelihood.count)),
        most.size,
        float(fit.std[at][0]),
        tuple(fit.model.of(WANDERING.id)),
    )
    return Wander(fit, trial, statistic - 2.0 * (final.likelihood.value - less.likelihood.value))


def evidence_of_wandering(less: Fit, terms: list[Term]) -> float:
    """Log of how much likelier a record is if friction walks over these pieces, how far integrated out with the walk.

    less: the model without it.
    """
    return evidence_of_random(Profiled(less), _regressors(less, terms))


def _regressors(less: Fit, terms: list[Term]) -> Float64Array:
    """Columns (n, m) of pieces of one walk, each in units of what it makes of the same variance per second."""
    columns = analytic(less.linearised, [(WANDERING, Candidate(1.0, term.shape)) for term in terms])
    lengths = np.array([term.shape[2] for term in terms])
    return np.asarray(np.concatenate([column.regressors for column in columns], axis=1) / np.sqrt(lengths))
