"""What is kept of a filter's pass over a log: counts, sums and the worst of it, so that nothing grows with the log."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rw_ekf.course.course import WILD, Course
from rw_ekf.errors import FilterError
from rw_ekf.filter import decisions, health
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.operating_points import OperatingPoints
from rw_ekf.filter.physician import findings, troubles_of
from rw_ekf.filter.second_look import log_likelihood, was_reset
from rw_ekf.records import FilterTrouble
from rw_ekf.starting_point import FilterSetup
from rw_ekf.statistics import RunStatistics

_BREAKAGES = 3  # of the filter's arithmetic in one log: more is no accident


@dataclass
class PassSums:
    """Of a pass over a log, or over its parts one after the other."""

    gate: float
    statistics: RunStatistics = field(default_factory=RunStatistics)
    log_likelihood: float = 0.0  # of the readings, as `rw_ekf.filter.second_look.log_likelihood`
    worst_rad_s: float = 0.0  # by which a prediction missed, gated or not
    troubles: list[FilterTrouble] = field(default_factory=list)  # that led to resets, in order
    was_reset: bool = False  # whether the parameters were

    @classmethod
    def of(cls, setup: FilterSetup) -> PassSums:
        """Before the first sample of a filter that starts so."""
        found = cls(setup.constants.gate)
        found.statistics.points = OperatingPoints.of_wheel(setup.prior.parameters, setup.constants.stribeck.omega_s)
        return found

    def add(self, course: Course, run: FilterRun, begin: int = 0) -> None:
        """Count the samples of a part from `begin` on; what is kept of where the wheel has been is since a reset.

        Raises FilterError where predictions go beyond what any machine does.
        """
        since = run.since(begin)
        self.statistics.add_run(course, run, begin)
        self.log_likelihood += log_likelihood(since, self.gate)
        self.troubles += troubles_of(since.mended)
        self.was_reset = self.was_reset or was_reset(since)
        points = self.statistics.points
        if points is not None:
            used = run.outcome == decisions.UPDATED
            used[:begin] = False
            resets = np.flatnonzero((run.mended != health.WELL) & (run.mended != health.LOCKED_OUT))
            if resets.size and resets[-1] >= begin:
                used[: resets[-1] + 1] = False
                points.clear()
            points.add_course(course, used)
        self.worst_rad_s = max(self.worst_rad_s, float(np.nanmax(np.abs(since.innovation_rad_s), initial=0.0)))
        self._refuse_runaway(run)

    def _refuse_runaway(self, run: FilterRun) -> None:
        if not self.worst_rad_s <= WILD or not np.isfinite(run.covariance).all():
            raise FilterError(f"a prediction missed by {self.worst_rad_s:.3g} rad/s")
        broken = [why for why in self.troubles if why not in (FilterTrouble.DIVERGED, FilterTrouble.LOCKED_OUT)]
        if len(broken) > _BREAKAGES:
            raise FilterError(f"the filter had to be reset {len(broken)} times: {'; '.join(findings(broken))}")
