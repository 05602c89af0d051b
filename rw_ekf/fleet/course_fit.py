"""One parameter of one wheel over time: a line, its temperature, steps, and what wanders and scatters about them.

    y(t) = level + rate t + share (T - T0) + sum of steps + walk(t) + scatter + the day's own error

The walk is a Brownian motion and the scatter white; how large they are is not known, so the numbers are averaged over a
grid of both by the restricted likelihood: a wheel that wanders has a rate with a wide band, and a quiet one a narrow
band. Where steps are is decided by the same likelihood ("change points by evidence": docs/fleet.md#trends).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array

# Of the scatter from day to day (the scale): white scatter beside the days' own errors, and the walk over the whole
# record: none, and factors of two over all that a record can distinguish. Before anything is seen all are alike.
_SCATTERS = (0.0, 0.25, 0.5, 0.7, 1.0, 1.4, 2.0, 4.0)
_WALKS = (0.0, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4, 12.8, 25.6)
ANY_WALK = np.full(len(_WALKS), 1.0 / len(_WALKS))
_LIKE_BEFORE = 10.0  # wheels that `ANY_WALK` is worth beside what a fleet's own wheels say of their walks; chosen
_WALK_ROUNDS = 50
_STEP_SHARE = 0.1  # of the parameter: the size of a step before it is seen [1 sigma]; chosen: failures are per cents
_STEPS_PER_YEAR = 0.1  # before anything is seen; chosen: one in ten years of a wheel
STEP_PROBABILITY = 0.95  # above which a step is reported
_MOST_STEPS = 4
_LEAST_BESIDE = 2  # points on either side of a step


@dataclass(eq=False, frozen=True)
class Points:
    """n points of a course: a day each, or several days taken together."""

    time_y: Float64Array  # (n,) since the first [years]
    value: Float64Array  # (n,)
    variance: Float64Array  # (n,) of the days' own errors
    share: Float64Array  # (n,) of the white scatter's variance that a point has: 1 for a day
    spread_y: Float64Array  # (n,) half the mean distance between the days of a point: 0 for a day
    now_y: float  # the last day, which may be later than the last point
    warmth_K: Float64Array | None  # (n,) temperature over the fleet's own; None: not taken out


@dataclass(frozen=True)
class Step:
    """A sudden change between two points."""

    before: int  # it lies between this point and the next
    size: float
    std: float
    probability: float


@dataclass(eq=False, frozen=True)
class CourseFit:
    """What a course says. Levels are at the fleet's own temperature, rates per year."""

    level: float  # on the last day, with what the walk has done
    level_std: float
    began: float  # the line at the first point
    rate: float
    rate_std: float
    per_K: float | None
    per_K_std: float | None
    scatter: float  # white [1 sigma]
    walk: float  # per sqrt(year) [1 sigma]
    steps: tuple[Step, ...]
    line: Float64Array  # (n,) line and steps at the points' times, without temperature and walk
    walks: Float64Array  # probability of each size of the walk


def walks_of_fleet(walks: Float64Array) -> Float64Array:
    """How probable each size of the walk is for a wheel of this fleet: (m,), from those of n wheels, (n, m).

    walks: each wheel's by `ANY_WALK`. One wheel's record hardly shows whether it wanders, and the band of its rate
    depends on it; like wheels wander alike, and all of them show it (empirical Bayes, by expectation and maximisation).
    """
    prior = ANY_WALK
    for _ in range(_WALK_ROUNDS):
        each = walks / ANY_WALK * prior
        each /= each.sum(axis=1, keepdims=True)
        prior = (each.sum(axis=0) + _LIKE_BEFORE * ANY_WALK) / (walks.shape[0] + _LIKE_BEFORE)
    return prior


def fit_course(points: Points, walks: Float64Array = ANY_WALK) -> CourseFit:
    """Fit a course of five points or more. walks: how probable each size of the walk is before this record is seen."""
    places: list[int] = []
    probabilities: list[float] = []
    while True:
        grid = _Grid(points, places, walks)
        found = grid.likeliest_step() if len(places) < _MOST_STEPS else None
        if found is None or found[1] < STEP_PROBABILITY:
            return grid.fit(probabilities)
        places.append(found[0])
        probabilities.append(found[1])


class _Grid:
    """All pairs of scatter and walk at once, with the steps that stand."""

    def __init__(self, points: Points, places: list[int], walks_before: Float64Array) -> None:
        self._points, self._places = points, places
        t, y = points.time_y, points.value
        self._columns = [np.ones_like(t), t] + ([] if points.warmth_K is None else [points.warmth_K])
        self._columns += [_risen(t.size, place) for place in places]
        X = np.column_stack(self._columns)
        scale, span = _scale(points), max(float(t[-1]), 1e-6)
        scatters, walks = np.meshgrid(scale * np.array(_SCATTERS), scale * np.array(_WALKS), indexing="ij")
        self._scatter, self._walk = scatters.ravel(), walks.ravel() / np.sqrt(span)
        # Of two points' means min(t, t'); of one with itself, of its days s and s', E min(s, s') = t - spread.
        self._brown = np.minimum.outer(t, t) - np.diag(points.spread_y)
        V = self._walk[:, None, None] ** 2 * self._brown
        at = np.arange(t.size)
        V[:, at, at] += points.variance + self._scatter[:, None] ** 2 * points.share + 1e-12 * scale**2
        L = np.linalg.cholesky(V)
        candidates = np.column_stack([_risen(t.size, place) for place in self._candidates()] or [np.zeros_like(t)])
        last = self._walk[:, None] ** 2 * t  # covariance of the walk now with the walk then
        right = np.concatenate(
            [np.broadcast_to(A, (L.shape[0], *A.shape)) for A in (X, y[:, None], candidates)], axis=2
        )
        white = np.linalg.solve(L, np.concatenate([right, last[:, :, None]], axis=2))
        k = X.shape[1]
        self._X, self._y, self._Z, self._c = white[..., :k], white[..., k], white[..., k + 1 : -1], white[..., -1]
        normal = np.einsum("gni,gnj->gij", self._X, self._X)
        self._covariance = np.linalg.inv(normal)
        self._beta = np.einsum("gij,gnj,gn->gi", self._covariance, self._X, self._y)
        self._residual = self._y - np.einsum("gni,gi->gn", self._X, self._beta)
        self._log = -np.log(np.diagonal(L, axis1=1, axis2=2)).sum(axis=1) - 0.5 * np.linalg.slogdet(normal)[1]
        self._log -= 0.5 * np.einsum("gn,gn->g", self._residual, self._residual)
        self._log += np.log(np.tile(np.maximum(walks_before, 1e-300), len(_SCATTERS)))

    @property
    def _weights(self) -> Float64Array:
        weights = np.exp(self._log - self._log.max())
        return np.asarray(weights / weights.sum())

    def likeliest_step(self) -> tuple[int, float] | None:
        """Where a further step is likeliest, and the probability that there is one anywhere; None where none can be."""
        places = self._candidates()
        if not places:
            return None
        onto = np.einsum("gni,gnk->gik", self._X, self._Z)
        information = np.einsum("gnk,gnk->gk", self._Z, self._Z)
        information -= np.einsum("gik,gij,gjk->gk", onto, self._covariance, onto)
        score = np.einsum("gnk,gn->gk", self._Z, self._residual)
        prior = (_STEP_SHARE * abs(float(np.mean(self._points.value)))) ** 2
        grown = 1.0 + prior * np.maximum(information, 0.0)
        of_each = self._log[:, None] - 0.5 * np.log(grown) + 0.5 * prior * score**2 / grown
        chance = min(_STEPS_PER_YEAR * float(self._points.time_y[-1]), 0.5)
        without = np.log1p(-chance) + _log_sum(self._log)
        by_place = np.logaddexp.reduce(of_each, axis=0) + np.log(chance / len(places))
        with_one = _log_sum(by_place)
        return places[int(np.argmax(by_place))], float(1.0 / (1.0 + np.exp(min(without - with_one, 700.0))))

    def fit(self, probabilities: list[float]) -> CourseFit:
        """The numbers, averaged over the grid: means, and standard deviations with what the means differ by."""
        weights = self._weights
        beta, std = _averaged(weights, self._beta, np.diagonal(self._covariance, axis1=1, axis2=2))
        now = np.array([column[-1] for column in self._columns])
        now[1] = self._points.now_y
        if self._points.warmth_K is not None:
            now[2] = 0.0
        reach = now - np.einsum("gni,gn->gi", self._X, self._c)
        level = self._beta @ now + np.einsum("gn,gn->g", self._c, self._residual)
        variance = self._walk**2 * self._points.now_y - np.einsum("gn,gn->g", self._c, self._c)
        variance += np.einsum("gi,gij,gj->g", reach, self._covariance, reach)
        level_mean, level_std = _averaged(weights, level[:, None], np.maximum(variance, 0.0)[:, None])
        first = 2 if self._points.warmth_K is None else 3
        warm = None if first == 2 else (float(beta[2]), float(std[2]))
        line = beta[0] + beta[1] * self._columns[1] + sum(
            beta[first + i] * self._columns[first + i] for i in range(len(self._places))
        )  # fmt: skip
        steps = [
            Step(place, float(beta[first + i]), float(std[first + i]), probability)
            for i, (place, probability) in enumerate(zip(self._places, probabilities, strict=True))
        ]
        return CourseFit(
            level=float(level_mean[0]), level_std=float(level_std[0]), began=float(beta[0]),
            rate=float(beta[1]), rate_std=float(std[1]),
            per_K=None if warm is None else warm[0], per_K_std=None if warm is None else warm[1],
            scatter=float(np.sqrt(weights @ self._scatter**2)), walk=float(np.sqrt(weights @ self._walk**2)),
            steps=tuple(sorted(steps, key=lambda step: step.before)), line=np.asarray(line),
            walks=weights.reshape(len(_SCATTERS), len(_WALKS)).sum(axis=0),
        )  # fmt: skip

    def _candidates(self) -> list[int]:
        """Places of a further step: with points on either side, and not beside one that stands."""
        n = self._points.time_y.size
        taken = {place + off for place in self._places for off in (-1, 0, 1)}
        return [place for place in range(_LEAST_BESIDE - 1, n - _LEAST_BESIDE) if place not in taken]


def _risen(n: int, place: int) -> Float64Array:
    return (np.arange(n) > place).astype(np.float64)


def _scale(points: Points) -> float:
    """Scatter from one point to the next [1 sigma], robust against steps; never below the days' own errors."""
    differences = np.abs(np.diff(points.value)) / np.sqrt(points.share[1:] + points.share[:-1])
    return max(
        1.4826 * float(np.median(differences)), float(np.median(np.sqrt(points.variance / points.share))), 1e-300
    )


def _averaged(weights: Float64Array, means: Float64Array, variances: Float64Array) -> tuple[Float64Array, Float64Array]:
    mean = weights @ means
    return mean, np.sqrt(weights @ (variances + (means - mean) ** 2))


def _log_sum(values: Float64Array) -> float:
    return float(np.logaddexp.reduce(values))
