"""`rw-ekf export-model --basilisk`: parameters of its reaction wheel, and what that does not do as the model does."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

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
    assert not any("effects" in said for said in plain["not_carried"])
    (shape,) = in_use("stribeck_shape").terms
    wide = Term.of(shape.effect, shape.shape, 2.0 * wheel_model().stribeck.omega_s, 0.1)
    effects = EffectSet((*in_use("quadratic_drag", "friction_lag").terms, wide))
    document = basilisk_document(wheel_model(effects, _J), 0.5)
    (said,) = [said for said in document["not_carried"] if said.startswith("effects")]
    assert "quadratic_drag, friction_lag" in said
    assert "stribeck_shape" not in said
    assert document["create"]["betaStatic"] == pytest.approx(2.0 * plain["create"]["betaStatic"])


def test_without_an_inertia_there_are_no_torques() -> None:
    """A sentence that says how to give it."""
    with pytest.raises(BadInputError, match="--inertia-kg-m2"):
        basilisk_document(wheel_model(), None)
