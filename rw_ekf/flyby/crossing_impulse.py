"""The torque impulse of a zero crossing: from rate perturbations as [L17] III has it, and from an attitude record."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rw_ekf.arrays import Float64Array
from rw_ekf.records import Believed

_FEWEST = 4  # samples beyond a window's own coefficients
_LEAST_COSINE = 1.0e-3


class AxisImpulses(NamedTuple):
    """The impulse along a wheel's axis as each body axis shows it."""

    per_axis_Nms: tuple[float | None, ...]  # None for an axis that was not used
    mean_Nms: float  # what [L17] reports
    least_squares_Nms: float  # weighted by squared cosines: no axis is divided by its small cosine


def wheel_axis_impulse(
    rate_changes_rad_s: Sequence[float | None], inertia_kg_m2: Sequence[float], wheel_angles_rad: Sequence[float]
) -> AxisImpulses:
    """Impulse along a wheel's axis from the body's rate changes: inertia * rate / cos(angle to the wheel), [L17] III.

    All of length 3: rate changes, None where other motion hides one; principal moments of inertia; angles between the
    wheel's axis and the body's. Raises ValueError where no rate is given, or its axis is square to the wheel's.
    """
    per_axis: list[float | None] = []
    projected = squares = 0.0
    for rate, inertia, angle in zip(rate_changes_rad_s, inertia_kg_m2, wheel_angles_rad, strict=True):
        cosine = math.cos(angle)
        if rate is None:
            per_axis.append(None)
            continue
        if abs(cosine) < _LEAST_COSINE:
            raise ValueError("a body axis square to the wheel's shows nothing of its impulse: give None for its rate")
        per_axis.append(inertia * rate / cosine)
        projected += cosine * inertia * rate
        squares += cosine * cosine
    used = [value for value in per_axis if value is not None]
    if not used:
        raise ValueError("no rate change is given: there is no impulse to be had")
    return AxisImpulses(tuple(per_axis), sum(used) / len(used), projected / squares)


def zero_crossing_impulse(
    time_s: npt.ArrayLike,
    attitude_rad: npt.ArrayLike,
    crossing_s: float,
    inertia_kg_m2: float,
    *,
    before_s: float = 10.0,
    lasts_s: float = 0.0,
    after_s: float = 5.0,
    after_degree: int = 2,
) -> Believed:
    """Impulse on the body [N m s] of a wheel's zero crossing, from its attitude about one axis: inertia * rate change.

    time_s, attitude_rad: (n,), time rising, NaN attitudes are left out. A line is fitted over `before_s` before the
    crossing, a polynomial of `after_degree` over `after_s` from `lasts_s` after it (while the wheel stands the impulse
    continues); the rate changes from the slope at the end of the one to that at the beginning of the other. Degree 2
    lets the controller pull the body back meanwhile; 1 is surer, and right for a window much shorter than its time.
    The standard deviation holds white noise of the attitude and a random walk (of a gyro's integral), their shares by
    restricted maximum likelihood. Raises ValueError where a window has too few samples.
    """
    time, attitude = np.asarray(time_s, dtype=np.float64), np.asarray(attitude_rad, dtype=np.float64)
    known = np.isfinite(attitude) & np.isfinite(time)
    time, attitude = time[known], attitude[known]
    begin = crossing_s + lasts_s
    before = (time >= crossing_s - before_s) & (time < crossing_s)
    after = (time >= begin) & (time <= begin + after_s)
    for name, inside, coefficients in (("before", before, 2), ("after", after, 1 + after_degree)):
        count, needed = int(np.count_nonzero(inside)), coefficients + _FEWEST
        if count < needed:
            raise ValueError(f"{count} samples {name} the crossing at {crossing_s:g} s, at least {needed} are needed")
    used = before | after
    t, y = time[used], attitude[used]
    if np.any(np.diff(t) <= 0.0):
        raise ValueError("the time of an attitude record must rise")
    is_before, is_after = before[used], after[used]
    columns = [is_before, is_before * (t - crossing_s)]
    columns += [is_after * (t - begin) ** power for power in range(1 + after_degree)]
    change = np.zeros(len(columns))
    change[1], change[3] = -1.0, 1.0
    rate = _generalised_least_squares(t, y, np.column_stack(columns).astype(np.float64), change)
    return Believed(inertia_kg_m2 * rate.value, inertia_kg_m2 * rate.std)


def _generalised_least_squares(
    t: Float64Array, y: Float64Array, x: Float64Array, combination: Float64Array
) -> Believed:
    """A combination of the coefficients of y = x beta + white noise + random walk, t (n,), x (n, p).

    Differences of neighbours make the covariance tridiagonal: D (random walk) + B B' (white), B the differences.
    """
    from scipy.optimize import minimize_scalar

    steps = np.diff(t)
    scale = float(np.mean(steps))
    walk = np.concatenate([[1.0], steps / scale])  # the first is anything: a level is among the coefficients
    white = np.full(t.size, 2.0)
    white[0] = 1.0
    du = np.concatenate([y[:1], np.diff(y)])
    dx = np.concatenate([x[:1], np.diff(x, axis=0)])
    freedom = y.size - x.shape[1]

    def fit(share: float) -> tuple[float, Believed]:
        """Twice the negative restricted log likelihood, and the combination, where so much is random walk."""
        from scipy.linalg import cho_solve_banded, cholesky_banded

        band = np.stack([np.full(t.size, share - 1.0), (1.0 - share) * white + share * walk])
        factor = cholesky_banded(band)
        weighted = cho_solve_banded((factor, False), np.column_stack([dx, du]))
        normal = dx.T @ weighted[:, :-1]
        beta = np.linalg.solve(normal, dx.T @ weighted[:, -1])
        square = max(float(du @ weighted[:, -1] - beta @ (dx.T @ weighted[:, -1])), 0.0)
        variance = square / freedom
        spread = variance * float(combination @ np.linalg.solve(normal, combination))
        log_determinants = 2.0 * float(np.sum(np.log(factor[1]))) + float(np.linalg.slogdet(normal)[1])
        loss = freedom * math.log(max(variance, 1e-300)) + log_determinants
        return loss, Believed(float(combination @ beta), math.sqrt(max(spread, 0.0)))

    found = minimize_scalar(lambda logit: fit(_share(logit))[0], bounds=(-16.0, 7.0), method="bounded")
    return min((fit(0.0), fit(_share(float(found.x)))), key=lambda one: one[0])[1]


def _share(logit: float) -> float:
    return 1.0 / (1.0 + math.exp(-logit))
