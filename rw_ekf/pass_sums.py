"""What is kept of a filter's pass over a log: counts, sums and the worst of it, so that nothing grows with the log."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from rw_ekf.course.beyond_law_range import BeyondLaws
from rw_ekf.course.course import WILD, Course
from rw_ekf.errors import FilterError
from rw_ekf.filter import gating
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.health_monitor import findings, troubles_of
from rw_ekf.filter.operating_points import OperatingPoints
from rw_ekf.filter.second_pass import log_likelihood, resets_of
from rw_ekf.records import FilterTrouble
from rw_ekf.starting_point import FilterSetup
from rw_ekf.statistics import RunStatistics
from rw_ekf.wheel.effect_table import NO_EFFECTS

_FEW_SAMPLES = 20
_BREAKAGES = 3  # of the filter's arithmetic in one log: more is no accident


@dataclass
class PassSums:
    """Of a pass over a log, or over its parts one after the other."""

    gate: float
    statistics: RunStatistics = field(default_factory=RunStatistics)
    log_likelihood: float = 0.0  # of the readings, as `rw_ekf.filter.second_pass.log_likelihood`
    worst_rad_s: float = 0.0  # by which a prediction missed, gated or not
    troubles: list[FilterTrouble] = field(default_factory=list)  # that led to resets, in order
    was_reset: bool = False  # whether the parameters were
    beyond: BeyondLaws = field(default_factory=lambda: BeyondLaws(NO_EFFECTS))

    @classmethod
    def of(cls, setup: FilterSetup) -> PassSums:
        """Before the first sample of a filter that starts so."""
        found = cls(setup.constants.gate, beyond=BeyondLaws(setup.effects))
        found.statistics.points = OperatingPoints.of_wheel(setup.prior.parameters, setup.constants.stribeck.omega_s)
        return found

    def add(self, course: Course, run: FilterRun, begin: int = 0) -> None:
        """Count the samples of a part from `begin` on; what is kept of where the wheel has been is since a reset."""
        since = run.since(begin)
        self.statistics.add_run(course, run, begin)
        self.beyond.add(course, begin)
        self.log_likelihood += log_likelihood(since, self.gate)
        self.troubles += troubles_of(since.mended)
        resets = begin + resets_of(since)
        self.was_reset = self.was_reset or resets.size > 0
        points = self.statistics.points
        if points is not None:
            used = run.outcome == gating.UPDATED
            used[:begin] = False
            if resets.size:
                used[: resets[-1] + 1] = False
                points.clear()
            points.add_course(course, used)
        worst_rad_s = float(np.nanmax(np.abs(since.innovation_rad_s), initial=0.0))
        self.worst_rad_s = max(self.worst_rad_s, worst_rad_s if np.isfinite(run.covariance).all() else math.inf)

    def refuse_runaway(self) -> None:
        """Raise FilterError where predictions went beyond what any machine does, gated readings or not."""
        if not self.worst_rad_s <= WILD:
            raise FilterError(f"a prediction missed by {self.worst_rad_s:.3g} rad/s")
        broken = [why for why in self.troubles if why not in (FilterTrouble.DIVERGED, FilterTrouble.LOCKED_OUT)]
        if len(broken) > _BREAKAGES:
            raise FilterError(f"the filter had to be reset {len(broken)} times: {'; '.join(findings(broken))}")

    def remarks(self, *, driven: bool) -> list[str]:
        """What a reader of the estimates must know of the readings that they come from, and of the filter's resets."""
        stated = []
        present = self.statistics.samples - self.statistics.missing
        if present < _FEW_SAMPLES:
            stated.append(f"only {present} speed readings: the estimates are little more than the prior")
        refused = self.statistics.gate_finding(self.gate)
        if refused is not None:
            stated.append(refused)
        if not driven:
            stated.append("the current is zero throughout: the motor gain cannot be learned from this log")
        return [*stated, *self.beyond.sentences(), *findings(self.troubles)]
