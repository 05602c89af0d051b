"""The document's entry for every effect of the catalogue: what was tried, and what became of it."""

from __future__ import annotations

from typing import Any

from rw_ekf.diagnosis.judge.event import event_gain
from rw_ekf.diagnosis.judge.heldout import Performance, gain_over
from rw_ekf.diagnosis.judge.investigation import Found
from rw_ekf.diagnosis.judge.lattice import Lattice
from rw_ekf.diagnosis.judge.verdict import Verdict, fitted_terms
from rw_ekf.diagnosis.search.candidates import testable
from rw_ekf.diagnosis.search.trial import threshold
from rw_ekf.diagnosis.standing import (
    ADDED,
    GIVEN,
    NO_GRID,
    NOT_CONFIRMED,
    NOT_SIGNIFICANT,
    TOO_SMALL,
    UNTESTABLE,
    explained_by,
    explanations,
    indistinguishable_from,
    standing_of,
)
from rw_ekf.effects.catalogue import CATALOGUE, GRID
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import Term, size_of


def candidate_entries(
    found: Found, lattice: Lattice | None, verdict: Verdict, before: Performance, after: Performance
) -> list[dict[str, Any]]:
    """One entry for every effect of the catalogue, strongest first."""
    facts, selection = found.prepared.facts, found.selection
    reasons = testable(facts)
    entries = []
    for name, effect in CATALOGUE.items():
        trial = selection.trials.get(name)
        entry: dict[str, Any] = {
            "effect": name, "parameters": {}, "statistic": None, "p_value": None,
            "heldout_gain_percent": None, "decision": NOT_SIGNIFICANT,
        }  # fmt: skip
        if name in selection.base.model.effects.ids:
            entry["decision"] = GIVEN
            entry["parameters"] = _parameters(selection.final, name)
        elif name == GRID.id:
            if lattice is not None:
                entry |= _lattice_entry(lattice)
                entry["decision"] = ADDED if name in verdict.effects else NOT_SIGNIFICANT
            else:
                entry["decision"] = NO_GRID
        elif reasons[name] is not None:
            entry["decision"] = f"{UNTESTABLE}: {reasons[name]}"
        elif trial is not None:
            entry |= {"statistic": trial.statistic, "p_value": trial.p_value, "decision": trial.decision}
            entry["threshold"] = threshold(effect, facts)
            if name in selection.final.model.effects.ids:
                entry["parameters"] = _parameters(selection.final, name)
                for constant, std in trial.shape_std.items():
                    entry["parameters"][constant] = {**entry["parameters"][constant], "std": std}
                entry["heldout_gain_percent"] = _gain(found, name, before, after)
            else:
                entry["parameters"] = _tried(trial.terms, trial.std)
                if trial.decision == NOT_SIGNIFICANT and trial.p_value < 1.0e-5:
                    entry["decision"] = explained_by(found.new_ids) if found.new_ids else TOO_SMALL
            for group in verdict.indistinguishable:
                if name in group[1:]:
                    entry["decision"] = indistinguishable_from(group[0])
        entries.append(entry)
    _explained_by_what_stands(entries)
    return sorted(entries, key=lambda e: -(e["statistic"] if e["statistic"] is not None else -1.0e300))


def _explained_by_what_stands(entries: list[dict[str, Any]]) -> None:
    """Only what is in the model explains anything; what looked like a cause that was rejected is said to."""
    said = {str(entry["effect"]): str(entry["decision"]) for entry in entries}
    stand = {str(entry["effect"]) for entry in entries if standing_of(entry) == "added"}
    for entry in entries:
        names = explanations(str(entry["decision"]))
        standing = [name for name in names if name in stand]
        if standing:
            entry["decision"] = explained_by(standing)
        elif names:
            entry["decision"] = f"looks like {names[0]}: {said.get(names[0], NOT_CONFIRMED)}"


def _gain(found: Found, name: str, before: Performance, after: Performance) -> float | None:
    """Percent by which the held-out error falls when the effect is added to the others.

    Of one effect that was added alone it is what the figures before and after say.
    """
    if CATALOGUE[name].local_in_time:
        gain = event_gain(found.whole, name, found.prepared.seen)
        return None if gain is None else gain.percent
    errors = [performed.figures.get("free_run_rms_rpm") for performed in (before, after)]
    if found.new_ids == [name] and errors[0] and errors[1] is not None:
        return float(100.0 * (1.0 - errors[1] / errors[0]))
    final = found.selection.final
    return gain_over(found.prepared, final.without(name), final)


def _described(fit: Fit, name: str) -> dict[str, Any]:
    """`parameters` of a candidate that was fitted, with standard deviations; the strongest term of several first."""
    found: dict[str, Any] = {}
    terms = sorted(fitted_terms(fit, name), key=lambda item: -item[1].size)
    for count, (number, term, covariance) in enumerate(terms, start=1):
        parameters = dict(term.described(covariance))
        for at, (i, j) in enumerate(fit.model.refined, start=fit.model.known):
            if i == number:
                constant = term.effect.constants[j].name
                parameters[constant] = {**parameters[constant], "std": float(fit.std[at])}
        found |= {key if count == 1 else f"{key}_{count}": value for key, value in parameters.items()}
    return found


def _parameters(fit: Fit, name: str) -> dict[str, Any]:
    return _described(fit, name) if fit.model.of(name) else {}


def _tried(terms: tuple[Term, ...], std: float) -> dict[str, Any]:
    """Parameters of a candidate that was only scored."""
    first = terms[0]
    value = size_of(terms) if len(terms) > 1 or len(first.values) > 1 else first.values[0]
    return dict(first.effect.described(value, std, first.shape))


def _lattice_entry(lattice: Lattice) -> dict[str, Any]:
    coefficient = GRID.coefficient
    return {
        "parameters": {coefficient.name: {"value": lattice.grid_rad_s, "std": None, "unit": coefficient.unit}},
        "statistic": lattice.statistic,
        "p_value": None,
    }
