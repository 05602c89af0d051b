"""What a model foretells, where no likelihood can be believed: numbers by simulation, and laws that predict.

A likelihood measures how well a model does if what it misses is noise. A machine on a bench has a flexible coupling, a
belt, a drive with a law of its own; what is left then is no noise, whatever is added. Two questions remain that need no
white noise: with which numbers does the model run free best, and does a law without a formula make that run better on
the held-out part? No effect of the catalogue is named by them: a name is a cause, and wants its checks.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.checks.checks import of_size
from rw_ekf.diagnosis.checks.heldout import by_fit_part, gain_over, performance
from rw_ekf.diagnosis.checks.residual_tests import failed_tests, left_over, residual_tests
from rw_ekf.diagnosis.hypotheses.contenders import Search
from rw_ekf.diagnosis.hypotheses.learned_laws import laws_beside
from rw_ekf.diagnosis.hypotheses.selection import Trial
from rw_ekf.diagnosis.investigate.found import Found, mapped
from rw_ekf.diagnosis.ledger.ledger import Row
from rw_ekf.diagnosis.prepare.preparation import Advance, Prepared
from rw_ekf.diagnosis.standing import Decision, Reason
from rw_ekf.diagnosis.thresholds import BEYOND_DOUBT_P, MOST_LAWS, REAL_GAIN, WORST
from rw_ekf.effects.catalogue import CATALOGUE, WANDERING
from rw_ekf.likelihood.by_simulation import at_given_numbers, by_simulation, error_of_run
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect_kinds import LawEffect

_MOST_ROWS = 3
_AHEAD = ("horizon_1s_rms_rpm", "horizon_20s_rms_rpm", "free_run_rms_rpm")
NOTE = (
    "what is left is no noise, so that the numbers are those by which the model runs free nearest to the readings "
    "(output error), not the likeliest; their sigmas hold what the two parts of the record differ by"
)
NOTE_SLOWER = (
    "of all readings what is left is no noise, of some of them it is less: effects and numbers are those of the lower "
    "rate, which foretell more"
)


def as_it_foretells(found: Found, advance: Advance) -> Found:
    """The same, with numbers and laws that foretell more where what is left is beyond doubt no noise."""
    followed = found.lattice is not None or WANDERING.id in found.fit.model.effects.ids
    if followed and not found.is_unexplained:  # where nothing stands, neither does a grid or a friction that wanders
        return found
    failed = failed_tests(residual_tests(left_over(found.fit)))
    if not found.is_unexplained and min(failed.values(), default=1.0) > BEYOND_DOUBT_P:
        return found
    advance("running free what was found")
    bare = _with_nothing_named(found) if found.is_unexplained else found
    candidates = _candidates(bare, advance)
    refused = [fit for fit in _refused(bare, advance) if fit not in candidates] if found.is_unexplained else []
    other = _foretelling_most(bare, [*candidates, *refused])
    if other is bare:
        return found
    return replace(other, described=any(other.selection.final is fit for fit in refused))


def as_foretold(found: Found, fit: Fit, part: Found) -> Found:
    """The same with what stands at a lower rate, and its numbers; as it was where they foretell no more here.

    fit: that model's likeliest numbers, on all readings. A coupling that swings ten times a second is most of what a
    hundred readings a second show, and next to nothing of ten: what is left there may be noise when here it is not.
    What was left out would move the numbers by less than they are known to.
    """
    prepared, other = found.prepared, part.prepared
    way = at_given_numbers(fit, part.reported.model, part.reported.likelihood.covariance)
    half = by_fit_part(other, part.reported)
    prepared.remember(
        "fit", way, at_given_numbers(fit.on_part(prepared.fit_part), half.model, way.likelihood.covariance)
    )
    note = NOTE if part.reported.simulated else NOTE_SLOWER
    return _foretelling(found, fit, way, note) or found


def _foretelling_most(found: Found, fits: list[Fit]) -> Found:
    """The same with the numbers by simulation of that of some fits which runs free best; as it was where none may."""
    prepared = found.prepared
    ways = [(fit, _simulated(prepared, fit)) for fit in fits]
    if found.is_unexplained:  # nothing stands whose likeliest numbers would be held against those by simulation
        ways += [(fit, fit) for fit in fits if fit is not found.selection.final]
    for fit, way in sorted(ways, key=lambda item: _free_run(prepared, item[1])):
        foretold = _foretelling(found, fit, way)
        if foretold is None:
            continue
        covariance = found.reported.likelihood.covariance if fit is found.fit else fit.likelihood.covariance
        known = replace(way, likelihood=replace(way.likelihood, covariance=covariance + _apart(prepared, way)))
        for what, given in (("fit", by_fit_part(prepared, way)), ("figures", performance(prepared, way))):
            prepared.remember(what, known, given)  # of another covariance, on which neither turns
        return replace(foretold, reported=known)
    return found


def _foretelling(found: Found, fit: Fit, way: Fit, note: str = NOTE) -> Found | None:
    """The same with a fit's numbers by simulation; None where they, or laws that it brings, do not foretell more."""
    prepared, base, stands = found.prepared, found.selection.base, found.selection.final
    if _gained(prepared, stands, way) < REAL_GAIN or not _no_worse_ahead(prepared, base, way):
        return None
    new = found.selection.new_in(fit)
    model, facts = way.model, prepared.facts
    if _has_nothing(way) or not all(model.possible(name, facts) and model.matters(name, facts) for name in new):
        return None
    if fit is not found.fit:
        if _gained(prepared, _simulated(prepared, stands), way) < REAL_GAIN:
            return None
        found = _named(found, fit)
    notes = prepared.notes if way is fit else (*prepared.notes, note)
    return replace(found, prepared=replace(prepared, notes=notes), reported=way)


def _simulated(prepared: Prepared, fit: Fit) -> Fit:
    return prepared.remembered("simulated", fit, lambda: by_simulation(fit))


def _apart(prepared: Prepared, way: Fit) -> Float64Array:
    """A covariance (p, p) of numbers by simulation, d d' / 4, with d what the record's two parts disagree by.

    That of the likelihood supposes what is not so, a torque noise that is new each moment. What is left acts again and
    again, and a part of the record is as wrong by it as the parts are different: half of d, of the mean of both.
    """
    one, other = (by_fit_part(parts, way).model.vector for parts in (prepared, prepared.exchanged()))
    return 0.25 * np.outer(one - other, one - other)


def _candidates(found: Found, advance: Advance) -> list[Fit]:
    """What stands, the likeliest rows with laws beside that, and what stands with up to three laws, one by one."""
    prepared, stands = found.prepared, found.selection.final
    search = Search(prepared.record, prepared.facts, advance)
    fits = [stands] if found.new_ids else []
    for row in _likeliest_rows(found):
        laws = [name for name in row.effects if issubclass(CATALOGUE[name], LawEffect)]
        if (
            laws
            and _are_sized(search, row, laws)
            and set(row.effects) - set(laws) <= set(found.new_ids)
            and row.fit is not stands
        ):
            fits.append(row.fit)
    fits, fit = fits[:_MOST_ROWS], stands
    for _ in range(MOST_LAWS - sum(term.law is not None for term in stands.model.terms)):
        # A law of the record's own clock foretells nothing.
        law = next((law for law in laws_beside(prepared, fit) if not law.passes and law.weight > 0.0), None)
        if law is None:
            break
        fit = fit.refitted(fit.model.with_terms(law.term))
        fits.append(fit)
    return fits


def _refused(found: Found, advance: Advance) -> list[Fit]:
    """Of rows that were refused, likeliest first, the likeliest of one effect, of two and of three.

    What explains half of the structure is no cause, yet it may foretell far more than nothing at all does. An event
    foretells nothing, and a size that no machine has, or that nobody knows, is none.
    """
    search, rows = Search(found.prepared.record, found.prepared.facts, advance), {}
    for row in _likeliest_rows(found):
        count = len(row.effects)
        if not 0 < count <= _MOST_ROWS or count in rows or any(CATALOGUE[name].local_in_time for name in row.effects):
            continue
        if _are_sized(search, row, row.effects):
            rows[count] = row.fit
    return list(rows.values())


def _likeliest_rows(found: Found) -> list[Row]:
    """All hypotheses that were fitted, those with laws that do not stand among them; the likeliest first."""
    return sorted(dict.fromkeys((*found.ledger.rows, *found.weighed)), key=lambda row: -row.weight)


def _are_sized(search: Search, row: Row, names: Iterable[str]) -> bool:
    """Whether some effects of a row pass the tests of a size."""
    return all(check.passed for name in names for check in of_size(search, row.fit, name))


def _has_nothing(fit: Fit) -> bool:
    """Whether a law of a model is zero throughout."""
    return any(not any(term.values) for term in fit.model.terms if term.law is not None)


def _free_run(prepared: Prepared, fit: Fit) -> float:
    """Mean square by which a fit with the numbers of one part of the record misses the other, run free."""
    model = by_fit_part(prepared, fit).model
    error = error_of_run(fit, model)[prepared.split.heldout[fit.linearised.innovation_at]]
    return float(np.mean(error**2))


def _gained(prepared: Prepared, less: Fit, more: Fit) -> float:
    """Share by which the free run's error on the held-out part is smaller."""
    return 0.01 * (gain_over(prepared, less, more) or 0.0)


def _no_worse_ahead(prepared: Prepared, base: Fit, way: Fit) -> bool:
    """Whether no figure of more than one step is worse than the base model's."""
    before, after = performance(prepared, base).figures, performance(prepared, way).figures
    return all(after[key] <= (1.0 + WORST) * before[key] for key in _AHEAD if before[key] and after[key])


def _with_nothing_named(found: Found) -> Found:
    """The same with the base model standing, as the verdict has it."""
    base = found.selection.base
    return replace(found, selection=replace(found.selection, final=base, rivals={}), fit=base, reported=base)


def _named(found: Found, fit: Fit) -> Found:
    """The same with another fit standing, which explains what share it explains."""
    ledger = found.ledger.with_rows([fit])
    selection = replace(found.selection, final=fit, rivals={})
    for term in (term for term in fit.model.terms if term.law is not None and not term.given):
        if term.id not in selection.trials:
            selection = selection.tried(Trial.of_law(term, fit.without(term.id), fit))
    for name in selection.new_ids:
        selection = selection.decided(name, Decision(Reason.ADDED))
    other = mapped(found.prepared, selection, ledger)
    return replace(other, is_unexplained=False, unnamed_odds=found.unnamed_odds)
