"""From the log of the identification to the model, and what it lacks: fit and diagnosis as the verbs do them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from rw_ekf.batch_fit import Fit, fit_record
from rw_ekf.commissioning.dialogue import RefusedError
from rw_ekf.commissioning.identification_run import DIRECTORY
from rw_ekf.commissioning.report import PAGE, write_page
from rw_ekf.commissioning.setting import CONFIGURATION_FILE, write_configuration
from rw_ekf.commissioning.step_context import Work
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.report.words import verdict_of
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.errors import ConfigError
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.run_directory import DIAGNOSED_MODEL, model_path
from rw_ekf.settings.load import load_configuration
from rw_ekf.wheel.model_file import WheelModel, read_model
from rw_ekf.wheel.wheel_tag import WheelTag

MODEL_FILE = "wheel.model.yaml"
DIAGNOSIS = "diagnosis"


def make_model(work: Work, advance: Callable[[str], object]) -> dict[str, Any]:
    """Fit, diagnose, write all that is left behind. Raises RefusedError where the log gives no model."""
    directory = work.progress.directory
    path = Path(work.progress["identification"]["log"])
    log, wheel = read_log(path), _wheel_of(path)
    configuration = load_configuration(write_configuration(work.progress))
    advance("fitting")
    fit = fit_record(log, configuration, with_noise=True, wheel=wheel)
    if fit.refusal is not None:
        raise RefusedError(f"{path}: no model was written, because {fit.refusal}")
    fit.save(directory / MODEL_FILE)
    found = diagnose_log(log, configuration, advance=advance)
    if found.model is not None:
        found = replace(found, model=replace(found.model, wheel=wheel))
    advance("drawing")
    found.report(directory / DIAGNOSIS)
    better = found.model is not None and found.verdict["kind"] == "effect"
    name = f"{DIAGNOSIS}/{DIAGNOSED_MODEL}" if better else MODEL_FILE
    write_configuration(work.progress, name)
    used = read_model(directory / name)
    content = _document(fit, found, name, used)
    work.dialogue.say("model", f"{verdict_of(found.document())[2]} Model: {directory / name}")
    work.progress.keep("files", _files(work, name))
    write_page(work.progress, log, used, content)
    return content


def _document(fit: Fit, found: Diagnosis, name_of_model: str, model: WheelModel) -> dict[str, Any]:
    reported = {item.name: item.identifiable for item in fit.reports}
    better = name_of_model != MODEL_FILE
    stated = () if better else fit.warnings  # the four parameters alone lack what the better model has
    kind, name, statement = verdict_of(found.document())
    return {
        "file": name_of_model,
        "parameters": {
            key: {"value": value, "std": std, "unit": unit, "identifiable": reported.get(key, True)}
            for key, (value, std, unit) in model.numbers.items()
        },
        "noise": fit.document()["noise"],
        "residual_rms_rpm": fit.quality.get("residual_rms_rpm"),
        "verdict": {
            "kind": kind,
            "name": name,
            "effects": list(found.verdict.get("effects") or ()),
            "statement": statement,
        },
        "warnings": list(dict.fromkeys((*stated, *map(str, found.document().get("warnings") or ())))),
    }


def _files(work: Work, model: str) -> dict[str, str]:
    directory = work.progress.directory
    names = {
        "configuration": CONFIGURATION_FILE,
        "model": model,
        "report": PAGE,
        "diagnosis": f"{DIAGNOSIS}/report.html",
    }
    files = {what: str(directory / name) for what, name in names.items()}
    log, wire_map = work.progress["identification"]["log"], work.progress["sign"]["protocol"]
    return files | {"wire_map": wire_map, "log": log, "runs": str(directory / DIRECTORY)}


def _wheel_of(log: Path) -> WheelTag | None:
    try:
        return read_model(model_path(log)).wheel
    except ConfigError:
        return None
