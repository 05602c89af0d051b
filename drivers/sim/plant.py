"""The physics of a simulated wheel, stepped finely: scalar functions that import only `math`.

It is the truth the estimator is judged by, so it shares nothing with it: small Heun steps, not exact propagation.
plant_batch compiles these very functions; plant_runner calls them as they are. Per unit inertia, f > 0 slows a wheel
turning forward:

    d omega/dt = u - f          u = k_eff I_eff - (offset + ripple + periodic), f = friction, opposing the motion

Each step either slips in one direction (the step is clipped where the speed reaches zero) or sticks (|u| at most the
break-away friction, decided at zero speed; Karnopp 1985). docs/simulated-wheel.md has every equation.
"""

from __future__ import annotations

import math

from rw_ekf.drivers.sim.plant_parameters import PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_terms import (
    TWO_PI,
    coulomb_shift,
    drag,
    dry_friction,
    external_acceleration,
    lag_mean,
    motor_acceleration,
    ripple_acceleration,
    spike_acceleration,
)

SLOW_STEP_S = 0.1  # temperature and Coulomb level are held this long at most
COARSE_STEP_S = 5.0e-3  # the longest step far from zero speed
STUCK_STEP_S = 1.0e-3  # how often a stuck wheel under a varying torque is looked at


def choose_step(p: PlantParameters, speed_rad_s: float, fine_step_s: float) -> float:
    """Step [s]: the fine one where the Stribeck curve bends, growing with speed to the coarse one."""
    growth = abs(speed_rad_s) / p.stribeck_speed_rad_s
    step = fine_step_s * growth if growth > 1.0 else fine_step_s
    return min(step, max(COARSE_STEP_S, fine_step_s))


def crossing_fraction(speed_rad_s: float, start_rad_s2: float, end_rad_s2: float, step_s: float) -> float:
    """Fraction of a step after which omega(t) = speed + start t + (end - start) t^2/(2 step) first reaches zero."""
    bend = 0.5 * (end_rad_s2 - start_rad_s2) * step_s
    slope = start_rad_s2 * step_s
    fraction = -speed_rad_s / (slope + bend)  # the secant, then two Newton steps
    for _ in range(2):
        incline = slope + 2.0 * bend * fraction
        if incline != 0.0:
            fraction -= (speed_rad_s + fraction * (slope + bend * fraction)) / incline
    return min(max(fraction, 0.0), 1.0)


def step_bristle(
    p: PlantParameters, state: PlantState, drive: float, current_A: float, shift: float, step_s: float
) -> PlantState:
    """One step with presliding: a bristle z replaces the dry friction, which then never sticks. Source: [L17 (4), (5)].

    dz/dt = omega - |omega| z / z_ss(omega), friction = sigma0 z + sigma1 dz/dt, sigma0 = s / deflection. The
    exponential of the linear z equation keeps it stable however fast the wheel turns.
    """
    stiffness = p.static / p.presliding_rad
    damping = 2.0 * p.presliding_damping * math.sqrt(stiffness)
    speed, bristle, lagged = state.speed_rad_s, state.bristle_rad, state.lagged_friction_rad_s2
    friction = stiffness * bristle
    if p.friction_lag_s > 0.0:
        friction = lagged
    middle = speed + 0.5 * step_s * (drive - friction - drag(p, speed, state.temperature_degC))
    for _ in range(2):
        level = dry_friction(p, middle, shift) + 1.0e-12
        ratio = abs(middle) * stiffness / level * step_s
        target = math.copysign(level / stiffness, middle)
        end_bristle = target + (bristle - target) * math.exp(-ratio) if middle != 0.0 else bristle
        friction = stiffness * lag_mean(bristle, target, ratio) + damping * (end_bristle - bristle) / step_s
        end_lagged = friction
        if p.friction_lag_s > 0.0:
            lag_ratio = step_s / p.friction_lag_s
            end_lagged = friction + (lagged - friction) * math.exp(-lag_ratio)
            friction = lag_mean(lagged, friction, lag_ratio)
        end = speed + step_s * (drive - friction - drag(p, middle, state.temperature_degC))
        middle = 0.5 * (speed + end)
    return PlantState(
        state.time_s + step_s, end, state.angle_rad + middle * step_s, state.temperature_degC, current_A,
        end_lagged, end_bristle, state.coulomb_wander_rad_s2,
    )  # fmt: skip


def step_slip(
    p: PlantParameters, state: PlantState, drive: float, current_A: float, shift: float, direction: float, step_s: float
) -> PlantState:
    """One step of a wheel that slips in `direction` (+1 or -1), clipped where the speed reaches zero (exactly 0 then).

    current_A: the winding current at the step's end. Heun, with dry friction continued smoothly through zero, so that
    the clipped part is as exact as the rest.
    """
    speed, temperature, lagged = state.speed_rad_s, state.temperature_degC, state.lagged_friction_rad_s2
    dry = direction * dry_friction(p, speed, shift)
    end_lagged = 0.0
    if p.friction_lag_s > 0.0:
        middle = speed + 0.5 * step_s * (drive - lagged - drag(p, speed, temperature))
        target = direction * dry_friction(p, middle, shift)
        ratio = step_s / p.friction_lag_s
        end_lagged = target + (lagged - target) * math.exp(-ratio)
        start = drive - lag_mean(lagged, target, ratio) - drag(p, speed, temperature)
        end = start + drag(p, speed, temperature) - drag(p, speed + step_s * start, temperature)
    else:
        start = drive - dry - drag(p, speed, temperature)
        ahead = speed + step_s * start
        level = dry_friction(p, ahead, shift) if ahead * direction > 0.0 else dry_friction(p, 0.0, shift)
        end = drive - direction * level - drag(p, ahead, temperature)
    end_speed = speed + 0.5 * step_s * (start + end)
    done = 1.0
    if end_speed * direction <= 0.0 and speed != 0.0:
        done = crossing_fraction(speed, start, end, step_s)
        end_speed = 0.0
        end_lagged = lagged + (end_lagged - lagged) * done
        current_A = state.winding_current_A + (current_A - state.winding_current_A) * done
    passed = done * step_s
    turned = passed * (speed + passed * (start / 2.0 + (end - start) * done / 6.0))
    return PlantState(
        state.time_s + passed, end_speed, state.angle_rad + turned, temperature, current_A,
        end_lagged, state.bristle_rad, state.coulomb_wander_rad_s2,
    )  # fmt: skip


def driven(
    p: PlantParameters, state: PlantState, current_A: float, shift: float, step_s: float
) -> tuple[float, float, float]:
    """(drive, level of dry friction, winding current at the end) of a step under a commanded current [A]."""
    winding, mean_current = current_A, current_A
    if p.actuator_lag_s > 0.0:
        ratio = step_s / p.actuator_lag_s
        mean_current = lag_mean(state.winding_current_A, current_A, ratio)
        winding = current_A + (state.winding_current_A - current_A) * math.exp(-ratio)
    middle_s = state.time_s + 0.5 * step_s
    motor = motor_acceleration(p, mean_current, state.temperature_degC, state.speed_rad_s)
    drive = (
        motor
        - p.offset_rad_s2
        - ripple_acceleration(p, state.angle_rad, state.speed_rad_s * step_s)
        - external_acceleration(p, middle_s)
    )
    return drive, shift + spike_acceleration(p, middle_s) + p.load_friction * abs(motor), winding


def step_fast(
    p: PlantParameters, state: PlantState, current_A: float, shift: float, fine_step_s: float, left_s: float
) -> PlantState:
    """One step of at most `left_s` seconds under a commanded current [A]; shorter where the speed reaches zero."""
    at_rest = state.speed_rad_s == 0.0 and p.presliding_rad == 0.0
    step_s = choose_step(p, state.speed_rad_s, fine_step_s)
    if at_rest:
        step_s = STUCK_STEP_S if varies_at_rest(p, state, current_A) else left_s
    if p.actuator_lag_s > 0.0:
        step_s = min(step_s, max(fine_step_s, 0.1 * p.actuator_lag_s))
    if p.friction_lag_s > 0.0:
        step_s = min(step_s, max(fine_step_s, 0.1 * p.friction_lag_s))
    if p.spike_rad_s2 != 0.0 and state.time_s < p.spike_onset_s:
        step_s = min(step_s, p.spike_onset_s - state.time_s + 1.0e-9)  # the onset is a jump: step up to it, not across
    step_s = min(step_s, left_s)
    drive, level, winding = driven(p, state, current_A, shift, step_s)
    if at_rest and step_s > fine_step_s and abs(drive) > dry_friction(p, 0.0, level):
        step_s = fine_step_s  # it breaks away within: no more is gone over at once, of the current's lag neither
        drive, level, winding = driven(p, state, current_A, shift, step_s)
    if p.presliding_rad > 0.0:
        return step_bristle(p, state, drive, winding, level, step_s)
    if state.speed_rad_s != 0.0:
        return step_slip(p, state, drive, winding, level, math.copysign(1.0, state.speed_rad_s), step_s)
    if abs(drive) <= dry_friction(p, 0.0, level):
        return PlantState(
            state.time_s + step_s, 0.0, state.angle_rad, state.temperature_degC, winding,
            drive, 0.0, state.coulomb_wander_rad_s2,
        )  # fmt: skip
    return step_slip(p, state, drive, winding, level, math.copysign(1.0, drive), step_s)


def varies_at_rest(p: PlantParameters, state: PlantState, current_A: float) -> bool:
    """Whether the torque on a wheel at rest can change while current and temperature are held."""
    if p.external_rad_s2 != 0.0 or p.spike_rad_s2 != 0.0:
        return True
    return p.actuator_lag_s > 0.0 and abs(state.winding_current_A - current_A) > 1.0e-12


def advance(
    p: PlantParameters, state: PlantState, current_A: float, duration_s: float, fine_step_s: float
) -> PlantState:
    """The state `duration_s` later under one commanded current [A].

    fine_step_s: step near zero speed, 0.2 ms for a reference, 0.5 ms where time counts. Temperature and Coulomb
    level are slow: they move every 0.1 s at most.
    """
    end_s = state.time_s + duration_s
    while end_s - state.time_s > 1.0e-10:
        part_s = min(end_s - state.time_s, SLOW_STEP_S)
        part_end_s = state.time_s + part_s
        shift = coulomb_shift(p, state)
        while part_end_s - state.time_s > 1.0e-10:
            state = step_fast(p, state, current_A, shift, fine_step_s, part_end_s - state.time_s)
        state = step_thermal(p, state, part_s)
    return state


def step_thermal(p: PlantParameters, state: PlantState, step_s: float) -> PlantState:
    """First-order warming towards ambient (with its slow cycle) plus self heating by speed and winding current."""
    ambient = p.ambient_degC
    if p.ambient_cycle_degC != 0.0:
        ambient += p.ambient_cycle_degC * math.sin(TWO_PI * state.time_s / p.ambient_period_s)
    target = (
        ambient
        + p.heating_degC_s_rad * abs(state.speed_rad_s)
        + p.heating_degC_A2 * state.winding_current_A * state.winding_current_A
    )
    temperature = target + (state.temperature_degC - target) * math.exp(-step_s / p.thermal_time_s)
    return PlantState(
        state.time_s, state.speed_rad_s, state.angle_rad, temperature, state.winding_current_A,
        state.lagged_friction_rad_s2, state.bristle_rad, state.coulomb_wander_rad_s2,
    )  # fmt: skip
