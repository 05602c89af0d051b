"""Logs for the tests of the command line: simulated from a seed, written as files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.model.state import CK13_STATISTICAL, FrictionParameters
from tests.truth import fine_trajectory, run_of

HEADER = "time_s,speed_rad_s,current_command_A"


def write_log(path: Path, columns: Sequence[Float64Array], header: str = HEADER) -> Path:
    """Write columns as CSV, floats exactly; NaN becomes an empty field."""
    rows = (",".join("" if np.isnan(v) else repr(float(v)) for v in row) for row in zip(*columns, strict=True))
    path.write_text(header + "\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def profile_log(path: Path, profile: str = "P2", seed: int = 4, samples: int | None = None) -> Path:
    """A published profile on the wheel of [CK13], readings with 1 rpm of noise."""
    run = run_of(profile, seed)
    return write_log(path, [v[:samples] for v in (run.time_s, run.reading_rad_s, run.current_A)])


def plant_columns(
    profile: str = "P2", effects: Sequence[str] = (), *, seed: int = 4, initial_speed_rad_s: float = 0.0
) -> dict[str, Float64Array]:
    """The driver's plant, which shares no line with the estimator, through a profile at 10 Hz, 1 rpm of noise."""
    time_s, current_A = (np.array(v) for v in sample_profile(make_profile(profile, seed=seed), 10.0, 300.0))
    run = simulate_run(
        parse_effects(list(effects)), current_A, time_s, seed=seed, initial_speed_rad_s=initial_speed_rad_s
    )
    return {"time_s": time_s, "speed_rad_s": run.measured_speed_rad_s, "current_command_A": current_A}


def write_columns(path: Path, columns: dict[str, Float64Array]) -> Path:
    """Write columns under their names."""
    return write_log(path, list(columns.values()), ",".join(columns))


def coast_log(path: Path, seed: int = 1) -> Path:
    """A coast-down from 200 rad/s, no current: nothing in it says what a current does."""
    time_s = 0.1 * np.arange(2000, dtype=np.float64)
    current = np.zeros(time_s.size)
    speed = fine_trajectory(CK13_STATISTICAL, time_s, current, initial_speed_rad_s=200.0)
    return write_log(path, [time_s, speed + 0.1 * np.random.default_rng(seed).standard_normal(time_s.size), current])


def experiments_log(path: Path, seed: int = 2) -> Path:
    """Three drives up in steps from rest and three coast-downs to rest, as the deterministic method wants them."""
    pieces = []
    for level in (0.15, 0.25, -0.2):
        pieces += [np.linspace(0.0, 0.25 * level, 100), np.full(400, level), np.zeros(1700)]
    current: Float64Array = np.concatenate(pieces)
    time_s = 0.1 * np.arange(current.size, dtype=np.float64)
    speed = fine_trajectory(CK13_STATISTICAL, time_s, current)
    return write_log(path, [time_s, speed + 0.1 * np.random.default_rng(seed).standard_normal(time_s.size), current])


def carriage_log(path: Path, seed: int = 3) -> Path:
    """A carriage of 95 kg on a rail, driven by newtons at 1 kHz, at about 0.1 m/s (EMPS-like); columns t, v, force."""
    time_s = 1e-3 * np.arange(20_000, dtype=np.float64)
    truth = FrictionParameters(1.0 / 95.0, 214.0 / 95.0, 20.0 / 95.0, 21.0 / 95.0)
    force = 55.0 * np.sign(np.sin(2.0 * np.pi * time_s / 4.0)) + 12.0 * np.sin(2.0 * np.pi * time_s / 0.9)
    speed = fine_trajectory(truth, time_s, force, omega_s=0.002)
    noise = 2e-5 * np.random.default_rng(seed).standard_normal(time_s.size)
    return write_log(path, [time_s, speed + noise, force], "t,v,force")


CARRIAGE_MAP = "time_s: {column: t}\nspeed_rad_s: {column: v}\ncurrent_command_A: {column: force}\n"
