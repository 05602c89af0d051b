"""Four machines that are no wheels, simulated, with files of the same shape as the public records of their kind.

A motor on a dynamometer (yuvalm11/Motor-Position-Prediction): an effort of the other sign than the motion, degrees,
milliseconds. A geared motor between two voltages (nebisman/DCMotor.jl): one way, on an encoder's grid, commands a row
late. An actuated pendulum (torque_limited_simple_pendulum): gravity is a law of the angle. A brushless motor recorded
by dSPACE (brushless-DC-electric-motor-identification): structs within a struct, a speed that is held until the next
edge. All integrate by Euler's rule in small steps of their own and share no code with the estimator.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.io import savemat

from rw_ekf.arrays import Float64Array

DEG = math.pi / 180.0

DYNO_GAIN, DYNO_VISCOUS, DYNO_COULOMB = 70.5, 0.18, 28.2  # rad/s^2 at full effort, 1/s, rad/s^2
DYNO_SATURATION = 0.12  # share of the gain that is lost at full effort
PRBS_GAIN, PRBS_VISCOUS, PRBS_COULOMB, PRBS_LATE_S = 70.0, 25.0, 16.4, 0.02  # rad/s^2/V, 1/s, rad/s^2, one row
PRBS_LEVELS_V, PRBS_GRID_DEG_S = (1.4538461, 2.70493913), 6.42857
PENDULUM_GAIN, PENDULUM_VISCOUS, PENDULUM_COULOMB, GRAVITY = 2.8, 0.3, 0.6, 17.0
DSPACE_GAIN, DSPACE_VISCOUS, DSPACE_COULOMB, DSPACE_LATE_S = 4400.0, 18.0, 150.0, 0.027
DSPACE_ROW_S, DSPACE_COUNTS_RAD = 7.2e-4, 4.8975

Torque = Callable[[float, float], float]  # drive in force and angle [rad] -> acceleration without friction [rad/s^2]


def write_dyno(folder: Path, seed: int = 1, seconds: float = 260.0) -> None:
    """dyno_motor/data_concat.csv: steps of effort in tenths, held 3 to 9 s, the gain falling with the effort."""
    random = np.random.default_rng(seed)
    shares = [0.1, 0.2, 0.1, 0.3, 0.15, 0.1, 0.04, 0.01]
    gaps_ms = random.choice([16, 17, 18, 20, 22, 24, 35, 91], p=shares, size=90_000)
    stamps_ms = 1_284_857 + np.cumsum(gaps_ms)
    time_s = 1.0e-3 * (stamps_ms - stamps_ms[0])
    time_s = time_s[time_s < seconds]
    holds = _held(time_s, random, 3.0, 9.0, lambda: 0.1 * float(random.integers(-10, 11)))

    def torque(effort: float, angle: float) -> float:
        return DYNO_GAIN * effort * (1.0 - DYNO_SATURATION * abs(effort))

    speed, angle = _run(torque, DYNO_VISCOUS, DYNO_COULOMB, 1.15 * DYNO_COULOMB, time_s, holds)
    read = speed / DEG + 60.0 * random.standard_normal(time_s.size)
    acceleration = 1.0e-3 * np.gradient(read, time_s)
    table = np.column_stack((stamps_ms[: time_s.size], -holds, read, angle / DEG, acceleration))
    _save(folder / "dyno_motor", "data_concat.csv", table, "%.8g", "time,torque,rate,position,acceleration")


def write_prbs(folder: Path, seed: int = 2, seconds: float = 80.0) -> None:
    """prbs_motor/DCmotor_prbs_open_exp.csv: two voltages, each for 0.1 to 0.8 s, in force a row late."""
    random = np.random.default_rng(seed)
    time_s = 0.02 * np.arange(round(seconds / 0.02), dtype=np.float64)
    volts = _held(time_s, random, 0.1, 0.8, lambda: float(random.choice(PRBS_LEVELS_V)))
    late = np.concatenate((volts[:1], volts[:-1]))
    start = (PRBS_GAIN * volts[0] - PRBS_COULOMB) / PRBS_VISCOUS
    speed, _ = _run(lambda u, a: PRBS_GAIN * u, PRBS_VISCOUS, PRBS_COULOMB, PRBS_COULOMB, time_s, late, start)
    noisy = speed / DEG + 2.0 * random.standard_normal(time_s.size)
    read = np.asarray(PRBS_GRID_DEG_S * np.round(noisy / PRBS_GRID_DEG_S))
    table = np.column_stack((time_s, volts, read))
    _save(folder / "prbs_motor", "DCmotor_prbs_open_exp.csv", table, "%.8f", "t,u,y")


def write_pendulum(folder: Path, seed: int = 3, seconds: float = 60.0) -> None:
    """pendulum/measured_data.csv: torque in steps of 0.1 to 0.6 s about what keeps it swinging, gravity order 1."""
    random = np.random.default_rng(seed)
    time_s = 0.01 * np.arange(round(seconds / 0.01), dtype=np.float64)
    drive = _held(time_s, random, 0.1, 0.6, lambda: float(random.uniform(-5.0, 5.0)))

    def torque(wanted: float, angle: float) -> float:
        return PENDULUM_GAIN * wanted - GRAVITY * math.sin(angle)

    speed, angle = _run(torque, PENDULUM_VISCOUS, PENDULUM_COULOMB, PENDULUM_COULOMB, time_s, drive)
    read = speed + 1.0 * random.standard_normal(time_s.size)
    index = np.arange(time_s.size, dtype=np.float64)
    table = np.column_stack((index, time_s, 0.00583 * np.round(angle / 0.00583), read, drive))
    _save(folder / "pendulum", "measured_data.csv", table, "%.8g", ",time,pos,vel,torque")


def write_dspace(folder: Path, seed: int = 4, seconds: float = 24.0) -> None:
    """dspace_motor/dataset.mat: a command between two levels each way, acting late; the speed is held."""
    random = np.random.default_rng(seed)
    time_s = DSPACE_ROW_S * np.arange(round(seconds / DSPACE_ROW_S), dtype=np.float64)
    way = np.sign(np.sin(2.0 * np.pi * time_s / 4.8 + 0.3))
    command = way * _held(time_s, random, 0.06, 0.4, lambda: float(random.choice([0.5, 0.6, 0.75])))
    command[((time_s % 2.4) > 2.0) | (time_s < 0.2)] = 0.0
    rows_late = round(DSPACE_LATE_S / DSPACE_ROW_S)
    late = np.concatenate((np.zeros(rows_late), command[:-rows_late]))
    speed, angle = _run(
        lambda u, a: DSPACE_GAIN * u, DSPACE_VISCOUS, DSPACE_COULOMB, 1.3 * DSPACE_COULOMB, time_s, late, step_s=2.4e-4
    )
    counts = np.floor(DSPACE_COUNTS_RAD * angle)
    renewed = np.maximum.accumulate(np.where(np.arange(time_s.size) % 14 == 0, np.arange(time_s.size), 0))
    noisy = speed + 0.8 * random.standard_normal(time_s.size)
    kinds = ('"Model Root"/"Sum3"/"Out1"', '"Model Root"/"Switch"/"Out1"', '"Model Root"/"Switch2"/"Out1"')
    channels = np.zeros((1, 3), dtype=[(name, object) for name in ("Name", "Type", "Data", "Unit", "XIndex")])
    for number, (name, values) in enumerate(zip(kinds, (counts, noisy[renewed], command), strict=True)):
        channels[0, number] = (name, 2, values.astype(np.float32)[None, :], "", 1)
    recording = {
        "X": {"Name": "", "Type": 4, "Data": time_s[None, :], "Unit": ""},
        "Y": channels,
        "Capture": {"Length": float(time_s[-1]), "Downsampling": 6, "SamplingPeriod": 1.2e-4},
    }
    (folder / "dspace_motor").mkdir(parents=True)
    savemat(folder / "dspace_motor" / "dataset.mat", {"cigan": recording})


def _held(
    time_s: Float64Array, random: np.random.Generator, low_s: float, high_s: float, draw: Callable[[], float]
) -> Float64Array:
    """Values drawn anew after times between two bounds, (n,)."""
    out, value, until = np.empty(time_s.size), draw(), random.uniform(low_s, high_s)
    for i, now in enumerate(time_s.tolist()):
        if now >= until:
            value, until = draw(), now + random.uniform(low_s, high_s)
        out[i] = value
    return out


def _run(
    torque: Torque, viscous: float, coulomb: float, static: float, time_s: Float64Array, drive: Float64Array,
    speed_rad_s: float = 0.0, step_s: float = 1.0e-3,
) -> tuple[Float64Array, Float64Array]:  # fmt: skip
    """True speed and angle at each row (n,); the drive of a row holds until the next. Dry friction holds at rest."""
    omega, angle = speed_rad_s, 0.0
    speeds, angles = np.empty(time_s.size), np.empty(time_s.size)
    for i, now in enumerate(time_s.tolist()):
        speeds[i], angles[i] = omega, angle
        if i + 1 == time_s.size:
            break
        steps = max(1, round((float(time_s[i + 1]) - now) / step_s))
        h, wanted = (float(time_s[i + 1]) - now) / steps, float(drive[i])
        for _ in range(steps):
            free = torque(wanted, angle)
            if omega == 0.0 and abs(free) <= static:
                continue
            along = math.copysign(1.0, omega if omega != 0.0 else free)
            new = omega + h * (free - viscous * omega - along * coulomb)
            new = 0.0 if new * omega < 0.0 else new
            angle += 0.5 * h * (omega + new)
            omega = new
    return speeds, angles


def _save(folder: Path, name: str, table: Float64Array, style: str, header: str) -> None:
    folder.mkdir(parents=True)
    np.savetxt(folder / name, table, style, ",", header=header, comments="")
