"""From what was found to a verdict, and the document (docs/contract.md#diagnosis)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rw_ekf.diagnosis.judge.candidate_entries import candidate_entries
from rw_ekf.diagnosis.judge.heldout import performance
from rw_ekf.diagnosis.judge.investigation import Found
from rw_ekf.diagnosis.judge.lattice import Lattice, find_lattice
from rw_ekf.diagnosis.judge.residual_tests import residual_tests
from rw_ekf.diagnosis.judge.verdict import verdict_on
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.result import Diagnosis, ModelTrace
from rw_ekf.diagnosis.standing import ADDED, PARTIAL
from rw_ekf.effects.catalogue import GRID
from rw_ekf.model.effect import Term
from rw_ekf.model.state import PARAMETER_COUNT
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.model_file import refusal_of
from rw_ekf.wheel.table import EffectSet

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration
    from rw_ekf.wheel.model_file import WheelModel

Advance = Callable[[str], object]

SCHEMA = "rw_ekf.diagnosis/1"
MODEL_FILE = "augmented-model.yaml"
_REGISTER_RPM = 0.6  # a finer grid than this is the wire's own register (0.5 rpm), which is no effect


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
    verdict = verdict_on(found, lattice if quantised else None, before, after)
    chosen = [] if unexplained else [*names, *([GRID.id] if quantised else [])]
    for name in names:
        trial = selection.trials[name]
        trial.decision = ADDED if not unexplained else PARTIAL
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
    course = prepared.whole.course
    return Diagnosis(
        log=prepared.log,
        document=document,
        heldout=heldout,
        before=_over_log(prepared, before.trace),
        after=_over_log(prepared, after.trace) if chosen else None,
        temperature_degC=prepared.over_log(course.temperature_degC) if prepared.temperature_is_logged else None,
        angle_rad=prepared.over_log(course.angle_rad) if prepared.facts.angle else None,
        angle_is_logged=prepared.angle_is_logged,
        model=model,
        inertia_kg_m2=inertia,
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


def augmented_model(found: Found, lattice: Lattice | None) -> WheelModel:
    """The final model, fitted to the whole record, as a file carries it on."""
    from rw_ekf import __version__
    from rw_ekf.model.friction import LAW_NAMES
    from rw_ekf.wheel.model_file import WheelModel

    fit, prepared = found.whole, found.prepared
    known = fit.model.known
    covariance = fit.likelihood.covariance[:known, :known]
    covariance = 0.5 * (covariance + covariance.T)
    effects = fit.model.effects.with_values(fit.model.effects.values, fit.std[PARAMETER_COUNT:known])
    variance = fit.noise.variance
    if lattice is not None:
        effects = EffectSet((*effects.terms, Term.of(GRID, value=lattice.grid_rad_s)))
        variance = max(variance - GRID.variance(lattice.grid_rad_s), (0.02 * lattice.grid_rad_s) ** 2)
    return WheelModel(
        parameters=fit.model.parameters,
        covariance=tuple(tuple(float(v) for v in row) for row in covariance),
        stribeck_speed_rad_s=fit.model.stribeck.omega_s,
        stribeck_law=LAW_NAMES[fit.model.stribeck.law],
        speed_noise_rad_s=float(np.sqrt(variance)),
        acceleration_noise=float(np.sqrt(fit.noise.ratio * fit.noise.variance / prepared.course.period_s)),
        inertia_kg_m2=prepared.setup.inertia_kg_m2,
        source={"method": "diagnose, fitted to the whole record", "log": prepared.log.name, "rw_ekf": __version__},
        effects=effects,
    )
