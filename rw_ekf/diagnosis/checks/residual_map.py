"""Is anything structured left, and along what? The map of the residual (docs/likelihood.md, "The map").

Each dependence (speed, low speed, current, angle, temperature, time) is a set of functions that multiply a torque or a
dry friction, entered into the same regression as an effect would be. Nothing in particular is assumed of the shape, and
a dependence that the model's own parameters can follow counts for nothing. What bends anyhow is tested on all of them
at once; what bends little, as most laws do, of the two smoothest of each kind, which weak structure does not drown in.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.checks.noise_alone import p_values_by_draws
from rw_ekf.diagnosis.hypotheses.joint_regressors import GroupFit, fit_group
from rw_ekf.diagnosis.hypotheses.noise_ratios import Profiled
from rw_ekf.diagnosis.thresholds import INFLATION
from rw_ekf.filter.tails import chi_square_tail
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.structure import hats, slopes_by_torque, where_begun
from rw_ekf.model.effect import RecordFacts

Kind = Literal["drag", "torque", "torque along the current", "motor gain"]

_DOUBTED = 0.01  # a p-value below it is computed again from noise alone
_SMOOTHNESS = 0.5  # of a quantity's range: over less a smooth law bends little
_LEAST_SMOOTH = 1.0e-6  # of the largest: curves that bend more than a smooth law does at all
_SMOOTHEST = 2  # curves of each kind that are tried by themselves
_ORDERS = 4  # of the angle's sines and cosines
_ANGLES = 49  # at which a curve over the angle is reported


@dataclass(frozen=True)
class Dependence:
    """What the residual's dependence on one quantity amounts to."""

    name: str
    statistic: float  # chi-square gain, profiled over the noises as an effect's is
    freedom: int
    p_value: float


@dataclass(eq=False, frozen=True)
class Cover:
    """Functions of one quantity that multiply one kind of slope."""

    kind: Kind
    regressors: Float64Array  # (n, m)
    at: Float64Array  # (k,) places at which a curve of them is given, in the quantity's own SI unit, angle in rad
    functions: Float64Array  # (k, m) what they are there
    followed: Float64Array  # (m, j) coefficients of what the four parameters follow: no curve has them

    def unfollowed(self) -> Float64Array:
        """Projection (m, m) of coefficients that leaves what the four parameters do not follow, weighed by the record.

        A regression leaves the rest open but for what is known beforehand: its sigma would be that of no curve.
        """
        weights = np.sum(self.regressors**2, axis=0)
        scaled = self.followed / np.maximum(np.linalg.norm(self.followed, axis=0), 1.0e-300)
        fitted: Float64Array = scaled @ np.linalg.pinv((scaled.T * weights) @ scaled) @ (scaled.T * weights)
        return np.eye(weights.size) - fitted

    def smooth(self) -> Float64Array:
        """Regressors (n, j) of smooth curves, independent of each other, the smoothest first.

        Coefficients of unit variance give a curve of unit variance that bends over half of the quantity's range.
        """
        place = self.at[: self.functions.shape[1]] / max(float(np.ptp(self.at)), 1.0e-300)
        alike = np.exp(-0.5 * ((place[:, None] - place) / _SMOOTHNESS) ** 2)
        free = self.unfollowed()
        sizes, curves = np.linalg.eigh(free @ alike @ free.T)
        order = np.argsort(-sizes)
        order = order[sizes[order] > _LEAST_SMOOTH * sizes[order[0]]]
        return np.ascontiguousarray(self.regressors @ (curves[:, order] * np.sqrt(sizes[order])))


def covers_of(fit: Fit, facts: RecordFacts) -> dict[str, list[Cover]]:
    """What each dependence is looked for with."""
    drive, dry = slopes_by_torque(fit)
    record = fit.linearised.record
    course = record.course
    speed = where_begun(fit.trajectory.speed)
    size, current, time = np.abs(speed), course.mean_current_A, course.time_s
    weak = np.abs(current)

    def hatted(values: Float64Array, count: int, low: float, high: float, *kinds: tuple[Kind, Float64Array],
               open_end: bool = False) -> list[Cover]:  # fmt: skip
        """open_end: without the last hat, which would continue beyond."""
        kept = count - 1 if open_end else count
        shapes, at = hats(values, count, low, high)[:, :kept], np.linspace(low, high, count)
        curves = np.eye(count)[:, :kept]
        return [
            Cover(kind, np.where(record.follows[:, None], slope[:, None] * shapes, 0.0), at, curves,
                  _followed(kind, at[:kept], "speed" if values is size else "current" if values is weak else ""))
            for kind, slope in kinds
        ]  # fmt: skip

    both: tuple[tuple[Kind, Float64Array], ...] = (("drag", dry), ("torque", drive))
    gain: tuple[Kind, Float64Array] = ("motor gain", drive * current)
    top = max(facts.top_speed_rad_s, 1.0e-9)
    covers = {
        # A drive short of voltage loses gain as the speed rises.
        "speed": [*hatted(size, 12, 0.0, top, *both), *hatted(size, 5, 0.0, top, gain)],
        "low speed": hatted(size, 5, 0.0, min(8.0 * facts.stribeck_speed_rad_s, top), *both, open_end=True),
    }  # and no place is reported at which the wheel has not been
    if facts.top_current_A > 0.0:
        along: tuple[Kind, Float64Array] = ("torque along the current", drive * np.sign(current))
        covers["current"] = hatted(weak, 6, 0.0, facts.top_current_A, *both, along)
    covers["time"] = hatted(time, 10, facts.first_s, facts.last_s, *both)
    if facts.temperature_range_K is not None and facts.temperature_range_K > 0.5:
        warmth = course.temperature_degC
        covers["temperature"] = hatted(warmth, 4, float(warmth.min()), float(warmth.max()), *both, gain)
    if facts.angle:
        orders, turn = np.arange(1, _ORDERS + 1), np.linspace(0.0, 2.0 * np.pi, _ANGLES)
        phases = np.outer(course.angle_rad, orders)
        waves = np.concatenate((drive[:, None] * np.sin(phases), drive[:, None] * np.cos(phases)), axis=1)
        curves = np.concatenate((np.sin(np.outer(turn, orders)), np.cos(np.outer(turn, orders))), axis=1)
        covers["angle"] = [
            Cover("torque", np.where(record.follows[:, None], waves, 0.0), turn, curves, np.zeros((2 * _ORDERS, 0)))
        ]
    return covers


def _followed(kind: Kind, at: Float64Array, over: str) -> Float64Array:
    """Coefficients of hats at `at` (m,) that the four parameters follow, (m, j). over: `speed`, or another quantity."""
    level, line = np.ones((at.size, 1)), at[:, None]
    if kind == "drag":
        return np.concatenate((level, line), axis=1) if over == "speed" else level  # dry and viscous friction
    if kind == "motor gain":
        return level
    return line if kind == "torque along the current" else np.zeros((at.size, 0))


def residual_map(fit: Fit, facts: RecordFacts, beside: Float64Array | None = None) -> list[Dependence]:
    """Dependences of what the model leaves, most significant first; beside: more regressors (n, m) that are free."""
    profiled = Profiled(fit, beside)
    tests = [
        test
        for name, covers in covers_of(fit, facts).items()
        for test in _tests(name, covers, profiled, smoothly=name != "angle")
    ]
    doubted = [test for test in tests if test.p_value < _DOUBTED]
    drawn = p_values_by_draws(
        fit, profiled, [test.regressors for test in doubted], [test.group.statistic for test in doubted]
    )
    for test, p in zip(doubted, drawn, strict=True):
        test.p_value = max(test.p_value, p)
    found: dict[str, Dependence] = {}
    for test in tests:
        p = min(test.chances * test.p_value, 1.0)
        if test.name not in found or p < found[test.name].p_value:
            found[test.name] = Dependence(test.name, test.group.statistic, test.group.freedom, p)
    return sorted(found.values(), key=lambda item: (item.p_value, -item.statistic))


@dataclass(eq=False)
class _Test:
    """One way to look for a dependence."""

    name: str
    regressors: Float64Array
    group: GroupFit
    chances: int  # in how many ways the dependence was looked for, this one the best of its sort
    p_value: float


def _tests(name: str, covers: list[Cover], profiled: Profiled, *, smoothly: bool) -> list[_Test]:
    """All hats at once; and, of the smoothest curves of each kind, those that show most."""

    def test(regressors: Float64Array, chances: int) -> _Test:
        group = fit_group(profiled, regressors)
        return _Test(name, regressors, group, chances, p_value_of(group.statistic, group.freedom))

    anyhow = np.concatenate([cover.regressors for cover in covers], axis=1)
    if not smoothly:
        return [test(anyhow, 1)]
    smooth = [test(cover.smooth()[:, :_SMOOTHEST], 2 * len(covers)) for cover in covers]
    return [test(anyhow, 2), min(smooth, key=lambda item: (item.p_value, -item.group.statistic))]


def p_value_of(statistic: float, freedom: int) -> float:
    """Of a group of regressors by chi-square, which noises that are fitted exceed; 1 where none says anything."""
    return chi_square_tail(statistic / INFLATION, freedom) if freedom and statistic > 0.0 else 1.0
