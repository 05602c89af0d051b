"""A record of a high rate: hypotheses are sought at a lower one, and what stands is decided at its own.

The rows that a search at a lower rate found likeliest are fitted to every reading, and put to every check there.
"""

from __future__ import annotations

from dataclasses import replace

from rw_ekf.diagnosis.hypotheses.contenders import Search
from rw_ekf.diagnosis.investigate.foretelling import as_foretold, as_it_foretells
from rw_ekf.diagnosis.investigate.found import Found, mapped
from rw_ekf.diagnosis.investigate.investigation import beside_a_walk, with_widths
from rw_ekf.diagnosis.investigate.law_rows import with_laws
from rw_ekf.diagnosis.investigate.rounding import investigated, without_rounding
from rw_ekf.diagnosis.ledger.choice import chosen
from rw_ekf.diagnosis.ledger.growth import begun
from rw_ekf.diagnosis.ledger.ledger import Row, key_of
from rw_ekf.diagnosis.prepare.preparation import Advance, Prepared
from rw_ekf.diagnosis.prepare.slower import slower
from rw_ekf.diagnosis.thresholds import BEAM
from rw_ekf.effects.catalogue import WANDERING
from rw_ekf.likelihood.fitting import Fit, fit_model
from rw_ekf.likelihood.gauss_newton import Start


def thoroughly_investigated(prepared: Prepared, advance: Advance) -> Found:
    """What is found in a record: searched at a rate that a search can afford, decided on all of it."""
    part = slower(prepared)
    found = as_it_foretells(with_laws(investigated(part, advance), advance), advance)
    return found if part is prepared else _on_all_of_it(prepared, found, advance)


def _on_all_of_it(prepared: Prepared, part: Found, advance: Advance) -> Found:
    """What stands when every reading is used, of what a search at a lower rate found likeliest."""
    advance("fitting what was found to every reading")
    lattice, own = part.lattice, prepared
    if lattice is not None:
        own = without_rounding(prepared, prepared.base.trajectory, lattice)
    ledger, selection = begun(own.base, own.facts)
    selection = replace(selection, trials=part.selection.trials, set_aside=part.selection.set_aside)
    for row in _likeliest(part):
        fit = _fitted_to(own, row.fit)
        ledger = ledger.with_rows([fit], constructed=row.constructed, waits=row.waits)
    search = Search(own.record, own.facts, advance)
    ledger, selection = chosen(own, search, ledger, selection)
    advance("mapping the residual")
    found = replace(mapped(own, selection, ledger), unnamed_odds=part.unnamed_odds)
    if part.nearest is not None and not found.new_ids:
        found = replace(found, nearest=_fitted_to(own, part.nearest), share=part.share)
    if WANDERING.id in part.new_ids:
        found = beside_a_walk(found, advance)
    prepared.record.work.note(part.prepared.record.work)
    wide = with_widths(found, advance)
    if lattice is not None:
        return replace(wide, prepared=prepared, lattice=lattice, corrected=own)
    is_same = key_of(wide.fit) == key_of(part.fit)
    if part.is_unexplained or not part.new_ids or (is_same and not part.reported.simulated):
        return wide
    stands = wide.fit if is_same else _fitted_to(prepared, part.fit)
    return as_foretold(wide, stands, part)


def _likeliest(part: Found) -> list[Row]:
    """The row that stands, those indistinguishable from it, and the likeliest, whatever it was refused for."""
    rivals = {id(rival.fit) for rivals in part.selection.rivals.values() for rival in rivals}
    own = {id(part.fit), id(part.selection.final), *rivals}
    rows = [row for row in part.ledger.rows if row.effects and WANDERING.id not in row.effects]
    weighed = [row for row in part.weighed if row.effects and WANDERING.id not in row.effects]
    return [row for number, row in enumerate(rows) if number < BEAM or id(row.fit) in own] + weighed[:BEAM]


def _fitted_to(prepared: Prepared, fit: Fit) -> Fit:
    """A model of a slower record fitted to all readings."""
    base = prepared.base
    return fit_model(base.problem, Start(fit.model, base.trajectory, base.noise))
