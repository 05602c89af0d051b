"""What explanations predict of a motion, and how far apart they are on it (docs/active-diagnosis.md eq. 3)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.course.conditions import integrated_angle
from rw_ekf.course.course import Course
from rw_ekf.course.free_run import free_run
from rw_ekf.filter.constants import filter_constants
from rw_ekf.likelihood.gauss_newton import smoothed_trajectory
from rw_ekf.likelihood.linearisation import Noise, linearise
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import Record, Trajectory, state_vector
from rw_ekf.model.effect import REFERENCE_DEGC
from rw_ekf.model.friction import LAW_NAMES
from rw_ekf.settle.standing_explanations import Explanation, Standing

_FIRST_SPREAD = 0.3  # of the speed noise
_REST_TICKS = 10  # before a motion: what lags or comes late there is the current of none
CHECK_S = 5.0  # how far apart the times are at which a divergence is evaluated


@dataclass(frozen=True)
class Scene:
    """Where and when a motion takes place: after the record that was diagnosed, from rest."""

    standing: Standing
    period_s: float

    def course(self, model: Model, current_A: Float64Array) -> Course:
        """The motion (n,) and some rest before it, as a model predicts it: speed without noise, temperature, angle."""
        current_A = np.concatenate((np.zeros(_REST_TICKS), current_A))
        n = current_A.size
        time: Float64Array = self.standing.ended_s + self.period_s * np.arange(1.0 - _REST_TICKS, n + 1.0 - _REST_TICKS)
        warmth = np.full(
            n, REFERENCE_DEGC if self.standing.temperature_degC is None else self.standing.temperature_degC
        )
        course = Course.of(time, np.zeros(n), current_A, None, None, warmth, np.zeros(n))
        law, start = self.standing.warming, self.standing.temperature_degC
        speed = _path(course, model)
        if model.effects.terms:  # conditions follow from the motion, which hardly follows from them
            if law is not None and start is not None:
                course = course._replace(temperature_degC=law.temperature(start, time, speed, current_A))
            course = course._replace(angle_rad=integrated_angle(course, speed))
            speed = _path(course, model)
        return course._replace(speed_rad_s=speed)

    def hottest(self, course: Course, current_A: Float64Array) -> float | None:
        """The highest temperature of a motion [degC]; None where the record had none."""
        law, start = self.standing.warming, self.standing.temperature_degC
        if law is None or start is None:
            return start
        moving = slice(_REST_TICKS, None)
        return float(np.max(law.temperature(start, course.time_s[moving], course.speed_rad_s[moving], current_A)))

    @property
    def checks(self) -> int:
        """Ticks between the times at which a divergence is evaluated."""
        return max(round(CHECK_S / self.period_s), 1)


def _path(course: Course, model: Model) -> Float64Array:
    """Free run of a model from rest, (n,)."""
    start = state_vector(model.coefficients, model.effects)[None, :]
    first, last = np.array([0]), np.array([course.samples - 1])
    path: Float64Array = free_run(course, model.effects, model.stribeck, start, first, last, keep_path=True).path_rad_s
    return path


def divergences(truth: Explanation, others: list[Explanation], scene: Scene, current_A: Float64Array) -> Float64Array:
    """Log-evidence by which the truth is expected to gain over each other explanation, (others, checks), by time.

    The other explanation's parameters and coefficients, base parameters included, follow the readings as far as the
    record before lets them. Zero for a motion that a model follows into no number.
    """
    course = scene.course(truth.model, current_A)
    n, period = course.samples, scene.period_s
    found = np.zeros((len(others), current_A.size // scene.checks))
    if not np.isfinite(course.speed_rad_s).all():
        return found
    noise = Noise(truth.variance, truth.density * period / truth.variance)
    sigma = math.sqrt(truth.variance)
    constants = filter_constants(
        truth.model.stribeck.omega_s,
        LAW_NAMES[truth.model.stribeck.law],
        speed_noise_rad_s=sigma,
        acceleration_noise=math.sqrt(truth.density),
        max_gap_s=2.0 * period,
    )
    record = Record.of(course, np.ones(n, dtype=bool), constants)
    omit = np.zeros(n, dtype=bool)
    seen = Trajectory.of_speed(course.speed_rad_s, np.full(n, _FIRST_SPREAD * sigma))
    own = linearise(record, truth.model, seen, noise, omit, with_jacobian=False)
    spread = smoothed_trajectory(own, np.zeros(0), noise).spread
    seen = Trajectory.of_speed(course.speed_rad_s, spread)
    for row, other in enumerate(others):
        known = other.model.known
        linear = linearise(record, other.model, seen, noise, omit)
        r, A, _ = linear.whitened(
            noise.ratio, noise.variance, linear.jacobian[:, :known], linear.memory_jacobian[:, :known]
        )
        found[row] = _refitted(
            r, A, other.covariance, _REST_TICKS + scene.checks * np.arange(1, found.shape[1] + 1) - 1
        )
    return found


def _refitted(r: Float64Array, A: Float64Array, covariance: Float64Array, ends: Int64Array) -> Float64Array:
    """Half of |r|^2 that no change of the vector explains, of the first so many innovations (eq. 3)."""
    scale = np.sqrt(np.diag(covariance))
    B = A * scale
    prior = np.linalg.inv(covariance / np.outer(scale, scale))
    squares = np.concatenate(([0.0], np.cumsum(r * r)))
    found = np.zeros(ends.size)
    gram, target, begin = np.zeros(prior.shape), np.zeros(scale.size), 0
    for i, end in enumerate(np.minimum(ends, r.size)):
        part = slice(begin, end)
        gram += B[part].T @ B[part]
        target += B[part].T @ r[part]
        found[i] = 0.5 * max(squares[end] - float(target @ np.linalg.solve(gram + prior, target)), 0.0)
        begin = end
    return found
