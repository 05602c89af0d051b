"""Two machines that are no wheels, simulated, with files of the same shape as the public records of their kind.

A ball-screw carriage as in EMPS (Janot, Gautier, Brunot 2019): position loop, 1 kHz, friction differs by direction.
A bare rotor with cogging on an ODrive (gchenfc/ODrive, analysis/cogging_torque): steps of current, 1.3 kHz, counts.
Both integrate by the midpoint rule in steps of their own and share no code with the estimator.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from scipy.io import savemat

from rw_ekf.arrays import Float64Array

MASS_KG, COULOMB_N = 95.109, 20.39
VISCOUS_N_S_M = (
    185.1,
    221.9,
)  # forward, backward; they differ, as does the offset from zero, half as much as published
OFFSET_N = 1.6
FORCE_N_V = 35.15065188
ENCODER_STEP_M = 5.0e-8

ROTOR_GAIN_RAD_S2_A = 30.0
ROTOR_FRICTION_A, ROTOR_VISCOUS_1_S = 0.3, 0.1
COGGING_A, COGGING_ORDER = 0.4, 7
COUNTS = 8192
SEGMENTS, SEGMENT_ROWS, ROWS_AT_REST = 50, 1300, 25


def write_carriage(folder: Path) -> None:
    """emps/DATA_EMPS.mat at 1 kHz, and its copy at 100 Hz: mean force until the next row, backward difference."""
    time_s, position_m, voltage_V = _carriage()
    folder.mkdir(parents=True)
    vectors = {"t": time_s, "qm": position_m, "vir": voltage_V}
    savemat(
        folder / "DATA_EMPS.mat", {name: v[:, None] for name, v in vectors.items()} | {"gtau": FORCE_N_V, "kp": 160.18}
    )
    rows = time_s.size // 10
    force = FORCE_N_V * voltage_V[: 10 * rows].reshape(rows, 10).mean(axis=1)
    position = position_m[: 10 * rows : 10]
    speed = np.diff(position, prepend=position[0]) / 0.01
    table = np.column_stack((time_s[: 10 * rows : 10], force, position, speed))
    np.savetxt(
        folder / "DATA_EMPS_100Hz.csv", table, "%.8f", ",", header="t_s,force_N,position_m,speed_m_s", comments=""
    )


def write_rotor(folder: Path, trial: str, seed: int, *, compensated: bool) -> None:
    """A trial's cells, 4 channels x 50 segments, and the copy of it at 100 Hz, whose speed comes from the angle."""
    segments = _rotor(np.random.default_rng(seed), compensated)
    folder.mkdir(parents=True, exist_ok=True)
    cells = np.empty((4, SEGMENTS), dtype=object)
    copies = []
    for i, (set_A, time_s, counts, current_A) in enumerate(segments):
        cells[:, i] = [np.array([[abs(set_A)]]), time_s[:, None], counts[:, None], current_A[:, None]]
        grid_s = np.arange(time_s[0], time_s[-1], 0.01)
        angle = 2.0 * np.pi / COUNTS * np.interp(grid_s, time_s, counts)
        current = np.interp(grid_s, time_s, current_A)
        speed = np.diff(angle, prepend=np.nan) / 0.01
        same = np.ones(grid_s.size)
        copies.append(np.column_stack((i * same, grid_s, abs(set_A) * same, current, angle, speed)))
    savemat(folder / f"spinup_{trial}.mat", {"data": cells})
    header = "segment,t_s,set_current_A,iq_meas_A,angle_rad,speed_rad_s"
    formats = ["%d", *["%.6f"] * 5]
    np.savetxt(folder / f"spinup_{trial}_100Hz.csv", np.vstack(copies), formats, ",", header=header, comments="")


def _carriage() -> tuple[Float64Array, Float64Array, Float64Array]:
    """Time [s], position by the encoder [m] and drive [V], (24840,): ramps of 1 m/s^2 to speeds there and back."""
    time_s = 1.0e-3 * np.arange(24_840, dtype=np.float64)
    goals_m_s = np.repeat(6 * [0.125, -0.125, 0.08, -0.08, 0.04, -0.04], 690)
    position, speed, wanted_m, wanted_m_s = 0.12, 0.0, 0.12, 0.0
    before = position
    positions, voltages = np.empty(time_s.size), np.empty(time_s.size)
    for i, goal in enumerate(goals_m_s.tolist()):
        wanted_m_s += min(max(goal - wanted_m_s, -1.0e-3), 1.0e-3)
        wanted_m += 1.0e-3 * wanted_m_s
        read = ENCODER_STEP_M * round(position / ENCODER_STEP_M)
        force = 1.2e5 * (wanted_m - read) + 4.0e3 * (wanted_m_s - (read - before) / 1.0e-3)
        voltage = min(max(force / FORCE_N_V, -5.0), 5.0)
        before, positions[i], voltages[i] = read, read, voltage
        for _ in range(5):
            half = speed + 1.0e-4 * _carriage_acceleration(speed, FORCE_N_V * voltage)
            position += 2.0e-4 * half
            speed += 2.0e-4 * _carriage_acceleration(half, FORCE_N_V * voltage)
    return time_s, positions, voltages


def _carriage_acceleration(speed_m_s: float, force_N: float) -> float:
    viscous = VISCOUS_N_S_M[speed_m_s < 0.0]
    dry = COULOMB_N * math.tanh(speed_m_s / 1.0e-3)
    return (force_N + OFFSET_N - viscous * speed_m_s - dry) / MASS_KG


def _rotor(rng: np.random.Generator, compensated: bool) -> list[tuple[float, Float64Array, Float64Array, Float64Array]]:
    """Of each segment: current asked for [A], time [s], position [counts], measured current [A]."""
    segments = []
    angle, speed = 0.0, 0.0
    for i in range(SEGMENTS):
        wanted = 2.4 * (i // 2) / (SEGMENTS // 2 - 1) * (-1.0) ** i
        time_s = np.cumsum(rng.uniform(0.9, 1.1, SEGMENT_ROWS)) / 1300.0
        counts, currents = np.empty(SEGMENT_ROWS), np.empty(SEGMENT_ROWS)
        last_s = 0.0
        for row, now_s in enumerate(time_s.tolist()):
            cogging = COGGING_A * math.sin(COGGING_ORDER * angle)
            current = (wanted if row >= ROWS_AT_REST else 0.0) + (cogging if compensated else 0.0)
            step_s = now_s - last_s
            half = speed + 0.5 * step_s * _rotor_acceleration(angle, speed, current)
            angle += step_s * half
            speed += step_s * _rotor_acceleration(angle - 0.5 * step_s * half, half, current)
            last_s = now_s
            counts[row], currents[row] = math.floor(angle * COUNTS / (2.0 * math.pi)), current
        segments.append((wanted, time_s, counts, currents + 0.03 * rng.standard_normal(SEGMENT_ROWS)))
    return segments


def _rotor_acceleration(angle_rad: float, speed_rad_s: float, current_A: float) -> float:
    torque_A = current_A - COGGING_A * math.sin(COGGING_ORDER * angle_rad)
    dry_A = ROTOR_FRICTION_A * math.tanh(speed_rad_s / 0.05)
    return ROTOR_GAIN_RAD_S2_A * (torque_A - dry_A) - ROTOR_VISCOUS_1_S * speed_rad_s
