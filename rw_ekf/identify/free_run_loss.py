"""The loss of free runs over a log, and its slopes [CK13 (6)].

J = |y - omega(p, omega_0)|^2 / R + |p - p_0|^2 in the metric of P_0^-1, where omega(.) is the free run of the
event-located model and omega_0 is free in every stretch of the log. p are the four parameters, then the coefficients
of effects.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.course.course import Course
from rw_ekf.course.free_run import FreeRun, free_run, stretches
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, PARAMETER_COUNT, SPEED, STATE_SIZE
from rw_ekf.wheel.effect_table import ABSENT, EffectSet

_SPEED_STEP = 0.1  # of the speed noise, for a slope by differences of whole runs
_PARAMETER_STEP = 1.0e-3  # of a parameter
_LEAST_PARAMETER_STEP = 1.0e-6


@dataclass(eq=False, frozen=True)
class Point:
    """Where the loss was evaluated."""

    p: Float64Array  # (4 + m,)
    omega_0: Float64Array  # (stretches,)
    loss: float  # infinite where the run left all bounds
    simulated: Float64Array  # (n,) NaN outside the stretches


class FreeRunLoss:
    """The loss for one log."""

    def __init__(
        self, course: Course, constants: FilterConstants, prior: Belief, effects: EffectSet, used: BoolArray
    ) -> None:
        """Used (n,): readings that count; those outside any stretch do not."""
        self.course = course
        self.constants = constants
        self.effects = effects
        self.table = effects.table()
        self.runs = stretches(course, constants.max_gap_s)
        inside = np.zeros(used.size, dtype=bool)
        for run in self.runs:
            inside[run.first : run.last] = True
        self.used = used & inside
        self.first, self.last = np.array(self.runs, dtype=np.int64).reshape(-1, 2).T
        self.prior_mean, covariance = prior.known(effects.size)
        self.size = self.prior_mean.size
        self.prior_root = np.linalg.cholesky(np.linalg.inv(covariance)).T  # root' root = P_0^-1   [CK13 (7)]
        self.variance = constants.speed_variance + effects.reading_variance  # R
        self.weight = 1.0 / math.sqrt(self.variance)
        coefficients = [term.effect.coefficient for term in effects.state_terms for _ in term.values]
        self.lower = np.array([-math.inf] * PARAMETER_COUNT + [item.lower for item in coefficients])
        self.upper = np.array([math.inf] * PARAMETER_COUNT + [item.upper for item in coefficients])

    def run(self, p: Float64Array, omega_0: Float64Array, *, with_jacobian: bool = False) -> FreeRun:
        """Every stretch from its own first speed, hidden states settled there, under one set of parameters."""
        table, stribeck = self.table, self.constants.stribeck
        states = np.zeros((len(self.runs), table.size))
        states[:, SPEED] = omega_0
        states[:, MOTOR_GAIN : MOTOR_GAIN + self.size] = p
        if table.lag_state_at != ABSENT:
            before = np.maximum(self.course.piece_start[self.first] - 1, self.course.first_piece[self.first])
            current = self.course.pieces.current_A
            states[:, table.lag_state_at] = current[np.minimum(before, current.size - 1)]
        if table.memory_state_at != ABSENT:
            turning = np.abs(omega_0) > stribeck.omega_s
            states[:, table.memory_state_at] = np.where(turning, np.copysign(states[:, COULOMB], omega_0), 0.0)
        return free_run(
            self.course, self.effects, stribeck, states, self.first, self.last - 1,
            keep_path=True, with_jacobian=with_jacobian,
        )  # fmt: skip

    def at(self, p: Float64Array, omega_0: Float64Array | None = None) -> Point:
        """The loss at p (4 + m,), kept within its bounds; every stretch from its first reading without omega_0."""
        if omega_0 is None:
            omega_0 = self.course.speed_rad_s[self.first]
        p = np.clip(p, self.lower, self.upper)
        simulated = self.run(p, omega_0).path_rad_s
        with np.errstate(over="ignore", invalid="ignore"):  # a step too far: its loss counts as infinite
            r = (self.course.speed_rad_s - simulated)[self.used] * self.weight
            a = self.prior_root @ (self.prior_mean - p)
            loss = float(r @ r + a @ a)
        return Point(p, omega_0, loss if math.isfinite(loss) else math.inf, simulated)

    def sensitivity(self, at: Point) -> Float64Array:
        """Slopes of the whole run by first speed and parameters, (n, 1 + p).

        Where the flow does not know them, central differences of whole runs: by the coefficient of a delay, a lag or a
        Stribeck shape, and by everything where friction has a memory.
        """
        x = np.concatenate(([0.0], at.p))  # the first place moves all first speeds at once
        if self.table.memory_at != ABSENT:
            jacobian, places = np.zeros((self.course.samples, x.size)), list(range(x.size))
        else:
            jacobian = self.run(at.p, at.omega_0, with_jacobian=True).jacobian[:, : x.size]
            flags = [term.effect.analytic for term in self.effects.state_terms for _ in term.values]
            places = [STATE_SIZE + i for i, analytic in enumerate(flags) if not analytic]
        lower, upper = np.append(-math.inf, self.lower), np.append(math.inf, self.upper)
        steps = self._step_sizes(at.p) if places else []
        for j in places:
            ends, reached = [], []
            for way in (1.0, -1.0):
                moved = x.copy()
                moved[j] = min(max(x[j] + way * steps[j], lower[j]), upper[j])
                ends.append(self.run(moved[1:], at.omega_0 + moved[0]).path_rad_s)
                reached.append(moved[j])
            jacobian[:, j] = (ends[0] - ends[1]) / (reached[0] - reached[1])
        return jacobian

    def _step_sizes(self, p: Float64Array) -> list[float]:
        """By how much first speed, parameters and coefficients are moved for a slope."""
        sizes = [_SPEED_STEP / self.weight]
        sizes += [max(_PARAMETER_STEP * abs(value), _LEAST_PARAMETER_STEP) for value in p[:PARAMETER_COUNT]]
        kinds = [(t.effect.coefficient, std) for t in self.effects.state_terms for std in t.stds]
        pairs = zip(kinds, p[PARAMETER_COUNT:], strict=True)
        return sizes + [kind.step_at(float(value)) or kind.step_share * std for (kind, std), value in pairs]
