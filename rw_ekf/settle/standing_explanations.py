"""What a diagnosis left standing, read from its document and checked: explanations, and how the record ended."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.warming import Warming
from rw_ekf.errors import BadInputError
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.model.friction import LAW_CODES, Stribeck
from rw_ekf.plain_file import json_of, read_plain
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.model_file import WheelModel, model_from_data

SCHEMA = "rw_ekf.diagnosis/1"
MOST = 5  # explanations that a motion is designed for, the most probable
_WRITE = "name the diagnosis.json that `rw-ekf diagnose LOG --out DIR` writes"
_NOISE, _TORQUE_NOISE = RAD_S_PER_RPM, 0.02 * RAD_S_PER_RPM  # where the document says nothing
_MOST_BYTES = 20_000_000
_LATEST_S = 1.0e10  # three centuries: beyond it the time of a sample says nothing of its period


@dataclass(eq=False, frozen=True)
class Explanation:
    """A model that explains the record, and how probable it is."""

    effects: tuple[str, ...]  # beyond the base model
    posterior: float
    model: Model
    covariance: Float64Array  # (4 + m, 4 + m) of the four parameters and the coefficients
    variance: float  # of a reading [rad^2/s^2]
    density: float  # of torque noise [rad^2/s^3]

    @property
    def id(self) -> str:
        """Its effects, or `none`."""
        return "+".join(self.effects) or "none"


@dataclass(frozen=True)
class Standing:
    """A diagnosis as the design of a motion takes it."""

    path: str
    logs: tuple[str, ...]
    explanations: tuple[Explanation, ...]  # two at least, the most probable first; their probabilities add up to 1
    ended_s: float  # time of the record's last sample, from which the next one continues
    temperature_degC: float | None
    warming: Warming | None


def read_standing(path: str) -> Standing:
    """Read a diagnosis document. Raises BadInputError for one that leaves nothing to settle, or is none."""
    return standing_of_document(path, _document(path))


def standing_of_document(path: str, document: dict[str, Any]) -> Standing:
    """What a diagnosis document says; path: what to call it. Raises BadInputError as `read_standing`."""
    entries = document.get("explanations")
    if not isinstance(entries, list):
        raise BadInputError(f"{path}: lists no `explanations`: diagnose the log again with this version, then {_WRITE}")
    found = [_explanation(path, i, entry) for i, entry in enumerate(entries)]
    _refuse_settled(path, document, found)
    ended = document.get("ended")
    ended_s = _number(ended.get("time_s")) if isinstance(ended, dict) else None
    if not isinstance(ended, dict) or ended_s is None or abs(ended_s) > _LATEST_S:
        raise BadInputError(
            f"{path}: `ended.time_s`, when the log ended, is {'missing' if ended_s is None else f'{ended_s:g} s'}: the "
            f"motion goes on from there; {_WRITE}"
        )
    parts = document.get("logs")
    logs = parts if isinstance(parts, list) else [document]
    return Standing(
        path=path,
        logs=tuple(str(part.get("log")) for part in logs if isinstance(part, dict)),
        explanations=most_probable(found),
        ended_s=ended_s,
        temperature_degC=_number(ended.get("temperature_degC")),
        warming=Warming.of(ended.get("warming")),
    )


def most_probable(found: Sequence[Explanation]) -> tuple[Explanation, ...]:
    """Those that a motion is designed for, the most probable first, their probabilities made to add up to 1."""
    kept = sorted(found, key=lambda item: -item.posterior)[:MOST]
    total = sum(item.posterior for item in kept)
    return tuple(replace(item, posterior=item.posterior / total) for item in kept)


def _document(path: str) -> dict[str, Any]:
    try:
        text = read_plain(path, _MOST_BYTES + 1)
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read ({error.strerror or error}): {_WRITE}") from None
    document = json_of(text) if len(text) <= _MOST_BYTES else None
    schema = document.get("schema") if isinstance(document, dict) else None
    if not isinstance(document, dict) or schema != SCHEMA:
        stated = f"its schema is {schema!r}" if schema is not None else "it is no JSON document with a schema"
        raise BadInputError(f"{path}: not a diagnosis ({stated}): {_WRITE}")
    return document


def _refuse_settled(path: str, document: dict[str, Any], found: list[Explanation]) -> None:
    """Raise BadInputError where fewer than two explanations stand, with what to do in their place."""
    if len(found) > 1:
        return
    verdict = document.get("verdict")
    kind = verdict.get("kind") if isinstance(verdict, dict) else None
    if found:
        raise BadInputError(
            f"{path}: only one explanation stands ({found[0].id}): there is nothing to settle, use its model"
        )
    if kind == "unexplained":
        raise BadInputError(
            f"{path}: no explanation stands, no effect of the catalogue explains the record: there is nothing to tell "
            "apart; see the map of the residual in its report.html"
        )
    raise BadInputError(
        f"{path}: no explanation stands: record a log that shows more first (`rw-ekf excite identification --config F`)"
    )


def _explanation(path: str, number: int, entry: Any) -> Explanation:
    """One entry of the document, its model checked as a model file is."""
    at = f"explanations[{number}]"
    if not isinstance(entry, dict) or not isinstance(entry.get("effects"), list):
        raise BadInputError(f"{path}: {at} is not an explanation: {_WRITE}")
    posterior = _number(entry.get("posterior"))
    if posterior is None or not 0.0 < posterior <= 1.0:
        raise BadInputError(f"{path}: {at}.posterior is {entry.get('posterior')!r}; a probability is needed: {_WRITE}")
    wheel = model_from_data(entry.get("model"), lambda keys: f"{path}: {at}.model{''.join(f'.{key}' for key in keys)}")
    absent = [str(name) for name in entry["effects"] if str(name) not in wheel.effects.ids]
    if absent:
        raise BadInputError(f"{path}: {at}.effects names {', '.join(absent)[:60]}, which its model has not: {_WRITE}")
    return Explanation(
        effects=tuple(str(name) for name in entry["effects"]),
        posterior=posterior,
        model=_model_of(wheel),
        covariance=np.array(wheel.covariance),
        variance=(wheel.speed_noise_rad_s or _NOISE) ** 2,
        density=(_TORQUE_NOISE if wheel.acceleration_noise is None else wheel.acceleration_noise) ** 2,
    )


def _model_of(wheel: WheelModel) -> Model:
    stribeck = Stribeck(wheel.stribeck_speed_rad_s, LAW_CODES[wheel.stribeck_law])
    return Model(wheel.parameters, stribeck, wheel.effects)


def _number(value: Any) -> float | None:
    """A finite number, or None."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:  # an integer of three hundred digits and more
        return None
    return number if math.isfinite(number) else None
