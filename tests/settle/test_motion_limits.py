"""A designed motion keeps to the limits: as it is made, on a wheel that is not what it is believed to be, and hot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.drivers.sim.plant_parameters import PlantParameters
from rw_ekf.errors import RwEkfError
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.settings.load import load_configuration
from rw_ekf.settings.schema import Configuration
from rw_ekf.settle.motion_limits import MotionLimits, refuse_hot
from rw_ekf.settle.named_moves import Bounds, currents, draw_move
from rw_ekf.settle.predicted import Scene
from rw_ekf.settle.standing_explanations import Standing, standing_of_document
from rw_ekf.units import RAD_S_PER_RPM
from tests.live.bench import write_config
from tests.settle.rig import designed, run
from tests.settle.standing import LAG_OR_DELAY

SPEED_RPM, CURRENT_A, SLEW_A_PER_S = 600.0, 0.3, 2.0


def standing() -> Standing:
    """A lag or a delay."""
    return standing_of_document("diagnosis.json", LAG_OR_DELAY)


def configured(directory: Path) -> Configuration:
    """Narrow limits, 10 Hz."""
    limits = {"speed_rpm": SPEED_RPM, "current_A": CURRENT_A, "slew_A_per_s": SLEW_A_PER_S}
    path = write_config(directory, str(directory / "nowhere"), limits=limits, loop={"rate_hz": 10.0})
    return load_configuration(path)


def test_currents_of_any_motion_keep_to_current_and_slew() -> None:
    """Two hundred motions drawn at random."""
    draws = np.random.default_rng(5)
    bounds = Bounds(current_A=0.25, step_A=0.08, speed_rad_s=80.0, period_s=0.1, ticks=600)
    for _ in range(200):
        made = currents([draw_move(draws, CK13_STATISTICAL, bounds) for _ in range(60)], CK13_STATISTICAL, bounds)
        assert np.max(np.abs(made)) <= bounds.current_A
        assert np.max(np.abs(np.diff(made, prepend=0.0))) <= bounds.step_A * (1.0 + 1.0e-9)


@pytest.mark.parametrize(("gain", "friction"), [(1.0, 1.0), (1.5, 0.5), (0.6, 1.5)])
def test_the_limits_are_held_on_a_wheel_that_is_not_what_it_is_believed_to_be(
    tmp_path: Path, gain: float, friction: float
) -> None:
    """From 400 rpm: braked to rest first; then never above the limit of speed, current and slew as they are set."""
    configuration = configured(tmp_path)
    plan, usual = designed(standing(), configuration), PlantParameters()
    plant = usual._replace(
        motor_gain=gain * usual.motor_gain,
        viscous=friction * usual.viscous,
        coulomb=friction * usual.coulomb,
        static=friction * usual.static,
    )
    log = run(configuration, plan, plant, 400.0)
    assert np.max(np.abs(log.speed_rad_s)) <= SPEED_RPM * RAD_S_PER_RPM
    assert np.max(np.abs(log.current_A)) <= CURRENT_A
    steps = np.abs(np.diff(log.current_A))[log.current_A[1:] != 0.0]  # zero is exempt
    assert np.max(steps) <= 1.05 * SLEW_A_PER_S / configuration.loop.rate_hz
    size = plan.design.current_A.size
    matches = [
        np.max(np.abs(log.current_A[at : at + size - 1] - plan.design.current_A[:-1]))
        for at in range(len(log) - size + 1)
    ]
    began = int(np.argmin(matches))
    assert began > 20
    assert np.all(np.abs(log.speed_rad_s[began - 10 : began]) < 5.0 * RAD_S_PER_RPM)
    if (gain, friction) == (1.0, 1.0):
        assert min(matches) < 1.0e-9
        off = log.speed_rad_s[began : began + size] - plan.speed_rad_s
        assert np.sqrt(np.mean(off**2)) < 6.0 * RAD_S_PER_RPM


def test_what_is_predicted_stays_below_the_limit_with_room(tmp_path: Path) -> None:
    """Every explanation's path, and that of a wheel with more gain and less friction."""
    configuration = configured(tmp_path)
    plan = designed(standing(), configuration)
    assert np.max(np.abs(plan.speed_rad_s)) <= 0.85 * SPEED_RPM * RAD_S_PER_RPM
    assert MotionLimits.of(configuration).kept(plan.scene, plan.design.current_A)
    strong = np.full(plan.design.current_A.size, CURRENT_A)
    assert not MotionLimits.of(configuration).kept(plan.scene, strong)


def test_a_hot_wheel_is_not_moved(tmp_path: Path) -> None:
    """A record that ended near the limit of temperature is refused, with what to do."""
    hot = replace(standing(), temperature_degC=58.5)
    with pytest.raises(RwEkfError, match="cool down"):
        refuse_hot(Scene(hot, 0.1), configured(tmp_path))
