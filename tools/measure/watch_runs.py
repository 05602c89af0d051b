"""Simulated wheels under watch, fast: the plant and the filter compiled, then the watch itself, sample by sample.

The compiled pass and the online estimator agree to rounding (tests/watch/test_observation.py holds this stream
against the daemon's), so that hours of a loop take seconds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.course.course import Course
from rw_ekf.drivers.sim.plant_batch import PlantRun, simulate_run
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_parameters import QUICK_STEP_S, PlantNoise, PlantParameters
from rw_ekf.filter import gating
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.filter.constants import FilterConstants, filter_constants
from rw_ekf.filter.estimator import OUTCOMES
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.records import Estimate, Innovation, IssuedCommand, Tick, WheelSample, WheelState
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.watch.alarms import Alarm
from rw_ekf.watch.wheel_watch import WatchedFilter, WatchKnobs, WheelWatch

RATE_HZ = 10.0
COMMAND_DELAY_S = 0.01
OMEGA_S = 4.0 * RAD_S_PER_RPM
INERTIA_KG_M2 = 1.5e-3
# Wheels that run at one speed, swing about one, creep through zero, reverse often, and are put through everything.
PROFILES: dict[str, tuple[str, dict[str, Any]]] = {
    "steady": ("sine", {"amplitude_A": 0.0, "bias_A": 0.08}),
    "biased": ("sine", {"amplitude_A": 0.03, "bias_A": 0.1, "period_s": 60.0}),
    "S1": ("S1", {}),
    "S3": ("S3", {}),
    "S4": ("S4", {}),
    "sine": ("sine", {}),
    "steps": ("steps", {}),
    "random-sines": ("random-sines", {"amplitude_A": 0.12, "period_s": 25.0}),
    "P1": ("P1", {}),
    "P2": ("P2", {}),
    "identification": ("identification", {}),
}


@dataclass(frozen=True)
class Heard:
    """An alarm, and the time of the sample that raised, renamed or ended it [s]."""

    time_s: float
    alarm: Alarm


def commands(profile: str, hours: float, seed: int) -> tuple[Float64Array, Float64Array]:
    """Times [s] and currents [A] of a profile, (n,) each; one that ends is begun again."""
    name, shape = PROFILES[profile]
    made = make_profile(name, seed=seed, **shape)
    duration_s = 3600.0 * hours
    time_s, current_A = sample_profile(made, RATE_HZ, duration_s)
    n = round(duration_s * RATE_HZ)
    return np.arange(n) / RATE_HZ, np.resize(np.array(current_A), n) if len(time_s) < n else np.array(current_A)


def drawn_wheel(seed: int, share: float = 0.5) -> PlantParameters:
    """A wheel drawn around [CK13] with `share` of the default prior's spread."""
    spread = np.linalg.cholesky(DEFAULT_PRIOR.parameter_covariance)
    drawn = np.array(CK13_STATISTICAL) + share * spread @ np.random.default_rng(1000 + seed).standard_normal(4)
    k, b, c, s = np.maximum(drawn, [5.0, 1.0e-4, 0.1, 0.1])
    return PlantParameters(motor_gain=float(k), viscous=float(b), coulomb=float(c), static=float(max(s, c)))


def simulated(
    wheel: PlantParameters,
    time_s: Float64Array,
    current_A: Float64Array,
    seed: int,
    *,
    noise_rpm: float = 1.0,
    effect: str | None = None,
    from_s: float = 0.0,
) -> PlantRun:
    """One run of the plant; the effect, written as `simulate --effect` takes it, sets in at from_s [s]."""
    noise = PlantNoise(noise_rpm * RAD_S_PER_RPM)
    common: dict[str, Any] = {"command_delay_s": COMMAND_DELAY_S, "fine_step_s": QUICK_STEP_S}
    other = wheel if effect is None else parse_effects([effect], wheel)
    if from_s <= 0.0:
        return simulate_run(other, current_A, time_s, noise, seed=seed, **common)
    cut = round(from_s * RATE_HZ)
    first = simulate_run(wheel, current_A[:cut], time_s[:cut], noise, seed=seed, **common)
    second = simulate_run(
        other, current_A[cut - 1 :], time_s[cut - 1 :], noise, seed=seed + 1_000_000,
        initial_speed_rad_s=float(first.speed_rad_s[-1]),
        initial_temperature_degC=float(first.temperature_degC[-1]), **common,
    )  # fmt: skip
    joined: dict[str, Any] = {
        name: np.concatenate((getattr(first, name), getattr(second, name)[1:]))
        for name in ("time_s", "current_command_A", "measured_speed_rad_s", "speed_rad_s", "temperature_degC")
    }
    return replace(first, **joined)


def filtered(run: PlantRun, noise_rpm: float = 1.0) -> tuple[FilterConstants, FilterRun]:
    """Filter a run as the daemon would with its default prior; noise_rpm: what the configuration says."""
    delay_s = np.full(run.time_s.size, run.command_delay_s)
    course = Course.of(run.time_s, run.measured_speed_rad_s, run.current_command_A, delay_s)
    constants = filter_constants(OMEGA_S, speed_noise_rad_s=noise_rpm * RAD_S_PER_RPM)
    return constants, filter_log(course, constants, DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance, keep_states=True)


def stream(run: PlantRun, constants: FilterConstants, done: FilterRun) -> Iterator[Tick]:
    """What the daemon's sinks would have been given."""
    columns = zip(
        run.time_s.tolist(), run.measured_speed_rad_s.tolist(), run.current_command_A.tolist(),
        run.temperature_degC.tolist(),
        done.innovation_rad_s.tolist(), done.innovation_variance.tolist(), done.outcome.tolist(),
        done.states.tolist(), done.stds.tolist(), strict=True,
    )  # fmt: skip
    for time_s, reading, current_A, warmth, innovation, variance, code, mean, std in columns:
        tested = code in (gating.UPDATED, gating.GATED, gating.RESEEDED) and not math.isnan(innovation)
        accepted = code == gating.UPDATED
        test = None
        if tested:
            root = math.sqrt(variance)
            test = Innovation(time_s, innovation, root, innovation**2 / variance, constants.gate, accepted)
        state = WheelState(*mean)
        predicted = reading - innovation if tested else state.speed_rad_s
        estimate = Estimate(time_s, OUTCOMES[code], state, WheelState(*std), test, predicted)
        speed = None if math.isnan(reading) else reading
        sample = WheelSample(time_s, speed, temperature_degC=warmth)
        yield Tick(sample, estimate, IssuedCommand(current_A, run.command_delay_s))


def watch_of(constants: FilterConstants, knobs: WatchKnobs | None = None) -> WheelWatch:
    """The daemon's watch for these constants."""
    about = WatchedFilter(
        constants.speed_variance,
        constants.acceleration_density,
        constants.stribeck.omega_s,
        1.0 / RATE_HZ,
        INERTIA_KG_M2,
    )
    return WheelWatch(about, WatchKnobs() if knobs is None else knobs)


def heard(run: PlantRun, noise_rpm: float = 1.0, knobs: WatchKnobs | None = None) -> list[Heard]:
    """Everything the watch says over a run."""
    constants, done = filtered(run, noise_rpm)
    watch = watch_of(constants, knobs)
    return [Heard(t.sample.time_s, alarm) for t in stream(run, constants, done) for alarm in watch.step(t)]
