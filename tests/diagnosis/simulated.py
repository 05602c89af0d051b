"""Records of the simulated plant, made ready for the diagnosis; the plant shares no code with the estimator."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.course.course import Course
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.drivers.sim.plant_batch import PlantRun, simulate_run
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_parameters import PlantNoise
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.filter.constants import filter_constants
from rw_ekf.likelihood.fitting import Fit, fit_model
from rw_ekf.likelihood.gauss_newton import Problem, Start, smoothed_trajectory
from rw_ekf.likelihood.linearisation import Noise, linearise
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import Record, Trajectory
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.friction import GAUSS, Stribeck
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.units import RAD_S_PER_RPM
from tools.measure.runs import OMEGA_S

RATE_HZ = 10.0
MAX_GAP_S = 2.0
TRUTH = Model(CK13_STATISTICAL, Stribeck(OMEGA_S, GAUSS))  # the healthy plant


def simulated(
    effects: Sequence[str] = (),
    *,
    seed: int,
    profile: str = "identification",
    samples: int | None = None,
    noise_rpm: float = 1.0,
    process_rpm: float = 0.0,
) -> PlantRun:
    """One run; the seed draws the noise and, for P1 and P2, the profile."""
    times, currents = sample_profile(make_profile(profile, seed=seed), RATE_HZ)
    noise = PlantNoise(noise_rpm * RAD_S_PER_RPM, process_rpm * RAD_S_PER_RPM)
    return simulate_run(parse_effects(list(effects)), currents[:samples], times[:samples], noise, seed=seed)


def record_of(run: PlantRun) -> Record:
    """The whole run as a record, temperature and angle as the plant has them."""
    course = Course.of(
        run.time_s, run.measured_speed_rad_s, run.current_command_A, None, None, run.temperature_degC, run.angle_rad
    )
    everything = np.ones(run.time_s.size, dtype=bool)
    return Record.of(
        course,
        everything,
        filter_constants(TRUTH.stribeck.omega_s, max_gap_s=MAX_GAP_S),
    )


def first_trajectory(record: Record, model: Model) -> Trajectory:
    """The readings smoothed once under a model: along the readings themselves no likelihood means anything."""
    speed = record.course.speed_rad_s
    noise = Noise(RAD_S_PER_RPM**2, 1.0e-2)
    raw = Trajectory.of_speed(speed.copy(), np.full(speed.size, RAD_S_PER_RPM))
    linearised = linearise(record, model, raw, noise, np.zeros(speed.size, dtype=bool), with_jacobian=False)
    return smoothed_trajectory(linearised, np.zeros(0), noise)


def fitted(record: Record, model: Model = TRUTH, start: Fit | None = None) -> Fit:
    """A model fitted to a record, from its readings or from where another fit ended."""
    omit = np.zeros(record.follows.size, dtype=bool)
    if start is None:
        begin = Start(model, first_trajectory(record, model), Noise(RAD_S_PER_RPM**2, 1.0e-2))
    else:
        begin = Start(model, start.trajectory, start.noise)
    return fit_model(Problem(record, DEFAULT_PRIOR, omit), begin)


def log_of(run: PlantRun, *, angle: bool = False) -> WheelLog:
    """The run as `read_log` would give it: temperature logged, the angle where it is asked for."""
    channels = {"current_command_A": run.current_command_A, "temperature_degC": run.temperature_degC}
    if angle:
        channels["angle_rad"] = run.angle_rad
    n = run.time_s.size
    return WheelLog(
        "simulated.csv",
        run.time_s.copy(),
        run.measured_speed_rad_s,
        run.current_command_A.copy(),
        "current_command_A",
        np.zeros(n),
        np.zeros(n, dtype=np.int64),
        channels,
        rows_read=n,
    )


@lru_cache
def diagnosed_once(effect: str) -> tuple[WheelLog, Diagnosis]:
    """The log of a wheel with one effect, and its diagnosis, made once for all tests of one process."""
    log = log_of(simulated([effect], seed=41), angle=effect.startswith("torque_ripple"))
    return log, diagnose_log(log)
