"""A diagnosis as its document has it (docs/contract.md#diagnosis), every candidate of the catalogue included."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from rw_ekf.course.beyond_law_range import BeyondLaws
from rw_ekf.course.conditions import of_lost_temperature
from rw_ekf.course.warming import ended
from rw_ekf.diagnosis.checks.event_agreement import percent_gained
from rw_ekf.diagnosis.checks.heldout import Performance, gain_over, percent_better, performance
from rw_ekf.diagnosis.checks.reading_grid import Lattice
from rw_ekf.diagnosis.checks.residual_tests import left_over, residual_tests
from rw_ekf.diagnosis.hypotheses.candidates import threshold
from rw_ekf.diagnosis.hypotheses.other_starts import LAW
from rw_ekf.diagnosis.hypotheses.random_walk import walk_of
from rw_ekf.diagnosis.hypotheses.selection import Trial
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.investigate.sigmas import with_open_noise, with_open_stribeck_speed
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.standing import Decision, Reason, explained_by
from rw_ekf.diagnosis.thresholds import SIGNIFICANT_P
from rw_ekf.diagnosis.verdict.explanations import explanation_entries, surviving
from rw_ekf.diagnosis.verdict.formulas_in_band import readings
from rw_ekf.diagnosis.verdict.judged import Judged
from rw_ekf.diagnosis.verdict.residual_curves import shapes_of
from rw_ekf.diagnosis.verdict.verdict import Verdict
from rw_ekf.documents import inertia_document
from rw_ekf.effects.catalogue import CATALOGUE, GRID, WANDERING
from rw_ekf.identify.least_squares import OUTLIER_STDS
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.logs.run_directory import DIAGNOSED_MODEL
from rw_ekf.model.effect import size_of
from rw_ekf.model.state import PARAMETER_COUNT, PARAMETER_NAMES, STATE_UNITS
from rw_ekf.units import rpm_from_rad_s

SCHEMA = "rw_ekf.diagnosis/1"


def document_of(judged: Judged) -> dict[str, Any]:
    """The whole document."""
    found, verdict = judged.found, judged.verdict
    prepared, base = found.prepared, found.selection.base
    course, noise, in_rpm = prepared.record.course, judged.noise, prepared.in_rpm
    stands = None if found.new_ids and not judged.is_better else found.fit
    usual = with_open_stribeck_speed(with_open_noise(base), prepared.facts)
    return {
        "schema": SCHEMA,
        **prepared.source.document(),
        "split": prepared.split.document(),
        "verdict": asdict(replace(verdict, statement=prepared.source.first_remark + verdict.statement)),
        "candidates": candidate_entries(found, verdict, judged.before, judged.after),
        "before": judged.before.figures,
        "after": judged.after.figures if judged.is_better else judged.before.figures,
        "parameters": {
            "before": base_parameters(usual),
            "after": base_parameters(found.reported) if judged.is_better else None,
        },
        "model": DIAGNOSED_MODEL if judged.model is not None else None,
        **inertia_document(prepared.setup),
        "explanations": explanation_entries(found, surviving(found, judged.weighed)),
        "ledger": found.ledger.document(None if found.is_unexplained else stands),
        "ended": ended(course, found.fit.trajectory.speed, with_temperature=prepared.temperature_is_logged),
        "map": [
            {"dependence": d.name, "statistic": d.statistic, "degrees_of_freedom": d.freedom, "p_value": d.p_value}
            for d in found.dependences
        ],
        "torque_noise": None if noise.torque is None else noise.torque.document(in_rpm=in_rpm),
        "reading_noise": None if noise.readings is None else noise.readings.document(in_rpm=in_rpm),
        "swallowed": [{"sentence": item.sentence, "p_value": item.p_value} for item in noise.reported],
        "shapes": shapes_of(found, prepared.setup.inertia_kg_m2, in_rpm=prepared.in_rpm),
        "residual_tests": {"before": residual_tests(left_over(base)), "after": judged.tests},
        "warnings": _warnings(judged),
        "left_out": list(prepared.record.work.left_out),
    }


def _warnings(judged: Judged) -> list[str]:
    prepared, found = judged.found.prepared, judged.found
    beyond = BeyondLaws(prepared.base.model.effects)
    beyond.add(prepared.record.course)
    return [
        *prepared.source.notes,
        *prepared.source.log.warnings,
        *beyond.sentences(),
        *of_lost_temperature(
            prepared.source.course.time_s, prepared.source.course.temperature_degC, found.fit.model.effects
        ),
        *prepared.setup.notes,
        *prepared.notes,
        *_left_out(prepared),
        *([] if (text := judged.uneven) is None else [f"{text[:1].upper()}{text[1:]}"]),
        *_of_no_use(found.lattice if judged.lattice is None else None, in_rpm=prepared.in_rpm),
        *prepared.record.work.sentences(),
        *([] if judged.refusal is None else [f"no model was written, because none could read it: {judged.refusal}"]),
    ]


def _left_out(prepared: Prepared) -> list[str]:
    """A sentence where readings that no noise explains were left out of the base fit, and so of all others."""
    places = np.flatnonzero(prepared.base.omit)
    if not places.size:
        return []
    first_s = float(prepared.split.time_s[places[0]])
    return [
        f"{places.size} of {prepared.base.omit.size} readings are further than {OUTLIER_STDS:g} standard deviations "
        f"from what the model foretells and were left out, the first at {first_s:.10g} s: nothing said here is of them"
    ]


def base_parameters(fit: Fit) -> dict[str, dict[str, Any]]:
    """The four friction parameters of a fit, as the candidates' parameters are given: name to value, std and unit."""
    return {
        name: {"value": value, "std": float(std), "unit": STATE_UNITS[name]}
        for name, value, std in zip(PARAMETER_NAMES, fit.model.parameters, fit.std[:PARAMETER_COUNT], strict=True)
    }


def candidate_entries(found: Found, verdict: Verdict, before: Performance, after: Performance) -> list[dict[str, Any]]:
    """One entry for every effect of the catalogue, strongest first."""
    facts, selection = found.prepared.facts, found.selection
    entries = []
    for name, effect in CATALOGUE.items():
        trial = selection.trials.get(name)
        entry: dict[str, Any] = {
            "effect": name, "parameters": {}, "statistic": None, "p_value": None,
            "posterior": verdict.posterior.get(name), "heldout_gain_percent": None,
            "decision": Decision(Reason.NOT_SIGNIFICANT),
        }  # fmt: skip
        if name in selection.base.model.effects.ids and name not in found.new_ids:
            entry["decision"] = Decision(Reason.GIVEN)
            entry["parameters"] = described(found.reported, name)
        elif name == GRID.id:
            entry |= {"decision": Decision(Reason.NO_GRID)} if found.lattice is None else _lattice_entry(found.lattice)
            if name in verdict.effects:
                entry["decision"] = Decision(Reason.ADDED)
                less = performance(found.prepared, selection.final)
                entry["heldout_gain_percent"] = percent_better(less.figures, after.figures)
        elif trial is None and (why := effect.untestable(facts)) is not None:
            entry["decision"] = Decision(Reason.UNTESTABLE, why)
        elif trial is not None:
            entry |= {"statistic": trial.statistic, "p_value": trial.p_value, "decision": trial.decision}
            entry["threshold"] = threshold(effect, facts)
            if name in selection.final.model.effects.ids:
                entry["parameters"] = described(found.reported, name)
                if found.orders and effect.angular:
                    odds = {f"{order:g}": probability for order, probability in found.orders.items()}
                    entry["parameters"]["order"]["probability"] = odds
                if name in found.laws:
                    entry["parameters"][LAW]["probability"] = found.laws[name]
                entry["heldout_gain_percent"] = _gain(found, name, before, after)
            else:
                entry["parameters"] = _tried(trial)
                if trial.decision.reason is Reason.NOT_SIGNIFICANT and trial.p_value < SIGNIFICANT_P:
                    behind = found.new_ids
                    entry["decision"] = explained_by(*behind) if behind else Decision(Reason.TOO_SMALL)
            if name in verdict.effects and "temperature_degC" in effect.needs:
                entry["parameters"] |= _lag_entry(found.prepared)
            for group in verdict.indistinguishable:
                if name in group[1:]:
                    entry["decision"] = Decision(Reason.ALIKE, group[0])
        entries.append(entry)
    in_words(entries)
    return sorted(entries, key=lambda e: -(e["statistic"] if e["statistic"] is not None else -1.0e300))


def in_words(entries: list[dict[str, Any]]) -> None:
    """Replace decisions by their words.

    Only what is in the model explains anything; what looked like a rejected cause is reported as that.
    """
    decisions: dict[str, Decision] = {entry["effect"]: entry["decision"] for entry in entries}
    stand = {name for name, decision in decisions.items() if decision.reason in {Reason.ADDED, Reason.GIVEN}}
    for entry in entries:
        decision = decisions[entry["effect"]]
        standing = [name for name in decision.instead if name in stand]
        if standing:
            decision = explained_by(*standing)
        elif decision.instead:
            first = decision.instead[0]
            why = f": {decisions[first].words}" if first in decisions else ""
            decision = Decision(Reason.LOOKS_LIKE, f"{first}{why}")
        entry["decision"] = decision.words


def _gain(found: Found, name: str, before: Performance, after: Performance) -> float | None:
    """Percent by which the held-out error falls when the effect is added to the others.

    Of one effect that was added alone it is what the figures before and after say.
    """
    if CATALOGUE[name].local_in_time:
        return percent_gained(found.fit, name)
    final = found.selection.final
    if found.new_ids == [name] and found.lattice is None:
        return percent_better(before.figures, after.figures)
    return gain_over(found.prepared, final.without(name), final)


def described(fit: Fit, name: str) -> dict[str, Any]:
    """`parameters` of a candidate that was fitted, with standard deviations; the strongest term of several first."""
    found: dict[str, Any] = {}
    walk = walk_of(fit) if name == WANDERING.id else None
    if walk is not None:
        return {"walk_rad_s2_per_sqrt_s": {"value": walk.rate, "std": None, "unit": "rad/s^2/sqrt(s)"}}
    terms = sorted(fit.terms_of(name), key=lambda item: -item.term.size)
    for count, item in enumerate(terms, start=1):
        parameters = dict(item.term.described(item.covariance))
        for constant, std in item.shape_std.items():
            parameters[constant] = {**parameters[constant], "std": std}
        law = item.term.law
        read = [] if law is None else readings(law, item.term.values, item.covariance)
        if read:
            chances = {formula.text: formula.probability for formula in read}
            parameters["reading"] = {"value": read[0].text, "std": None, "unit": None, "probability": chances}
        found |= {key if count == 1 else f"{key}_{count}": value for key, value in parameters.items()}
    return found


def _lag_entry(prepared: Prepared) -> dict[str, Any]:
    """How late the temperature acts, among the parameters of a law of it; nothing where it is as it was read."""
    lag = prepared.temperature_lag
    if lag is None:
        return {}
    ahead = {
        f"ahead_K{f'_{number}' if number > 1 else ''}": {"value": ahead_K, "std": None, "unit": "K"}
        for number, ahead_K in enumerate(lag.ahead_K, start=1)
    }
    return {"temperature_lag_s": {"value": lag.value_s, "std": lag.std_s, "unit": "s"}, **ahead}


def _tried(trial: Trial) -> dict[str, Any]:
    """Parameters of a candidate that was only scored."""
    first = trial.terms[0]
    value = size_of(trial.terms) if len(trial.terms) > 1 or len(first.values) > 1 else first.values[0]
    return dict(first.effect.described(value, trial.std, first.shape))


def _lattice_entry(lattice: Lattice) -> dict[str, Any]:
    coefficient = GRID.coefficient
    return {
        "parameters": {coefficient.name: {"value": lattice.grid_rad_s, "std": None, "unit": coefficient.unit}},
        "statistic": lattice.statistic,
        "p_value": None,
        "decision": Decision(Reason.HARMLESS_GRID),
    }


def _of_no_use(lattice: Lattice | None, *, in_rpm: bool) -> list[str]:
    """What is reported of a grid that is not named, if there is one."""
    if lattice is None:
        return []
    size = f"{rpm_from_rad_s(lattice.grid_rad_s):.4g} rpm" if in_rpm else f"{lattice.grid_rad_s:.4g} rad/s (or m/s)"
    return [
        f"The readings stand on a grid of {size}; held-out errors are no smaller for knowing it, so it is not named."
    ]
