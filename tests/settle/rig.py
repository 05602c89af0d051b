"""A designed motion through the daemon's own loop and guard, on a simulated wheel and a virtual clock."""

from __future__ import annotations

from rw_ekf.clock import VirtualClock
from rw_ekf.drivers.sim.plant_batch import compiled_advance
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.drivers.sim.simulated_wheel import SimulatedProtocol, SimulatedWheel
from rw_ekf.learning.run_start import GivenModel
from rw_ekf.live.daemon import Task, run_daemon
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.logs.reader import read_log
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.settings.schema import Configuration
from rw_ekf.settle.motion_limits import MotionLimits, bounds_of
from rw_ekf.settle.predicted import Scene
from rw_ekf.settle.search import design_motion
from rw_ekf.settle.settle_plan import Plan, commander_for
from rw_ekf.settle.standing_explanations import Standing
from rw_ekf.units import RAD_S_PER_RPM
from tests.live.daemon import Notes


def designed(standing: Standing, configuration: Configuration, *, looked_at: int = 12) -> Plan:
    """A motion from a short search."""
    scene = Scene(standing, 1.0 / configuration.loop.rate_hz)
    design = design_motion(
        scene, CK13_STATISTICAL, bounds_of(configuration), MotionLimits.of(configuration), 3, looked_at=looked_at
    )
    assert design is not None
    return Plan(scene, design)


def run(configuration: Configuration, plan: Plan, plant: PlantParameters, speed_rpm: float) -> WheelLog:
    """The log of a run; the wheel turns at a speed when it begins."""
    clock = VirtualClock()
    wheel = SimulatedWheel(
        plant,
        noise=PlantNoise(RAD_S_PER_RPM),
        seed=7,
        initial_speed_rad_s=speed_rpm * RAD_S_PER_RPM,
        clock=clock,
        law=compiled_advance,
    )
    with StopSignal() as stop:
        outcome = run_daemon(
            Task(
                configuration,
                SimulatedProtocol(wheel),
                GivenModel(None, None),
                None,
                commander_for(plan, configuration),
            ),
            Notes(),
            stop,
            clock,
        )
    return read_log(outcome.files.log)
