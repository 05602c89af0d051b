"""A log of a simulated wheel, for whoever has none: a profile, a truth, effects, noise."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rw_ekf.attach.simulated import simulated_plant, simulated_record, with_own_formulas
from rw_ekf.checking.effect_file import read_effect_file
from rw_ekf.control.profiles import make_profile
from rw_ekf.effects.catalogue import CATALOGUE_IDS
from rw_ekf.errors import BadInputError
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.state import CK13_STATISTICAL, FrictionParameters
from rw_ekf.units import rad_s_from_rpm

_FOR_EVER_S = 600.0  # of a profile that has no end
_RATES_HZ = (1.0, 2000.0)


def simulate(
    profile: str = "identification",
    wheel: FrictionParameters | None = None,
    effects: Sequence[str] = (),
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

    wheel: its four parameters; None: those of [CK13]. effects: what it has beside them, as `simulate --effect` has
    them: "quadratic_drag" alone, or "quadratic_drag:coefficient_1_rad=1e-5". effect_file: of formulas of one's own,
    which `effects` then may name too.
    seed: of noise and profile. shape: amplitude_A, period_s, bias_A. duration_s: the profile's own, else 600 s.
    Raises BadInputError for a profile or an effect that there is not, or a time or rate that cannot be.
    """
    law = make_profile(profile, seed=seed, **shape)
    lasts_s = duration_s if duration_s is not None else law.duration_s or _FOR_EVER_S
    if not (_RATES_HZ[0] <= rate_hz <= _RATES_HZ[1] and np.isfinite(lasts_s) and lasts_s * rate_hz >= 1.0):
        raise BadInputError(f"{lasts_s:g} s at {rate_hz:g} Hz are no log: give 1 to 2000 Hz, and a sample at least")
    times_s = np.arange(round(lasts_s * rate_hz)) / rate_hz
    formulas = [] if effect_file is None else read_effect_file(effect_file, CATALOGUE_IDS)
    rest, options, _ = with_own_formulas(list(effects), formulas, compiled=True)
    run = simulated_record(
        simulated_plant(wheel or CK13_STATISTICAL, rad_s_from_rpm(stribeck_speed_rpm), rest),
        np.array([law.current_A(float(t)) for t in times_s]),
        times_s,
        speed_noise_rad_s=rad_s_from_rpm(speed_noise_rpm),
        torque_noise=rad_s_from_rpm(acceleration_noise_rpm_per_sqrt_s),
        seed=seed,
        **options,
    )
    return WheelLog.from_arrays(
        run.time_s,
        speed_rad_s=run.measured_speed_rad_s,
        current_command_A=run.current_command_A,
        temperature_degC=run.temperature_degC,
        angle_rad=run.angle_rad,
        name=f"simulated {profile}",
    )
