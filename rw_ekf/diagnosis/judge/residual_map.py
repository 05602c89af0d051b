"""Is anything structured left, and along what? The map of the residual (docs/diagnosis.md, "The map").

Each dependence (speed, low speed, current, angle, temperature, time) is a set of functions that multiply a torque or a
dry friction, entered into the same regression as an effect would be. Nothing in particular is assumed of the shape, and
a dependence that the model's own parameters can follow counts for nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.judge.noise_alone import p_value_by_draws
from rw_ekf.diagnosis.search.candidates import INFLATION
from rw_ekf.diagnosis.search.group import fit_group
from rw_ekf.diagnosis.search.profiled import Profiled
from rw_ekf.filter.consistency import chi_square_tail
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.structure import hats, slopes_by_torque
from rw_ekf.model.effect import RecordFacts

Kind = Literal["drag", "torque", "torque along the current", "motor gain"]

_DOUBTED = 0.01  # a p-value below it is asked of noise alone
_ORDERS = 4  # of the angle's sines and cosines
_ANGLES = 49  # at which a curve over the angle is told


@dataclass(frozen=True)
class Dependence:
    """What the residual's dependence on one quantity amounts to."""

    name: str
    statistic: float  # chi-square gain, profiled over the noises as an effect's is
    freedom: int
    p_value: float


@dataclass(frozen=True)
class Cover:
    """Functions of one quantity that multiply one kind of slope."""

    kind: Kind
    regressors: Float64Array  # (n, m)
    at: Float64Array  # (k,) places at which a curve of them is told, in the quantity's own SI unit, the angle in rad
    functions: Float64Array  # (k, m) what they are there
    followed: Float64Array  # (m, j) coefficients of what the four parameters follow: no curve has them


def covers_of(fit: Fit, facts: RecordFacts) -> dict[str, list[Cover]]:
    """What each dependence is looked for with."""
    drive, dry = slopes_by_torque(fit)
    record = fit.linearised.record
    course = record.course
    speed = np.concatenate((fit.trajectory.speed[:1], fit.trajectory.speed[:-1]))  # where each interval began
    size, current, time = np.abs(speed), course.mean_current_A, course.time_s

    def hatted(values: Float64Array, count: int, low: float, high: float, *kinds: tuple[Kind, Float64Array],
               open_end: bool = False) -> list[Cover]:  # fmt: skip
        """open_end: without the last hat, which would go on beyond."""
        kept = count - 1 if open_end else count
        shapes, at = hats(values, count, low, high)[:, :kept], np.linspace(low, high, count)
        told = np.eye(count)[:, :kept]
        return [
            Cover(kind, np.where(record.follows[:, None], slope[:, None] * shapes, 0.0), at, told,
                  _followed(kind, at[:kept], by_speed=values is size))
            for kind, slope in kinds
        ]  # fmt: skip

    both: tuple[tuple[Kind, Float64Array], ...] = (("drag", dry), ("torque", drive))
    gain: tuple[Kind, Float64Array] = ("motor gain", drive * current)
    top = max(facts.top_speed_rad_s, 1.0e-9)
    covers = {
        # A drive short of voltage loses gain as the speed rises.
        "speed": [*hatted(size, 12, 0.0, top, *both), *hatted(size, 5, 0.0, top, gain)],
        "low speed": hatted(size, 5, 0.0, 8.0 * facts.stribeck_speed_rad_s, *both, open_end=True),
    }
    if facts.top_current_A > 0.0:
        along: tuple[Kind, Float64Array] = ("torque along the current", drive * np.sign(current))
        covers["current"] = hatted(np.abs(current), 6, 0.0, facts.top_current_A, *both, along)
    covers["time"] = hatted(time, 10, facts.first_s, facts.last_s, *both)
    if facts.temperature_range_K is not None and facts.temperature_range_K > 0.5:
        warmth = course.temperature_degC
        covers["temperature"] = hatted(warmth, 4, float(warmth.min()), float(warmth.max()), *both, gain)
    if facts.angle:
        orders, turn = np.arange(1, _ORDERS + 1), np.linspace(0.0, 2.0 * np.pi, _ANGLES)
        phases = np.outer(course.angle_rad, orders)
        waves = np.concatenate((drive[:, None] * np.sin(phases), drive[:, None] * np.cos(phases)), axis=1)
        told = np.concatenate((np.sin(np.outer(turn, orders)), np.cos(np.outer(turn, orders))), axis=1)
        covers["angle"] = [
            Cover("torque", np.where(record.follows[:, None], waves, 0.0), turn, told, np.zeros((2 * _ORDERS, 0)))
        ]
    return covers


def _followed(kind: Kind, at: Float64Array, *, by_speed: bool) -> Float64Array:
    """Coefficients (m, j) of hats at `at` that Coulomb friction, viscous friction or the motor gain are."""
    level = np.ones(at.size)
    if kind == "drag":
        return np.column_stack((level, at)) if by_speed else level[:, None]
    if kind == "motor gain":
        return level[:, None]
    return at[:, None] if kind == "torque along the current" else np.zeros((at.size, 0))


def residual_map(fit: Fit, facts: RecordFacts, beside: Float64Array | None = None) -> list[Dependence]:
    """Dependences of what the model leaves, most significant first; beside: more regressors (n, m) that are free."""
    profiled = Profiled(fit, beside)
    found = []
    for name, covers in covers_of(fit, facts).items():
        regressors = np.concatenate([cover.regressors for cover in covers], axis=1)
        group = fit_group(profiled, regressors)
        p = p_value_of(group.statistic, group.freedom)
        if p < _DOUBTED:
            p = max(p, p_value_by_draws(fit, profiled, regressors, group.statistic))
        found.append(Dependence(name, group.statistic, group.freedom, p))
    return sorted(found, key=lambda item: (item.p_value, -item.statistic))


def p_value_of(statistic: float, freedom: int) -> float:
    """Of a group of regressors by chi-square, which noises that are fitted exceed; 1 where none says anything."""
    return chi_square_tail(statistic / INFLATION, freedom) if freedom and statistic > 0.0 else 1.0
