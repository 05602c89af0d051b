"""Investigate a record: search it, confirm what its two parts agree on, map what is left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from rw_ekf.diagnosis.judge.choice import chosen
from rw_ekf.diagnosis.judge.found import Found, mapped
from rw_ekf.diagnosis.judge.ledger import begun, grown
from rw_ekf.diagnosis.judge.open_law import with_open_law
from rw_ekf.diagnosis.judge.walking import weighed_against_a_walk, with_wandering_friction
from rw_ekf.diagnosis.judge.widths import (
    with_free_shapes,
    with_open_noise,
    with_open_stribeck_speed,
    with_profiled_onset,
    with_profiled_widths,
)
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.search.confounding import one_and_the_same, quantity_of
from rw_ekf.diagnosis.search.contenders import Search
from rw_ekf.diagnosis.search.laws import has_laws
from rw_ekf.diagnosis.search.lost_angle import with_open_order
from rw_ekf.diagnosis.search.selection import Selection
from rw_ekf.diagnosis.standing import Reason
from rw_ekf.effects.catalogue import CATALOGUE, WANDERING
from rw_ekf.likelihood import work

Advance = Callable[[str], object]

_BEYOND_DOUBT_P = 1.0e-9


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
    follows anything that goes with time, is the last to be asked, and a rival of whatever follows the temperature.
    """
    search = Search(prepared.record, prepared.facts, advance)
    found = _searched(prepared, search, advance)
    again = found.left and found.selection.set_aside and prepared.record.work.has(work.RIVALS)
    if again and not one_and_the_same(found.fit, "time", "speed"):
        impatient = Search(prepared.record, prepared.facts, advance, stationary_first=False)
        other = _searched(prepared, impatient, advance)
        if other.new_ids and not other.left:
            found, search = other, impatient
    found, search = _with_what_is_small(found, search, advance)
    law = not found.left and found.new_ids and not any(CATALOGUE[name].of_one_record for name in found.new_ids)
    if law and not any(quantity_of(CATALOGUE[name]) == "temperature" for name in found.new_ids):
        return found
    if not prepared.record.work.has(work.WANDER):
        prepared.record.work.leave_out("a dry friction that wanders with time")
        return found
    advance(f"fitting {WANDERING.id}, wandering")
    return weighed_against_a_walk(found) if law else with_wandering_friction(found, search)


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
    small = {name: trial for name, trial in selection.trials.items() if trial.decision.reason is Reason.TOO_SMALL}
    name = max(small, key=lambda name: small[name].statistic, default=None)
    return name if name is not None and small[name].p_value < _BEYOND_DOUBT_P else None


def _searched(prepared: Prepared, search: Search, advance: Advance) -> Found:
    ledger, selection = begun(prepared.base, prepared.facts)
    ledger, selection = grown(search, ledger, selection)
    ledger, selection = chosen(prepared, search, ledger, selection)
    advance("mapping the residual")
    return mapped(prepared, selection, ledger)
