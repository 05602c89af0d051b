"""From what was found to a verdict, and the document (docs/contract.md#diagnosis)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rw_ekf.diagnosis.judge.augmented_model import augmented_model
from rw_ekf.diagnosis.judge.candidate_entries import candidate_entries
from rw_ekf.diagnosis.judge.investigation import Found
from rw_ekf.diagnosis.judge.lattice import Lattice, find_lattice
from rw_ekf.diagnosis.judge.metrics import Performance, performance
from rw_ekf.diagnosis.judge.residual_tests import residual_tests
from rw_ekf.diagnosis.judge.verdict import (
    Verdict,
    grouped,
    improvement,
    sentence,
    separation,
)
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.result import Diagnosis, ModelTrace
from rw_ekf.diagnosis.search.confounding import Quantity, one_and_the_same, quantity_of, separates
from rw_ekf.effects.catalogue import CATALOGUE, GRID
from rw_ekf.units import RAD_S_PER_RPM, rpm_from_rad_s
from rw_ekf.wheel.model_file import refusal_of

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration

Advance = Callable[[str], object]

SCHEMA = "rw_ekf.diagnosis/1"
MODEL_FILE = "augmented-model.yaml"
_TOLD_RATIO = 1.0e-3  # q dt / R: with less process noise nobody would see it in the speed
_REGISTER_RPM = 0.6  # a finer grid than this is the wire's own register (0.5 rpm), which nobody calls an effect


def _lattice(found: Found) -> Lattice | None:
    """The grid of the readings, if it is coarser than their noise."""
    prepared, fit = found.prepared, found.whole
    if GRID.id in prepared.base.model.effects.ids:
        return None
    performed = performance(prepared, fit)
    innovation = performed.trace.one_step_error_rad_s
    speed = prepared.course.speed_rad_s
    lattice = find_lattice(
        speed, speed - innovation, performed.predicted_std_rad_s, fit.noise.variance, prepared.split.heldout,
        0.0 if prepared.setup.inertia_kg_m2 is None else _REGISTER_RPM * RAD_S_PER_RPM,
    )  # fmt: skip
    if lattice is None or lattice.statistic + lattice.heldout_statistic < 0.0:
        return None
    return lattice


def conclude(found: Found, configuration: Configuration | None, advance: Advance) -> Diagnosis:
    """Judge, decide, and write the document and the model."""
    lattice = _lattice(found)
    prepared, selection = found.prepared, found.selection
    inertia = prepared.setup.inertia_kg_m2 if configuration is None else configuration.wheel.inertia_kg_m2
    before = performance(prepared, selection.base, inertia)
    names = found.new_ids
    unexplained = found.is_unexplained
    after = performance(prepared, selection.final, inertia) if names else before
    quantised = lattice is not None and not unexplained
    verdict = _verdict(found, lattice if quantised else None, before, after)
    chosen = [] if unexplained else [*names, *([GRID.id] if quantised else [])]
    for name in names:
        trial = selection.trials[name]
        trial.decision = "added" if not unexplained else "explains only part of the residual"
    advance("writing the model")
    model = augmented_model(found, lattice if quantised else None) if chosen else None
    refusal = None if model is None else refusal_of(model)
    if refusal is not None:
        model = None
    if chosen and quantised and not names:
        after = before
    document = {
        "schema": SCHEMA,
        **prepared.source.document(),
        "split": prepared.split.document(),
        "verdict": replace(verdict, statement=prepared.source.said_first + verdict.statement).document(),
        "candidates": candidate_entries(found, lattice, verdict, before, after),
        "before": before.figures,
        "after": after.figures if chosen else before.figures,
        "model": MODEL_FILE if model is not None else None,
        "map": [
            {"dependence": d.name, "statistic": d.statistic, "degrees_of_freedom": d.freedom, "p_value": d.p_value}
            for d in found.dependences
        ],
        "residual_tests": {
            "before": residual_tests(before.trace.normalised_innovation),
            "after": residual_tests((after if chosen else before).trace.normalised_innovation),
        },
        "warnings": [
            *prepared.source.notes,
            *prepared.log.warnings,
            *prepared.setup.notes,
            *prepared.notes,
            *prepared.work.sentences(),
            *_not_written(refusal),
        ],
        "left_out": list(prepared.work.left_out),
    }
    heldout = np.zeros(prepared.kept.size, dtype=bool)
    heldout[prepared.kept] = prepared.split.heldout
    return Diagnosis(
        prepared.log,
        document,
        heldout,
        _over_log(prepared, before.trace),
        _over_log(prepared, after.trace) if chosen else None,
        prepared.over_log(prepared.whole.course.temperature_degC) if prepared.temperature_is_logged else None,
        prepared.over_log(prepared.whole.course.angle_rad) if prepared.facts.angle else None,
        prepared.angle_is_logged,
        model,
        inertia,
        inertia_from=prepared.setup.inertia_from,
        in_rpm=inertia is not None or prepared.log.in_rpm,
    )


def _over_log(prepared: Prepared, trace: ModelTrace) -> ModelTrace:
    return ModelTrace(
        prepared.over_log(trace.one_step_error_rad_s),
        prepared.over_log(trace.free_run_rad_s),
        prepared.over_log(trace.residual_acceleration_rad_s2),
        prepared.over_log(trace.normalised_innovation),
    )


def _not_written(refusal: str | None) -> list[str]:
    return [] if refusal is None else [f"no model was written, because none could read it: {refusal}"]


def _verdict(found: Found, lattice: Lattice | None, before: Performance, after: Performance) -> Verdict:
    facts, names, left = found.prepared.facts, found.new_ids, found.left
    if found.is_unexplained:
        along = ", ".join(item.name for item in left[:2])
        partly = f"; {', '.join(names)} would explain {100.0 * found.share:.0f} % of it" if names else ""
        return Verdict(
            "unexplained",
            statement=(
                f"The residual is not noise: it depends on {along} (p = {left[0].p_value:.0e}) in a way that no effect "
                f"of the catalogue explains{partly}; see the map of the residual for its shape."
            ),
        )
    if not names and lattice is None:
        given, kept = found.selection.base.model.effects.ids, found.selection.final.model.effects.ids
        note = " (nothing was added to the model given)" if given else ""
        if set(given) - set(kept):
            note = f" (of the model given, {', '.join(sorted(set(given) - set(kept)))} is not missed)"
        return Verdict(
            "adequate",
            statement=f"The model explains this log: what is left is noise of {_noise_text(found)}{note}.",
        )
    said = [sentence(found.selection.final, name, facts) for name in names]
    if lattice is not None:
        names = [*names, GRID.id]
        said.append(GRID.sentence(lattice.grid_rad_s, 0.0, (0.0, 0.0, 0.0), facts))
    groups = grouped(found.selection, names)
    seconds = sum(b - a for a, b in found.prepared.split.document()["heldout_s"])
    tail = "nothing is left in the residual" if not left else f"some dependence on {left[0].name} is left"
    where = ""
    if found.selection.whole_record:
        where = f" ({', '.join(found.selection.whole_record)} sought on the whole record)"
    if any(CATALOGUE[name].local_in_time for name in names):
        where += " (an event is sought on the whole record; its gain is that on every other 5 s inside it)"
    better = improvement(before.figures, after.figures, seconds, wheel_units=found.prepared.in_rpm)
    text = f"{'; '.join(said)}; add {', '.join(names)}{where}: {better}; {tail}."
    if groups:
        text += f" {separation(groups[0], found.selection)}."
    elif any(_goes_with_time(name) for name in names):
        for other in _CONFUSED_WITH_TIME:
            if one_and_the_same(found.whole, "time", other):
                way = separates(other)
                text += f" {way[:1].upper()}{way[1:]} would show whether it goes with time at all."
                break
    return Verdict("effect", names, groups, text)


_CONFUSED_WITH_TIME: tuple[Quantity, ...] = ("speed", "temperature")


def _goes_with_time(name: str) -> bool:
    """Whether an effect varies smoothly with the record's clock; the onset of an event is no law of speed."""
    return quantity_of(CATALOGUE[name]) == "time" and not CATALOGUE[name].local_in_time


def _noise_text(found: Found) -> str:
    noise, period = found.whole.noise, found.prepared.course.period_s
    sigma, wander = float(np.sqrt(noise.variance)), float(np.sqrt(noise.ratio * noise.variance / period))
    unit = "rad/s (or m/s)"
    if found.prepared.in_rpm:
        sigma, wander, unit = rpm_from_rad_s(sigma), rpm_from_rad_s(wander), "rpm"
    if noise.ratio < _TOLD_RATIO:
        return f"{sigma:.3g} {unit}"
    return f"{sigma:.3g} {unit}, and a torque noise that moves the speed by {wander:.2g} in a second"
