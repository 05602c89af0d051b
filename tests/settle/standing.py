"""Diagnoses that leave two explanations standing, written by hand: what the design of a motion is tested with."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.model.effect import Term
from rw_ekf.model.state import CK13_STATISTICAL, FrictionParameters
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.effect_table import EffectSet
from rw_ekf.wheel.model_file import WheelModel
from tools.measure.runs import OMEGA_S

STD = (0.01, 4.0e-5, 1.0e-3, 1.0e-2)  # of the four parameters, as five minutes at 1 rpm leave them


def model(*effects: tuple[str, float, float], noise_rpm: float = 1.0, wander_rpm: float = 0.0) -> WheelModel:
    """A wheel of [CK13] with effects: (id, coefficient, its standard deviation)."""
    terms = tuple(Term.of(CATALOGUE[name], value=value, std=std) for name, value, std in effects)
    stds = [*STD, *(std for _, _, std in effects)]
    return WheelModel(
        parameters=FrictionParameters(*CK13_STATISTICAL),
        covariance=tuple(tuple(row) for row in np.diag(np.square(stds)).tolist()),
        stribeck_speed_rad_s=OMEGA_S,
        speed_noise_rad_s=noise_rpm * RAD_S_PER_RPM,
        acceleration_noise=wander_rpm * RAD_S_PER_RPM,
        effects=EffectSet(terms),
    )


def diagnosis(*weighed: tuple[float, WheelModel], kind: str = "effect", degC: float = 22.0) -> dict[str, Any]:
    """A diagnosis document with explanations: (posterior, model)."""
    return {
        "schema": "rw_ekf.diagnosis/1",
        "log": "first.csv",
        "verdict": {"kind": kind},
        "explanations": [
            {"effects": list(item.effects.ids), "posterior": posterior, "log_evidence": 0.0, "model": item.document()}
            for posterior, item in weighed
        ],
        "ended": {"time_s": 299.9, "temperature_degC": degC, "warming": None},
    }


LAG_OR_DELAY = diagnosis((0.55, model(("actuator_lag", 0.05, 0.002))), (0.45, model(("transport_delay", 0.05, 0.002))))


def write(path: Path, document: Any) -> str:
    """The document in a file."""
    path.write_text(json.dumps(document), encoding="utf-8")
    return str(path)
