"""A dry friction that wanders with time, in no particular shape: the last that is tried."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from rw_ekf.diagnosis.checks.heldout import foretold_better
from rw_ekf.diagnosis.hypotheses.confounding import one_and_the_same, quantity_of
from rw_ekf.diagnosis.hypotheses.contenders import Search
from rw_ekf.diagnosis.hypotheses.random_walk import pieces, wandering
from rw_ekf.diagnosis.hypotheses.selection import Rival, Trial
from rw_ekf.diagnosis.investigate.found import Found, mapped
from rw_ekf.diagnosis.ledger.evidence import log_evidence, log_evidence_with_walk
from rw_ekf.diagnosis.standing import Decision, Reason, explained_by
from rw_ekf.diagnosis.thresholds import INDISTINGUISHABLE, MAP_P, SIGNIFICANT_P
from rw_ekf.effects.catalogue import CATALOGUE, WANDERING
from rw_ekf.likelihood.fitting import Fit

_GOES_WITH_TIME = ("time", "temperature")


def with_wandering_friction(found: Found, search: Search) -> Found:
    """The same with a dry friction that wanders, if that leaves nothing but what goes with time.

    A given model's own drift is not touched.
    """
    prepared, selection = found.prepared, found.selection
    if WANDERING.id in selection.base.model.effects.ids or one_and_the_same(found.fit, "time", "speed"):
        return found  # no smooth function of time is seen beside one of speed
    if found.left and found.left[0].name not in _GOES_WITH_TIME:
        return found  # whatever it is, time does not show it best
    # Where the map shows something of time already, that it is a walk needs no more evidence than that.
    tried = wandering(prepared, selection.final, MAP_P if found.left else SIGNIFICANT_P)
    if tried is None or not tried.fit.may_matter(WANDERING.id, prepared.facts):
        return found
    if not found.left and tried.gain < 0.0:
        return found
    if not tried.fit.model.possible(WANDERING.id, prepared.facts):
        return found
    trials = {**selection.trials, WANDERING.id: tried.trial}
    final, changed = search.pruned(tried.fit, replace(selection, trials=trials))
    if WANDERING.id not in final.model.effects.ids:
        return found
    rivals = {name: fits for name, fits in changed.rivals.items() if name in final.model.effects.ids}
    other = mapped(prepared, replace(changed, final=final, rivals=rivals), found.ledger.with_rows([final]))
    worst = max((item.statistic for item in found.left), default=0.0)
    better = all(item.name in _GOES_WITH_TIME and item.statistic < 0.5 * worst for item in other.left)
    if not better or (not found.left and _refused_is_likelier(found, other)):
        return found
    if foretold_better(prepared, final) <= 0.0:
        return found
    return _with_a_clock(found, other) or other


def _refused_is_likelier(found: Found, walk: Found) -> bool:
    """Whether an effect that held-out errors refused makes the record likelier than a walk, which nothing refuses.

    A walk does what many an effect does. What is not settled is then better left open than called a walk.
    """
    refused = [
        trial
        for trial in found.selection.trials.values()
        if trial.decision.reason is Reason.NOT_CONFIRMED and trial.terms
    ]
    return any(True for _ in _as_likely(found, walk, refused))


def _as_likely(found: Found, walk: Found, trials: list[Trial]) -> Iterator[tuple[Trial, Fit]]:
    """Of further effects those that make the record at least as likely as a walk does, and the fit with each."""
    if not trials:
        return
    facts = found.prepared.facts
    least = walk.ledger.row(walk.fit).log_evidence
    for trial in trials:
        fit = found.fit.refitted(found.fit.model.with_terms(trial.terms[0]))
        if log_evidence(fit, (*found.new_ids, trial.effect.id), facts) >= least:
            yield trial, fit


def _with_a_clock(found: Found, walk: Found) -> Found | None:
    """With what has a clock in the place of a walk, where it makes the record likelier and leaves nothing; else None.

    Set aside in the search because smooth laws of the motion together say as much. They are many numbers, and so is a
    walk; once something has to be named, the likeliest is.
    """
    facts = found.prepared.facts
    tried = found.selection.trials.values()
    waiting = [trial for trial in tried if trial.decision.reason is Reason.NOT_BESIDE_MOTION and trial.terms]
    for trial, fit in _as_likely(found, walk, sorted(waiting, key=lambda item: -item.screening_gain)):
        name = trial.effect.id
        if not (fit.may_matter(name, facts) and fit.model.possible(name, facts)):
            continue
        clocked = mapped(
            found.prepared, found.selection.decided(name, Decision(Reason.ADDED), fit), found.ledger.with_rows([fit])
        )
        if not clocked.left:
            return clocked
    return None


def weighed_against_a_walk(found: Found) -> Found:
    """The same with a dry friction that wanders beside each law of the temperature, as its rival or in its place.

    To a record whose temperature only rises a walk is easily one of those. What holds at any time stands, unless the
    walk makes the record likelier by more than chance and leaves nothing.
    """
    for law in found.new_ids:
        if quantity_of(CATALOGUE[law]) == "temperature" and WANDERING.id not in found.new_ids:
            found = _or_a_walk(found, law)
    return found


def _or_a_walk(found: Found, law: str) -> Found:
    prepared, selection = found.prepared, found.selection
    facts, less = prepared.facts, selection.without(law)
    rest = tuple(name for name in found.new_ids if name != law)
    own = found.ledger.row(found.fit).log_evidence
    ahead = log_evidence_with_walk(less, rest, pieces(prepared), facts) - own
    tried = wandering(prepared, less, SIGNIFICANT_P) if ahead > -INDISTINGUISHABLE else None
    if tried is None or not tried.fit.may_matter(WANDERING.id, facts):
        return found
    if not tried.fit.model.possible(WANDERING.id, facts):
        return found
    others = {name: fits for name, fits in selection.rivals.items() if name != law}
    if ahead < INDISTINGUISHABLE:
        rivals = (*selection.rivals.get(law, ()), Rival(WANDERING.id, tried.fit, ahead))
        return replace(found, selection=replace(selection, rivals={**others, law: rivals}))
    walking = selection.tried(tried.trial).decided(law, explained_by(WANDERING.id), tried.fit)
    walk = mapped(prepared, replace(walking, rivals=others), found.ledger.with_rows([tried.fit]))
    return found if walk.left or foretold_better(prepared, tried.fit) <= 0.0 else walk
