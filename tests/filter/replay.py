"""A log put through the online estimator, sample by sample, as the daemon does it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.course.course import Course
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.estimator import Estimator
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.records import Estimate, IssuedCommand, Outcome, WheelSample

OUTCOMES = tuple(Outcome)  # in the order of the codes of rw_ekf.filter.gating


@dataclass(frozen=True)
class Columns:
    """A log's columns, (n,) each; NaN is a missing speed."""

    time_s: Float64Array
    speed_rad_s: Float64Array
    current_A: Float64Array
    delay_s: Float64Array = field(default_factory=lambda: np.zeros(0))
    segment: Int64Array = field(default_factory=lambda: np.zeros(0, np.int64))

    def complete(self) -> Columns:
        """The same with zeros for a delay and a segment not given."""
        n = self.time_s.size
        delay = self.delay_s if self.delay_s.size else np.zeros(n)
        return replace(self, delay_s=delay, segment=self.segment if self.segment.size else np.zeros(n, np.int64))


def online(columns: Columns, constants: FilterConstants, belief: Belief) -> tuple[Estimator, list[Estimate]]:
    """Every sample in, and after each the command that the row says was issued."""
    log = columns.complete()
    estimator = Estimator(constants, belief.mean, belief.covariance)
    results = []
    for i in range(log.time_s.size):
        speed = float(log.speed_rad_s[i])
        reading = None if math.isnan(speed) else speed
        results.append(estimator.step(WheelSample(float(log.time_s[i]), reading, segment=int(log.segment[i]))))
        estimator.command_issued(IssuedCommand(float(log.current_A[i]), float(log.delay_s[i])))
    return estimator, results


def compiled(columns: Columns, constants: FilterConstants, belief: Belief, *, keep_history: bool = False) -> FilterRun:
    """The compiled pass over the same columns, states kept."""
    log = columns.complete()
    course = Course.of(log.time_s, log.speed_rad_s, log.current_A, log.delay_s, log.segment)
    return filter_log(
        course, constants, belief.mean, belief.covariance, keep_states=True, keep_history=keep_history, mends=True
    )
