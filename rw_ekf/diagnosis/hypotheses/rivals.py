"""Other effects in the place of one that a model has, where they may explain nearly as much: found and fitted."""

from __future__ import annotations

import math
from typing import NamedTuple

from rw_ekf.diagnosis.hypotheses.candidates import Score
from rw_ekf.diagnosis.hypotheses.confounding import (
    is_smooth_in_time,
    may_confound,
    one_and_the_same,
    quantity_of,
    says_more,
)
from rw_ekf.diagnosis.hypotheses.contenders import Search
from rw_ekf.diagnosis.hypotheses.event import settled_event
from rw_ekf.diagnosis.hypotheses.selection import Selection
from rw_ekf.diagnosis.thresholds import (
    ALIAS_SHARE,
    EXPLAINED_SHARE,
    INDISTINGUISHABLE,
    INFLATION,
    MOST_TRIED,
    SIGNIFICANT_P,
)
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood import work_budget
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import Candidate, Effect, Term

_ROOM = 1.5  # by which the evidence of a linear effect that was only scored may be wrong
_HOPELESS = 0.4  # of the log-likelihood gained: a sketch of a rival with less is not completed
_SECANT_SHARE = 0.05  # of what was gained: a secant falls short of a curve, but not by as much as this
_TWIN_RATIOS = (0.5, 1.0, 2.0)  # of what was chosen: a mean over a window is half as late as it is long


class Exchanged(NamedTuple):
    """A model with another effect in the place of one."""

    fit: Fit
    constructed: bool  # it does what that one does, and the record has both as one: no likelihood decides
    waits: bool  # the record has it as one with what holds at any time, which goes first


def rivals_in_place(search: Search, selection: Selection) -> dict[str, list[Exchanged]]:
    """For each effect of a model, those that may explain nearly as much in its place; all fitted in full."""
    found = {}
    for name in selection.new_ids:
        less = selection.without(name)
        timeless = may_confound(less, "time", "speed")  # an event in such a record is whatever law is missing
        if timeless and CATALOGUE[name].local_in_time:
            continue
        near = _near(search, selection, name)
        near += [] if timeless else _events_near(search, selection, name)
        if not near:
            continue
        if not any(_has_work(search, name, effect) for effect in near):
            search.work.leave_out(f"rivals of {name} ({', '.join(effect.id for effect in near)})")
            continue
        search.advance(f"comparing rivals of {name}")
        found[name] = _rivals_of(search, selection, name, less, near)
    return found


def twins_in_place(search: Search, selection: Selection) -> list[Fit]:
    """A model with each other way of being late in the place of one that it has, whatever the budget.

    Beside a law that was found last nobody has compared them, and many a record has them as one.
    """
    fits, present = [], set(selection.final.model.effects.ids)
    for name in selection.new_ids:
        less, value = selection.without(name), selection.final.model.of(name)[0].values[0]
        twins = [effect for effect in search.effects if effect.id not in present and _is_twin(name, effect)]
        for effect in (twin for twin in twins if twin.coefficient.unit == CATALOGUE[name].coefficient.unit):
            search.advance(f"comparing rivals of {name}")
            best = max(_sketches_of_twin(less, effect, value), key=lambda fit: fit.likelihood.value)
            fits.append(less.refitted(best.model))
    return [fit for fit in fits if all(fit.model.possible(name, search.facts) for name in fit.model.effects.ids)]


def _rivals_of(search: Search, selection: Selection, name: str, less: Fit, near: list[type[Effect]]) -> list[Exchanged]:
    """Rivals of an effect; `less` is the model without it."""
    final, rivals = selection.final, list[Exchanged]()
    scores = selection.scores_beside(less, [CATALOGUE[name], *near], search.facts)
    mine = _weight(scores.get(name), less, final)
    gained = final.likelihood.value - less.likelihood.value
    law = quantity_of(CATALOGUE[name])
    timed = law != "time" and may_confound(less, law, "time")  # no likelihood decides between the two
    for effect in _worth_a_fit(near, scores, mine, gained, timed=timed):
        if not _has_work(search, name, effect):
            search.work.leave_out(f"rivals of {name} ({effect.id})")
            continue
        score = scores.get(effect.id)
        fits = _fits_in_place(search, final, name, less, effect, score)
        fits = [fit for fit in fits if fit.model.possible(effect.id, search.facts)]
        if not fits:
            continue
        rival = search.with_open_speed(max(fits, key=lambda item: item.likelihood.value))
        constructed = _same_by_construction(search, less, final, rival, name, effect)
        # A law of temperature that is true is not behind a curve of time by more than chance; where time goes with
        # speed, a curve of time takes the place of whatever law of speed is missing.
        waits = law == "speed" and (constructed or _is_another_clock(less, effect))
        rivals.append(Exchanged(rival, constructed, waits))
    return rivals


def _fits_in_place(
    search: Search, final: Fit, name: str, less: Fit, effect: type[Effect], score: Score | None
) -> list[Fit]:
    """An effect fitted in the place of one that was chosen, from each start that is worth it."""
    if effect.local_in_time:
        return [] if score is None else [settled_event(less, score, search.facts)]
    value, gained = final.model.of(name)[0].values[0], final.likelihood.value - less.likelihood.value
    starts = [] if score is None else list(score.starts)
    if not effect.linear and effect.coefficient.unit == CATALOGUE[name].coefficient.unit:
        starts.append(Term.at(effect, Candidate(value)))
    if search.work.has(work_budget.RIVALS):
        models = [less.model.with_terms(term) for term in starts]
        return [less.refitted(model) for model in less.worth_a_fit(models, _HOPELESS * gained)]
    return _sketches_of_twin(less, effect, value)


def _sketches_of_twin(less: Fit, effect: type[Effect], value: float) -> list[Fit]:
    """A twin beside `less`, sketched from around the value of what it may replace."""
    near_it = (Term.at(effect, Candidate(ratio * value)) for ratio in _TWIN_RATIOS)
    return [less.sketched(less.model.with_terms(term)) for term in near_it]


def _has_work(search: Search, name: str, rival: type[Effect]) -> bool:
    """Whether there is room for a rival, if only for sketches of a twin."""
    return search.work.has(work_budget.FITS if _is_twin(name, rival) else work_budget.RIVALS)


def _is_twin(name: str, rival: type[Effect]) -> bool:
    """Whether a rival is another way of being late, which most records have as one with what was chosen."""
    return rival.id in CATALOGUE[name].confounded and not rival.linear and not rival.flow_kind


def _worth_a_fit(
    near: list[type[Effect]], scores: dict[str, Score], mine: float, gained: float, *, timed: bool
) -> list[type[Effect]]:
    """Those whose score may reach what was chosen, the strongest first; what is not linear scores by a secant.

    timed: effects of time are worth one whatever they score: the record has what was chosen and time as one.
    """
    least = mine - INDISTINGUISHABLE - _ROOM
    linear = [
        e
        for e in near
        if e.linear and e.id in scores and (scores[e.id].screening_gain > least or (timed and quantity_of(e) == "time"))
    ]
    linear.sort(key=lambda effect: -scores[effect.id].screening_gain)
    enough = _SECANT_SHARE * 2.0 * gained
    bent = [e for e in near if not e.linear and (e.id not in scores or scores[e.id].statistic > enough)]
    bent.sort(key=lambda effect: -scores[effect.id].screening_gain if effect.id in scores else math.inf)
    return [*linear[:MOST_TRIED], *bent]


def _weight(score: Score | None, less: Fit, fit: Fit) -> float:
    """What an effect that was fitted in full beside `less` gains: as it was screened, its likelihood the fit's."""
    gain = fit.likelihood.value - less.likelihood.value
    return gain / INFLATION if score is None else score.screening_gain + (gain - 0.5 * score.statistic) / INFLATION


def _same_by_construction(search: Search, less: Fit, final: Fit, rival: Fit, name: str, other: type[Effect]) -> bool:
    """Whether an effect of time does what the one chosen does, in a record that has them confounded."""
    mine, its = quantity_of(CATALOGUE[name]), quantity_of(other)
    if its != "time" or mine == "time" or not may_confound(less, mine, its):
        return False
    gained = final.likelihood.value - less.likelihood.value
    if rival.likelihood.value - less.likelihood.value < EXPLAINED_SHARE * gained:
        return False
    return not says_more(less, search.facts, CATALOGUE[name], its, SIGNIFICANT_P)


def _is_another_clock(less: Fit, effect: type[Effect]) -> bool:
    """Whether an effect goes with time as smoothly as the speed does, in a record that has them as one."""
    return is_smooth_in_time(effect) and one_and_the_same(less, "time", "speed")


def _near(search: Search, selection: Selection, name: str) -> list[type[Effect]]:
    """Effects worth comparing with one that was chosen: known aliases, and those that scored half as much."""
    least = ALIAS_SHARE * selection.trials[name].statistic
    strong = sorted(selection.trials.values(), key=lambda trial: -trial.screening_gain)
    names = [trial.effect.id for trial in strong if trial.statistic > least and trial.effect.linear]
    names += [trial.effect.id for trial in strong if trial.statistic > least and not trial.effect.linear][:MOST_TRIED]
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


def _events_near(search: Search, selection: Selection, name: str) -> list[type[Effect]]:
    """Events that scored nearly as much as a law that was chosen."""
    if CATALOGUE[name].local_in_time:
        return []
    least = selection.trials[name].screening_gain - INDISTINGUISHABLE - _ROOM
    present = set(selection.final.model.effects.ids)
    events = [effect.id for effect in search.effects if effect.local_in_time]
    tried = [selection.trials.get(name) for name in events]
    return [t.effect for t in tried if t is not None and t.screening_gain > least and t.effect.id not in present]
