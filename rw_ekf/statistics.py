"""Running statistics of a run, the same numbers online and over a whole log."""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from rw_ekf.numbers import p_text
from rw_ekf.records import Estimate, Outcome
from rw_ekf.units import rpm_from_rad_s

if TYPE_CHECKING:
    from rw_ekf.course.course import Course
    from rw_ekf.filter.filter_run import FilterRun
    from rw_ekf.filter.operating_points import OperatingPoints

_NIS_95 = 3.841458820694124  # chi-square(1)
_LATENESS_KEPT = 36_000  # an hour at 10 Hz: the percentiles are those of the last hour, and memory stays flat
LATE_BOUNDS_MS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
_FALSE_ALARM = 1.0e-3  # of the finding that the gate refuses too much


@dataclass
class RunStatistics:
    """Counts and sums; nothing grows with the length of the run."""

    samples: int = 0
    missing: int = 0
    rejected: int = 0
    reseeded: int = 0
    duration_s: float = 0.0
    used: int = 0
    innovation_sum: float = 0.0
    innovation_squares: float = 0.0
    nis_sum: float = 0.0
    nis_inside_95: int = 0
    points: OperatingPoints | None = None  # where the wheel has been; None: not known
    _last_time_s: float | None = None

    def add(self, estimate: Estimate, *, same_segment: bool) -> None:
        """Count one sample of a running loop."""
        self.samples += 1
        if same_segment and self._last_time_s is not None:
            self.duration_s += max(estimate.time_s - self._last_time_s, 0.0)
        self._last_time_s = estimate.time_s
        if estimate.outcome in (Outcome.MISSING, Outcome.REPEATED, Outcome.BACKWARD):
            self.missing += 1
        self.reseeded += estimate.outcome is Outcome.RESEEDED
        test = estimate.innovation
        if test is None:
            return
        if not test.accepted:
            self.rejected += 1
            return
        self.used += 1
        self.innovation_sum += test.innovation_rad_s
        self.innovation_squares += test.innovation_rad_s**2
        self.nis_sum += test.nis
        self.nis_inside_95 += test.nis <= _NIS_95

    def add_run(self, course: Course, run: FilterRun, begin: int) -> None:
        """Count the samples of a compiled pass from `begin` on; those before are of a part that has been counted."""
        import numpy as np

        from rw_ekf.filter import gating

        here = slice(begin, None)
        outcome = run.outcome[here]
        used = outcome == gating.UPDATED
        innovation = run.innovation_rad_s[here][used]
        nis = innovation**2 / run.innovation_variance[here][used]
        tested = np.isfinite(run.innovation_rad_s[here])
        self.samples += int(outcome.size)
        self.missing += int(np.count_nonzero(np.isnan(course.speed_rad_s[here])))
        self.rejected += int(np.count_nonzero(tested & ~used))
        self.reseeded += int(np.count_nonzero(outcome == gating.RESEEDED))
        self.duration_s += course.window(max(begin - 1, 0), course.samples).duration_s
        self.used += int(used.sum())
        self.innovation_sum += float(innovation.sum())
        self.innovation_squares += float(innovation @ innovation)
        self.nis_sum += float(nis.sum())
        self.nis_inside_95 += int(np.count_nonzero(nis <= _NIS_95))

    def innovation_document(self) -> dict[str, float | None]:
        """Return the `innovation` object of a replay document; null where there was no innovation."""
        if self.used == 0:
            return {"rms_rpm": None, "mean_rpm": None, "nis_mean": None, "nis_inside_95": None}
        return {
            "rms_rpm": rpm_from_rad_s(math.sqrt(self.innovation_squares / self.used)),
            "mean_rpm": rpm_from_rad_s(self.innovation_sum / self.used),
            "nis_mean": self.nis_sum / self.used,
            "nis_inside_95": self.nis_inside_95 / self.used,
        }

    def gate_finding(self, gate: float) -> str | None:
        """Sentence where the gate (a bound on NIS) refused more readings than noise would have it; None where not.

        By an exact binomial test: each reading of a filter that is right is refused with the gate's own probability.
        """
        tested = self.used + self.rejected
        chance = math.erfc(math.sqrt(0.5 * gate))
        expected = tested * chance
        if self.rejected <= expected:  # no more than the mean, so that p is near a half or above
            return None
        from rw_ekf.filter.tails import binomial_tail

        p = binomial_tail(self.rejected, tested, chance)
        if p >= _FALSE_ALARM:
            return None
        return (
            f"{self.rejected} of {tested} readings were rejected by the gate, where noise alone gives {expected:.2g} "
            f"({p_text(p)}): bad readings, or a model or a noise that does not fit; they taught the "
            "filter nothing. The rows marked `gate` in the output of `rw-ekf replay --out` show where."
        )


@dataclass
class LoopTiming:
    """When the ticks came (the `loop` object of `run --json`)."""

    ticks: int = 0
    overruns: int = 0
    late_ms_max: float = 0.0
    late_ms: list[float] = field(default_factory=list)
    late_ms_sum: float = 0.0
    late_counts: list[int] = field(default_factory=lambda: [0] * (len(LATE_BOUNDS_MS) + 1))  # up to each bound; beyond

    def note(self, late_s: float) -> None:
        """Note one tick that began late_s after its time."""
        late = 1e3 * max(late_s, 0.0)
        if len(self.late_ms) < _LATENESS_KEPT:
            self.late_ms.append(late)
        else:
            self.late_ms[self.ticks % _LATENESS_KEPT] = late
        self.ticks += 1
        self.late_ms_sum += late
        self.late_counts[bisect_left(LATE_BOUNDS_MS, late)] += 1
        self.late_ms_max = max(self.late_ms_max, late)

    def percentile_ms(self, share: float) -> float:
        """Percentile of the lateness [ms], nearest rank; 0.0 before the first tick."""
        if not self.late_ms:
            return 0.0
        ordered = sorted(self.late_ms)
        return ordered[min(len(ordered) - 1, int(share * len(ordered)))]
