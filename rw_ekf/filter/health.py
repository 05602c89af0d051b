"""When a filter cannot be believed any more, and what is reset then: the rules that both paths share.

A filter breaks in its arithmetic, or it diverges: it is sure of parameters that are not the wheel's, for the wheel has
changed, and a gain that has fallen asleep corrects them in hours, if at all. Its innovations then have one sign for
many samples, and every few readings the speed has to be seeded anew; no noise does that (docs/filter.md, "Health").
"""

import math
from typing import Any, NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, by_identity
from rw_ekf.filter.gating import GATED, RESEEDED, UPDATED
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, SPEED

# What is wrong.
WELL = 0
NOT_FINITE = 1
NOT_POSITIVE = 2
RAN_AWAY = 3
DIVERGED = 4
LOCKED_OUT = 5
UNPHYSICAL = 6  # reported, and reset by nothing

# What is reset.
NOTHING = 0
SPEED_ONLY = 1
PARAMETERS_WIDENED = 2
ALL_AFRESH = 3

# Places in the memory.
_TIME_S = 0  # that the filter has run for
SPREAD = 1  # low-passed z^2, z the standardised innovation; 1 where all is well
CORRELATED = 2  # low-passed z_i z_(i-1); 0 where all is well
_LAST = 3  # innovation [rad/s]
_REFUSED_S = 4  # for how long every reading was refused
_REFUSED = 5  # and how many
_RECOVERING = 6  # used readings to come until the filter is called well again
_KEPT_S = 7  # when a good belief was last kept
_UNPROVEN = 8  # 1 where the filter was reset since then
_DIVERGED_S = 9  # when a divergence was last mended
_ACCIDENTS = 10  # resets that were no divergence, each forgotten in ten minutes, ...
_ACCIDENT_S = 11  # ... as of this time
_LOCKED_OUT = 12  # 1 where the speed has just been seeded anew after a long refusal
HEALTH_SIZE = 13

_STATISTICS_PER_S = 1.0 / 60.0  # of the low-passes, ...
_STATISTICS_SHARE = 0.01  # ... over a hundred readings at least
_DIVERGED_SPREAD = 4.0  # healthy wheels stay below 1.2, effects that the model lacks below 3
_DIVERGED_SHARE = 0.6  # of the spread: noise of five times the size that is believed reaches 0.46
_RESEED_WEIGHT = 5.0  # a seeding anew stands for the readings that were refused before it
_SOUND_SPREAD = 2.0  # of a belief that is worth keeping
_PATIENCE_S = 600.0  # between two divergences that are mended: an effect that the model lacks is mended by none
_FIRST_PATIENCE_S = 60.0
_LONG_REFUSAL_S = 10.0  # a filter that is seeded anew after that was locked out
_REFUSED_TOO_LONG_S = 60.0
_KEEP_EVERY_S = 10.0
_FAR = 1.0e3  # in the widest sigmas, from the start: no wheel is there
_WILD = 1.0e9  # rad/s: nor there
_FORGET_S = 600.0
_BEYOND_MENDING = 3.5  # accidents that are not forgotten yet
_RECOVERY = 20.0  # readings
_NOT_SO_SURE = 4.0  # times the variance that was believed
_WIDE_AGAIN = 0.25  # of the ceiling: half the sigmas of a wide prior
_SURE = 5.0  # sigmas by which a motor gain or a Coulomb friction is negative
_ROUNDING = 1.0e-9  # of a variance: so much may a pivot be below zero


def start_health(memory: Any) -> None:
    """Begin: nothing has happened yet."""
    for i in range(HEALTH_SIZE):
        memory[i] = 0.0
    memory[SPREAD] = 1.0
    memory[_DIVERGED_S] = _FIRST_PATIENCE_S - _PATIENCE_S


def learns(P: Any) -> bool:
    """Whether P (n, n) leaves anything but the speed to be learned; a filter that does not is never reset."""
    widest = 0.0
    for j in range(MOTOR_GAIN, P.shape[0]):
        widest = max(widest, P[j, j])
    return bool(widest > 0.0)


@by_identity
class Grounds(NamedTuple):
    """What a reset falls back to; only variances, for a covariance is part of what may be wrong."""

    good_mean: Float64Array  # (n,) the last good belief
    good_variance: Float64Array  # (n,)
    start_mean: Float64Array  # (n,) what the filter began with
    start_variance: Float64Array  # (n,)
    ceiling: Float64Array  # (n,) variances of a wide prior
    root: Float64Array  # (n, n) scratch


def lay_grounds(x: Any, P: Any, ceiling: Any) -> Grounds:
    """The grounds at the start."""
    n = P.shape[0]
    variance = np.zeros(n)
    for j in range(n):
        variance[j] = P[j, j]
    return Grounds(x.copy(), variance.copy(), x.copy(), variance, ceiling, np.zeros((n, n)))


def notice(memory: Any, x: Any, P: Any, what: int, innovation: float, variance: float, gate: float, dt: float) -> bool:
    """Take a sample of outcome `what` into the memory; whether the filter has to be examined after it.

    innovation [rad/s] and its variance: of the reading, zero and one where there was none; dt [s] since the sample
    before. What is not finite shows in the speed and its variance first, because nothing else corrects a parameter.
    """
    memory[_TIME_S] += dt
    if what == UPDATED:
        share = min(dt * _STATISTICS_PER_S, _STATISTICS_SHARE)
        per_variance = innovation / variance
        memory[SPREAD] += share * (per_variance * innovation - memory[SPREAD])
        memory[CORRELATED] += share * (per_variance * memory[_LAST] - memory[CORRELATED])
        memory[_LAST] = innovation
        memory[_REFUSED] = 0.0
        if memory[_RECOVERING] > 0.0:
            memory[_RECOVERING] -= 1.0
    elif what == GATED:
        memory[_REFUSED_S] = memory[_REFUSED_S] + dt if memory[_REFUSED] > 0.0 else dt
        memory[_REFUSED] += 1.0
    elif what == RESEEDED:
        if innovation != 0.0:  # not after a gap
            memory[_LOCKED_OUT] = 1.0 if memory[_REFUSED_S] >= _LONG_REFUSAL_S else 0.0
            share = _RESEED_WEIGHT * min(dt * _STATISTICS_PER_S, _STATISTICS_SHARE)
            memory[SPREAD] += share * (gate - memory[SPREAD])
            memory[CORRELATED] += share * (gate - memory[CORRELATED])
            memory[_LAST] = 0.0
        memory[_REFUSED] = 0.0
    look = memory[_TIME_S] - memory[_KEPT_S] >= _KEEP_EVERY_S or memory[_LOCKED_OUT] == 1.0
    if memory[SPREAD] > _DIVERGED_SPREAD or not math.isfinite(x[SPEED] + P[SPEED, SPEED]):
        look = True
    return bool(look)


def examine(memory: Any, x: Any, P: Any, grounds: Grounds, what: int) -> int:
    """WELL, or what is wrong with the belief x (n,), P (n, n) after a sample that was noticed."""
    broken = breakage(x, P, grounds)
    if broken != WELL:
        return broken
    if memory[_LOCKED_OUT] == 1.0:
        return LOCKED_OUT
    if is_diverged(memory) and memory[_TIME_S] - memory[_DIVERGED_S] >= _PATIENCE_S:
        return DIVERGED
    is_sound = what == UPDATED and memory[SPREAD] < _SOUND_SPREAD and memory[_RECOVERING] == 0.0
    if is_sound and memory[_TIME_S] - memory[_KEPT_S] >= _KEEP_EVERY_S:
        return keep(memory, x, P, grounds)
    return WELL


def breakage(x: Any, P: Any, grounds: Grounds) -> int:
    """WELL, or how a belief has broken: NOT_FINITE, NOT_POSITIVE in a variance, RAN_AWAY."""
    total = 0.0
    least = 0.0
    far = abs(x[SPEED]) > _WILD
    for j in range(P.shape[0]):
        total += x[j] + P[j, j]
        least = min(least, P[j, j])
        away = x[j] - grounds.start_mean[j]
        if j > SPEED and away * away > _FAR * _FAR * grounds.ceiling[j]:
            far = True
    if not math.isfinite(total):
        return NOT_FINITE
    if least < 0.0:
        return NOT_POSITIVE
    return RAN_AWAY if far else WELL


def is_diverged(memory: Any) -> bool:
    """Whether the innovations are those of a filter that believes in a wheel that is not there."""
    return bool(memory[SPREAD] > _DIVERGED_SPREAD and memory[CORRELATED] > _DIVERGED_SHARE * memory[SPREAD])


def is_refusing(memory: Any) -> bool:
    """Whether every reading has been refused for too long."""
    return bool(memory[_REFUSED] > 0.0 and memory[_REFUSED_S] >= _REFUSED_TOO_LONG_S)


def is_recovering(memory: Any) -> bool:
    """Whether fewer than twenty readings were used since the last reset."""
    return bool(memory[_RECOVERING] > 0.0)


def is_beyond_mending(memory: Any) -> bool:
    """Whether the filter had to be reset so often of late that resetting does not help."""
    return bool(memory[_ACCIDENTS] > _BEYOND_MENDING)


def still_wrong(memory: Any, x: Any, P: Any) -> int:
    """WELL, or what is wrong with a filter of which nothing has to be reset now: LOCKED_OUT, DIVERGED, UNPHYSICAL."""
    if is_refusing(memory):
        return LOCKED_OUT
    if is_diverged(memory):
        return DIVERGED
    return UNPHYSICAL if _is_negative(x, P, MOTOR_GAIN) or _is_negative(x, P, COULOMB) else WELL


def _is_negative(x: Any, P: Any, i: int) -> bool:
    """Whether a parameter is below zero by five of its sigmas."""
    return bool(x[i] < 0.0 and x[i] * x[i] > _SURE * _SURE * P[i, i])


def keep(memory: Any, x: Any, P: Any, grounds: Grounds) -> int:
    """Keep the belief as the last good one; NOT_POSITIVE, and it is not kept, where P (n, n) has no Cholesky root."""
    n = P.shape[0]
    root = grounds.root
    for j in range(n):
        pivot = P[j, j]
        for m in range(j):
            pivot -= root[j, m] * root[j, m]
        if pivot < -_ROUNDING * P[j, j]:
            return NOT_POSITIVE
        for i in range(j + 1, n):
            value = P[i, j]
            for m in range(j):
                value -= root[i, m] * root[j, m]
            root[i, j] = value / math.sqrt(pivot) if pivot > _ROUNDING * P[j, j] else 0.0
    for j in range(n):
        grounds.good_mean[j] = x[j]
        grounds.good_variance[j] = P[j, j]
    memory[_KEPT_S] = memory[_TIME_S]
    memory[_UNPROVEN] = 0.0
    return WELL


def mend(memory: Any, verdict: int, x: Any, P: Any, grounds: Grounds) -> int:
    """Reset everything but the speed, which the caller seeds from the reading, by what is wrong; what was reset.

    Locked out: nothing. Else to the last good belief, its sigmas doubled, after a divergence at least half of those
    of a wide prior; or to the start, where the filter has not been well since it was last reset.
    """
    n = P.shape[0]
    now = memory[_TIME_S]
    memory[_RECOVERING] = _RECOVERY
    memory[_REFUSED] = 0.0
    memory[_LOCKED_OUT] = 0.0
    memory[SPREAD] = 1.0
    memory[CORRELATED] = 0.0
    memory[_LAST] = 0.0
    if verdict == DIVERGED:
        memory[_DIVERGED_S] = now
    else:
        memory[_ACCIDENTS] = max(memory[_ACCIDENTS] - (now - memory[_ACCIDENT_S]) / _FORGET_S, 0.0) + 1.0
        memory[_ACCIDENT_S] = now
    if verdict == LOCKED_OUT:
        return SPEED_ONLY
    afresh = memory[_UNPROVEN] == 1.0 and verdict != DIVERGED
    memory[_UNPROVEN] = 1.0
    memory[_KEPT_S] = now
    mean = grounds.start_mean if afresh else grounds.good_mean
    variance = grounds.start_variance if afresh else grounds.good_variance
    for j in range(n):
        for m in range(n):
            P[j, m] = 0.0
        x[j] = mean[j]
        wider = _NOT_SO_SURE * variance[j]
        if verdict == DIVERGED:
            wider = max(wider, _WIDE_AGAIN * grounds.ceiling[j])
        P[j, j] = variance[j] if afresh else min(wider, grounds.ceiling[j])
    x[SPEED] = 0.0
    P[SPEED, SPEED] = 0.0
    return ALL_AFRESH if afresh else PARAMETERS_WIDENED
