"""Many simulated runs, compiled: the very functions of plant.py printed as C, one call per run.

Import this only where numbers are crunched: it loads numpy.
"""

from __future__ import annotations

import math
import sys
import types
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rw_ekf.arrays import Float64Array
from rw_ekf.compiled import Kernel
from rw_ekf.drivers.sim import plant, plant_parameters, plant_terms
from rw_ekf.drivers.sim.plant_parameters import FINE_STEP_S, PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import Advance

Run = Callable[..., PlantState]

advance = plant.advance


@dataclass(eq=False, frozen=True, slots=True)
class PlantRun:
    """One simulated run; every array has shape (n,), row i is at sample_times_s[i], before current_A[i] takes force."""

    time_s: Float64Array
    current_command_A: Float64Array  # as given
    command_delay_s: float  # from a sample's time until its command acts, as a driver would report it
    measured_speed_rad_s: Float64Array
    speed_rad_s: Float64Array  # true
    temperature_degC: Float64Array
    angle_rad: Float64Array
    current_A: Float64Array  # true winding current
    parameters: PlantParameters


def plain_run(
    p: PlantParameters,
    state: PlantState,
    current_A: Float64Array,
    times_s: Float64Array,
    delay_s: float,
    kicks_rad_s: Float64Array,
    wanders_rad_s2: Float64Array,
    fine_step_s: float,
    truth: Float64Array,
) -> PlantState:
    """Advance from sample to sample and return the last state.

    truth: (n, 5), filled with speed, temperature, angle, winding current and the angle where the window of the reading
    began (0 where readings have none).
    The command of sample i acts from times_s[i] + delay_s on, however many samples that is later.
    """
    n = times_s.shape[0]
    in_force = 0.0
    following = 0  # the next command to take force
    window = p.speed_window_s
    opening = 0 if window > 0.0 else n  # the next sample whose window begins
    for i in range(n):
        while True:
            opens_s = float(times_s[opening]) - window if opening < n else math.inf
            acts_s = float(times_s[following]) + delay_s if following < i else math.inf
            if min(opens_s, acts_s) > times_s[i]:
                break
            state = advance(p, state, in_force, min(opens_s, acts_s) - state.time_s, fine_step_s)
            if acts_s < opens_s:
                in_force = current_A[following]
                following += 1
            else:  # before the run began the wheel turned as it did when it began
                truth[opening, 4] = state.angle_rad - state.speed_rad_s * max(state.time_s - opens_s, 0.0)
                opening += 1
        state = advance(p, state, in_force, times_s[i] - state.time_s, fine_step_s)
        if i > 0:
            kicked = state.speed_rad_s + kicks_rad_s[i] if state.speed_rad_s != 0.0 else 0.0
            state = PlantState(
                times_s[i], kicked, state.angle_rad, state.temperature_degC, state.winding_current_A,
                state.lagged_friction_rad_s2, state.bristle_rad, state.coulomb_wander_rad_s2 + wanders_rad_s2[i],
            )  # fmt: skip
        truth[i, 0] = state.speed_rad_s
        truth[i, 1] = state.temperature_degC
        truth[i, 2] = state.angle_rad
        truth[i, 3] = state.winding_current_A if p.actuator_lag_s > 0.0 else in_force
    return state


def run_by(law: Advance) -> Run:
    """`plain_run` by another law of motion than the plant's own."""
    found: Run = types.FunctionType(plain_run.__code__, {**globals(), "advance": law})
    return found


def _example() -> tuple[Any, ...]:
    return PlantParameters(), PlantState(), 0.0, 0.0, 0.0


def _run_example() -> tuple[Any, ...]:
    series = np.zeros(0)
    return PlantParameters(), PlantState(), series, series, 0.0, series, series, 0.0, np.zeros((0, 5))


_PHYSICS = [plant, plant_terms, plant_parameters, sys.modules[__name__]]
compiled_run = Kernel(plain_run, _PHYSICS, _run_example, result=PlantState())
compiled_advance = Kernel(advance, _PHYSICS, _example, result=PlantState())  # a runner's step, for many intervals


def simulate_run(
    parameters: PlantParameters,
    current_A: ArrayLike,
    sample_times_s: ArrayLike,
    noise: PlantNoise | None = None,
    *,
    seed: int = 0,
    command_delay_s: float = 0.0,
    initial_speed_rad_s: float = 0.0,
    initial_temperature_degC: float | None = None,
    fine_step_s: float = FINE_STEP_S,
    run: Run = compiled_run,
) -> PlantRun:
    """Simulate one run.

    current_A: (n,) command given at each sample [A]; before the first one takes force there is none.
    sample_times_s: (n,) increasing [s]; the wheel has run since time 0 (or since a negative first time).
    command_delay_s: until a command acts; the effect transport_delay comes on top and is not reported.
    run: compiled_run, or plain_run to run the same in Python. Raises ValueError for shapes or times that cannot be.
    """
    currents_A = np.ascontiguousarray(current_A, dtype=np.float64)
    times_s = np.ascontiguousarray(sample_times_s, dtype=np.float64)
    if currents_A.shape != times_s.shape or times_s.ndim != 1 or times_s.size == 0:
        raise ValueError(f"current_A {currents_A.shape} and sample_times_s {times_s.shape} must be (n,) with n above 0")
    steps_s = np.diff(times_s, prepend=times_s[0])
    if not (np.isfinite(currents_A).all() and np.isfinite(times_s).all() and (steps_s[1:] > 0.0).all()):
        raise ValueError("currents must be finite, and sample times finite and increasing")
    noise = noise if noise is not None else PlantNoise()
    readings, kicks, wanders = np.random.default_rng(seed).standard_normal((3, times_s.size))
    warmth = parameters.ambient_degC if initial_temperature_degC is None else initial_temperature_degC
    state = PlantState(float(times_s[0]), float(initial_speed_rad_s), 0.0, float(warmth))
    truth = np.zeros((times_s.size, 5))
    run(
        PlantParameters(*(float(value) for value in parameters)), state, currents_A, times_s,
        float(command_delay_s + parameters.transport_delay_s), kicks * noise.process_rad_s * np.sqrt(steps_s),
        wanders * parameters.drift_wander_rad_s2 * np.sqrt(steps_s), float(fine_step_s), truth,
    )  # fmt: skip
    window_s = parameters.speed_window_s
    seen = truth[:, 0] if window_s == 0.0 else (truth[:, 2] - truth[:, 4]) / window_s
    measured = seen + readings * noise.speed_rad_s
    grid = parameters.speed_grid_rad_s
    if grid > 0.0:
        measured = np.round(measured / grid) * grid
    return PlantRun(
        time_s=times_s,
        current_command_A=currents_A,
        command_delay_s=float(command_delay_s),
        measured_speed_rad_s=measured,
        speed_rad_s=truth[:, 0].copy(),
        temperature_degC=truth[:, 1].copy(),
        angle_rad=truth[:, 2].copy(),
        current_A=truth[:, 3].copy(),
        parameters=parameters,
    )
