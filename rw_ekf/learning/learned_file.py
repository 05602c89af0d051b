"""What the runs of one wheel have learned, as a file from which the next run continues: read with mistrust.

A model file (rw_ekf.wheel.model_file) whose `wheel` says whose it is, and whose `source` says when it was saved, from
what start the learning began, and a checksum: the file is the daemon's own, and a number in it that somebody changed
would be believed to its sigma.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.checking.yaml_loader import load_yaml
from rw_ekf.errors import ConfigError
from rw_ekf.logs.metadata import moment_of, utc_text
from rw_ekf.model.state import PARAMETER_COUNT, PARAMETER_NAMES, STATE_UNITS
from rw_ekf.starting_point import FilterSetup
from rw_ekf.wheel.model_file import WheelModel, model_from_data
from rw_ekf.wheel.wheel_tag import WheelTag

if TYPE_CHECKING:
    from rw_ekf.arrays import Float64Array

_METHOD = "learned"
# Of the motor gain that the configuration starts from: beyond it the sign watch would speak of a wrong scale.
_GAIN_FACTOR = 4.0
_FRICTION_FACTOR = 10.0
# One of the four parameters known twice as well, or several a little better. Two seconds of motion bring three times
# as much, a wheel at rest nothing: a third more or less changes no run.
_LEARNED = math.log(2.0)
# Every parameter known half as well: what a quarter of the data gives, because a sigma goes with their root. A run as
# long as those before replaces what they learned, a short test does not; a third more or less is a fifth or a third of
# the data.
_WORSE = PARAMETER_COUNT * math.log(2.0)


@dataclass(frozen=True)
class Learned:
    """A learned file as it was read: whole and unchanged; whether it is of any use is another question."""

    model: WheelModel
    wheel: WheelTag
    started_from: str  # fingerprint of where its learning began
    saved: datetime

    def of_another(self, present: WheelTag) -> str | None:
        """Say how its wheel is another than the present one; None where it is the same."""
        return self.wheel.difference(present, versions=True)


def read_learned(path: Path) -> Learned:
    """Read a learned file. Raises ConfigError, one sentence, where it is torn, changed, of another schema or none."""
    document = load_yaml(path)
    model = model_from_data(document.data, document.where)
    source = model.source
    if source.get("method") != _METHOD or not isinstance(source.get("started_from"), str) or model.wheel is None:
        raise ConfigError(f"{path}: not what a run has learned, but a model of another origin: give it with --model")
    if source.get("checksum") != _checksum(document.data):
        raise ConfigError(f"{path}: was changed after it was written: give it with --model, if that is meant")
    saved = moment_of(source.get("utc"))
    if saved is None:
        raise ConfigError(f"{path}: source.utc is no time")
    return Learned(model, model.wheel, str(source["started_from"]), saved)


def learned_text(model: WheelModel, started_from: str, log: str, now: datetime) -> str:
    """Text of a learned file of a model that has a wheel."""
    source = {**model.source, "method": _METHOD, "log": log, "utc": utc_text(now), "started_from": started_from}
    unsigned = replace(model, source=source)
    return replace(unsigned, source={**source, "checksum": _checksum(unsigned.document())}).to_text()


def out_of_bounds(model: WheelModel, start: FilterSetup) -> str | None:
    """Say what the model has learned that is too far from where it began to be continued from; None if nothing."""
    began, stds = start.prior.parameters, start.prior.parameter_std
    for name, value, first, std in zip(PARAMETER_NAMES, model.parameters, began, stds, strict=True):
        factor = _GAIN_FACTOR if name == "motor_gain" else _FRICTION_FACTOR
        if abs(value) > factor * max(abs(first), std) or (name == "motor_gain" and value < first / factor):
            return (
                f"{name} is {value:.4g} {STATE_UNITS[name]}, where the configuration starts from {first:.4g}: a change "
                f"by more than {factor:g} times is no learning, something was wrong"
            )
    return None


def fingerprint(*parts: Any) -> str:
    """sha256 of plain data (numbers, texts, null, lists, mappings)."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def content_of(model: WheelModel) -> dict[str, Any]:
    """What of a model a filter starts from: without where it came from, and whose it is."""
    return {key: value for key, value in model.document().items() if key not in ("source", "wheel")}


def _checksum(document: Mapping[str, Any]) -> str:
    source = {key: value for key, value in document["source"].items() if key != "checksum"}
    return fingerprint({**document, "source": source})


def has_learned(before: Float64Array, after: Float64Array) -> bool:
    """Whether the four parameters, covariances (4, 4), are known better after than before."""
    return 0.5 * float(np.linalg.slogdet(before)[1] - np.linalg.slogdet(after)[1]) >= _LEARNED


def may_replace(standing: Float64Array, new: Float64Array, prior: Float64Array) -> bool:
    """Whether what a run itself has read of the parameters is of as much worth as what stands there, all (4, 4).

    prior: what the run began with. Its own information is that of its belief `new` less that: a model that was given
    may know a wheel to a thousandth, and three seconds with it say next to nothing.
    """
    sigma = np.sqrt(np.diag(standing))
    if not np.all(sigma > 0.0):
        return False
    scale = np.outer(sigma, sigma)
    try:
        information = np.linalg.eigvalsh(np.linalg.inv(new / scale) - np.linalg.inv(prior / scale))
    except np.linalg.LinAlgError:
        return False
    if not np.all(information > 0.0):
        return False
    volume = float(np.linalg.slogdet(standing / scale)[1])
    return 0.5 * (float(np.sum(np.log(information))) + volume) >= -_WORSE
