"""What noises a record has, and its Stribeck speed where nobody gave it: a fit of the part where the wheel moves most.

Used where no configuration speaks: a filter that is told too little torque noise believes itself far too much (its NIS
stays at 1.0 to 1.2 meanwhile), so that the noise has to come from the record, and never as zero.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

import numpy as np

from rw_ekf.errors import FilterError
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.log_filter import FilterInput
from rw_ekf.identify.least_squares import least_squares
from rw_ekf.identify.record_scale import busiest
from rw_ekf.likelihood.log_fit import LogFit, fit_log

_SAMPLES = 8_000  # enough for torque noise to a tenth of itself
_FEWEST = 100
_STRIBECK_RATIOS = (0.25, 1.0, 4.0)  # of a guess, where a search begins
_STRIBECK_STD = 1.0  # of a guess, in shares of it
_STRIBECK_SEEN = 0.5  # known better than to this share: it is the record's and no guess any more


@dataclass(frozen=True)
class RecordNoise:
    """Noises of a record, in SI, and the fit that they come from."""

    speed_noise_rad_s: float
    acceleration_noise: float  # rad/s per sqrt(s)
    stribeck_speed_rad_s: float
    stribeck_speed_std: float  # 0 where it was given
    fit: LogFit


def noise_of_record(
    data: FilterInput, constants: FilterConstants, prior: Belief, *, guessed_stribeck: bool = False
) -> RecordNoise | None:
    """Noises by restricted likelihood; None where the record is too short, or so odd that no fit comes about.

    constants: of a first guess; its acceleration noise is kept as the upper limit where the record shows none.
    guessed_stribeck: the Stribeck speed of `constants` is a guess and is fitted too.
    """
    part = busiest(data, _SAMPLES)
    if int(np.isfinite(part.speed_rad_s).sum()) < _FEWEST:
        return None
    with contextlib.suppress(FilterError, np.linalg.LinAlgError):
        fit = _fit(part, constants, prior, guessed_stribeck=guessed_stribeck)
        noises = fit.noises
        usual = float(np.sqrt(constants.acceleration_noise))
        found = noises.acceleration_noise
        if not np.isfinite([found, noises.speed_noise_rad_s, *fit.parameters]).all():
            return None
        known = not guessed_stribeck or fit.stribeck_speed_std < _STRIBECK_SEEN * fit.stribeck_speed_rad_s
        return RecordNoise(
            noises.speed_noise_rad_s,
            found if noises.acceleration_noise_seen else min(found, usual),
            fit.stribeck_speed_rad_s if known else constants.omega_s,
            fit.stribeck_speed_std if known else _STRIBECK_SEEN * constants.omega_s if guessed_stribeck else 0.0,
            fit,
        )
    return None


def _fit(data: FilterInput, constants: FilterConstants, prior: Belief, *, guessed_stribeck: bool) -> LogFit:
    if not guessed_stribeck:
        return fit_log(data, constants, prior, least_squares(data, constants, prior.core).parameters)
    tried = []
    for ratio in _STRIBECK_RATIOS:
        omega_s = ratio * constants.omega_s
        there = constants._replace(omega_s=omega_s, near_zero_speed=6.0 * omega_s)
        tried.append((fit_log(data, there, prior, least_squares(data, there, prior.core).parameters), there))
    best, there = max(tried, key=lambda item: item[0].noises.log_evidence)
    return fit_log(data, there, prior, best.parameters, stribeck_speed_std=_STRIBECK_STD * there.omega_s)
