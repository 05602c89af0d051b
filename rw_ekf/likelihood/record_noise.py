"""A record's noises, and its Stribeck speed where it was not given: a fit of the part where the wheel moves most.

Used without a configuration: a filter that is given too little torque noise believes itself far too much (its NIS
stays at 1.0 to 1.2 meanwhile), so that the noise has to come from the record, and never as zero.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.errors import FilterError
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.identify.least_squares import least_squares
from rw_ekf.identify.record_scale import (
    COULOMB_BAND,
    DEFAULT_STRIBECK_SPEED_RAD_S,
    GAIN_BAND,
    MOST_VISCOUS,
    RecordScale,
    busiest,
)
from rw_ekf.likelihood.log_fit import LogFit, fit_log
from rw_ekf.model.state import CK13_STATISTICAL, PARAMETER_NAMES, FrictionParameters

_SAMPLES = 8_000  # enough for torque noise to a tenth of itself
_SAMPLES_OF_CLEAR_CASE = 1_000
_FEWEST = 100
_SAYS_NOTHING = 10.0  # values, as the standard deviation of a prior
_HELD_AMONG = PARAMETER_NAMES.index("static")  # break-away friction goes with Coulomb's
_HELD = 1.0e-8  # of a value, as the standard deviation of a prior that holds it
_CLEARLY = 20.0  # log-likelihood
_STRIBECK_RATIOS = (0.0625, 0.25, 1.0, 4.0)  # of a guess, where a search begins
_GUESS_REFUTED = 5.0  # log-evidence by which another start is better
_STRIBECK_STD = 1.0  # of a guess, in shares of it
STRIBECK_SEEN = 0.5  # known better than to this share: it is the record's and no guess any more


@dataclass(frozen=True)
class RecordNoise:
    """Noises of a record, in SI, and the fit that they come from."""

    speed_noise_rad_s: float
    acceleration_noise: float  # rad/s per sqrt(s)
    stribeck_speed_rad_s: float
    stribeck_speed_std: float  # 0 where it was given
    acceleration_noises: tuple[float, ...]  # five of equal weight that stand for what is not known of it
    fit: LogFit
    lowest_loss: FrictionParameters | None  # of the free run over the whole record; None: only a part was looked at


def noise_of_record(
    course: Course, constants: FilterConstants, prior: Belief, *, guessed_stribeck: bool = False
) -> RecordNoise | None:
    """Noises by restricted likelihood; None where the record is too short, or so odd that no fit comes about.

    constants: of a first guess; its acceleration noise is kept as the upper limit where the record shows none.
    guessed_stribeck: the Stribeck speed of `constants` is a guess and is fitted too.
    """
    part = busiest(course, _SAMPLES)
    if not _has_enough(part):
        return None
    with contextlib.suppress(FilterError, np.linalg.LinAlgError):
        fit, lowest, guess = _fit(part, constants, prior, guessed_stribeck=guessed_stribeck)
        noises = fit.noises
        usual = constants.acceleration_noise
        found = noises.acceleration_noise
        if not np.isfinite([found, noises.speed_noise_rad_s, *fit.parameters]).all():
            return None
        limit = math.inf if noises.acceleration_noise_seen else usual
        known = not guessed_stribeck or fit.stribeck_speed_std < STRIBECK_SEEN * fit.stribeck_speed_rad_s
        return RecordNoise(
            noises.speed_noise_rad_s,
            min(found, limit),
            fit.stribeck_speed_rad_s if known else guess,
            fit.stribeck_speed_std if known else STRIBECK_SEEN * guess if guessed_stribeck else 0.0,
            tuple(float(noise) for noise in noises.acceleration_noise_quantiles),
            fit,
            lowest if part.samples == course.samples else None,
        )
    return None


def is_foreign(course: Course, scale: RecordScale) -> bool:
    """Whether a record that does not look like the default wheel at first sight is clearly not one.

    The four parameters are fitted with a prior so wide that it says nothing, and once more with motor gain, viscous and
    Coulomb friction held within the band of the default wheel's class. Foreign is what the band makes clearly less
    likely, each fit at its own best noises: a wheel that hardly moves, whatever its best parameters, proves nothing.
    """
    part, little = busiest(course, _SAMPLES), busiest(course, _SAMPLES_OF_CLEAR_CASE)
    if not _has_enough(part):
        return not scale.like_default_wheel
    if little.samples < part.samples and _has_enough(little) and _is_outside_band(little, scale):
        return True  # what the band cannot explain here no other part makes good
    return _is_outside_band(part, scale)


def _has_enough(part: Course) -> bool:
    read = part.speed_rad_s[np.isfinite(part.speed_rad_s)]
    return read.size >= _FEWEST and bool(np.ptp(read) > 0.0)  # one number throughout shows no noise


def _is_outside_band(part: Course, scale: RecordScale) -> bool:
    usual = np.array(CK13_STATISTICAL)
    wide = _SAYS_NOTHING * np.maximum(usual, np.abs(np.array(scale.rough)))
    free = _best(part, scale, [scale.rough, CK13_STATISTICAL], usual, wide)
    if free is None:
        return True
    found = free.parameters
    held = found._replace(
        motor_gain=_within(found.motor_gain, CK13_STATISTICAL.motor_gain, GAIN_BAND),
        viscous=min(found.viscous, MOST_VISCOUS * CK13_STATISTICAL.viscous),
        coulomb=_within(found.coulomb, CK13_STATISTICAL.coulomb, COULOMB_BAND),
    )
    held = held._replace(static=max(held.static, 1.03 * held.coulomb))
    if held[:_HELD_AMONG] == found[:_HELD_AMONG]:
        return False
    std = wide.copy()
    for place, (name, before, after) in enumerate(zip(PARAMETER_NAMES, found, held, strict=True)):
        if name != "static" and before != after:
            std[place] = _HELD * abs(after)
    like_a_wheel = _best(part, scale, [held, CK13_STATISTICAL], np.array(held), std)
    return like_a_wheel is None or free.fit.likelihood.value - like_a_wheel.fit.likelihood.value > _CLEARLY


def _best(
    course: Course, scale: RecordScale, starts: list[FrictionParameters], mean: Float64Array, std: Float64Array
) -> LogFit | None:
    """The likeliest fit from several starts, at the default's Stribeck speed and at the record's; None if all fail."""
    prior = Belief.of_known(mean, np.diag(np.square(std)))
    found = []
    for omega_s in (DEFAULT_STRIBECK_SPEED_RAD_S, scale.constants.stribeck.omega_s):
        constants = scale.constants.with_stribeck_speed(omega_s)
        for start in starts:
            with contextlib.suppress(FilterError, np.linalg.LinAlgError):
                found.append(fit_log(course, constants, prior, start))
    return max(found, key=lambda fit: fit.fit.likelihood.value, default=None)


def _within(value: float, usual: float, band: tuple[float, float]) -> float:
    return min(max(value, band[0] * usual), band[1] * usual)


def _fit(
    course: Course, constants: FilterConstants, prior: Belief, *, guessed_stribeck: bool
) -> tuple[LogFit, FrictionParameters, float]:
    """The fit, where the free run's loss was lowest, from which it began, and a guess not refuted."""
    if not guessed_stribeck:
        lowest = least_squares(course, constants, prior.core).parameters
        return fit_log(course, constants, prior, lowest), lowest, constants.stribeck.omega_s
    tried = {}
    for ratio in _STRIBECK_RATIOS:
        there = constants.with_stribeck_speed(ratio * constants.stribeck.omega_s)
        lowest = least_squares(course, there, prior.core).parameters
        tried[ratio] = fit_log(course, there, prior, lowest), there, lowest
    best, there, lowest = max(tried.values(), key=lambda item: item[0].noises.log_evidence)
    refuted = best.noises.log_evidence > tried[1.0][0].noises.log_evidence + _GUESS_REFUTED
    guess = (there if refuted else constants).stribeck.omega_s
    std = _STRIBECK_STD * there.stribeck.omega_s
    return fit_log(course, there, prior, best.parameters, stribeck_speed_std=std), lowest, guess
