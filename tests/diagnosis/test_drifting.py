"""What drifts: only dry friction is called a drift of dry friction, and what changes is called a change."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.units import RAD_S_PER_RPM
from tests.diagnosis.simulated import log_of

pytestmark = pytest.mark.slow


def changed(first: PlantParameters, second: PlantParameters, seed: int) -> WheelLog:
    """Identification with one wheel for the first 30 % of the time, and another, from the speed that it had then."""
    time_s, current_A = (
        np.array(column) for column in sample_profile(make_profile("identification", seed=seed), 10.0)[:2]
    )
    then, noise = 3 * time_s.size // 10, PlantNoise(RAD_S_PER_RPM)
    one = simulate_run(first, current_A[: then + 1], time_s[: then + 1], noise, seed=seed)
    two = simulate_run(
        second, current_A[then:], time_s[then:], noise, seed=seed + 1, initial_speed_rad_s=float(one.speed_rad_s[-1])
    )
    whole = log_of(simulate_run(first, current_A, time_s, noise, seed=seed))
    return replace(
        whole, speed_rad_s=np.concatenate((one.measured_speed_rad_s[:then], two.measured_speed_rad_s)), channels={}
    )


@pytest.mark.parametrize(("what", "kind"), [("viscous", "viscous_drag"), ("offset_rad_s2", "torque")])
def test_a_change_of_something_else_is_no_drift_of_dry_friction(what: str, kind: str) -> None:
    """Viscous friction that trebles, or a torque of 8 % that sets in, is told with its time and its size."""
    wheel = PlantParameters()
    size = {"viscous": 2.0 * wheel.viscous, "offset_rad_s2": 0.08 * wheel.coulomb}[what]
    log = changed(wheel, wheel._replace(**{what: getattr(wheel, what) + size}), 2)
    document = diagnose_log(log).document()
    assert document["verdict"]["effects"] == ["change"], document["verdict"]["statement"]
    found = next(item for item in document["candidates"] if item["effect"] == "change")["parameters"]
    assert found["what"]["value"] == kind
    assert found["begins_at"]["value"] == pytest.approx(log.time_s[3 * len(log) // 10], abs=3.0)
    assert found["size"]["value"] == pytest.approx(size, abs=5.0 * found["size"]["std"])


def test_dry_friction_that_changes_is_named() -> None:
    """The same with dry friction up by 8 %: a drift, or a spike that lasts."""
    wheel = PlantParameters()
    rough = wheel._replace(coulomb=1.08 * wheel.coulomb, static=1.08 * wheel.static)
    verdict = diagnose_log(changed(wheel, rough, 1)).document()["verdict"]
    assert verdict["kind"] == "effect"
    assert {"coulomb_drift", "drag_spike"} & set(verdict["effects"])
