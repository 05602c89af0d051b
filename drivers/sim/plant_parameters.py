"""What a simulated wheel is made of: its parameters and its state, as named tuples of numbers, which C takes too."""

from __future__ import annotations

from typing import NamedTuple

from rw_ekf.units import RAD_S_PER_RPM

REFERENCE_TEMPERATURE_DEGC = 20.0  # where the temperature effects vanish
STRIBECK_LAWS = {"gauss": 0.0, "tustin": 1.0, "lorentz": 2.0}
TEMPERATURE_LAWS = {"linear": 0.0, "exponential": 1.0}
FINE_STEP_S = 2.0e-4  # the reference step
QUICK_STEP_S = 5.0e-4  # the step where processor time counts more than the last 0.0001 rpm


class PlantParameters(NamedTuple):
    """A wheel. Everything behind the first five defaults to "not there"; effects fill it in. Per unit inertia."""

    # the base model, [CK13] table 1
    motor_gain: float = 15.205  # rad/s^2/A
    viscous: float = 0.00322  # 1/s
    coulomb: float = 0.5863  # rad/s^2
    static: float = 0.6037  # rad/s^2
    stribeck_speed_rad_s: float = 4.0 * RAD_S_PER_RPM
    stribeck_law: float = 0.0  # a value of STRIBECK_LAWS
    # steady torques and drags
    offset_rad_s2: float = 0.0
    asymmetry_1_s: float = 0.0
    quadratic_drag_1_rad: float = 0.0
    cubic_drag_s_rad2: float = 0.0
    # relative to 20 degC
    viscous_temperature_1_K: float = 0.0
    viscous_temperature_law: float = 0.0  # a value of TEMPERATURE_LAWS
    coulomb_temperature_1_K: float = 0.0
    coulomb_temperature_law: float = 0.0
    motor_gain_temperature_1_K: float = 0.0
    # motor
    motor_saturation_1_A: float = 0.0
    current_deadzone_A: float = 0.0
    actuator_lag_s: float = 0.0
    transport_delay_s: float = 0.0  # of the command; applied by whoever keeps the commands (plant_runner, plant_batch)
    # friction with memory
    presliding_rad: float = 0.0  # bristle deflection at break-away; 0: dry friction that sticks
    presliding_damping: float = 0.3  # damping ratio of the bristle
    friction_lag_s: float = 0.0
    # in angle and in time
    ripple_1_rad_s2: float = 0.0
    ripple_1_order: float = 1.0
    ripple_1_phase_rad: float = 0.0
    ripple_2_rad_s2: float = 0.0
    ripple_2_order: float = 1.0
    ripple_2_phase_rad: float = 0.0
    ripple_3_rad_s2: float = 0.0
    ripple_3_order: float = 1.0
    ripple_3_phase_rad: float = 0.0
    spike_rad_s2: float = 0.0
    spike_onset_s: float = 0.0
    spike_decay_s: float = 60.0
    drift_rad_s3: float = 0.0
    drift_time_s: float = 0.0  # 0: for ever
    drift_wander_rad_s2: float = 0.0  # per sqrt(s)
    external_rad_s2: float = 0.0
    external_Hz: float = 0.0
    external_phase_rad: float = 0.0
    # telemetry
    speed_window_s: float = 0.0  # a reading is the mean speed over it; applied by whoever reads, as the grid is
    speed_grid_rad_s: float = 0.0
    # not in the catalogue of effects: for proofs that the unknown is called unknown
    bump_rad_s2: float = 0.0
    bump_speed_rad_s: float = 0.0
    bump_width_rad_s: float = 1.0
    gain_speed_s_rad: float = 0.0  # relative loss of motor gain per rad/s
    load_friction: float = 0.0  # dry friction per commanded acceleration
    # warmth: a chamber cycled up and down within a run, so that temperature effects can be distinguished from drift
    ambient_degC: float = 20.0
    ambient_cycle_degC: float = 8.0
    ambient_period_s: float = 1200.0
    heating_degC_s_rad: float = 0.03  # per rad/s
    heating_degC_A2: float = 5.0
    thermal_time_s: float = 300.0


class PlantState(NamedTuple):
    """Where a simulated wheel is. The speed is exactly 0.0 when and only when it stands still."""

    time_s: float = 0.0
    speed_rad_s: float = 0.0
    angle_rad: float = 0.0
    temperature_degC: float = 20.0
    winding_current_A: float = 0.0
    lagged_friction_rad_s2: float = 0.0
    bristle_rad: float = 0.0
    coulomb_wander_rad_s2: float = 0.0


class PlantNoise(NamedTuple):
    """What is random about a simulated wheel."""

    speed_rad_s: float = 1.0 * RAD_S_PER_RPM  # standard deviation of a speed reading
    process_rad_s: float = 0.0  # per sqrt(s): random walk of the speed of a wheel that turns
