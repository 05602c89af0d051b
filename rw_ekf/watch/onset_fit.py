"""When exactly did it set in, and how large is it? Generalised least squares over the last seconds, once per spike."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from rw_ekf.watch.observation import Observation, breakaway

_CANDIDATES = 64
_SURE_SQUARE = 16.0  # an amplitude of fewer than four standard deviations is no number to report
_STANDING = 5  # readings near zero running
_AWAY = 2.0  # times the limit of rest that the drive would have moved a wheel that is not held


class OnsetFit(NamedTuple):
    """The likeliest onset."""

    time_s: float
    amplitude_rad_s2: float
    std_rad_s2: float
    lag_rad_s: float  # of the wheel behind the filter's speed after the last update
    sized: bool  # the amplitude is at least four standard deviations
    is_step: bool  # a sudden step of the speed explains the readings better
    at_least: bool  # the wheel stands still under a current that would move it: the amplitude is a lower bound


def fit_onset(
    recent: Sequence[Observation], drag_gains: Sequence[float], earliest_s: float, near_rest_rad_s: float
) -> OnsetFit | None:
    """Try onsets between `earliest_s` and the last sample; None where no drag above zero explains anything.

    recent: observations, no gap, oldest first; drag_gains: L of each (docs/watch.md eq. 3), zero for the estimator.
    Readings count in full: once a spike is sure there is no wild one among them. A reading below `near_rest_rad_s` may
    be that of a wheel at rest, which shows no more than that its drag holds it.
    """
    first_s = max(earliest_s, recent[0].time_s - recent[0].dt_s)
    step_s = (recent[-1].time_s - first_s) / _CANDIDATES
    tried = []
    rival = 0.0
    for number in range(_CANDIDATES):
        onset_s = first_s + number * step_s
        lag, information, score, step_square = _response(recent, drag_gains, onset_s, near_rest_rad_s)
        rival = max(rival, step_square)
        if score > 0.0:
            tried.append((score * score / information, onset_s, score / information, 1.0 / information, lag))
    best = _weighed(tried, rival) if tried else None
    held = _held(recent, first_s, near_rest_rad_s)
    if held > 0.0 and (best is None or not best.sized or best.amplitude_rad_s2 < held):
        since_s, lag = (first_s, 0.0) if best is None else (best.time_s, best.lag_rad_s)
        return OnsetFit(since_s, held, held, lag, sized=False, is_step=False, at_least=True)
    return best


def _weighed(tried: Sequence[tuple[float, float, float, float, float]], rival: float) -> OnsetFit:
    """Mean over the onsets by likelihood: (square, onset, amplitude, its variance, lag per amplitude) of each.

    So the amplitude's standard deviation holds what the uncertain onset adds.
    """
    square = max(tried)[0]
    onset_s = amplitude = squares = lag = total = 0.0
    for its_square, its_onset_s, its_amplitude, its_variance, its_lag in tried:
        weight = math.exp(0.5 * (its_square - square))
        total += weight
        onset_s += weight * its_onset_s
        amplitude += weight * its_amplitude
        squares += weight * (its_amplitude * its_amplitude + its_variance)
        lag += weight * its_lag * its_amplitude
    mean = amplitude / total
    std = math.sqrt(max(squares / total - mean * mean, 0.0))
    return OnsetFit(
        onset_s / total, mean, std, lag / total, sized=square > _SURE_SQUARE, is_step=rival > square, at_least=False
    )


def _response(
    recent: Sequence[Observation], drag_gains: Sequence[float], onset_s: float, near_rest_rad_s: float
) -> tuple[float, float, float, float]:
    """(lag after the last update, sum m^2/S, sum m nu/S, square of the rival) of a unit of drag from `onset_s` on."""
    lag, missing, information, score = 0.0, 1.0, 0.0, 0.0
    step, step_information, step_score = 1.0, 0.0, 0.0
    for e, drag_gain in zip(recent, drag_gains, strict=True):
        if e.time_s <= onset_s:
            continue
        lag = e.keep * lag - e.direction * min(e.dt_s, e.time_s - onset_s) * missing
        step *= e.keep
        if not math.isnan(e.innovation_rad_s):
            if e.direction * (e.speed_rad_s + e.innovation_rad_s) > near_rest_rad_s:
                information += lag * lag / e.variance
                score += lag * e.innovation_rad_s / e.variance
                step_information += step * step / e.variance
                step_score += step * e.innovation_rad_s / e.variance
            missing -= drag_gain * lag
            lag *= 1.0 - e.gain
            step *= 1.0 - e.gain
        if e.reseeded:
            lag = step = 0.0
    return lag, information, score, step_score * step_score / step_information if step_information > 0.0 else 0.0


def _held(recent: Sequence[Observation], first_s: float, near_rest_rad_s: float) -> float:
    """Largest drive beyond break-away [rad/s^2] under which the wheel stood still; 0 where it did not.

    It stood, and did not just pass through zero slowly, where that drive would have moved it well away meanwhile.
    """
    static = breakaway(recent[0].belief)
    held, largest, impulse, readings = 0.0, 0.0, 0.0, 0
    for e in recent:
        if e.time_s <= first_s or math.isnan(e.innovation_rad_s):
            continue
        beyond = abs(e.belief.motor_gain * e.current_A) - static
        if e.direction == 0.0 or beyond <= 0.0 or abs(e.speed_rad_s + e.innovation_rad_s) > near_rest_rad_s:
            largest, impulse, readings = 0.0, 0.0, 0
            continue
        readings += 1
        largest = max(largest, beyond)
        impulse += beyond * e.dt_s
        if impulse > _AWAY * near_rest_rad_s and readings >= _STANDING:
            held = max(held, largest)
    return held
