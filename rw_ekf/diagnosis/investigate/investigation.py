"""Investigate a record: search it, confirm what its two parts agree on, map what is left."""

from __future__ import annotations

import math
from dataclasses import replace

from rw_ekf.diagnosis.hypotheses.confounding import may_confound, one_and_the_same, quantity_of
from rw_ekf.diagnosis.hypotheses.contenders import Search
from rw_ekf.diagnosis.hypotheses.learned_laws import laws_beside
from rw_ekf.diagnosis.hypotheses.lost_angle import with_open_order
from rw_ekf.diagnosis.hypotheses.other_starts import LAW, has_laws, with_each_law
from rw_ekf.diagnosis.hypotheses.selection import Selection
from rw_ekf.diagnosis.investigate.found import Found, mapped
from rw_ekf.diagnosis.investigate.sigmas import (
    with_free_shapes,
    with_open_noise,
    with_open_stribeck_speed,
    with_possible_break_away,
    with_profiled_onset,
    with_profiled_widths,
)
from rw_ekf.diagnosis.investigate.walk_row import weighed_against_a_walk, with_wandering_friction
from rw_ekf.diagnosis.ledger.choice import chosen
from rw_ekf.diagnosis.ledger.growth import begun, grown
from rw_ekf.diagnosis.ledger.ledger import Ledger
from rw_ekf.diagnosis.prepare.preparation import Advance, Prepared
from rw_ekf.diagnosis.standing import SMALL_OR_UNKNOWN
from rw_ekf.diagnosis.thresholds import BEYOND_DOUBT_P, INFLATION
from rw_ekf.effects.catalogue import CATALOGUE, WANDERING
from rw_ekf.likelihood import work_budget
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.state import PARAMETER_COUNT

_LEAST_REPORTED = 0.02


def with_open_law(less: Fit, fit: Fit, name: str) -> tuple[Fit, dict[str, float]]:
    """A fit with an effect of several laws, and how probable each is by its name.

    less: without it. All laws are as likely beforehand. The variances of the coefficient and of the four parameters
    become those about the reported values, over all laws: another one needs other numbers.
    """
    effect = CATALOGUE[name]
    fits = with_each_law(less, fit, name)
    best = max(item.likelihood.value for item in fits.values())
    odds = {law: math.exp((item.likelihood.value - best) / INFLATION) for law, item in fits.items()}
    total = sum(odds.values())
    likeliest_first = sorted(odds, key=lambda law: -odds[law])
    probabilities = {
        str(effect.described(1.0, 1.0, fits[law].terms_of(name)[0].term.shape)[LAW]["value"]): odds[law] / total
        for law in likeliest_first
    }
    wider, places = fit, _places(fit, name)
    for number, place in enumerate(places):
        others = [(odds[law] / total, *_known(item, _places(item, name)[number])) for law, item in fits.items()]
        wider = wider.widened_over(slice(place, place + 1), _known(fit, place), others)
    return wider, {law: p for law, p in probabilities.items() if p > _LEAST_REPORTED}


def _places(fit: Fit, name: str) -> list[int]:
    """Where the four parameters and the effect's coefficient stand in a model's vector."""
    return [*range(PARAMETER_COUNT), fit.model.placed_of(name)[0][1].start]


def _known(fit: Fit, place: int) -> tuple[float, float]:
    """A number of a fit and its standard deviation."""
    return float(fit.model.vector[place]), float(fit.std[place])


def investigate(prepared: Prepared, advance: Advance) -> Found:
    """Search the record; keep what both its parts agree on; map what is left; say how well the numbers are known."""
    return with_widths(_named(prepared, advance), advance)


def with_widths(found: Found, advance: Advance) -> Found:
    """The same, its numbers as uncertain as what was not fitted leaves them."""
    prepared, reported = found.prepared, found.fit
    orders: dict[float, float] = {}
    laws: dict[str, dict[str, float]] = {}
    for name in found.new_ids:
        reported = with_free_shapes(reported, name)
    reported = with_open_noise(reported) if found.new_ids else reported
    for name in found.new_ids:
        if CATALOGUE[name].local_in_time:
            reported = with_profiled_onset(reported, name, prepared.facts)
        if CATALOGUE[name].angular:
            reported, orders = with_open_order(found.selection.without(name), reported, name, prepared.facts)
        if CATALOGUE[name].valleys(prepared.facts) and prepared.record.work.has(work_budget.FITS):
            advance(f"profiling {name}")
            reported = with_profiled_widths(reported, name)
        if has_laws(name):
            reported, laws[name] = with_open_law(found.selection.without(name), reported, name)
    reported = with_open_stribeck_speed(reported, prepared.facts) if found.new_ids else reported
    return replace(found, reported=with_possible_break_away(reported), orders=orders, laws=laws)


def _named(prepared: Prepared, advance: Advance) -> Found:
    """What both parts of the record agree on, and what it leaves.

    One ledger, grown in up to three steps. What goes with time waits where time goes with speed or temperature. If the
    laws of those leave structure, the ledger grows on without waiting, and what stands then is kept if it leaves none;
    but not where time and speed are one and the same, because there a curve of time would take the place of whatever
    law of speed is missing. Then with effects too small to matter, if one is beyond doubt: what matters in practice is
    decided on a wheel that is understood without it. A friction that wanders in no particular shape, which follows
    anything that goes with time, is the last to be tried, and a rival of whatever follows the temperature.
    """
    search, facts, work_left = Search(prepared.record, prepared.facts, advance), prepared.facts, prepared.record.work
    found = _searched(prepared, search, *begun(prepared.base, facts), advance)
    again = found.left and found.selection.set_aside and work_left.has(work_budget.RIVALS)
    if again and not one_and_the_same(found.fit, "time", "speed"):
        found = _or_further(found, Search(prepared.record, facts, advance, stationary_first=False), prepared, advance)
    small = _left_out_for_its_size(found.selection)
    if found.left and small is not None and work_left.has(work_budget.RIVALS):
        lenient = replace(prepared, facts=replace(facts, any_size=True))
        other = _or_further(found, Search(lenient.record, lenient.facts, advance), lenient, advance)
        found = other if small in other.new_ids else found
    return beside_a_walk(found, advance)


def beside_a_walk(found: Found, advance: Advance) -> Found:
    """The same with a dry friction that wanders, where it is called for: beside what was found, or in its place."""
    work_left = found.prepared.record.work
    law = not found.left and found.new_ids and not any(CATALOGUE[name].of_one_record for name in found.new_ids)
    if law and not any(quantity_of(CATALOGUE[name]) == "temperature" for name in found.new_ids):
        return found
    if not work_left.has(work_budget.WANDER):
        work_left.leave_out("a dry friction that wanders with time")
        return found
    advance(f"fitting {WANDERING.id}, wandering")
    return (
        weighed_against_a_walk(found)
        if law
        else with_wandering_friction(found, Search(found.prepared.record, found.prepared.facts, advance))
    )


def _or_further(found: Found, search: Search, prepared: Prepared, advance: Advance) -> Found:
    """What stands when the ledger has grown on by another search, if that leaves no structure; else as it was."""
    ledger = replace(found.ledger.unchecked(), facts=prepared.facts)
    selection = replace(found.selection, final=found.ledger.base, rivals={})
    other = _searched(prepared, search, ledger, selection, advance)
    return other if other.new_ids and not other.left else found


def _searched(prepared: Prepared, search: Search, ledger: Ledger, selection: Selection, advance: Advance) -> Found:
    # Where time goes with speed a curve of speed takes what an event does: it is tried after those.
    early = not may_confound(ledger.base, "time", "speed")
    ledger, selection = grown(search, ledger, selection, lambda fit: laws_beside(prepared, fit) if early else [])
    ledger, selection = chosen(prepared, search, ledger, selection)
    advance("mapping the residual")
    return mapped(prepared, selection, ledger)


def _left_out_for_its_size(selection: Selection) -> str | None:
    """The effect beyond doubt, if any, that explained most and was left out as too small, or as of no known size."""
    small = {name: trial for name, trial in selection.trials.items() if trial.decision.reason in SMALL_OR_UNKNOWN}
    name = max(small, key=lambda name: small[name].statistic, default=None)
    return name if name is not None and small[name].p_value < BEYOND_DOUBT_P else None
