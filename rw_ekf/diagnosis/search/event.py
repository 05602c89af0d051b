"""An event in time: its place sought ever more finely, and weighed with the law that stands beside it."""

from __future__ import annotations

from rw_ekf.diagnosis.search.candidates import Score
from rw_ekf.diagnosis.search.confounding import event_scores, may_confound
from rw_ekf.diagnosis.search.scorer import Scorer
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model import Model
from rw_ekf.model.effect import Candidate, Effect, RecordFacts, Term

_ZOOMS = 8
_WORTH_A_LAW = 16.0  # of twice the log-likelihood, for one law more


def zoomed(fit: Fit, score: Score, facts: RecordFacts) -> Score:
    """The best place of an event near the one found, by ever finer steps: a fit follows its onset only so far."""
    scorer, effect = Scorer(fit), score.effect
    best: Score | None = None
    at = score.candidate
    for turn in range(_ZOOMS):
        near = scorer.best_at(facts, [(effect, candidate) for candidate in effect.nearby(at, turn, facts)])
        best = max([*near.values(), *([best] if best else [])], key=lambda item: item.statistic, default=None)
        if best is None:
            return score
        at = best.candidate
    return best if best is not None else score


def with_other_laws(fit: Fit, name: str, facts: RecordFacts) -> tuple[Fit, dict[str, float]]:
    """An event and the law beside it shape each other where time goes with speed: the likeliest pair of them.

    Only alternatives that a law itself names as such are tried in its place, each with the event sought anew. Returned
    with the standard deviations of the event's shape constants.
    """
    if not may_confound(fit, "time", "speed"):
        return fit, {}
    tried = []
    for model in [fit.model, *_others(fit.model, facts)]:
        less = fit.refitted(model.without(name))
        score = event_scores(less, [CATALOGUE[name]], facts).get(name)
        if score is not None:
            tried.append(less.refitted(less.model.with_terms(zoomed(less, score, facts).starts[0])))
    if not tried:
        return fit, {}
    best = max(tried, key=lambda item: 2.0 * item.likelihood.value - _WORTH_A_LAW * len(item.model.effects.ids))
    return fit.refitted(best.model.settled(name)), best.terms_of(name)[0].shape_std


def _others(model: Model, facts: RecordFacts) -> list[Model]:
    """Models with one steady linear law in the place of one that is its known alias, beside it, and without either."""
    found = []
    for name in model.effects.ids:
        effect = CATALOGUE[name]
        if not _steady(effect):
            continue
        found.append(model.without(name))
        for other in (CATALOGUE[alias] for alias in effect.confounded if alias not in model.effects.ids):
            if other.in_state and _steady(other) and other.untestable(facts) is None:
                added = Term.at(other, Candidate(0.0))
                found += [model.without(name).with_terms(added), model.with_terms(added)]
    return found


def _steady(effect: type[Effect]) -> bool:
    """Whether it is one linear law that holds at any time."""
    return effect.linear and effect.components == 1 and not effect.of_one_record
