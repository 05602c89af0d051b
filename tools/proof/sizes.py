"""How strong each effect of a proof is made: a share of Coulomb friction where it acts, or a ladder of its own.

A torque that depends on speed is measured at the profile's top speed, one that depends on current at its top current,
a temperature slope by the temperature's range in the record. What has no torque of its own (lags, a delay, a dead zone,
the bristle's deflection, a grid) has a ladder of three rungs for the three sizes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.units import RAD_S_PER_RPM

SHARES = (0.05, 0.10, 0.03)  # of Coulomb friction: the three sizes, the middle one first
RATE_HZ = 10.0
_COARSE_STEP_S = 2.0e-3  # 1e-6 rpm is enough to know a top speed
_MODEL_STRIBECK_RAD_S = 4.0 * RAD_S_PER_RPM

# Rungs in the order of SHARES.
_LADDERS = {
    "current_deadzone": (0.002, 0.004, 0.001),  # A
    "actuator_lag": (0.05, 0.10, 0.02),  # s
    "transport_delay": (0.05, 0.10, 0.02),  # s
    "presliding_hysteresis": (0.03, 0.10, 0.01),  # rad
    "friction_lag": (0.10, 0.30, 0.03),  # s
    "speed_quantisation": (5.0 * RAD_S_PER_RPM, 10.0 * RAD_S_PER_RPM, 3.0 * RAD_S_PER_RPM),  # rad/s
    "speed_averaging": (0.05, 0.10, 0.03),  # s
    "stribeck_shape": (3.5, 5.0, 2.5),  # times the model's Stribeck speed
}


@dataclass(frozen=True)
class Reach:
    """How far a profile takes a healthy wheel."""

    duration_s: float
    top_speed_rad_s: float
    top_current_A: float
    temperature_range_K: float


@dataclass(frozen=True)
class Size:
    """One size of one effect: `rung` counts through SHARES, `share` is the jittered share of Coulomb friction."""

    rung: int
    share: float
    jitter: float  # share over SHARES[rung]


@lru_cache(maxsize=4096)
def reach_of(wheel: PlantParameters, profile: str, profile_seed: int) -> Reach:
    """Run the profile on the healthy wheel without noise."""
    time_s, current_A = commands(profile, profile_seed)
    run = simulate_run(wheel, current_A, time_s, PlantNoise(0.0), fine_step_s=_COARSE_STEP_S)
    return Reach(
        float(time_s[-1] - time_s[0]),
        float(np.abs(run.speed_rad_s).max()),
        float(np.abs(current_A).max()),
        float(np.ptp(run.temperature_degC)),
    )


@lru_cache(maxsize=512)
def commands(profile: str, seed: int) -> tuple[Float64Array, Float64Array]:
    """Nominal times [s] and currents [A] of a profile at 10 Hz, both (n,)."""
    time_s, current_A = sample_profile(make_profile(profile, seed=seed), RATE_HZ)
    return np.array(time_s), np.array(current_A)


def draw_size(draws: np.random.Generator, rung: int) -> Size:
    """A size near SHARES[rung], never outside 3 to 10 %."""
    share = float(np.clip(SHARES[rung] * np.exp(draws.uniform(-0.15, 0.15)), SHARES[2], SHARES[1]))
    return Size(rung, share, share / SHARES[rung])


def effect_text(draws: np.random.Generator, effect: str, size: Size, wheel: PlantParameters, reach: Reach) -> str:
    """The effect as `rw-ekf simulate --effect` takes it, with this size on this wheel and profile."""
    values = _RECIPES[effect](draws, size, wheel, reach)
    return effect + ":" + ",".join(f"{name}={value}" for name, value in values.items())


Values = dict[str, float | str]
Recipe = Callable[[np.random.Generator, Size, PlantParameters, Reach], Values]


def _sign(draws: np.random.Generator) -> float:
    return 1.0 if draws.random() < 0.5 else -1.0


def _speed_power(name: str, power: int, *, signed: bool) -> Recipe:
    """A drag that reaches its share at the top speed."""

    def recipe(draws: np.random.Generator, size: Size, wheel: PlantParameters, reach: Reach) -> Values:
        sign = _sign(draws) if signed else 1.0
        return {name: sign * size.share * wheel.coulomb / reach.top_speed_rad_s**power}

    return recipe


def _ladder(effect: str, name: str) -> Recipe:
    def recipe(draws: np.random.Generator, size: Size, wheel: PlantParameters, reach: Reach) -> Values:
        return {name: _LADDERS[effect][size.rung] * size.jitter}

    return recipe


def _viscous_temperature(draws: np.random.Generator, size: Size, wheel: PlantParameters, reach: Reach) -> Values:
    # The lubricant thins: three times out of four it is that way round.
    sign = 1.0 if draws.random() < 0.25 else -1.0
    torque = wheel.viscous * reach.top_speed_rad_s * reach.temperature_range_K
    return {"slope_1_K": sign * size.share * wheel.coulomb / torque}


def _coulomb_temperature(draws: np.random.Generator, size: Size, wheel: PlantParameters, reach: Reach) -> Values:
    return {"slope_1_K": _sign(draws) * size.share / reach.temperature_range_K}


def _gain_temperature(draws: np.random.Generator, size: Size, wheel: PlantParameters, reach: Reach) -> Values:
    torque = wheel.motor_gain * reach.top_current_A * reach.temperature_range_K
    return {"slope_1_K": _sign(draws) * size.share * wheel.coulomb / torque}


def _saturation(draws: np.random.Generator, size: Size, wheel: PlantParameters, reach: Reach) -> Values:
    return {"slope_1_A": size.share * wheel.coulomb / (wheel.motor_gain * reach.top_current_A**2)}


def _offset(draws: np.random.Generator, size: Size, wheel: PlantParameters, reach: Reach) -> Values:
    return {"torque_rad_s2": _sign(draws) * size.share * wheel.coulomb}


def _ripple(draws: np.random.Generator, size: Size, wheel: PlantParameters, reach: Reach) -> Values:
    phase = draws.uniform(0.0, 2.0 * np.pi)
    return {"amplitude_rad_s2": size.share * wheel.coulomb, "order": 1.0, "phase_rad": phase}


def _spike(draws: np.random.Generator, size: Size, wheel: PlantParameters, reach: Reach) -> Values:
    return {
        "amplitude_rad_s2": size.share * wheel.coulomb,
        "onset_s": draws.uniform(0.15, 0.7) * reach.duration_s,
        "decay_s": float(np.exp(draws.uniform(np.log(10.0), np.log(3600.0)))),
    }


def _drift(draws: np.random.Generator, size: Size, wheel: PlantParameters, reach: Reach) -> Values:
    """The share is what friction has changed by at the end; one in five wanders instead of settling."""
    change = size.share * wheel.coulomb
    kind = draws.random()
    if kind < 0.2:
        return {"rate_rad_s3": 0.0, "time_constant_s": 0.0, "wander_rad_s2": change / np.sqrt(reach.duration_s)}
    if kind < 0.5:
        return {"rate_rad_s3": _sign(draws) * change / reach.duration_s, "time_constant_s": 0.0}
    settling_s = draws.uniform(0.2, 1.0) * reach.duration_s
    settled_s = settling_s * (1.0 - np.exp(-reach.duration_s / settling_s))
    return {"rate_rad_s3": _sign(draws) * change / settled_s, "time_constant_s": settling_s}


def _stribeck(draws: np.random.Generator, size: Size, wheel: PlantParameters, reach: Reach) -> Values:
    law = ("gauss", "gauss", "tustin", "lorentz")[int(draws.integers(4))]
    factor = size.jitter * _LADDERS["stribeck_shape"][size.rung] if law == "gauss" else draws.uniform(1.0, 2.0)
    return {"speed_rad_s": factor * _MODEL_STRIBECK_RAD_S, "law": law}


def _external(draws: np.random.Generator, size: Size, wheel: PlantParameters, reach: Reach) -> Values:
    return {
        "amplitude_rad_s2": size.share * wheel.coulomb,
        "frequency_Hz": float(np.exp(draws.uniform(np.log(0.01), np.log(0.5)))),
        "phase_rad": draws.uniform(0.0, 2.0 * np.pi),
    }


def _bump(draws: np.random.Generator, size: Size, wheel: PlantParameters, reach: Reach) -> Values:
    """Within the speeds that the profile passes through, and narrow beside them."""
    speed = draws.uniform(0.2, 0.7) * reach.top_speed_rad_s
    return {
        "amplitude_rad_s2": 1.5 * size.share * wheel.coulomb,
        "speed_rad_s": speed,
        "width_rad_s": draws.uniform(0.03, 0.12) * reach.top_speed_rad_s,
    }


def _gain_speed(draws: np.random.Generator, size: Size, wheel: PlantParameters, reach: Reach) -> Values:
    """The share is that of the motor's gain, lost at the top speed."""
    return {"slope_s_rad": size.share / reach.top_speed_rad_s}


def _load_friction(draws: np.random.Generator, size: Size, wheel: PlantParameters, reach: Reach) -> Values:
    return {"ratio": size.share * wheel.coulomb / (wheel.motor_gain * reach.top_current_A)}


_RECIPES: dict[str, Recipe] = {
    "offset_torque": _offset,
    "viscous_asymmetry": _speed_power("difference_1_s", 1, signed=True),
    "quadratic_drag": _speed_power("coefficient_1_rad", 2, signed=False),
    "cubic_drag": _speed_power("coefficient_s_rad2", 3, signed=True),
    "viscous_temperature": _viscous_temperature,
    "coulomb_temperature": _coulomb_temperature,
    "motor_gain_temperature": _gain_temperature,
    "motor_saturation": _saturation,
    "current_deadzone": _ladder("current_deadzone", "width_A"),
    "actuator_lag": _ladder("actuator_lag", "time_constant_s"),
    "transport_delay": _ladder("transport_delay", "delay_s"),
    "presliding_hysteresis": _ladder("presliding_hysteresis", "deflection_rad"),
    "friction_lag": _ladder("friction_lag", "time_constant_s"),
    "torque_ripple": _ripple,
    "drag_spike": _spike,
    "coulomb_drift": _drift,
    "stribeck_shape": _stribeck,
    "external_torque": _external,
    "speed_quantisation": _ladder("speed_quantisation", "grid_rad_s"),
    "drag_bump": _bump,
    "speed_averaging": _ladder("speed_averaging", "window_s"),
    "motor_gain_speed": _gain_speed,
    "acceleration_friction": _load_friction,
}
