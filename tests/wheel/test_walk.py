"""The catalogue walked: what the plant is given is named from the log alone, and a healthy wheel is not accused.

Amplitudes are some five to ten percent of Coulomb friction where they act, on the identification profile at 1 rpm.
"""

from __future__ import annotations

import math

import pytest

from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.drivers.sim.plant_effects import CATALOGUE_IDS
from rw_ekf.effects.catalogue import FORMULAS
from rw_ekf.units import RAD_S_PER_RPM
from tests.diagnosis.simulated import diagnosed_once, log_of, simulated

# These logs are diagnosed for tests/diagnosis/test_rough_logs.py as well: once, where one process has both.
SHARED = ("quadratic_drag", "actuator_lag", "drag_spike", "external_torque")
# Parameters of the plant's twin, by id; those that a diagnosis must find to a share of this, with that share.
INJECTED: dict[str, tuple[dict[str, float], dict[str, float]]] = {
    "offset_torque": ({"torque_rad_s2": 0.03}, {"torque_rad_s2": 0.1}),
    "viscous_asymmetry": ({"difference_1_s": 2.0e-4}, {"difference_1_s": 0.2}),
    "quadratic_drag": ({"coefficient_1_rad": 1.2e-6}, {"coefficient_1_rad": 0.2}),
    "cubic_drag": ({"coefficient_s_rad2": 7.0e-9}, {"coefficient_s_rad2": 0.2}),
    "viscous_temperature": ({"slope_1_K": -0.02}, {"slope_1_K": 0.2}),
    "coulomb_temperature": ({"slope_1_K": -0.008}, {"slope_1_K": 0.2}),
    "motor_gain_temperature": ({"slope_1_K": -0.002}, {"slope_1_K": 0.2}),
    "motor_saturation": ({"slope_1_A": 0.05}, {"slope_1_A": 0.2}),
    "current_deadzone": ({"width_A": 0.003}, {"width_A": 0.3}),
    "actuator_lag": ({"time_constant_s": 0.06}, {"time_constant_s": 0.2}),
    "transport_delay": ({"delay_s": 0.06}, {"delay_s": 0.2}),
    "speed_averaging": ({"window_s": 0.12}, {"window_s": 0.2}),
    "presliding_hysteresis": ({"deflection_rad": 0.06, "damping": 0.3}, {"deflection_rad": 0.4}),
    "friction_lag": ({"time_constant_s": 0.2}, {"time_constant_s": 0.3}),
    "torque_ripple": ({"amplitude_rad_s2": 0.04, "order": 1.0, "phase_rad": 1.0}, {"amplitude_rad_s2": 0.3}),
    "drag_spike": ({"amplitude_rad_s2": 0.05, "onset_s": 250.0, "decay_s": 60.0}, {"amplitude_rad_s2": 0.3}),
    "coulomb_drift": ({"rate_rad_s3": -2.0e-4, "time_constant_s": 300.0}, {}),
    "stribeck_shape": ({"speed_rad_s": 16.0 * RAD_S_PER_RPM}, {"speed_rad_s": 0.4}),
    "external_torque": ({"amplitude_rad_s2": 0.04, "frequency_Hz": 0.05}, {"amplitude_rad_s2": 0.3}),
    "drag_bump": (
        {"amplitude_rad_s2": 0.06, "speed_rad_s": 90.0, "width_rad_s": 12.0},
        {"amplitude_rad_s2": 0.3, "speed_rad_s": 0.05, "width_rad_s": 0.4},
    ),
    "speed_quantisation": ({"grid_rad_s": 5.0 * RAD_S_PER_RPM}, {"grid_rad_s": 1.0e-6}),
}


def injected(effect_id: str) -> str:
    """What the simulated wheel is given of an effect."""
    return f"{effect_id}:" + ",".join(f"{name}={value!r}" for name, value in INJECTED[effect_id][0].items())


NAMES = [effect.id for effect in FORMULAS]


@pytest.mark.slow
@pytest.mark.parametrize(
    "effect_id",
    [pytest.param(name, marks=pytest.mark.xdist_group("rough logs")) if name in SHARED else name for name in NAMES],
)
def test_what_the_plant_has_is_named(effect_id: str) -> None:
    """The effect is named, by itself or in a group that the log cannot tell apart, with a size near the plant's."""
    if effect_id not in CATALOGUE_IDS:
        pytest.fail(f"{effect_id} has no twin in the simulated plant: add one to drivers/sim/plant_effects.py")
    if effect_id not in INJECTED:
        pytest.fail(f"{effect_id} has no amplitude here: add one of 5 to 10 % of Coulomb friction to INJECTED")
    given, sizes = INJECTED[effect_id]
    _, diagnosis = diagnosed_once(injected(effect_id))
    document = diagnosis.document()
    verdict = document["verdict"]
    assert verdict["kind"] == "effect", verdict["statement"]
    groups = [group for group in verdict["indistinguishable"] if effect_id in group]
    named = effect_id in verdict["effects"]
    assert named or any(other in verdict["effects"] for group in groups for other in group), verdict
    assert len(verdict["effects"]) == 1, verdict["statement"]
    if named:
        entry = next(item for item in document["candidates"] if item["effect"] == effect_id)
        assert entry["decision"] == "added"
        for name, share in sizes.items():
            assert math.isclose(entry["parameters"][name]["value"], given[name], rel_tol=share), entry["parameters"]
        if effect_id not in {"speed_quantisation", "drag_spike"}:
            assert document["after"]["free_run_rms_rpm"] < 1.02 * document["before"]["free_run_rms_rpm"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_a_healthy_wheel_is_not_accused(seed: int) -> None:
    """Nothing wrong, nothing found: adequate, no model written, figures after those before."""
    document = diagnose_log(log_of(simulated(seed=seed), angle=seed == 1)).document()
    assert document["verdict"]["kind"] == "adequate", document["verdict"]["statement"]
    assert document["model"] is None
    assert document["before"] == document["after"]


def test_every_effect_has_a_twin_and_an_amplitude() -> None:
    """Catalogue, plant and this walk know the same ids: a new effect that is not simulated cannot be proven."""
    assert set(NAMES) == set(CATALOGUE_IDS)
    assert set(NAMES) == set(INJECTED)
