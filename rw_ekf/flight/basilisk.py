"""A model as parameters of Basilisk's reaction wheel, and what its friction cannot say of the model.

Basilisk (hanspeterschaub.info/basilisk), `reactionWheelStateEffector.cpp`: with x = Omega/betaStatic the friction
torque of a wheel that gathers speed from rest is

    sqrt(2 e) (fStatic - fCoulomb) exp(-x^2/2) x/sqrt(2) + fCoulomb tanh(10 x) + cViscous Omega

and otherwise sgn(Omega) fCoulomb + cViscous Omega; below omegaLimitCycle, 1e-4 rad/s, it is in proportion to Omega.
tests/flight/test_basilisk.py holds `basilisk_friction` against Basilisk itself, where it is installed.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from rw_ekf.errors import BadInputError
from rw_ekf.flight.plant_model import PlantModel
from rw_ekf.logs.atomic import write_text
from rw_ekf.model.friction import GAUSS, TUSTIN, friction
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, STATIC, VISCOUS
from rw_ekf.wheel.pieces import stribeck_of

BASILISK_SCHEMA = "rw_ekf.export_basilisk/1"
_COMPARED = (0.1, 0.5, 1.0, 2.0, 5.0, 20.0)  # Stribeck speeds at which both frictions are written down
_UNLIMITED = -1.0  # as Basilisk's own factory says it
# Integral of g(v/omega_s) over v from rest, in Stribeck speeds: what the excess over Coulomb friction takes from a
# wheel that gathers speed evenly.
_GAUSS_AREA, _TUSTIN_AREA, _LORENTZ_AREA = 0.5 * math.sqrt(math.pi), 1.0, 0.5 * math.pi
_PEAK_AREA = math.sqrt(math.e)  # the same of Basilisk's peak, in betaStatic


def export_basilisk(model: PlantModel, path: Path, most_current_A: float | None) -> dict[str, Any]:
    """Write the parameters; what was written, as `export-model --json` has it.

    most_current_A: that the motor is given; None: not known, torque is not limited. Raises BadInputError for a model
    without an inertia, or a file that cannot be written.
    """
    document = basilisk_document(model, most_current_A)
    write_text(path, json.dumps(document, indent=2) + "\n")
    return {**document, "out": str(path)}


def basilisk_document(model: PlantModel, most_current_A: float | None) -> dict[str, Any]:
    """The file. Raises BadInputError for a model without an inertia, or without dry friction to speak of."""
    inertia = model.inertia_kg_m2
    if inertia is None:
        raise BadInputError(
            f"{model.name}: Basilisk reckons in torques, and nobody gave the wheel's inertia: give "
            "--inertia-kg-m2, or `wheel.inertia_kg_m2` in a configuration (--config)"
        )
    k, b, c, s = (float(model.x[at]) for at in (MOTOR_GAIN, VISCOUS, COULOMB, STATIC))
    curve = stribeck_of(model.x, model.table, model.stribeck)
    area = {GAUSS: _GAUSS_AREA, TUSTIN: _TUSTIN_AREA}.get(curve.law, _LORENTZ_AREA)
    beta = curve.omega_s * area / _PEAK_AREA
    made: dict[str, Any] = {
        "Js": inertia,
        "useRWfriction": True,
        "fCoulomb": inertia * c,
        "fStatic": inertia * s,
        "betaStatic": beta,
        "cViscous": inertia * b,
        "useMaxTorque": most_current_A is not None,
        "u_max": _UNLIMITED if most_current_A is None else inertia * abs(k) * most_current_A,
    }
    return {
        "schema": BASILISK_SCHEMA,
        "model": model.name,
        "use": "rwFactory.create('custom', axis, **document['create'])",
        "create": made,
        "torque_per_ampere_N_m_A": inertia * k,
        "compared": [_compared(made, (b, c, s), curve, ratio) for ratio in _COMPARED],
        "not_carried": not_carried(model, most_current_A),
    }


def basilisk_friction(made: dict[str, Any], speed_rad_s: float, *, from_rest: bool) -> float:
    """Basilisk's friction torque [N m] at a speed above omegaLimitCycle; from_rest: the wheel gathers speed from 0."""
    coulomb, viscous = made["fCoulomb"], made["cViscous"] * speed_rad_s
    if not from_rest:
        return float(math.copysign(coulomb, speed_rad_s) + viscous)
    x = speed_rad_s / made["betaStatic"]
    peak = math.sqrt(2.0 * math.e) * (made["fStatic"] - coulomb) * math.exp(-x * x / 2.0) * x / math.sqrt(2.0)
    return float(peak + coulomb * math.tanh(10.0 * x) + viscous)


def _compared(made: dict[str, Any], bcs: tuple[float, float, float], curve: Any, ratio: float) -> dict[str, float]:
    speed = ratio * curve.omega_s
    return {
        "speed_rad_s": speed,
        "model_N_m": made["Js"] * friction(speed, *bcs, curve.omega_s, curve.law),
        "basilisk_from_rest_N_m": basilisk_friction(made, speed, from_rest=True),
        "basilisk_otherwise_N_m": basilisk_friction(made, speed, from_rest=False),
    }


def not_carried(model: PlantModel, most_current_A: float | None) -> list[str]:
    """What Basilisk's wheel does not do as the model does, in sentences without a stop."""
    found = [
        "rest: Basilisk's wheel is never held, its friction is 0 at rest; under a drive below break-away friction, "
        "where the model's wheel sticks, it creeps at the speed, below betaStatic, at which its friction is as large",
        "the Stribeck curve: the model's friction is largest at rest and falls, Basilisk's is 0 at rest, rises to "
        "fStatic at betaStatic and falls from there; betaStatic gives what exceeds Coulomb friction the same integral "
        "over the speed (`compared` has both frictions)",
        "slowing down: Basilisk has the Stribeck peak while a wheel gathers speed from rest, and not while it comes to "
        "rest",
        "commands: u_cmd is a torque, the model's input a current; multiply by torque_per_ampere_N_m_A",
    ]
    if most_current_A is None:
        found.append("the largest torque: no limit of the current is known (--config), so useMaxTorque is false")
    ids = [name for name in model.effects.ids if name != "stribeck_shape"]
    if ids:
        found.append(f"effects: {', '.join(ids)}: Basilisk's friction has no place for any")
    return found
