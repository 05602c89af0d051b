"""The torques and drags on a simulated wheel, one function each: scalar functions that import only `math`.

Per unit inertia [rad/s^2]; docs/simulated-wheel.md has the equations together.
"""

from __future__ import annotations

import math

from rw_ekf.drivers.sim.plant_parameters import REFERENCE_TEMPERATURE_DEGC, PlantParameters, PlantState

TWO_PI = 2.0 * math.pi


def sinc(x: float) -> float:
    """sin(x)/x [-]: what remains of a sine averaged over a stretch of 2x radians."""
    if abs(x) < 1.0e-4:
        return 1.0 - x * x / 6.0
    return math.sin(x) / x


def lag_mean(start: float, target: float, ratio: float) -> float:
    """Mean over a step of a first-order lag that goes from `start` towards `target`; ratio = step / time constant."""
    if ratio < 1.0e-6:
        return start + (target - start) * 0.5 * ratio
    return target + (start - target) * (1.0 - math.exp(-ratio)) / ratio


def stribeck(speed_ratio: float, law: float) -> float:
    """How much of the extra break-away friction is left at |omega|/omega_s = speed_ratio [-]; 1 at rest, 0 far away.

    law: 0 Gauss, 1 Tustin (exponential), 2 Lorentz. Source: [CK13 (1)], [F12 (3)].
    """
    if law == 1.0:
        return math.exp(-speed_ratio)
    squared = speed_ratio * speed_ratio
    if law == 2.0:
        return 1.0 / (1.0 + squared)
    return math.exp(-squared) if squared < 50.0 else 0.0


def motor_acceleration(p: PlantParameters, current_A: float, temperature_degC: float, speed_rad_s: float) -> float:
    """k_eff(I, T, omega) I_eff [rad/s^2] of the current in the winding [A]: dead zone, saturation, warmth, speed."""
    effective = math.copysign(max(abs(current_A) - p.current_deadzone_A, 0.0), current_A)
    gain = p.motor_gain * (1.0 + p.motor_gain_temperature_1_K * (temperature_degC - REFERENCE_TEMPERATURE_DEGC))
    gain *= 1.0 - p.gain_speed_s_rad * abs(speed_rad_s)
    return gain * (1.0 - p.motor_saturation_1_A * abs(current_A)) * effective


def ripple_acceleration(p: PlantParameters, angle_rad: float, turned_rad: float) -> float:
    """Torque ripple [rad/s^2], averaged over the `turned_rad` of a step that starts at angle_rad.

    The average keeps a ripple far faster than the step exact: no step need be shorter than its period.
    """
    middle = angle_rad + 0.5 * turned_rad
    total = 0.0
    if p.ripple_1_rad_s2 != 0.0:
        total += (
            p.ripple_1_rad_s2
            * sinc(0.5 * p.ripple_1_order * turned_rad)
            * math.sin(p.ripple_1_order * middle + p.ripple_1_phase_rad)
        )
    if p.ripple_2_rad_s2 != 0.0:
        total += (
            p.ripple_2_rad_s2
            * sinc(0.5 * p.ripple_2_order * turned_rad)
            * math.sin(p.ripple_2_order * middle + p.ripple_2_phase_rad)
        )
    if p.ripple_3_rad_s2 != 0.0:
        total += (
            p.ripple_3_rad_s2
            * sinc(0.5 * p.ripple_3_order * turned_rad)
            * math.sin(p.ripple_3_order * middle + p.ripple_3_phase_rad)
        )
    return total


def external_acceleration(p: PlantParameters, time_s: float) -> float:
    """Periodic torque [rad/s^2] at an instant."""
    if p.external_rad_s2 == 0.0:
        return 0.0
    return p.external_rad_s2 * math.sin(TWO_PI * p.external_Hz * time_s + p.external_phase_rad)


def spike_acceleration(p: PlantParameters, time_s: float) -> float:
    """Drag spike [rad/s^2] at an instant: nothing, then all of it, then an exponential decay. Source: [L17 IV]."""
    if p.spike_rad_s2 == 0.0 or time_s < p.spike_onset_s:
        return 0.0
    return p.spike_rad_s2 * math.exp(-(time_s - p.spike_onset_s) / p.spike_decay_s)


def coulomb_shift(p: PlantParameters, state: PlantState) -> float:
    """By how much temperature and running time have raised Coulomb and break-away friction together [rad/s^2]."""
    warmer = state.temperature_degC - REFERENCE_TEMPERATURE_DEGC
    settled = p.drift_rad_s3 * state.time_s
    if p.drift_time_s > 0.0:
        settled = p.drift_rad_s3 * p.drift_time_s * (1.0 - math.exp(-state.time_s / p.drift_time_s))
    warmed = p.coulomb_temperature_1_K * warmer
    share = warmed if p.coulomb_temperature_law == 0.0 else math.exp(min(warmed, 700.0)) - 1.0
    return p.coulomb * share + settled + state.coulomb_wander_rad_s2


def dry_friction(p: PlantParameters, speed_rad_s: float, shift_rad_s2: float) -> float:
    """Magnitude of the friction that stays at rest [rad/s^2]: c + (s - c) g, both raised by shift_rad_s2."""
    level = p.coulomb + (p.static - p.coulomb) * stribeck(abs(speed_rad_s) / p.stribeck_speed_rad_s, p.stribeck_law)
    return max(level + shift_rad_s2, 0.0)


def drag(p: PlantParameters, speed_rad_s: float, temperature_degC: float) -> float:
    """Signed friction that vanishes at rest [rad/s^2]: viscous, asymmetry, windage, cubic, and the bump."""
    warmer = p.viscous_temperature_1_K * (temperature_degC - REFERENCE_TEMPERATURE_DEGC)
    viscous = p.viscous * (1.0 + warmer if p.viscous_temperature_law == 0.0 else math.exp(min(warmer, 700.0)))
    size = abs(speed_rad_s)
    total = (
        speed_rad_s * (viscous + size * (p.quadratic_drag_1_rad + p.cubic_drag_s_rad2 * size)) + p.asymmetry_1_s * size
    )
    if p.bump_rad_s2 != 0.0:
        offset = (size - p.bump_speed_rad_s) / p.bump_width_rad_s
        total += math.copysign(p.bump_rad_s2 * math.exp(-min(offset * offset, 700.0)), speed_rad_s)
    return total
