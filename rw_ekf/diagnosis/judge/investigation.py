"""Investigate a record: search a part, then the whole, confirm on what was held out, map what is left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from rw_ekf.diagnosis.judge.heldout import confirm, veto
from rw_ekf.diagnosis.judge.residual_map import Dependence, residual_map
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.search.confounding import one_and_the_same
from rw_ekf.diagnosis.search.rivals import find_rivals, settle_rivals
from rw_ekf.diagnosis.search.selection import Search
from rw_ekf.diagnosis.search.trial import (
    EXPLAINED_SHARE,
    LOCAL_P,
    MAP_P,
    WHOLE_P,
    Selection,
    determined,
    matters,
    possible,
)
from rw_ekf.diagnosis.search.wander import wandering
from rw_ekf.diagnosis.standing import IMPOSSIBLE, NOT_CONFIRMED, TOO_SMALL, explained_by
from rw_ekf.effects.catalogue import WANDERING
from rw_ekf.likelihood import work
from rw_ekf.likelihood.fitting import Fit

Advance = Callable[[str], object]
Figures = dict[str, Any]

_GOES_WITH_TIME = ("time", "temperature")
_LEAST_SIGMAS_OF_PART = 1.0  # what the whole record found, one part must know at least so well


@dataclass
class Found:
    """A search and what it left, on the whole record."""

    prepared: Prepared
    search: Search
    selection: Selection
    whole: Fit  # the final model on the whole record
    dependences: list[Dependence]  # of what it leaves

    @property
    def left(self) -> list[Dependence]:
        """What noise does not explain in the map."""
        return [item for item in self.dependences if item.p_value < MAP_P]

    @property
    def new_ids(self) -> list[str]:
        """Effects that the record asks for beyond the model it was given."""
        return self.selection.new_ids

    @property
    def is_unexplained(self) -> bool:
        """Whether structure is left that outweighs what was found, but for what the effects leave by nature."""
        terms = self.selection.final.model.terms
        excused = {name for term in terms for name in term.effect.may_leave(term.shape, self.prepared.facts)}
        return any(item.name not in excused for item in self.left) and self.share < EXPLAINED_SHARE

    @property
    def share(self) -> float:
        """Of all the structure there was, what the effects explain; of what is left only what exceeds chance counts."""
        if not self.left:
            return 1.0
        base = self.selection.base.widened(self.prepared.whole, self.prepared.seen)
        explained = 2.0 * (self.whole.likelihood.value - base.likelihood.value)
        most = max(item.statistic - item.freedom for item in self.left)
        return explained / (explained + most) if explained > 0.0 else 0.0


def investigate(prepared: Prepared, advance: Advance) -> Found:
    """Search the fit part, then the whole record for what one part shows too little of; keep what is confirmed.

    What goes with time waits where time goes with speed or temperature. If the laws of those then leave structure, the
    search is repeated without waiting, and kept if it leaves none; but not where time and speed are one and the same,
    because there a curve of time would take the place of whatever law of speed is missing.
    """
    found = _investigated(prepared, advance, stationary_first=True)
    again = found.is_unexplained and found.search.set_aside and prepared.work.has(work.RIVALS)
    if again and not one_and_the_same(found.whole, "time", "speed"):
        other = _investigated(prepared, advance, stationary_first=False)
        if other.new_ids and not other.is_unexplained:
            return other
    return found


def _investigated(prepared: Prepared, advance: Advance, *, stationary_first: bool) -> Found:
    search = Search(prepared.whole, prepared.seen, prepared.facts, advance)
    search.stationary_first = stationary_first
    selection = search.run(prepared.base)
    if selection.new_ids:
        find_rivals(search, selection)
        settle_rivals(search, selection)
        confirm(prepared, selection, selection.new_ids)
    if prepared.work.has(work.WIDEN):
        _widen(prepared, search, selection, advance)
    else:
        prepared.work.leave_out("the search of the whole record for what a part shows too little of")
    _drop_trifles(search, selection)
    veto(prepared, selection)
    advance("mapping the residual")
    found = _mapped(prepared, search, selection)
    if not found.left and found.new_ids:
        return found
    if not prepared.work.has(work.WANDER):
        prepared.work.leave_out("a dry friction that wanders with time")
        return found
    return _with_wandering_friction(found)


def _drop_trifles(search: Search, selection: Selection) -> None:
    """Drop what the searched part has next to nothing of, or impossibly much, once all else is in the model."""
    for name in selection.new_ids:
        if not matters(selection.final.model, name, search.facts):
            selection.trials[name].decision = TOO_SMALL
            selection.final = selection.final.without(name)
        elif not possible(selection.final.model, name, search.facts):
            selection.trials[name].decision = IMPOSSIBLE
            selection.final = selection.final.without(name)


def _mapped(prepared: Prepared, search: Search, selection: Selection) -> Found:
    whole = selection.final.widened(prepared.whole, prepared.seen)
    return Found(prepared, search, selection, whole, residual_map(whole, prepared.facts))


def _with_wandering_friction(found: Found) -> Found:
    """The same with a dry friction that wanders, if that leaves nothing but what goes with time.

    A given model's own drift is not touched.
    """
    prepared, search, selection = found.prepared, found.search, found.selection
    if WANDERING.id in selection.base.model.effects.ids or one_and_the_same(found.whole, "time", "speed"):
        return found  # no smooth function of time is seen beside one of speed
    tried = wandering(prepared, search, selection.final)
    if tried is None:
        return found
    if tried.trial.p_value >= LOCAL_P or not matters(tried.fit.model, WANDERING.id, prepared.facts):
        return found
    if not possible(tried.fit.model, WANDERING.id, prepared.facts):
        return found
    trials = {**selection.trials, WANDERING.id: tried.trial}
    changed = replace(selection, final=tried.fit, trials={name: replace(trial) for name, trial in trials.items()})
    changed.final = search.pruned(changed.final, changed)
    confirm(prepared, changed, [WANDERING.id])
    if WANDERING.id not in changed.final.model.effects.ids:
        return found
    changed.rivals = {name: fits for name, fits in changed.rivals.items() if name in changed.final.model.effects.ids}
    other = _mapped(prepared, search, changed)
    worst = max((item.statistic for item in found.left), default=0.0)
    better = all(item.name in _GOES_WITH_TIME and item.statistic < 0.5 * worst for item in other.left)
    return other if better else found


def _widen(prepared: Prepared, search: Search, selection: Selection, advance: Advance) -> None:
    """Look at the whole record for more, at a stricter level; coefficients are the fit part's all the same.

    The held-out part then has a share in finding an effect, but none in its size, and must still be predicted better.
    """
    advance("searching the whole record")
    everywhere = Search(prepared.whole, prepared.seen, prepared.facts, advance, WHOLE_P, work.WIDEN)
    everywhere.stationary_first = search.stationary_first
    wide = everywhere.run(selection.final.widened(prepared.whole, prepared.seen))
    names = [name for name in wide.final.model.effects.ids if name not in selection.final.model.effects.ids]
    if not names:
        return
    find_rivals(everywhere, wide)
    settle_rivals(everywhere, wide)
    names = [name for name in wide.final.model.effects.ids if name not in selection.final.model.effects.ids]
    fit = selection.final
    for name in [name for name in fit.model.effects.ids if name not in wide.final.model.effects.ids]:
        fit = fit.without(name)
        if name in selection.trials:  # else the model given had it
            selection.trials[name].decision = explained_by(names)
    for name in names:
        told = search.told(fit, name)
        selection.trials[name] = wide.trials[name]
        if determined(told, name, _LEAST_SIGMAS_OF_PART):
            fit = told
        else:
            selection.trials[name].decision = f"{NOT_CONFIRMED}: the searched part knows no size of it"
    before = set(fit.model.effects.ids)
    selection.final = fit
    confirm(prepared, selection, [name for name in names if name in before])
    selection.rivals |= {name: fits for name, fits in wide.rivals.items() if name in selection.final.model.effects.ids}
    selection.whole_record = [name for name in names if name in selection.final.model.effects.ids]
