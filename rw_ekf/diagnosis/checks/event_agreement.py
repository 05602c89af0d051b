"""What an event in time is worth on data that did not shape it: every other five seconds inside it.

An event lives in one stretch of the record, so that blocks can neither find nor judge it. Whether it is there is tested
on every other five seconds of it: they and all else have to agree on its size. How much is gained is measured on those
seconds too, its coefficients fitted without them, and those readings predicted from what surrounds them. That is no
test: five seconds between readings are bridged without the event nearly as well.
"""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import BoolArray
from rw_ekf.diagnosis.checks.cross_fit import disputed_share
from rw_ekf.diagnosis.thresholds import MOST_DISPUTED
from rw_ekf.likelihood.fitting import Fit, fit_model
from rw_ekf.likelihood.gauss_newton import Start
from rw_ekf.likelihood.model_vector import Model

_STRIDE_S = 5.0
_DECAYS = 3.0  # how long an event is, in its own time constants


def agrees_with_itself(whole: Fit, name: str) -> bool:
    """Whether every other five seconds of an event and all else agree on its size."""
    seconds = _every_other(whole, name)
    return not seconds.any() or disputed_share(whole, name, seconds) < MOST_DISPUTED


def percent_gained(whole: Fit, name: str) -> float | None:
    """Percent by which an event makes the error smaller on seconds that were left out; None if there are none."""
    left_out = _every_other(whole, name) & np.isfinite(whole.linearised.record.course.speed_rad_s)
    if not left_out.any():
        return None
    with_it = _error(whole, whole.model.settled(name), left_out)
    without = _error(whole, whole.model.without(name), left_out)
    return 100.0 * (1.0 - with_it / without) if without > 0.0 and with_it > 0.0 else None


def _every_other(whole: Fit, name: str) -> BoolArray:
    """Every other five seconds inside an event, (n,)."""
    term = whole.model.of(name)[0]
    onset, decay = term.effect.lasts_of(term)
    since = whole.linearised.record.course.time_s - onset
    inside = (since >= 0.0) & (since < max(_DECAYS * decay, 2.0 * _STRIDE_S))
    return np.asarray(inside & (np.floor(since / _STRIDE_S) % 2.0 == 1.0))


def _error(whole: Fit, model: Model, left_out: BoolArray) -> float:
    """Root mean square of readings less the speed smoothed without them [rad/s]."""
    problem = whole.problem._replace(omit=whole.omit | left_out)
    fit = fit_model(problem, Start(model, whole.trajectory, whole.noise), turns=4)
    error = (whole.linearised.record.course.speed_rad_s - fit.trajectory.speed)[left_out & ~whole.omit]
    return float(np.sqrt(np.mean(error**2))) if error.size else 0.0
