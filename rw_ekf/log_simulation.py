"""A log of a simulated wheel, for whoever has none: a profile, a truth, effects, noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from pydantic import Field

from rw_ekf.attach.simulated import simulated_plant, simulated_record, with_own_formulas
from rw_ekf.checking.arguments import arguments
from rw_ekf.checking.choices import names_of
from rw_ekf.checking.effect_file import read_effect_file
from rw_ekf.checking.paths import path_of
from rw_ekf.checking.section import Section
from rw_ekf.control.profiles import make_profile
from rw_ekf.effects.catalogue import CATALOGUE_IDS
from rw_ekf.errors import BadInputError
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.state import CK13_STATISTICAL, PARAMETER_NAMES, FrictionParameters
from rw_ekf.settings.schema import TrueWheelSection
from rw_ekf.units import rad_s_from_rpm

_FOR_EVER_S = 600.0  # of a profile that has no end
_MOST_ROWS = 1e8


class _Arguments(Section):
    """What a simulation is given beside a wheel and its effects."""

    profile: str
    seed: int = Field(ge=0, description="seed of noise and profile")
    duration_s: float | None = Field(gt=0, description="length of the log [s]")
    rate_hz: float = Field(ge=1, le=2000, description="samples per second [Hz]")
    stribeck_speed_rpm: float = Field(gt=0, le=1e4, description="speed scale of the Stribeck bump [rpm]")
    speed_noise_rpm: float = Field(ge=0, le=1e4, description="standard deviation of one speed reading [rpm]")
    acceleration_noise_rpm_per_sqrt_s: float = Field(ge=0, le=1e4, description="random walk of the speed [rpm/sqrt(s)]")
    amplitude_A: float = Field(0.1, ge=0, le=1e3, description="amplitude of sine, steps and random-sines [A]")
    period_s: float = Field(30.0, gt=0, le=1e6, description="period of sine, steps and random-sines [s]")
    bias_A: float = Field(0.0, ge=-1e3, le=1e3, description="constant current added to it [A]")


def simulate(
    profile: str = "identification",
    wheel: FrictionParameters | Mapping[str, float] | Sequence[float] | None = None,
    effects: Sequence[str] | str | None = (),
    seed: int = 0,
    *,
    duration_s: float | None = None,
    rate_hz: float = 10.0,
    stribeck_speed_rpm: float = 4.0,
    speed_noise_rpm: float = 1.0,
    acceleration_noise_rpm_per_sqrt_s: float = 0.03,
    effect_file: str | Path | None = None,
    **shape: float,
) -> WheelLog:
    """Drive a simulated wheel through a profile of `excite`, and log it.

    wheel: its four parameters by name or in order, as `fit.model.parameters`; None: those of [CK13]. effects: what it
    has beside them, as `simulate --effect` has them: "quadratic_drag" alone, or
    "quadratic_drag:coefficient_1_rad=1e-5". effect_file: of formulas of one's own, which `effects` then may name too.
    seed: of noise and profile. shape: amplitude_A, period_s, bias_A. duration_s: the profile's own, else 600 s.
    Raises BadInputError for a profile or an effect that there is not, or a number that cannot be.
    """
    given = arguments(
        _Arguments,
        {
            "profile": profile, "seed": seed, "duration_s": duration_s, "rate_hz": rate_hz,
            "stribeck_speed_rpm": stribeck_speed_rpm, "speed_noise_rpm": speed_noise_rpm,
            "acceleration_noise_rpm_per_sqrt_s": acceleration_noise_rpm_per_sqrt_s, **shape,
        },
        "simulate",
    )  # fmt: skip
    parameters = _parameters_of(wheel)
    law = make_profile(
        given.profile, seed=given.seed, amplitude_A=given.amplitude_A, period_s=given.period_s, bias_A=given.bias_A
    )
    lasts_s = duration_s if duration_s is not None else law.duration_s or _FOR_EVER_S
    if not 1.0 <= lasts_s * rate_hz <= _MOST_ROWS:
        raise BadInputError(f"{lasts_s:g} s at {rate_hz:g} Hz are no log: give 1 to {_MOST_ROWS:g} samples")
    times_s = np.arange(round(lasts_s * rate_hz)) / rate_hz
    formulas = [] if effect_file is None else read_effect_file(path_of(effect_file, "an effect file"), CATALOGUE_IDS)
    rest, options, _ = with_own_formulas(names_of("effects", effects), formulas, compiled=True)
    run = simulated_record(
        simulated_plant(parameters, rad_s_from_rpm(stribeck_speed_rpm), rest),
        np.array([law.current_A(float(t)) for t in times_s]),
        times_s,
        speed_noise_rad_s=rad_s_from_rpm(speed_noise_rpm),
        torque_noise=rad_s_from_rpm(acceleration_noise_rpm_per_sqrt_s),
        seed=given.seed,
        **options,
    )
    if not np.isfinite(run.measured_speed_rad_s).all():
        raise BadInputError(
            "simulate: the wheel's speed goes beyond all numbers: an effect or a parameter is too large"
        )
    return WheelLog.from_arrays(
        run.time_s,
        speed_rad_s=run.measured_speed_rad_s,
        current_command_A=run.current_command_A,
        temperature_degC=run.temperature_degC,
        angle_rad=run.angle_rad,
        name=f"simulated {profile}",
    )


def _parameters_of(wheel: FrictionParameters | Mapping[str, float] | Sequence[float] | None) -> FrictionParameters:
    if wheel is None:
        return CK13_STATISTICAL
    named = wheel
    if isinstance(wheel, Sequence) and len(wheel) == len(PARAMETER_NAMES) and not isinstance(wheel, str):
        named = dict(zip(PARAMETER_NAMES, wheel, strict=True))
    if not isinstance(named, Mapping):
        names = ", ".join(PARAMETER_NAMES)
        raise BadInputError(f"simulate: a wheel is its {names}, by name or in order; found {type(wheel).__name__}")
    held = arguments(TrueWheelSection, CK13_STATISTICAL._asdict() | dict(named), "simulate: wheel")
    return FrictionParameters(held.motor_gain, held.viscous, held.coulomb, held.static)
