"""Investigate a record: search it, confirm what its two parts agree on, map what is left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from rw_ekf.diagnosis.judge.heldout import confirm, veto
from rw_ekf.diagnosis.judge.lattice import Lattice
from rw_ekf.diagnosis.judge.open_law import with_open_law
from rw_ekf.diagnosis.judge.residual_map import Dependence, residual_map
from rw_ekf.diagnosis.judge.widths import (
    with_free_shapes,
    with_open_noise,
    with_open_stribeck_speed,
    with_profiled_onset,
    with_profiled_widths,
)
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.search.confounding import one_and_the_same
from rw_ekf.diagnosis.search.laws import has_laws
from rw_ekf.diagnosis.search.lost_angle import with_open_order
from rw_ekf.diagnosis.search.rivals import EXPLAINED_SHARE, weigh_rivals
from rw_ekf.diagnosis.search.selection import LOCAL_P, Search, Selection
from rw_ekf.diagnosis.search.valleys import in_deepest_valleys
from rw_ekf.diagnosis.search.wander import followed_finely, wandering
from rw_ekf.diagnosis.standing import IMPOSSIBLE, TOO_SMALL
from rw_ekf.effects.catalogue import CATALOGUE, GRID, WANDERING
from rw_ekf.likelihood import work
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import Term
from rw_ekf.model.state import PARAMETER_COUNT
from rw_ekf.wheel.table import EffectSet

if TYPE_CHECKING:
    from rw_ekf.wheel.model_file import WheelModel

Advance = Callable[[str], object]

MAP_P = 3.0e-4  # structure left in the residual's map
_BEYOND_DOUBT_P = 1.0e-9
_GOES_WITH_TIME = ("time", "temperature")


@dataclass(frozen=True)
class Found:
    """A search and what it left, on the whole record."""

    prepared: Prepared
    selection: Selection
    fit: Fit  # the final model on the whole record
    dependences: list[Dependence]  # of what it leaves
    left: list[Dependence]  # those that noise does not explain
    new_ids: list[str]  # effects that the record asks for beyond the model it was given
    is_unexplained: bool  # structure is left that outweighs what was found
    share: float  # of all the structure there was, what the effects explain, where some is left that they may not leave
    told: Fit  # the final model with the standard deviations that a person and the model's file are told
    nearest: Fit | None = None  # with what was named, where a law without a name is likelier
    unnamed_odds: float | None = None  # log of those of a law without a name to what was named; None: not weighed
    orders: dict[float, float] = field(default_factory=dict)  # how probable each is, of a ripple without a logged angle
    laws: dict[str, float] = field(default_factory=dict)  # the same of an effect that may follow several
    lattice: Lattice | None = None  # the readings' grid, where it is coarser than their noise


def investigate(prepared: Prepared, advance: Advance) -> Found:
    """Search the record; keep what both its parts agree on; map what is left; say how well the numbers are known."""
    found = _named(prepared, advance)
    told = found.fit
    orders: dict[float, float] = {}
    laws: dict[str, float] = {}
    for name in found.new_ids:
        told = with_free_shapes(told, name)
    told = with_open_noise(told) if found.new_ids else told
    for name in found.new_ids:
        if CATALOGUE[name].local_in_time:
            told = with_profiled_onset(told, name, prepared.facts)
        if CATALOGUE[name].angular:
            told, orders = with_open_order(found.selection.without(name), told, name, prepared.facts)
        if CATALOGUE[name].valleys(prepared.facts) and prepared.record.work.has(work.FITS):
            advance(f"profiling {name}")
            told = with_profiled_widths(told, name)
        if has_laws(name):
            told, laws = with_open_law(found.selection.without(name), told, name)
    told = with_open_stribeck_speed(told, prepared.facts) if found.new_ids else told
    return replace(found, told=told, orders=orders, laws=laws)


def _named(prepared: Prepared, advance: Advance) -> Found:
    """What both parts of the record agree on, and what it leaves.

    What goes with time waits where time goes with speed or temperature. If the laws of those then leave structure, the
    search is repeated without waiting, and kept if it leaves none; but not where time and speed are one and the same,
    because there a curve of time would take the place of whatever law of speed is missing. Nor is an effect beyond
    doubt too small to matter where nothing else leaves noise. A friction that wanders in no particular shape, which
    follows anything that goes with time, is the last to be asked.
    """
    search = Search(prepared.record, prepared.facts, advance)
    found = _searched(prepared, search, advance)
    again = found.left and search.set_aside and prepared.record.work.has(work.RIVALS)
    if again and not one_and_the_same(found.fit, "time", "speed"):
        impatient = Search(prepared.record, prepared.facts, advance, stationary_first=False)
        other = _searched(prepared, impatient, advance)
        if other.new_ids and not other.left:
            found, search = other, impatient
    found, search = _with_what_is_small(found, search, advance)
    if not found.left and found.new_ids and not any(CATALOGUE[name].of_one_record for name in found.new_ids):
        return found
    if not prepared.record.work.has(work.WANDER):
        prepared.record.work.leave_out("a dry friction that wanders with time")
        return found
    advance(f"fitting {WANDERING.id}, wandering")
    return _with_wandering_friction(found, search)


def _with_what_is_small(found: Found, search: Search, advance: Advance) -> tuple[Found, Search]:
    """Where structure is left and an effect beyond doubt was too small: the same with it, if nothing is left then.

    What matters in practice is asked of a wheel that is understood without it.
    """
    prepared, small = found.prepared, _left_out_for_its_size(found.selection)
    if small is None or not found.left or not prepared.record.work.has(work.RIVALS):
        return found, search
    lenient = replace(prepared, facts=replace(prepared.facts, any_size=True))
    thorough = Search(lenient.record, lenient.facts, advance)
    other = _searched(lenient, thorough, advance)
    return (other, thorough) if small in other.new_ids and not other.left else (found, search)


def _left_out_for_its_size(selection: Selection) -> str | None:
    """The effect beyond doubt, if any, that explained most and was left out as too small to matter."""
    small = {name: trial for name, trial in selection.trials.items() if trial.decision == TOO_SMALL}
    name = max(small, key=lambda name: small[name].statistic, default=None)
    return name if name is not None and small[name].p_value < _BEYOND_DOUBT_P else None


def _searched(prepared: Prepared, search: Search, advance: Advance) -> Found:
    selection = search.run(prepared.base)
    if selection.new_ids:
        in_deepest_valleys(selection, prepared.facts)
        chosen = selection.new_ids
        weigh_rivals(search, selection)
        if selection.new_ids != chosen:
            in_deepest_valleys(selection, prepared.facts)
        selection.final = search.with_open_speed(selection.final)
        confirm(prepared, selection, selection.new_ids)
    _drop_trifles(prepared, selection)
    stood = selection.new_ids
    veto(prepared, selection, stood)
    if selection.new_ids != stood:  # what stood beside it may have been there for its sake
        selection.final = search.pruned(selection.final, selection, least=0)
    advance("mapping the residual")
    return _mapped(prepared, selection)


def _drop_trifles(prepared: Prepared, selection: Selection) -> None:
    """Drop what the record has next to nothing of, or impossibly much, once all else is in the model."""
    for name in selection.new_ids:
        if not selection.final.may_matter(name, prepared.facts):
            selection.trials[name].decision = TOO_SMALL
            selection.final = selection.final.without(name)
        elif not selection.final.model.possible(name, prepared.facts):
            selection.trials[name].decision = IMPOSSIBLE
            selection.final = selection.final.without(name)


def _mapped(prepared: Prepared, selection: Selection) -> Found:
    """The selection on the whole record; structure that its effects leave by nature is no reason to doubt them."""
    whole, terms = selection.final, selection.final.model.terms
    dependences = residual_map(whole, prepared.facts, followed_finely(whole))
    left = [item for item in dependences if item.p_value < MAP_P]
    excused = {name for term in terms for name in term.effect.may_leave(term.shape, prepared.facts)}
    share = 1.0 if excused.issuperset(item.name for item in left) else _share(selection, left)
    return Found(
        prepared=prepared,
        selection=selection,
        fit=whole,
        dependences=dependences,
        left=left,
        new_ids=selection.new_ids,
        is_unexplained=share < EXPLAINED_SHARE,
        share=share,
        told=whole,
    )


def _share(selection: Selection, left: list[Dependence]) -> float:
    """Of all the structure there was, what the effects explain; of what is left only what exceeds chance counts."""
    explained = 2.0 * (selection.final.likelihood.value - selection.base.likelihood.value)
    most = max(item.statistic - item.freedom for item in left)
    return explained / (explained + most) if explained > 0.0 else 0.0


def _with_wandering_friction(found: Found, search: Search) -> Found:
    """The same with a dry friction that wanders, if that leaves nothing but what goes with time.

    A given model's own drift is not touched.
    """
    prepared, selection = found.prepared, found.selection
    if WANDERING.id in selection.base.model.effects.ids or one_and_the_same(found.fit, "time", "speed"):
        return found  # no smooth function of time is seen beside one of speed
    if found.left and found.left[0].name not in _GOES_WITH_TIME:
        return found  # whatever it is, time does not show it best
    # Where the map shows something of time already, that it is a walk needs no more evidence than that.
    tried = wandering(prepared, selection.final, MAP_P if found.left else LOCAL_P)
    if tried is None or not tried.fit.may_matter(WANDERING.id, prepared.facts):
        return found
    if not found.left and tried.gain < 0.0:
        return found
    if not tried.fit.model.possible(WANDERING.id, prepared.facts):
        return found
    trials = {**selection.trials, WANDERING.id: tried.trial}
    changed = replace(selection, final=tried.fit, trials={name: replace(trial) for name, trial in trials.items()})
    changed.final = search.pruned(changed.final, changed)
    if WANDERING.id not in changed.final.model.effects.ids:
        return found
    changed.rivals = {name: fits for name, fits in changed.rivals.items() if name in changed.final.model.effects.ids}
    other = _mapped(prepared, changed)
    worst = max((item.statistic for item in found.left), default=0.0)
    better = all(item.name in _GOES_WITH_TIME and item.statistic < 0.5 * worst for item in other.left)
    return other if better else found


def augmented_model(found: Found, lattice: Lattice | None) -> WheelModel:
    """The final model, fitted to the whole record, as a file carries it on."""
    model = model_of_fit(found.told, found.prepared)
    if lattice is None:
        return model
    return replace(
        model,
        effects=EffectSet((*model.effects.terms, Term.of(GRID, value=lattice.grid_rad_s))),
        speed_noise_rad_s=lattice.noise_rad_s,
    )


def model_of_fit(fit: Fit, prepared: Prepared) -> WheelModel:
    """A fit to the whole record as a file carries it on."""
    from rw_ekf import __version__
    from rw_ekf.model.friction import LAW_NAMES
    from rw_ekf.wheel.model_file import WheelModel

    known = fit.model.known
    covariance = fit.likelihood.covariance[:known, :known]
    covariance = 0.5 * (covariance + covariance.T)
    variance = fit.noise.variance
    return WheelModel(
        parameters=fit.model.parameters,
        covariance=tuple(tuple(float(v) for v in row) for row in covariance),
        stribeck_speed_rad_s=fit.model.stribeck.omega_s,
        stribeck_law=LAW_NAMES[fit.model.stribeck.law],
        speed_noise_rad_s=float(np.sqrt(variance)),
        acceleration_noise=float(np.sqrt(fit.noise.ratio * variance / prepared.course.period_s)),
        inertia_kg_m2=prepared.setup.inertia_kg_m2,
        source={
            "method": "diagnose, fitted to the whole record",
            "log": prepared.source.log.name,
            "rw_ekf": __version__,
        },
        effects=fit.model.effects.with_values(fit.model.effects.values, fit.std[PARAMETER_COUNT:known]),
    )
