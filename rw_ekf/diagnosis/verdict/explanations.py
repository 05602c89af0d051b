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

from rw_ekf.diagnosis.investigate.found import Found, model_of_fit
from rw_ekf.diagnosis.ledger.evidence import testable
from rw_ekf.diagnosis.ledger.ledger import Row, key_of
from rw_ekf.diagnosis.thresholds import HARDLY_MISSED, LEAST_POSTERIOR, NOTHING_ODDS, TEMPERATURE
from rw_ekf.likelihood import work_budget
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import Effect, RecordFacts
from rw_ekf.wheel.model_file import refusal_of

NONE = "none"  # the id of an explanation without any effect beyond the base
_MOST_WEIGHED = 3


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
    rows = {row.key: row for row in found.ledger.with_rows(fits).rows}
    weighed: dict[frozenset[str], Row] = {}
    for row in (rows[key_of(fit)] for fit in fits):
        key = frozenset(row.effects)
        if key not in weighed or weighed[key].log_evidence < row.log_evidence:
            weighed[key] = row
    return with_posteriors([Explanation(row.effects, row.fit, row.log_evidence) for row in weighed.values()])


def with_posteriors(weighed: list[Explanation]) -> list[Explanation]:
    """The same with probabilities that add up to 1, the most probable first.

    Evidence is too sure of itself: near rest statistics exceed chi-square, and no model of a wheel is exact.
    """
    logs = np.array([item.log_evidence for item in weighed])
    beforehand = np.array([1.0 if item.effects else NOTHING_ODDS for item in weighed])
    weights = beforehand * np.exp((logs - logs.max()) / TEMPERATURE)
    shares = weights / weights.sum()
    found = [replace(item, posterior=float(share)) for item, share in zip(weighed, shares, strict=True)]
    return sorted(found, key=lambda item: -item.posterior)


def explanation_entries(found: Found, explanations: list[Explanation]) -> list[dict[str, Any]]:
    """The `explanations` of the document: ids, posterior, evidence, and the fitted model as a model file has it."""
    entries = []
    for item in explanations:
        fit = found.reported if item.fit is found.fit and found.reported.simulated else item.fit
        model = model_of_fit(fit, found.prepared)
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
        fits += [rival.fit for rival in selection.rivals.get(name, ())]
        if selection.trials[name].statistic < HARDLY_MISSED:
            less = selection.without(name)
            fits += [less, *_beside(found, less, name)]
    return fits


def _beside(found: Found, whole: Fit, chosen: str | None = None) -> list[Fit]:
    """A model with each further effect that its data do not exclude, the strongest."""
    record, facts = whole.linearised.record, found.prepared.facts
    if not record.work.has(work_budget.FITS):
        record.work.leave_out("some explanations beside the one named")
        return []
    others = [effect for effect in _open(whole, facts) if effect.id != chosen]
    scores = found.selection.scores_beside(whole, others, facts)
    even = math.log(max(len(testable(facts)), 1))
    worth = [score for score in scores.values() if score.screening_gain > even + math.log(_worth_a_fit(score.effect))]
    fits = []
    for score in sorted(worth, key=lambda score: -score.screening_gain)[:_MOST_WEIGHED]:
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
