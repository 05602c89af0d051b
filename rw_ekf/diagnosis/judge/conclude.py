"""From what was found to the document (docs/contract.md#diagnosis): its verdict, figures, and every candidate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.course.warming import ended
from rw_ekf.diagnosis.judge.event_agreement import percent_gained
from rw_ekf.diagnosis.judge.explanations import explanation_entries, surviving, weighed_explanations
from rw_ekf.diagnosis.judge.found import Found, augmented_model
from rw_ekf.diagnosis.judge.heldout import Performance, gain_over, percent_better, performance, performance_read
from rw_ekf.diagnosis.judge.lattice import Lattice
from rw_ekf.diagnosis.judge.posterior import posterior_of
from rw_ekf.diagnosis.judge.residual_tests import failed_tests, left_over, residual_tests
from rw_ekf.diagnosis.judge.shapes import shapes_of
from rw_ekf.diagnosis.judge.uneven_noise import noise_finding
from rw_ekf.diagnosis.judge.verdict import Verdict, verdict_on
from rw_ekf.diagnosis.judge.widths import with_open_noise, with_open_stribeck_speed
from rw_ekf.diagnosis.result import Diagnosis, ModelTrace
from rw_ekf.diagnosis.search.candidates import threshold
from rw_ekf.diagnosis.search.laws import LAW, has_laws
from rw_ekf.diagnosis.search.selection import Trial
from rw_ekf.diagnosis.standing import Decision, Reason, explained_by
from rw_ekf.diagnosis.thresholds import GRID_GAINS, SIGNIFICANT_P
from rw_ekf.documents import inertia_document
from rw_ekf.effects.catalogue import CATALOGUE, GRID
from rw_ekf.filter.evenness import unevenness
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import size_of
from rw_ekf.model.state import PARAMETER_COUNT, PARAMETER_NAMES, STATE_UNITS
from rw_ekf.units import RAD_S_PER_RPM, rpm_from_rad_s
from rw_ekf.wheel.model_file import refusal_of

Advance = Callable[[str], object]

SCHEMA = "rw_ekf.diagnosis/1"
MODEL_FILE = "augmented-model.yaml"


def conclude(found: Found, advance: Advance) -> Diagnosis:
    """Judge, decide, and write the document and the model."""
    prepared, selection = found.prepared, found.selection
    work, kept, course = prepared.record.work, prepared.kept, prepared.record.course
    before = performance(prepared, selection.base)
    names, unexplained = found.new_ids, found.is_unexplained
    after = performance(prepared, selection.final) if names else before
    lattice, rounded_off = (None, None) if unexplained else named_grid(found)
    after = after if rounded_off is None else rounded_off
    split = prepared.split.document()
    heldout_s = sum(end - begin for begin, end in split["heldout_s"])
    advance("weighing explanations")
    weighed = weighed_explanations(found)
    rounded = lattice is not None or GRID.id in selection.base.model.effects.ids
    # Rounded readings are noisier where the wheel moves through cell after cell than where it stays: no torque does it.
    noise = None if rounded else noise_finding(found.fit, prepared.facts)
    noisy = None if noise is None else noise.sentence(in_rpm=prepared.in_rpm)
    chosen = [] if unexplained else [*names, *([] if lattice is None else [GRID.id])]
    judged = found.fit if chosen else selection.base
    white = left_over(judged)
    tests = residual_tests(white, rounded=rounded)
    uneven = None if rounded else unevenness(white, judged.trajectory.speed)
    failed = failed_tests(tests)
    posterior = posterior_of(found, weighed, lattice, noise, min(failed.values(), default=1.0))
    verdict = verdict_on(found, lattice, posterior, before, after, heldout_s, failed)
    if noisy is not None and verdict.kind == "adequate":
        verdict = replace(verdict, statement=f"{verdict.statement[:-1]}; but {noisy}.")
    for name in names:
        selection = selection.decided(name, Decision(Reason.PARTIAL if unexplained else Reason.ADDED))
    found = replace(found, selection=selection)
    advance("writing the model")
    model = augmented_model(found, lattice) if chosen else None
    refusal = None if model is None else refusal_of(model)
    if refusal is not None:
        model = None
    document = {
        "schema": SCHEMA,
        **prepared.source.document(),
        "split": split,
        "verdict": asdict(replace(verdict, statement=prepared.source.said_first + verdict.statement)),
        "candidates": candidate_entries(found, verdict, before, after),
        "before": before.figures,
        "after": after.figures if chosen else before.figures,
        "parameters": {
            "before": _base_parameters(with_open_stribeck_speed(with_open_noise(selection.base), prepared.facts)),
            "after": _base_parameters(found.told) if chosen else None,
        },
        "model": MODEL_FILE if model is not None else None,
        **inertia_document(prepared.setup),
        "explanations": explanation_entries(found, surviving(found, weighed)),
        "ledger": found.ledger.document(None if unexplained else found.fit),
        "ended": ended(course, found.fit.trajectory.speed, with_temperature=prepared.temperature_is_logged),
        "map": [
            {"dependence": d.name, "statistic": d.statistic, "degrees_of_freedom": d.freedom, "p_value": d.p_value}
            for d in found.dependences
        ],
        "torque_noise": None if noise is None else {**noise.document(in_rpm=prepared.in_rpm), "sentence": noisy},
        "shapes": shapes_of(found, prepared.setup.inertia_kg_m2, in_rpm=prepared.in_rpm),
        "residual_tests": {
            "before": residual_tests(left_over(selection.base)),
            "after": tests,
        },
        "warnings": [
            *prepared.source.notes,
            *prepared.source.log.warnings,
            *prepared.setup.notes,
            *prepared.notes,
            *([f"{noisy[:1].upper()}{noisy[1:]}."] if noisy is not None and verdict.kind == "effect" else []),
            *_of_no_use(found.lattice if lattice is None else None, in_rpm=prepared.in_rpm),
            *([] if uneven is None else [f"{uneven[:1].upper()}{uneven[1:]}"]),
            *work.sentences(),
            *([] if refusal is None else [f"no model was written, because none could read it: {refusal}"]),
        ],
        "left_out": list(work.left_out),
    }
    heldout = np.zeros(kept.size, dtype=bool)
    heldout[kept] = prepared.split.heldout
    return Diagnosis(
        log=prepared.source.log,
        content=document,
        heldout=heldout,
        before=_trace_over_log(before.trace, kept),
        after=_trace_over_log(after.trace, kept) if chosen else None,
        temperature_degC=_over_log(course.temperature_degC, kept) if prepared.temperature_is_logged else None,
        angle_rad=_over_log(course.angle_rad, kept) if prepared.facts.angle else None,
        angle_is_logged=prepared.angle_is_logged,
        model=model,
        inertia_kg_m2=prepared.setup.inertia_kg_m2,
        inertia_from=prepared.setup.inertia_from,
        in_rpm=prepared.in_rpm,
    )


def _base_parameters(fit: Fit) -> dict[str, dict[str, Any]]:
    """The four friction parameters of a fit, as the candidates' parameters are told."""
    return {
        name: {"value": value, "std": float(std), "unit": STATE_UNITS[name]}
        for name, value, std in zip(PARAMETER_NAMES, fit.model.parameters, fit.std[:PARAMETER_COUNT], strict=True)
    }


def _over_log(values: Float64Array, kept: BoolArray) -> Float64Array:
    """An array over the samples looked at as one over the whole log (kept (n,)), NaN elsewhere."""
    if kept.all():
        return values
    out = np.full(kept.size, np.nan)
    out[kept] = values
    return out


def _trace_over_log(trace: ModelTrace, kept: BoolArray) -> ModelTrace:
    return ModelTrace(**{name: _over_log(values, kept) for name, values in vars(trace).items()})


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
        if name in selection.base.model.effects.ids:
            entry["decision"] = Decision(Reason.GIVEN)
            entry["parameters"] = _described(found.told, name)
        elif name == GRID.id:
            entry |= {"decision": Decision(Reason.NO_GRID)} if found.lattice is None else _lattice_entry(found.lattice)
            if name in verdict.effects:
                entry["decision"] = Decision(Reason.ADDED)
                less = performance(found.prepared, selection.final)
                entry["heldout_gain_percent"] = percent_better(less.figures, after.figures)
        elif (why := effect.untestable(facts)) is not None:
            entry["decision"] = Decision(Reason.UNTESTABLE, why)
        elif trial is not None:
            entry |= {"statistic": trial.statistic, "p_value": trial.p_value, "decision": trial.decision}
            entry["threshold"] = threshold(effect, facts)
            if name in selection.final.model.effects.ids:
                entry["parameters"] = _described(found.told, name)
                if found.orders and effect.angular:
                    odds = {f"{order:g}": probability for order, probability in found.orders.items()}
                    entry["parameters"]["order"]["probability"] = odds
                if found.laws and has_laws(name):
                    entry["parameters"][LAW]["probability"] = found.laws
                entry["heldout_gain_percent"] = _gain(found, name, before, after)
            else:
                entry["parameters"] = _tried(trial)
                if trial.decision.reason is Reason.NOT_SIGNIFICANT and trial.p_value < SIGNIFICANT_P:
                    behind = found.new_ids
                    entry["decision"] = explained_by(*behind) if behind else Decision(Reason.TOO_SMALL)
            for group in verdict.indistinguishable:
                if name in group[1:]:
                    entry["decision"] = Decision(Reason.ALIKE, group[0])
        entries.append(entry)
    in_words(entries)
    return sorted(entries, key=lambda e: -(e["statistic"] if e["statistic"] is not None else -1.0e300))


def in_words(entries: list[dict[str, Any]]) -> None:
    """Replace decisions by their words.

    Only what is in the model explains anything; what looked like a cause that was rejected is said to.
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


def _described(fit: Fit, name: str) -> dict[str, Any]:
    """`parameters` of a candidate that was fitted, with standard deviations; the strongest term of several first."""
    found: dict[str, Any] = {}
    terms = sorted(fit.terms_of(name), key=lambda item: -item.term.size)
    for count, item in enumerate(terms, start=1):
        parameters = dict(item.term.described(item.covariance))
        for constant, std in item.shape_std.items():
            parameters[constant] = {**parameters[constant], "std": std}
        found |= {key if count == 1 else f"{key}_{count}": value for key, value in parameters.items()}
    return found


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


def named_grid(found: Found) -> tuple[Lattice, Performance] | tuple[None, None]:
    """The readings' grid, and the figures with it, where it is coarser than what held-out readings are missed by.

    One-step errors may be small where noise goes on from reading to reading: a grid that is lost in what a free run
    misses is nothing to anybody, unless errors are smaller for knowing it.
    """
    lattice = found.lattice
    if lattice is None or found.corrected is None:
        return None, None
    less = performance(found.prepared, found.selection.final).figures
    after = performance_read(found.prepared, found.corrected, found.selection.final, lattice)
    missed_rpm = less["free_run_rms_rpm"] or less["horizon_20s_rms_rpm"] or less["one_step_rms_rpm"] or 0.0
    coarse = lattice.is_coarser_than((missed_rpm * RAD_S_PER_RPM) ** 2)
    return (lattice, after) if coarse or (percent_better(less, after.figures) or 0.0) >= GRID_GAINS else (None, None)


def _of_no_use(lattice: Lattice | None, *, in_rpm: bool) -> list[str]:
    """What is said of a grid that is not named, if there is one."""
    if lattice is None:
        return []
    size = f"{rpm_from_rad_s(lattice.grid_rad_s):.4g} rpm" if in_rpm else f"{lattice.grid_rad_s:.4g} rad/s (or m/s)"
    return [
        f"The readings stand on a grid of {size}; held-out errors are no smaller for knowing it, so it is not named."
    ]
