"""What a run on the bench is judged by: peak, steady error, time to recover, stop, effort and chatter."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.attitude_bench.bench_run import BenchRun
from rw_ekf.flyby.crossing_impulse import zero_crossing_impulse

WINDOW_S = 120.0  # from the reversal on
STEADY_S = (30.0, 2.0)  # before the reversal
RECOVERED_DEG = 0.1


class Metrics(NamedTuple):
    """Figures of one run; NaN where there is none: it never reversed, or never recovered."""

    peak_deg: float  # largest attitude error from the reversal on, 120 s
    steady_deg: float  # RMS of the attitude error from 30 to 2 s before the reversal
    recover_s: float  # from the reversal until the error stays below 0.1 deg
    stop_s: float  # how long the wheel stood still
    effort_A_s: float  # integral of |I| over those 120 s
    chatter_A_per_s: float  # mean of |dI| per second over those 120 s
    impulse_Nms: float  # on the body, of the zero crossing, from its attitude as [L17] III has it


def metrics_of(run: BenchRun) -> Metrics:
    """Judge one run by its true attitude."""
    reversal_s = run.reversal_s
    if reversal_s is None:
        return Metrics(*(math.nan,) * len(Metrics._fields))
    error_deg = np.abs(np.degrees(run.attitude_rad))
    after = (run.time_s >= reversal_s) & (run.time_s <= reversal_s + WINDOW_S)
    before = (run.time_s >= reversal_s - STEADY_S[0]) & (run.time_s <= reversal_s - STEADY_S[1])
    time_s, error, current_A = run.time_s[after], error_deg[after], np.nan_to_num(run.current_A[after])
    lasts_s = max(float(time_s[-1] - time_s[0]), 1e-9)
    return Metrics(
        peak_deg=float(error.max()),
        steady_deg=float(np.sqrt(np.mean(error_deg[before] ** 2))) if before.any() else math.nan,
        recover_s=recovered_s(time_s, error, RECOVERED_DEG, reversal_s),
        stop_s=run.stood_s,
        effort_A_s=float(np.sum(np.abs(current_A[:-1]) * np.diff(time_s))),
        chatter_A_per_s=float(np.sum(np.abs(np.diff(current_A))) / lasts_s),
        impulse_Nms=_impulse_Nms(run, reversal_s),
    )


def recovered_s(time_s: Float64Array, error_deg: Float64Array, within_deg: float, from_s: float) -> float:
    """How long after from_s [s] errors (n,) at times (n,) are within a bound for good; NaN where the last is not."""
    beyond = np.flatnonzero(error_deg > within_deg)
    if beyond.size == 0:
        return 0.0
    return math.nan if beyond[-1] == error_deg.size - 1 else float(time_s[beyond[-1] + 1] - from_s)


def _impulse_Nms(run: BenchRun, reversal_s: float) -> float:
    try:
        return zero_crossing_impulse(
            run.time_s, run.attitude_rad, reversal_s, run.body_inertia_kg_m2, lasts_s=run.stood_s
        ).value
    except ValueError:  # too few readings beside the crossing
        return math.nan
