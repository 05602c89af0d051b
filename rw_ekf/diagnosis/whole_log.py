"""What a diagnosis of stretches is worth on all of a log that is too long to be held: its filter goes through it once.

Between the stretches something may have happened that nobody looked at. The models before and after are fitted to the
stretches alone, so that what their filters miss all over the log tells.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.errors import FilterError
from rw_ekf.logs.in_parts import UnsoundError
from rw_ekf.logs.long_log import LongLog
from rw_ekf.long_replay import replay_long
from rw_ekf.starting_point import setup_of_model
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.model_file import WheelModel

_MOST_ROWS = 50_000_000  # a minute of processor time for both models; beyond, the stretches have to do


def held_against_all(found: Diagnosis, log: LongLog, before: WheelModel, advance: Callable[[str], object]) -> Diagnosis:
    """The diagnosis with what the filters of the base model and of the model found miss over all of the log."""
    if len(log) > _MOST_ROWS:
        return found
    advance("going through the whole log")
    models = [before, *([] if found.model is None else [found.model])]
    missed = [_missed(log, model) for model in models]
    whole: dict[str, Any] = {
        "samples": len(log), "before": missed[0], "after": missed[1] if len(missed) == 2 else None
    }  # fmt: skip
    content = {**found.content, "whole_log": whole}
    sentence = _sentence(whole, in_rpm=found.in_rpm)
    if sentence is not None:
        content["warnings"] = [*content["warnings"], sentence]
    return replace(found, content=content)


def _missed(log: LongLog, model: WheelModel) -> dict[str, float | None] | None:
    """The innovations of a filter with a model over a log; None where it runs away, or the log is not sound."""
    setup = setup_of_model(model, model.speed_noise_rad_s or RAD_S_PER_RPM, model.acceleration_noise or 0.0, 0.0)
    try:
        return replay_long(log, setup=setup).statistics.innovation_document()
    except (FilterError, UnsoundError):
        return None


def _sentence(whole: dict[str, Any], *, in_rpm: bool) -> str | None:
    """What was missed, in words."""
    unit, scale = ("rpm", 1.0) if in_rpm else ("rad/s", RAD_S_PER_RPM)
    told = [
        f"by {scale * missed['rms_rpm']:.3g} {unit} (NIS {missed['nis_mean']:.3g}) {how}"
        for missed, how in ((whole["after"], "with the model found"), (whole["before"], "with the base model"))
        if missed is not None and missed["rms_rpm"] is not None
    ]
    if not told:
        return None
    return f"over all {whole['samples']} samples a filter's predictions miss {', '.join(told)}"
