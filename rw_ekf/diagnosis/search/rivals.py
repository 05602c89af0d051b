"""Explanations that fit nearly as well as the one chosen: found, compared, and settled on the whole record."""

from __future__ import annotations

from rw_ekf.diagnosis.search.confounding import may_confound, quantity_of, says_more
from rw_ekf.diagnosis.search.scorer import Scorer
from rw_ekf.diagnosis.search.selection import ALIAS_SHARE, MOST_TRIED, Search, Selection
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood import work
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import Candidate, Effect, Term

INDISTINGUISHABLE = 9.0  # two explanations whose log-likelihoods differ by less than half of this: three sigma
EXPLAINED_SHARE = 0.8  # of all structure: with less, what was found is not the explanation
_TIE = (
    0.1  # of the log-likelihood: two that are nearer are one model under two names, and the catalogue's first is said
)
_RIVAL_MARGIN = 16.0  # of twice the log-likelihood on the part: nearer ones are compared on the whole record


def weigh_rivals(search: Search, selection: Selection) -> None:
    """Find explanations that fit nearly as well as those chosen, and let the whole record decide where it can."""
    _find_rivals(search, selection)
    _settle_rivals(search, selection)


def _find_rivals(search: Search, selection: Selection) -> None:
    """For each effect chosen, those that fit nearly as well in its place; all fitted in full."""
    final = selection.final
    for name in final.model.effects.ids:
        if name in selection.base.model.effects.ids or CATALOGUE[name].local_in_time:
            continue
        near = _near(search, selection, name)
        if not near:
            continue
        if not search.work.has(max(work.RIVALS, search.share)):
            search.work.leave_out(f"rivals of {name} ({', '.join(effect.id for effect in near)})")
            continue
        search.advance(f"comparing rivals of {name}")
        less = final.without(name)
        scores = Scorer(less).best_of_each(search.facts, near)
        value = final.model.of(name)[0].values[0]
        for effect in near:
            if not search.work.has(max(work.RIVALS, search.share)):
                search.work.leave_out(f"rivals of {name} ({effect.id})")
                continue
            score = scores.get(effect.id)
            starts = [] if score is None else list(score.starts)
            if not effect.linear and effect.coefficient.unit == CATALOGUE[name].coefficient.unit:
                starts.append(Term.at(effect, Candidate(value)))
            fits = [less.refitted(less.model.with_terms(term)) for term in starts]
            fits = [fit for fit in fits if fit.model.possible(effect.id, search.facts)]
            if not fits:
                continue
            rival = max(fits, key=lambda item: item.likelihood.value)
            constructed = _same_by_construction(search, less, final, rival, name, effect)
            if constructed:
                selection.constructed.setdefault(name, set()).add(effect.id)
            if constructed or 2.0 * (final.likelihood.value - rival.likelihood.value) < _RIVAL_MARGIN:
                selection.rivals.setdefault(name, []).append(rival)


def _same_by_construction(search: Search, less: Fit, final: Fit, rival: Fit, name: str, other: type[Effect]) -> bool:
    """Whether an effect of time does what the one chosen does, in a record that has them confounded."""
    mine, its = quantity_of(CATALOGUE[name]), quantity_of(other)
    if its != "time" or mine == "time" or not may_confound(less, mine, its):
        return False
    gained = final.likelihood.value - less.likelihood.value
    if rival.likelihood.value - less.likelihood.value < EXPLAINED_SHARE * gained:
        return False
    return not says_more(less, search.facts, CATALOGUE[name], its, search.enough)


def _near(search: Search, selection: Selection, name: str) -> list[type[Effect]]:
    """Effects worth comparing with one that was chosen: known aliases, and those that scored half as much."""
    least = ALIAS_SHARE * selection.trials[name].statistic
    strong = sorted(selection.trials.values(), key=lambda trial: -trial.statistic)
    names = [trial.effect.id for trial in strong if trial.statistic > least][:MOST_TRIED]
    names += [other for other in CATALOGUE[name].confounded if not CATALOGUE[other].linear]
    present = set(selection.final.model.effects.ids)
    memory = any(term.effect.flow_kind for term in selection.final.model.terms if term.id != name)
    return [
        effect
        for effect in search.effects
        if effect.id in names
        and effect.id not in present
        and not effect.local_in_time
        and not (effect.flow_kind and memory)
    ]


def _settle_rivals(search: Search, selection: Selection) -> None:
    """Between explanations that the searched part cannot tell apart, the whole record decides where it can.

    Where it cannot either, what holds at any time goes before what is tied to this record's clock.
    """
    order = [*CATALOGUE]
    for name, fits in list(selection.rivals.items()):
        tried = [(selection.final.widened(search.record, search.seen).likelihood.value, name, selection.final)]
        for fit in fits:
            other = next(item for item in fit.model.effects.ids if item not in selection.final.model.effects.ids)
            tried.append((fit.widened(search.record, search.seen).likelihood.value, other, fit))
        top = max(value for value, _, _ in tried)
        same = selection.constructed.get(name, set())
        near = [
            item
            for item in tried
            if 2.0 * (top - item[0]) < INDISTINGUISHABLE or item[1] in same or (same and item[1] == name)
        ]
        _, winner, best = max(
            near,
            key=lambda item: (
                item[1] not in same,
                not CATALOGUE[item[1]].of_one_record,
                min(item[0], top - _TIE),
                -order.index(item[1]),
            ),
        )
        selection.rivals.pop(name)
        if best is not selection.final:
            selection.trials[name].decision = (winner,)
            selection.final = best
        others = [fit for _, other, fit in near if other != winner]
        if others:
            selection.rivals[winner] = others
