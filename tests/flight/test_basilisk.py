"""`rw-ekf export-model --basilisk`: parameters of its reaction wheel, and what that does not do as the model does."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from rw_ekf.errors import BadInputError
from rw_ekf.flight.basilisk import basilisk_document, basilisk_friction, export_basilisk
from rw_ekf.flight.plant_model import PlantModel
from rw_ekf.model.effect import Term
from rw_ekf.model.friction import GAUSS, LORENTZ, TUSTIN, Stribeck, friction, stribeck
from rw_ekf.wheel.effect_table import EffectSet
from tests.filter.effect_replay import in_use
from tests.flight.wheel_runs import wheel_model

_J = 1.5e-3
# What `rwFactory.create` of Basilisk (src/utilities/simIncludeRW.py) takes, with the types that it insists on.
_TAKEN = {
    "Js": float, "useRWfriction": bool, "fCoulomb": float, "fStatic": float, "betaStatic": float, "cViscous": float,
    "useMaxTorque": bool, "u_max": float,
}  # fmt: skip


def _with_law(model: PlantModel, law: int) -> PlantModel:
    from dataclasses import replace

    return replace(model, stribeck=Stribeck(model.stribeck.omega_s, law))


def test_the_file_is_what_basilisk_takes(tmp_path: Path) -> None:
    """Names and types; torques are the model's numbers times the inertia, the largest of the largest current."""
    model = wheel_model(inertia_kg_m2=_J)
    export_basilisk(model, tmp_path / "wheel.json", 0.5)
    document = json.loads((tmp_path / "wheel.json").read_text())
    made = document["create"]
    assert {name: type(value) for name, value in made.items()} == _TAKEN
    _, k, b, c, s = model.x.tolist()
    assert made["fCoulomb"] == pytest.approx(_J * c)
    assert made["fStatic"] == pytest.approx(_J * s)
    assert made["cViscous"] == pytest.approx(_J * b)
    assert made["u_max"] == pytest.approx(_J * k * 0.5)
    assert document["torque_per_ampere_N_m_A"] == pytest.approx(_J * k)


@pytest.mark.parametrize("law", [GAUSS, TUSTIN, LORENTZ])
def test_its_peak_takes_as_much_as_the_models(law: int) -> None:
    """Over all speeds the excess over Coulomb friction has the same integral; the peak is fStatic, at betaStatic."""
    model = _with_law(wheel_model(inertia_kg_m2=_J), law)
    made = basilisk_document(model, None)["create"]
    excess = made["fStatic"] - made["fCoulomb"]
    # The model's own, less Coulomb friction; without the tail beyond reach of the numbers, which Lorentz's law has.
    omega_s = model.stribeck.omega_s
    ours, _ = quad(lambda v: stribeck(v / omega_s, law), 0.0, math.inf)
    peak: dict[str, Any] = {**made, "fCoulomb": 0.0, "cViscous": 0.0, "fStatic": excess}
    theirs, _ = quad(lambda v: basilisk_friction(peak, v, from_rest=True) / excess, 0.0, 40.0 * made["betaStatic"])
    assert theirs == pytest.approx(ours, rel=1.0e-6)
    assert basilisk_friction(peak, made["betaStatic"], from_rest=True) == pytest.approx(excess)


def test_both_frictions_are_written_down() -> None:
    """Far from rest they are the same; at a tenth of the Stribeck speed they are not, and the file shows it."""
    model = wheel_model(inertia_kg_m2=_J)
    compared = basilisk_document(model, None)["compared"]
    far, near = compared[-1], compared[0]
    assert far["basilisk_from_rest_N_m"] == pytest.approx(far["model_N_m"], rel=1.0e-6)
    assert far["basilisk_otherwise_N_m"] == pytest.approx(far["model_N_m"], rel=1.0e-6)
    assert near["basilisk_from_rest_N_m"] < 0.99 * near["model_N_m"]
    _, _, b, c, s = model.x.tolist()
    assert near["model_N_m"] == pytest.approx(
        _J * friction(near["speed_rad_s"], b, c, s, model.stribeck.omega_s, model.stribeck.law)
    )


def test_effects_that_have_no_place_are_named() -> None:
    """All but another Stribeck curve, which betaStatic follows."""
    plain = basilisk_document(wheel_model(inertia_kg_m2=_J), None)
    assert not any("effects" in stated for stated in plain["not_carried"])
    (shape,) = in_use("stribeck_shape").terms
    wide = Term.of(shape.effect, shape.shape, 2.0 * wheel_model().stribeck.omega_s, 0.1)
    effects = EffectSet((*in_use("quadratic_drag", "friction_lag").terms, wide))
    document = basilisk_document(wheel_model(effects, _J), 0.5)
    (stated,) = [stated for stated in document["not_carried"] if stated.startswith("effects")]
    assert "quadratic_drag, friction_lag" in stated
    assert "stribeck_shape" not in stated
    assert document["create"]["betaStatic"] == pytest.approx(2.0 * plain["create"]["betaStatic"])


def test_without_an_inertia_there_are_no_torques() -> None:
    """A sentence that says how to give it."""
    with pytest.raises(BadInputError, match="--inertia-kg-m2"):
        basilisk_document(wheel_model(), None)


def _in_basilisk(made: dict[str, Any], torque_N_m: float, speed_rad_s: float, until_s: float) -> Any:
    """Speeds and friction torques every millisecond, (n, 2), of a wheel on a body that hardly moves."""
    from Basilisk.architecture import messaging
    from Basilisk.simulation import reactionWheelStateEffector, spacecraft
    from Basilisk.utilities import SimulationBaseClass, macros, simIncludeRW

    run = SimulationBaseClass.SimBaseClass()
    run.CreateNewProcess("process").addTask(run.CreateNewTask("steps", macros.sec2nano(1.0e-3)))
    body = spacecraft.Spacecraft()
    body.hub.mHub = 1.0e6
    body.hub.IHubPntBc_B = (1.0e12 * np.eye(3)).tolist()
    factory = simIncludeRW.rwFactory()
    factory.create("custom", [1.0, 0.0, 0.0], Omega=speed_rad_s / macros.RPM, **made)
    wheels = reactionWheelStateEffector.ReactionWheelStateEffector()
    factory.addToSpacecraft("wheels", wheels, body)
    command = messaging.ArrayMotorTorqueMsgPayload()
    command.motorTorque = [torque_N_m]
    reported = messaging.ArrayMotorTorqueMsg().write(command)
    wheels.rwMotorCmdInMsg.subscribeTo(reported)
    record = wheels.rwOutMsgs[0].recorder()
    for part in (body, wheels, record):
        run.AddModelToTask("steps", part)
    run.InitializeSimulation()
    run.ConfigureStopTime(macros.sec2nano(until_s))
    run.ExecuteSimulation()
    return np.column_stack([record.Omega, record.frictionTorque])


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of its SWIG wrappers
def test_basilisk_itself_takes_the_numbers_and_has_this_friction() -> None:
    """From rest, coasting down, and under a torque that the model's wheel sticks at: there it creeps, as is said."""
    pytest.importorskip("Basilisk")
    made = basilisk_document(wheel_model(inertia_kg_m2=_J), 0.5)["create"]
    torques = {"from rest": (1.2e-3, 0.0), "coasting": (0.0, 1.0), "held": (0.5e-3, 0.0)}
    for name, (torque, begin) in torques.items():
        speed, friction_torque = _in_basilisk(made, torque, begin, 1.5).T
        expected = [-basilisk_friction(made, float(v), from_rest=begin == 0.0) for v in speed[100:]]
        slack = 4.0e-6 if name == "coasting" else 1.0e-7  # it tells the friction of the last stage of its step
        assert friction_torque[100:] == pytest.approx(expected, rel=slack), name
    assert made["fStatic"] > 0.5e-3
    assert speed[-1] == pytest.approx(speed[-500], rel=1.0e-6)
    assert 1.0e-3 < speed[-1] < made["betaStatic"]
