"""Fixed-interval smoother for logs: Rauch-Tung-Striebel in Bryson and Frazier's form (docs/filter.md eq. 12).

The two are algebraically the same; this one needs no inverse of a predicted covariance, which is nearly singular here
because the parameters hardly move. Checked against the textbook recursion in tests/filter/test_smoother.py.
"""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.compiled import Kernel
from rw_ekf.filter import filter_run as _filter_run
from rw_ekf.filter import gating as _gating
from rw_ekf.filter import health as _health
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.gating import UPDATED
from rw_ekf.filter.health import WELL
from rw_ekf.model import state as _state
from rw_ekf.model.state import SPEED, STATE_SIZE


def _smooth_pass(
    run: FilterRun, means: Float64Array, stds: Float64Array, adjoint: Float64Array, information: Float64Array,
    along: Float64Array, side: Float64Array,
) -> None:  # fmt: skip
    """Backward pass; writes the smoothed means (n, m) and standard deviations (n, m).

    adjoint (m,): lambda, the gradient of the future's log-likelihood by the state; information (m, m): Lambda, its
    expected curvature; zero where it begins. along, side (m,): scratch.
    """
    innovation, innovation_variance, outcome = run.innovation_rad_s, run.innovation_variance, run.outcome
    row, predicted, covariance = run.history.row, run.history.predicted, run.history.covariance
    n_samples, n = predicted.shape
    for i in range(n_samples - 1, -1, -1):
        P = covariance[i]
        if outcome[i] == UPDATED:
            # (I - K H)' a and (I - K H)' A (I - K H), where H picks the speed: but for its row and column all stays.
            S = innovation_variance[i]
            known, twice = 0.0, 0.0
            for j in range(n):
                gain = P[j, SPEED] / S
                known += gain * adjoint[j]
                along[j] = 0.0
                for m in range(n):
                    along[j] += information[j, m] * P[m, SPEED] / S
                twice += gain * along[j]
            adjoint[SPEED] -= known + innovation[i] / S
            for j in range(n):
                information[SPEED, j] -= along[j]
                information[j, SPEED] -= along[j]
            information[SPEED, SPEED] += twice + 1.0 / S
        for j in range(n):
            moved, narrowed = 0.0, 0.0
            for m in range(n):
                moved += P[j, m] * adjoint[m]
                part = 0.0
                for other in range(n):
                    part += information[m, other] * P[j, other]
                narrowed += P[j, m] * part
            means[i, j] = predicted[i, j] - moved
            stds[i, j] = math.sqrt(max(P[j, j] - narrowed, 0.0))
        if run.mended[i] != WELL:  # nothing of the past is in what follows
            for j in range(n):
                adjoint[j] = 0.0
                information[j, :] = 0.0
        # Back through F, which differs from identity in its first row: F' a = a + (row - e_0) a_0.
        first = adjoint[SPEED]
        adjoint[SPEED] = 0.0
        for j in range(n):
            adjoint[j] += row[i, j] * first
        head = information[SPEED, SPEED]
        for j in range(n):
            side[j] = information[SPEED, j]
        side[SPEED] = 0.0
        information[SPEED, :] = 0.0
        information[:, SPEED] = 0.0
        for j in range(n):
            for m in range(n):
                information[j, m] += row[i, j] * side[m] + side[j] * row[i, m] + head * row[i, j] * row[i, m]


def _example() -> tuple[Any, ...]:
    whole = np.zeros((0, STATE_SIZE))
    series = np.zeros(0)
    return FilterRun.empty(np.zeros(STATE_SIZE), np.eye(STATE_SIZE), 0), whole, whole, series, whole, series, series


smooth_pass = Kernel(_smooth_pass, [_state, _gating, _filter_run, _health, sys.modules[__name__]], _example)


def smooth_log(run: FilterRun) -> tuple[Float64Array, Float64Array]:
    """Smoothed states and standard deviations, (n, m) each, from a run made with `keep_history=True`.

    Raises ValueError when the history was not kept.
    """
    predicted = run.history.predicted
    if predicted.shape[0] != run.outcome.size:
        raise ValueError("smoothing needs the forward pass's history: filter_log(..., keep_history=True)")
    means, stds = np.empty_like(predicted), np.empty_like(predicted)
    n = predicted.shape[1]
    smooth_pass(run, means, stds, np.zeros(n), np.zeros((n, n)), np.zeros(n), np.zeros(n))
    return means, stds
