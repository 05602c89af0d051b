"""What an event in time is worth on data that did not shape it: every other five seconds inside it.

An event lives in one stretch of the record, so that blocks can neither find nor judge it. Here its coefficients are
fitted with every other five seconds of it left out, and those readings are predicted from what surrounds them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import BoolArray
from rw_ekf.likelihood.fitting import Fit, fit_model
from rw_ekf.likelihood.model import Model

_STRIDE_S = 5.0
_DECAYS = 3.0  # how long an event is, in its own time constants


@dataclass(frozen=True)
class EventGain:
    """What an event is worth on the seconds left out."""

    percent: float  # by which the error falls
    statistic: float  # twice the gain in log-likelihood, the noise being what the error is


def event_gain(whole: Fit, name: str) -> EventGain | None:
    """Compare the errors on the seconds left out, without and with the event in the model; None if there are none."""
    record = whole.linearised.record
    term = whole.model.of(name)[0]
    onset, decay = term.effect.lasts(term.shape)
    since = record.course.time_s - onset
    inside = (since >= 0.0) & (since < max(_DECAYS * decay, 2.0 * _STRIDE_S))
    left_out = inside & (np.floor(since / _STRIDE_S) % 2.0 == 1.0) & np.isfinite(record.course.speed_rad_s)
    if not left_out.any():
        return None
    with_it = _error(whole, whole.model.settled(name), left_out)
    without = _error(whole, whole.model.without(name), left_out)
    if without <= 0.0 or with_it <= 0.0:
        return None
    count = float(np.count_nonzero(left_out & ~whole.omit))
    return EventGain(100.0 * (1.0 - with_it / without), 2.0 * count * math.log(without / with_it))


def _error(whole: Fit, model: Model, left_out: BoolArray) -> float:
    """Root mean square of readings less the speed smoothed without them [rad/s]."""
    fit = fit_model(
        whole.linearised.record, model, whole.prior, whole.trajectory, whole.noise, whole.omit | left_out, turns=4
    )
    error = (whole.linearised.record.course.speed_rad_s - fit.trajectory.speed)[left_out & ~whole.omit]
    return float(np.sqrt(np.mean(error**2))) if error.size else 0.0
