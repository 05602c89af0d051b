"""From a case to the log of its wheel, and how much of its effect the data hold at all.

The wheel is that of drivers/sim, which shares no line with the estimator, or MuJoCo's (mujoco.py). What
can be seen at all is reckoned on the same plant: the excess chi-square that remains when a healthy wheel, its four
parameters refitted, has imitated the noiseless record as well as it can.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from rw_ekf.arrays import Float64Array
from rw_ekf.drivers.sim.plant_batch import PlantRun, simulate_run
from rw_ekf.drivers.sim.plant_parameters import FINE_STEP_S, PlantNoise, PlantParameters
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.logs.writer import SampleWriter
from rw_ekf.records import IssuedCommand, WheelSample
from rw_ekf.units import RAD_S_PER_RPM
from tools.proof.cases import Case
from tools.proof.mujoco import foreign_run
from tools.proof.sizes import RATE_HZ, commands

# Noncentrality of one degree of freedom that is found with 90 % power at 1 % false alarm: (2.576 + 1.282)^2.
SEEN_CHI_SQUARE = 14.9
_FIT_STEP_S = 1.0e-3
_FIT_ITERATIONS = 12
_TEMPERATURE_GRID_K = 0.01  # as the wire carries it
_CURRENT_GRID_A = 1.0e-4


def run_of(case: Case) -> PlantRun:
    """Simulate the case's wheel."""
    time_s, current_A = schedule(case)
    if case.plant != "own":
        return foreign_run(case, time_s, current_A)
    return simulate_run(
        case.parameters,
        current_A,
        time_s,
        case.noise,
        seed=case.seed,
        command_delay_s=case.delay_s,
        initial_speed_rad_s=case.initial_rpm * RAD_S_PER_RPM,
    )


def schedule(case: Case) -> tuple[Float64Array, Float64Array]:
    """Sample times, with their jitter, and the currents commanded at them, both (n,)."""
    nominal_s, current_A = commands(case.profile, case.profile_seed)
    if case.jitter_s == 0.0:
        return nominal_s, current_A
    early_late = np.random.default_rng([case.seed, 1]).standard_normal(nominal_s.size)
    time_s = nominal_s + np.clip(case.jitter_s * early_late, -0.3 / RATE_HZ, 0.3 / RATE_HZ)
    time_s[0] = 0.0
    return time_s, current_A


def log_of(case: Case, run: PlantRun | None = None) -> WheelLog:
    """The log as `read_log` would give it."""
    run = run_of(case) if run is None else run
    n = run.time_s.size
    channels = {"current_command_A": run.current_command_A}
    if case.telemetry:
        channels["current_A"] = np.round(run.current_A / _CURRENT_GRID_A) * _CURRENT_GRID_A
        channels["temperature_degC"] = np.round(run.temperature_degC / _TEMPERATURE_GRID_K) * _TEMPERATURE_GRID_K
    if case.angle != "none":
        channels["angle_rad"] = run.angle_rad if case.angle == "counted" else np.mod(run.angle_rad, 2.0 * np.pi)
    return WheelLog(
        name=f"{case.name}.csv",
        time_s=run.time_s.copy(),
        speed_rad_s=run.measured_speed_rad_s,
        current_A=run.current_command_A.copy(),
        drive="current_command_A",
        command_delay_s=np.full(n, run.command_delay_s),
        segment=np.zeros(n, dtype=np.int64),
        channels=channels,
        rows_read=n,
    )


def save_log(log: WheelLog, path: str) -> None:
    """Write the log as the daemon would. Raises BadInputError where the file exists already."""

    def optional(name: str) -> list[float | None]:
        values = log.channels.get(name)
        return [None] * len(log) if values is None else [float(value) for value in values]

    measured, warmth, angle = optional("current_A"), optional("temperature_degC"), optional("angle_rad")
    with SampleWriter(path) as writer:
        for i in range(len(log)):
            sample = WheelSample(
                float(log.time_s[i]),
                float(log.speed_rad_s[i]),
                current_A=measured[i],
                temperature_degC=warmth[i],
                angle_rad=angle[i],
            )
            writer.write(sample, IssuedCommand(float(log.current_A[i]), float(log.command_delay_s[i])))


def excess_chi_square(case: Case) -> float | None:
    """What the case's effects leave beyond the best imitation by a healthy wheel, in chi-square [-].

    With process noise the residual is whitened by the steady Kalman filter of a random walk first. A grid shows in the
    values, not in the motion: it counts as seen where it is coarser than the noise. None for a healthy wheel of the own
    plant, where it is nothing by construction.
    """
    if not case.effects and case.plant == "own":
        return None
    variance = (case.noise_rpm**2 + case.grid_rpm**2 / 12.0) * RAD_S_PER_RPM**2
    if case.effects and case.effects[0].startswith("speed_quantisation") and len(case.effects) == 1:
        return float(SEEN_CHI_SQUARE * (case.parameters.speed_grid_rad_s / RAD_S_PER_RPM / case.noise_rpm) ** 2)
    gain, factor = _random_walk_filter(case.process_rpm * RAD_S_PER_RPM, variance)

    def whitened(columns: Float64Array) -> Float64Array:
        if gain == 0.0:
            return columns
        return np.asarray(lfilter([1.0, -1.0], [1.0, gain - 1.0], columns, axis=0), dtype=np.float64)

    truth = _truth(case)
    p = np.array([case.wheel.motor_gain, case.wheel.viscous, case.wheel.coulomb, case.wheel.static])
    steps = 1.0e-4 * np.array([p[0], p[1], p[2], p[2]])
    misfit = whitened(truth - _imitation(case, p))
    loss, damping = float(misfit @ misfit), 1.0e-3
    for _ in range(_FIT_ITERATIONS):
        slopes = [
            (_imitation(case, p + step) - _imitation(case, p - step)) / (2.0 * step.max()) for step in np.diag(steps)
        ]
        jacobian = whitened(np.column_stack(slopes)) * steps
        normal = jacobian.T @ jacobian
        change = np.linalg.solve(normal + np.diag(damping * np.diag(normal) + 1e-30), jacobian.T @ misfit) * steps
        trial = whitened(truth - _imitation(case, p + change))
        trial_loss = float(trial @ trial)
        if trial_loss < loss:
            done = loss - trial_loss < 1.0e-3 * loss
            p, misfit, loss, damping = p + change, trial, trial_loss, 0.2 * damping
            if done:
                break
        else:
            damping *= 10.0
    return loss / (variance * factor)


def _random_walk_filter(process_rad_s: float, variance: float) -> tuple[float, float]:
    """Steady gain of the filter for a random walk read with `variance`, and innovation variance over `variance`."""
    added = process_rad_s**2 / RATE_HZ
    predicted = 0.5 * (added + np.sqrt(added**2 + 4.0 * added * variance))
    return float(predicted / (predicted + variance)), float((predicted + variance) / variance)


def _imitation(case: Case, p: Float64Array) -> Float64Array:
    return _noiseless(case, case.wheel._replace(motor_gain=p[0], viscous=p[1], coulomb=p[2], static=p[3]))


def _truth(case: Case) -> Float64Array:
    """What would be read of the case's own wheel without any noise and grid, (n,)."""
    if case.plant == "own":
        return _noiseless(case, case.parameters)
    return run_of(replace(case, noise_rpm=0.0, process_rpm=0.0)).speed_rad_s


def _noiseless(case: Case, parameters: PlantParameters) -> Float64Array:
    """Readings without any noise and grid, (n,)."""
    time_s, current_A = schedule(case)
    run = simulate_run(
        parameters._replace(speed_grid_rad_s=0.0),
        current_A,
        time_s,
        PlantNoise(0.0),
        seed=case.seed,
        command_delay_s=case.delay_s,
        initial_speed_rad_s=case.initial_rpm * RAD_S_PER_RPM,
        fine_step_s=_FIT_STEP_S if parameters.presliding_rad == 0.0 else FINE_STEP_S,
    )
    return run.measured_speed_rad_s
