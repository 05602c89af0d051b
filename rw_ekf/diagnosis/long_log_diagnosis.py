"""What a diagnosis of stretches is worth on all of a log that is too long to be held.

Between the stretches something may have happened that nobody looked at. So the model is fitted on to all of the log
where its parts can say it, and the filters of the models before and after go through all of it once.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from rw_ekf.diagnosis.investigate.found import Found, model_of_fit
from rw_ekf.diagnosis.investigate.sigmas import with_open_stribeck_speed
from rw_ekf.diagnosis.long_log_fit import WholeFit, fitted_to_all
from rw_ekf.diagnosis.prepare.preparation import Advance
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.diagnosis.verdict.document import base_parameters, described
from rw_ekf.errors import FilterError, LogError
from rw_ekf.logs.in_parts import UnsoundError
from rw_ekf.logs.long_log import LongLog
from rw_ekf.long_replay import replay_long
from rw_ekf.model.state import PARAMETER_NAMES
from rw_ekf.starting_point import setup_of_model
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.model_file import WheelModel, refusal_of

# Scatter of parts, in their noise, above which it is reported: of eight parts of a wheel it exceeds that once in 4,500.
_WANDERS = 2.0
_MOST_ROWS = 50_000_000  # a minute of processor time for both models; beyond, the stretches have to do


def held_against_all(described: Diagnosis, found: Found, log: LongLog, advance: Advance) -> Diagnosis:
    """The diagnosis with its model fitted to all of the log, and what the filters miss over all of it."""
    if len(log) > _MOST_ROWS:
        return described
    advance("fitting to the whole log")
    fit = _fit(described, found, log)
    before, model = model_of_fit(found.selection.base, found.prepared), described.model
    if fit is not None:
        fitted = model_of_fit(fit.fit, found.prepared, of="the whole log")
        if refusal_of(fitted) is not None:
            fit = None
        elif model is None:
            before = fitted
        else:
            model = fitted
    advance("going through the whole log")
    whole: dict[str, Any] = {
        "samples": len(log),
        "fit": None if fit is None else _document(fit),
        "before": _missed(log, before),
        "after": None if model is None else _missed(log, model),
    }
    sentences = [*wandering(fit), *_sentences(whole, in_rpm=described.in_rpm)]
    content = {**described.content, "whole_log": whole, "warnings": [*described.content["warnings"], *sentences]}
    return replace(described, content=content, model=model)


def _fit(described: Diagnosis, found: Found, log: LongLog) -> WholeFit | None:
    """What stands, fitted to all of a log; None where it cannot be, or has a grid of the readings beside it."""
    if found.lattice is not None:
        return None
    fit, reported = found.fit, found.reported
    if described.model is None:
        fit = found.selection.base
        reported = with_open_stribeck_speed(fit, found.prepared.facts)
    try:
        return fitted_to_all(fit, reported, found.prepared, log)
    except (UnsoundError, LogError):
        return None


def _document(whole: WholeFit) -> dict[str, Any]:
    fit = whole.fit
    return {
        "parts": whole.parts,
        "parameters": base_parameters(fit),
        "effects": {name: described(fit, name) for name in fit.model.effects.ids},
        "scatter": dict(zip(PARAMETER_NAMES, whole.scatter.tolist(), strict=False)),
    }


def wandering(whole: WholeFit | None) -> list[str]:
    """That the parts of a log do not agree, where they do not; else nothing."""
    if whole is None:
        return []
    worst = int(np.argmax(whole.scatter[: len(PARAMETER_NAMES)]))
    if whole.scatter[worst] < _WANDERS:
        return []
    return [
        f"the {whole.parts} parts of the log differ in {PARAMETER_NAMES[worst]} by {whole.scatter[worst]:.1f} times "
        "their noise: the wheel was not the same all the time; the standard deviations in `whole_log` are of its mean"
    ]


def _missed(log: LongLog, model: WheelModel) -> dict[str, float | None] | None:
    """The innovations of a filter with a model over a log; None where it runs away, or the log is not sound."""
    setup = setup_of_model(model, model.speed_noise_rad_s or RAD_S_PER_RPM, model.acceleration_noise or 0.0, 0.0)
    try:
        return replay_long(log, setup=setup).statistics.innovation_document()
    except (FilterError, UnsoundError):
        return None


def _sentences(whole: dict[str, Any], *, in_rpm: bool) -> list[str]:
    """What was missed, in words; none where nothing can be stated."""
    unit, scale = ("rpm", 1.0) if in_rpm else ("rad/s", RAD_S_PER_RPM)
    described = [
        f"by {scale * missed['rms_rpm']:.3g} {unit} (NIS {missed['nis_mean']:.3g}) {how}"
        for missed, how in ((whole["after"], "with the model found"), (whole["before"], "with the base model"))
        if missed is not None and missed["rms_rpm"] is not None
    ]
    return (
        [f"over all {whole['samples']} samples a filter's predictions miss {', '.join(described)}"] if described else []
    )
