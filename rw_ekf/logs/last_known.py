"""What was known last of one thing at the times of another."""

from __future__ import annotations

from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.logs.row_rules import restarted, usual_step

_SAME_TURN = 0.1  # of the step between rows: a bus sends in a hundredth of it, an own rate falls anywhere
_UNPAIRED = 0.1  # of the rows, at most, that have no partner
_NEARER = 0.5  # of the step: what comes later than that is nearer to the row that follows
_REPEATED = 0.01  # of the rows of a kind, at most: written twice
_APART = 10.0  # times the length of all runs, from where one begins to where the next does


def held_at(at_s: Float64Array, time_s: Float64Array, values: Any) -> Float64Array:
    """The last of `values` (n,), sampled at `time_s` (n,) in any order, known at each of `at_s` (m,); NaN before."""
    index = last_known(at_s, time_s)
    held = np.asarray(values, dtype=np.float64)[np.maximum(index, 0)]
    held[index < 0] = np.nan
    return held


def last_known(at_s: Float64Array, time_s: Float64Array) -> Int64Array:
    """Which of `time_s` (n,), in any order, was the last by each of `at_s` (m,): -1 before the first.

    What follows within a tenth of the usual step between these is of the same moment: one turn of a bus sends its
    messages one after the other. So is what follows by half a step at most, and always by as much: the answer to the
    second of two requests. Of equal times the later in order counts.
    """
    order = np.append(np.argsort(time_s, kind="stable"), -1)
    sorted_s, at = time_s[order[:-1]], np.sort(at_s)
    step = usual_step(at)
    within = max(_SAME_TURN * step, _steady_lag(at, sorted_s, step))
    return order[np.searchsorted(sorted_s, at_s + within, side="right") - 1]


def _steady_lag(at_s: Float64Array, time_s: Float64Array, step: float) -> float:
    """How long after each of sorted times (m,) the one of others (n,) comes that is of the same turn; 0: none is."""
    if not at_s.size or abs(len(time_s) - len(at_s)) > _UNPAIRED * len(at_s):
        return 0.0
    lag = time_s[np.minimum(np.searchsorted(time_s, at_s), len(time_s) - 1)] - at_s
    least, usual, most = np.quantile(lag, (_UNPAIRED, 0.5, 1.0 - _UNPAIRED))
    return float(most) if most - least < _SAME_TURN * step and usual < _NEARER * step else 0.0


def on_one_axis(time_s: Float64Array, kinds: Int64Array) -> Float64Array | None:
    """Times (n,) at which rows of several kinds, numbered from 0, may be put beside each other by time.

    The kinds may come in turn, each for itself, or newest first. Where the times of each begin anew equally often the
    file holds several runs, and each stands behind the one before. None where a time is missing, where one kind begins
    anew and another does not, where one ends before another begins, or where rows of one kind have the same time: only
    their order distinguishes them.
    """
    if not np.isfinite(time_s).all() or not time_s.size:
        return None
    runs = np.zeros(len(time_s))
    last, latest_begin, first_end = set(), -np.inf, np.inf
    for kind in range(int(kinds.max()) + 1):
        own = kinds == kind
        step = np.diff(time_s[own])
        if step.size:
            latest_begin = max(latest_begin, time_s[own].min())
            first_end = min(first_end, time_s[own].max())
            if float(np.mean(step == 0.0)) > _REPEATED:
                return None
        runs[own] = 0.0 if np.all(step <= 0.0) else restarted(time_s[own])
        last.add(runs[own][-1])
    if len(last) > 1 or latest_begin > first_end:  # by other clocks
        return None
    return time_s + _APART * float(np.ptp(time_s)) * runs
