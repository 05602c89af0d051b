"""An event in time: its place sought ever more finely, and weighed with the law that stands beside it."""

from __future__ import annotations

import math

from rw_ekf.diagnosis.hypotheses.candidates import Score
from rw_ekf.diagnosis.hypotheses.confounding import event_scores, may_confound
from rw_ekf.diagnosis.hypotheses.onset import with_better_onset
from rw_ekf.diagnosis.hypotheses.scorer import Scorer
from rw_ekf.diagnosis.thresholds import KEPT_SHARE, LAW_BESIDE_EVENT
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood import work_budget
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.robust_fit import likelier_along_filter
from rw_ekf.model.effect import Candidate, Effect, RecordFacts, Term

_ZOOMS = 8
_STARTS, _WORTH_FOLLOWING = 8, 0.3  # places of the bank that are followed, and their share of the strongest at least
_FITTED = 2  # of those


def zoomed(fit: Fit, score: Score, facts: RecordFacts) -> list[Score]:
    """The best places of an event, the strongest first: the bank's strongest, followed by ever finer steps.

    Several, because a place that is a little off may be weaker than another far away; a fit follows an onset only so
    far.
    """
    scorer, effect = Scorer(fit), score.effect
    bank = scorer.all_at(facts, [(effect, candidate) for candidate in effect.candidates(facts)])
    worth = [score, *(item for item in bank if item.statistic > _WORTH_FOLLOWING * score.statistic)]
    found = [_followed(scorer, start, facts) for start in _apart(worth, facts.duration_s / _STARTS)[:_STARTS]]
    return _apart(sorted(found, key=lambda item: -item.statistic), 0.0)[:_FITTED]


def _apart(scores: list[Score], least_s: float) -> list[Score]:
    """Of places in order those that are no neighbour of one before: another decay, or an onset a decay away."""
    chosen: list[Score] = []
    for item in scores:
        onset, decay = item.effect.lasts(item.candidate.shape)
        others = [other.effect.lasts(other.candidate.shape) for other in chosen]
        if not any(0.5 < decay / other < 2.0 and abs(onset - at) < max(0.3 * decay, least_s) for at, other in others):
            chosen.append(item)
    return chosen


def _followed(scorer: Scorer, start: Score, facts: RecordFacts) -> Score:
    """The best place of an event near one, nearer with every turn."""
    best = start
    for turn in range(_ZOOMS):
        near = [(best.effect, candidate) for candidate in best.effect.nearby(best.candidate, turn, facts)]
        best = max([*scorer.best_at(facts, near).values(), best], key=lambda item: item.statistic)
    return best


def fitted_event(fit: Fit, score: Score, facts: RecordFacts) -> Fit:
    """A fit with an event beside what it has, the likeliest of those from the event's best places."""
    found = [fitted_at(fit, place) for place in zoomed(fit, score, facts)]
    best = max(found, key=lambda item: item.likelihood.value)
    return with_better_onset(best, score.effect.id, facts)


def settled_event(fit: Fit, score: Score, facts: RecordFacts) -> Fit:
    """The same, its place held from then on: what else is fitted does not move it."""
    best = fitted_event(fit, score, facts)
    return best.refitted(best.model.settled(score.effect.id))


def fitted_at(fit: Fit, score: Score, least_gain: float = -math.inf) -> Fit:
    """A fit with an effect beside what it has, from its place; again along the filter's path where it gained little.

    least_gain: in log-likelihood; with less a fit need not go all ways.
    """
    models = [fit.model.with_terms(term) for term in score.starts]
    fits = [fit.refitted(model, least_gain) for model in fit.worth_a_fit(models)]
    best = max(fits, key=lambda item: item.likelihood.value)
    gained = 2.0 * (best.likelihood.value - fit.likelihood.value)
    if gained <= KEPT_SHARE * score.statistic:
        return likelier_along_filter(best, fit, fit.model.with_terms(score.starts[0]))
    return best


def with_other_laws(fit: Fit, name: str, facts: RecordFacts) -> Fit:
    """An event and the law beside it shape each other where time goes with speed: the likeliest pair of them.

    Only alternatives that a law itself names as such are tried in its place, each with the event sought anew; those of
    few effects first, for a score says little of what an event gains where it is sought anew (64, and 191 found).
    """
    if not may_confound(fit, "time", "speed"):
        return fit
    scored = []
    for model in [fit.model, *_others(fit.model, facts)]:
        less = fit.refitted(model.without(name))
        score = event_scores(less, [CATALOGUE[name]], facts).get(name)
        if score is not None:
            scored.append((len(less.model.effects.ids), -score.statistic - _twice_log(less), less, score))
    tried: list[Fit] = []
    spent = fit.linearised.record.work
    for _, _, less, score in sorted(scored, key=lambda item: item[:2]):
        if tried and not spent.has(work_budget.SEARCH):
            spent.leave_out(f"{name} beside {', '.join(less.model.effects.ids) or 'the model'}")
            break
        tried.append(fitted_event(less, score, facts))
    return fit.refitted(max(tried, key=_twice_log).model.settled(name)) if tried else fit


def _twice_log(fit: Fit) -> float:
    """Twice the log of how likely a fit is, less what each effect of it has to be worth."""
    return 2.0 * fit.likelihood.value - LAW_BESIDE_EVENT * len(fit.model.effects.ids)


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
