"""The explanations of a record that stand after its diagnosis, each with its evidence and what is left of doubt.

An explanation is a model: the final one, one with a rival in the place of an effect, one without an effect that is
hardly missed, or, where nothing was named, one with an effect that is not excluded. Its evidence is its likelihood with
everything fitted integrated out, noises included (docs/active-diagnosis.md eq. 1-2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.judge.investigation import Found, model_of_fit
from rw_ekf.diagnosis.search.selection import Rival, Selection
from rw_ekf.likelihood import work
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.linearisation import Linearisation
from rw_ekf.likelihood.model import prior_rows
from rw_ekf.likelihood.profile import LEAST_RATIO, MOST_RATIO, at_ratio
from rw_ekf.model.effect import Effect, RecordFacts, Term
from rw_ekf.wheel.model_file import refusal_of

NONE = "none"  # the id of an explanation without any effect beyond the base
_HARDLY_MISSED = 40.0  # statistic of an effect that was named, below which the model without it is weighed too
_MOST_WEIGHED = 3
LEAST_POSTERIOR = 0.005  # an explanation below it does not stand
# Evidence is too sure of itself: near rest statistics exceed chi-square, and no model of a wheel is exact. Fitted to
# simulated wheels, and tried on others (docs/diagnosis.md).
TEMPERATURE = 1.5
_KNOWN = 30.0  # sigmas: a size known better meets one density only
_GRID = 2000
_RATIO_STEP = 0.7  # of the logarithm of q dt / R


@dataclass(frozen=True)
class Explanation:
    """A model of the whole record, and how probable it is among those that were weighed."""

    effects: tuple[str, ...]  # beyond the base model
    fit: Fit
    log_evidence: float
    posterior: float = 0.0

    @property
    def id(self) -> str:
        """Its effects, or `none`."""
        return "+".join(self.effects) or NONE


def surviving(found: Found, weighed: list[Explanation]) -> list[Explanation]:
    """Explanations that are not excluded, the most probable first; none of a record that nothing explains."""
    return [] if found.is_unexplained else [item for item in weighed if item.posterior >= LEAST_POSTERIOR]


def weighed_explanations(found: Found) -> list[Explanation]:
    """The final model and all that were weighed against it, the most probable first."""
    if found.nearest is not None:
        fits = [found.fit, found.nearest]
    else:
        fits = [found.fit, *(_in_place(found) if found.new_ids else _beside(found, found.fit))]
    weighed: dict[tuple[str, ...], Explanation] = {}
    for fit in fits:
        effects = tuple(found.selection.new_in(fit))
        item = Explanation(effects, fit, log_evidence(fit, effects, found.prepared.facts))
        key = tuple(sorted(effects))
        if key not in weighed or weighed[key].log_evidence < item.log_evidence:
            weighed[key] = item
    return with_posteriors(list(weighed.values()))


def with_posteriors(weighed: list[Explanation]) -> list[Explanation]:
    """The same with probabilities that add up to 1, the most probable first."""
    logs = np.array([item.log_evidence for item in weighed])
    weights = np.exp((logs - logs.max()) / TEMPERATURE)
    shares = weights / weights.sum()
    found = [replace(item, posterior=float(share)) for item, share in zip(weighed, shares, strict=True)]
    return sorted(found, key=lambda item: -item.posterior)


def explanation_entries(found: Found, explanations: list[Explanation]) -> list[dict[str, Any]]:
    """The `explanations` of the document: ids, posterior, evidence, and the fitted model as a model file has it."""
    entries = []
    for item in explanations:
        model = model_of_fit(item.fit, found.prepared)
        if refusal_of(model) is None:
            entries.append(
                {
                    "effects": list(item.effects),
                    "posterior": item.posterior,
                    "log_evidence": item.log_evidence,
                    "model": model.document(),
                }
            )
    return entries


def _in_place(found: Found) -> list[Fit]:
    """For each effect named its rivals, fitted to the whole record; anything, or nothing, for one hardly missed."""
    selection, fits = found.selection, []
    for name in found.new_ids:
        fits += [_of_what_stands(selection, rival) for rival in selection.rivals.get(name, ())]
        if selection.trials[name].statistic < _HARDLY_MISSED:
            less = selection.without(name)
            fits += [less, *_beside(found, less, name)]
    return fits


def _of_what_stands(selection: Selection, rival: Rival) -> Fit:
    """A rival's fit without effects that were refused after it had been made: a verdict has none of them."""
    fit = rival.fit
    for name in {*fit.model.effects.ids} - {*selection.final.model.effects.ids, rival.name}:
        fit = fit.without(name)
    return fit


def _beside(found: Found, whole: Fit, chosen: str | None = None) -> list[Fit]:
    """A model with each further effect that its data do not exclude, those of most evidence."""
    record, facts = whole.linearised.record, found.prepared.facts
    if not record.work.has(work.FITS):
        record.work.leave_out("some explanations beside the one named")
        return []
    others = [effect for effect in _open(whole, facts) if effect.id != chosen]
    scores = found.selection.scores_beside(whole, others, facts)
    even = math.log(max(len(testable(facts)), 1))
    worth = [score for score in scores.values() if score.evidence > even + math.log(_worth_a_fit(score.effect))]
    fits = []
    for score in sorted(worth, key=lambda score: -score.evidence)[:_MOST_WEIGHED]:
        starts = [whole.model.with_terms(term) for term in score.starts]
        tried = [whole.refitted(model) for model in whole.worth_a_fit(starts)]
        fit = max(tried, key=lambda item: item.likelihood.value)
        if fit.model.possible(score.effect.id, facts):
            fits.append(fit)
    return fits


def _worth_a_fit(effect: type[Effect]) -> float:
    """Odds, by its score, of an effect that is fitted to be weighed: a friction with a memory costs ten others."""
    return 0.05 if effect.linear else 0.3 if effect.flow_kind else 0.1


def _open(whole: Fit, facts: RecordFacts) -> list[type[Effect]]:
    """Effects that may be weighed beside a model: none that it has, no event, no second memory."""
    present, memory = set(whole.model.effects.ids), any(term.effect.flow_kind for term in whole.model.terms)
    return [
        effect
        for effect in testable(facts)
        if effect.id not in present and not effect.local_in_time and not (effect.flow_kind and memory)
    ]


def testable(facts: RecordFacts) -> list[type[Effect]]:
    """Effects of the catalogue that the record can show."""
    from rw_ekf.effects.catalogue import CATALOGUE

    return [effect for effect in CATALOGUE.values() if effect.in_state and effect.untestable(facts) is None]


def log_evidence(fit: Fit, effects: tuple[str, ...], facts: RecordFacts) -> float:
    """Log of likelihood times prior of a model, everything fitted integrated out (eq. 1).

    Along the fit's own linearisation. A record lacks nothing or any one effect that it can show, with equal odds; sizes
    spread evenly in their logarithm from the smallest that matters to the largest possible, places evenly.
    """
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
        if term.id in effects:
            total += 0.5 * len(term.values) * math.log(2.0 * math.pi)
            total += _log_prior(term, values[at], covariance[at, at], facts)
    return total - len(effects) * math.log(max(len(testable(facts)), 1))


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
    return total, mean, covariance


def _log_prior(term: Term, values: Float64Array, covariance: Float64Array, facts: RecordFacts) -> float:
    """Log of the prior density of a term's coefficients, its mean over what the data say of them (eq. 2)."""
    effect = term.effect
    low = effect.smallest(facts)
    high = max(effect.largest(facts), 10.0 * low)
    places = math.log(effect.places(facts)) if effect.linear else 0.0
    size, sigma = float(np.linalg.norm(values)), math.sqrt(max(float(np.trace(covariance)) / values.size, 1.0e-300))
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
