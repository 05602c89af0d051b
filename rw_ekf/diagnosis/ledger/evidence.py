"""The evidence of a model: its likelihood with everything fitted integrated out (docs/active-diagnosis.md eq. 1-2)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.hypotheses.law_grounds import LAW_LOG_ODDS
from rw_ekf.diagnosis.hypotheses.random_walk import evidence_of_wandering
from rw_ekf.effects.catalogue import CATALOGUE, WANDERING
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.linearisation import Linearisation
from rw_ekf.likelihood.model_vector import prior_rows
from rw_ekf.likelihood.profile import LEAST_RATIO, MOST_RATIO, at_ratio
from rw_ekf.model.effect import Effect, RecordFacts, Term
from rw_ekf.model.effect_kinds import LawEffect
from rw_ekf.model.law import Law

_KNOWN = 30.0  # sigmas: a size known better meets one density only
_GRID = 2000
_RATIO_STEP = 0.7  # of the logarithm of q dt / R


def testable(facts: RecordFacts) -> list[type[Effect]]:
    """Effects of the catalogue that the record can show."""
    return [effect for effect in CATALOGUE.values() if effect.in_state and effect.untestable(facts) is None]


def log_evidence(fit: Fit, effects: tuple[str, ...], facts: RecordFacts) -> float:
    """Log of likelihood times prior of a model, everything fitted integrated out (eq. 1).

    Along the fit's own linearisation. A record lacks nothing or any one effect that it can show, with equal odds; sizes
    spread evenly in their logarithm from the smallest that matters to the largest possible, places evenly. A friction
    that wanders is one effect, however many its pieces: they are drawn from one distribution, and integrated out.
    """
    pieces = [term for term in fit.model.of(WANDERING.id) if not term.settled]
    if len(pieces) > 1 and WANDERING.id in effects:
        rest = tuple(name for name in effects if name != WANDERING.id)
        less = fit.without(WANDERING.id)  # a drift of the model that was given is no piece, and stays
        return log_evidence_with_walk(less, rest, pieces, facts)
    model = replace(
        fit.model,
        effects=replace(fit.model.effects, terms=tuple(replace(t, settled=True) for t in fit.model.effects.terms)),
    )
    known = model.known
    linearised = replace(
        fit.linearised,
        model=model,
        jacobian=fit.linearised.jacobian[:, :known],
        memory_jacobian=fit.linearised.memory_jacobian[:, :known],
    )
    total, correction, covariance = _integrated(linearised, fit)
    values = model.vector + model.limited(correction)
    for term, at in model.placed:
        if term.id in effects and not term.given:
            total += 0.5 * len(term.values) * math.log(2.0 * math.pi)
            total += _log_prior(term, values[at], covariance[at, at], model.seen_by(term.effect, facts))
    # A law pays for its kind by itself.
    named = [name for name in effects if not issubclass(CATALOGUE[name], LawEffect)]
    return total - len(named) * math.log(max(len(testable(facts)), 1))


def log_evidence_with_walk(less: Fit, effects: tuple[str, ...], pieces: list[Term], facts: RecordFacts) -> float:
    """The same of a model with a friction that wanders over these pieces beside the effects, which `less` has alone."""
    factor = evidence_of_wandering(less, pieces) - math.log(max(len(testable(facts)), 1))
    return log_evidence(less, effects, facts) + factor


def _integrated(linearised: Linearisation, fit: Fit) -> tuple[float, Float64Array, Float64Array]:
    """Log of the likelihood with vector, R and the ratio of noises integrated out; mean and covariance of the vector.

    The torque noise has its prior, flat in sqrt(q) but for what is known of it; coefficients have a flat one here.
    """
    known = None if fit.prior is None else prior_rows(fit.prior, linearised.model)
    ratios = np.exp(np.arange(math.log(LEAST_RATIO), math.log(MOST_RATIO), _RATIO_STEP))
    points = [at_ratio(linearised, known, fit.noise.variance, float(ratio)) for ratio in ratios]
    logs = np.array([item.restricted + 0.5 * math.log(item.noise.ratio * item.noise.variance) for item in points])
    weights = np.exp(logs - logs.max())
    total = float(logs.max()) + math.log(float(weights.sum()) * _RATIO_STEP)
    weights /= weights.sum()
    mean = np.einsum("i,ij->j", weights, np.array([item.correction for item in points]))
    covariance = np.einsum("i,ijk->jk", weights, np.array([item.covariance for item in points]))
    # What the likelihood would gain by a last correction, were it not out of reach. Of a fit that has converged that is
    # nothing; one that ends at a bound, or at a kink whose two sides slope differently (a delay at the edge of an
    # interval), has the likelihood that it has, and not that which its slope promises.
    promised = max(points[int(np.argmax(logs))].value - fit.likelihood.value, 0.0)
    return total - promised, mean, covariance


def log_law_prior(law: Law) -> float:
    """Log of the prior density of a law's coefficients but for their squares, which the likelihood has already.

    With the odds of a law that no catalogue has, and those of its size and smoothness, which were chosen by likelihood.
    """
    return LAW_LOG_ODDS - sum(0.5 * math.log(2.0 * math.pi) + math.log(std) for std in law.prior_std)


def _log_prior(term: Term, values: Float64Array, covariance: Float64Array, facts: RecordFacts) -> float:
    """Log of the prior density of a term's coefficients, its mean over what the data say of them (eq. 2)."""
    effect = term.effect
    low = effect.smallest(facts)
    high = max(effect.largest(facts), 10.0 * low)
    places = math.log(effect.places(facts)) if effect.linear else 0.0
    size, sigma = float(np.linalg.norm(values)), math.sqrt(max(float(np.trace(covariance)) / values.size, 1.0e-300))
    if term.law is not None:
        return log_law_prior(term.law)
    if values.size > 1:  # a sine: its phase is anybody's guess
        around = max(size, sigma, low)
        return -math.log(2.0 * math.pi * around**2 * math.log(high / low)) - places
    sides = 1.0 if effect.coefficient.lower >= 0.0 else 2.0
    if size > _KNOWN * sigma:
        return -math.log(sides * min(max(size, low), high) * math.log(high / low)) - places
    grid = np.exp(np.linspace(math.log(low), math.log(high), _GRID))
    step = math.log(high / low) / (_GRID - 1)
    ways = (1.0, -1.0) if sides > 1.0 else (1.0,)
    density = sum(np.exp(-0.5 * ((way * grid - values[0]) / sigma) ** 2) for way in ways)
    mean = float(np.sum(density)) * step / (math.sqrt(2.0 * math.pi) * sigma * sides * math.log(high / low))
    return math.log(max(mean, 1.0e-300)) - places
