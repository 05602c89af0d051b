"""An event in time: its place sought ever more finely, and weighed with the law that stands beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rw_ekf.diagnosis.search.candidates import Score, hypotheses
from rw_ekf.diagnosis.search.confounding import may_confound
from rw_ekf.diagnosis.search.scorer import Scorer
from rw_ekf.diagnosis.search.trial import Trial
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model import Model
from rw_ekf.model.effect import Candidate, Effect, RecordFacts, Term

if TYPE_CHECKING:
    from rw_ekf.diagnosis.search.selection import Search

_ZOOMS = 8
_WORTH_A_LAW = 16.0  # of twice the log-likelihood, for one law more


def zoomed(fit: Fit, score: Score, facts: RecordFacts) -> Score:
    """The best place of an event near the one found, by ever finer steps: a fit follows its onset only so far."""
    scorer = Scorer(fit)
    effect = score.hypothesis.effect
    best: Score | None = None
    at = score.hypothesis.candidate
    for turn in range(_ZOOMS):
        places = [(effect, candidate) for candidate in effect.nearby(at, turn, facts)]
        for group in hypotheses(fit.frame, places):
            best = max([*scorer.score(group), *([best] if best else [])], key=lambda item: item.statistic, default=None)
        if best is None:
            return score
        at = best.hypothesis.candidate
    return best if best is not None else score


def with_other_laws(search: Search, fit: Fit, trial: Trial) -> Fit:
    """An event and the law beside it shape each other where time goes with speed: the likeliest pair of them.

    Only alternatives that a law itself names as such are tried in its place, each with the event sought anew.
    """
    whole = fit.widened(search.whole, search.seen)
    name = trial.effect.id
    if not may_confound(whole, "time", "speed"):
        return fit
    tried = []
    for model in [fit.model, *_others(fit.model, search.effects)]:
        less = whole.refitted(model.without(name))
        score = search.event_scores(less, [trial.effect]).get(name)
        if score is not None:
            term = zoomed(less, score, search.facts).hypothesis.starts(score.coefficients)[0]
            tried.append(less.refitted(less.model.with_terms(term)))
    if not tried:
        return fit
    best = max(tried, key=lambda item: 2.0 * item.likelihood.value - _WORTH_A_LAW * len(item.model.effects.ids))
    trial.shape_std |= shape_std_of(best, name)
    return fit.refitted(best.model.settled(name))


def _others(model: Model, effects: list[type[Effect]]) -> list[Model]:
    """Models with one steady linear law in the place of one that is its known alias, beside it, and without either."""
    found = []
    for name in model.effects.ids:
        effect = CATALOGUE[name]
        if _steady(effect):
            found.append(model.without(name))
        for other in effects:
            if other.id not in effect.confounded or other.id in model.effects.ids:
                continue
            if _steady(effect) and _steady(other):
                added = Term.at(other, Candidate(0.0))
                found += [model.without(name).with_terms(added), model.with_terms(added)]
    return found


def _steady(effect: type[Effect]) -> bool:
    """Whether it is one linear law that holds at any time."""
    return effect.linear and effect.components == 1 and not effect.of_one_record


def shape_std_of(fit: Fit, name: str) -> dict[str, float]:
    """Standard deviations of an effect's refined shape constants, by name."""
    refined = ((fit.model.terms[i], j, at) for at, (i, j) in enumerate(fit.model.refined, start=fit.model.known))
    return {term.effect.constants[j].name: float(fit.std[at]) for term, j, at in refined if term.id == name}
