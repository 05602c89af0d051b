"""A log filtered a second time, from near where the first time ended: linearised where its readings say the truth lies.

A filter linearises as it goes, and its first break-aways while it knows nothing yet: over a prior as wide as half of
static friction the decision between stick and slip bends more than eq. 8 can make up for. What it then took for
knowledge stays in its covariance. The second pass begins from the prior and a tenth of what the first pass learned
(`SHARE`): sqrt(10) of the first pass's sigmas wide, so that a first pass that was off by three of them is mended, and
narrow enough that the map is all but straight. That tenth is taken away again in the end: no reading counts twice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.filter import health
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.model.state import SPEED, STATE_SIZE
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet

SHARE = 0.1  # of what the first pass learned


def log_likelihood(run: FilterRun, gate: float) -> float:
    """Of the readings, but for a constant, each judged before it was used; a refused one counts as one at the gate."""
    judged = np.isfinite(run.innovation_rad_s)
    variance = run.innovation_variance[judged]
    if not np.all(variance > 0.0):
        return -math.inf
    return -0.5 * float(np.sum(np.minimum(run.nis[judged], gate) + np.log(variance)))


def log_density(run: FilterRun, gate: float) -> float:
    """The same with its constant: of the readings, each given those before it (the prediction error decomposition)."""
    return log_likelihood(run, gate) - 0.5 * int(np.isfinite(run.innovation_rad_s).sum()) * math.log(2.0 * math.pi)


@dataclass(frozen=True, eq=False)
class Start:
    """Where a second pass begins, and what of that is to be taken away from where it ends."""

    belief: Belief
    prior_mean: Float64Array  # (m,)
    known: slice  # of the states: parameters and coefficients, p of them
    size: Float64Array  # (p,) standard deviations of the prior, in which the rest is
    added: Float64Array  # (p, p) information
    aim: Float64Array  # (p,) what it is about, from the prior's mean

    @classmethod
    def of(cls, prior: Belief, first: Belief, effects: EffectSet = NO_EFFECTS) -> Start | None:
        """Of a pass that began with `prior`, at where another that did ended; None for a prior that holds something."""
        known = slice(SPEED + 1, STATE_SIZE + effects.size)
        size = np.sqrt(np.diag(prior.covariance[known, known]))
        if not np.all(size > 0.0):
            return None
        before = np.linalg.inv(prior.covariance[known, known] / np.outer(size, size))
        added = SHARE * _positive_part(np.linalg.inv(first.covariance[known, known] / np.outer(size, size)) - before)
        aim = (first.mean - prior.mean)[known] / size  # everything in the prior's sigmas, and from its mean
        start = np.linalg.inv(before + added)
        mean, covariance = prior.mean.copy(), prior.covariance.copy()
        mean[known] += size * (start @ added @ aim)
        covariance[known, known] = start * np.outer(size, size)
        return cls(Belief(mean, covariance), prior.mean, known, size, added, aim)

    def taken_from(self, found: Belief) -> Belief | None:
        """The belief without the information `added` about `aim`; None where that leaves no covariance."""
        known, size, P = self.known, self.size, found.covariance
        ended = P[known, known] / np.outer(size, size)
        information = np.linalg.inv(ended)
        left = information - self.added
        if not np.linalg.eigvalsh(left).min() > 0.0:
            return None
        covariance, mean = P.copy(), found.mean.copy()
        parameters = np.linalg.inv(left)
        parameters = 0.5 * (parameters + parameters.T)
        moved = parameters @ (information @ ((found.mean - self.prior_mean)[known] / size) - self.added @ self.aim)
        shift = self.prior_mean[known] + size * moved - found.mean[known]
        # What depends on the parameters, the speed and hidden states, follows them as it did.
        follows = (P[:, known] / size) @ information / size
        wider = parameters * np.outer(size, size) - P[known, known]
        mean += follows @ shift
        covariance += follows @ wider @ follows.T
        return Belief(mean, 0.5 * (covariance + covariance.T))


def second_look(
    course: Course, constants: FilterConstants, prior: Belief, first: Belief, effects: EffectSet = NO_EFFECTS
) -> tuple[Belief, float] | None:
    """The belief after a second pass, and the log-likelihood of that pass; None where no belief comes of it.

    constants: of the second pass, without drift; their noises may be others than the first one's. prior: what the first
    began with.
    """
    start = Start.of(prior, first, effects)
    if start is None:
        return None
    run = filter_log(course, constants, start.belief.mean, start.belief.covariance, effects, mends=True)
    if was_reset(run):
        return None
    found = start.taken_from(Belief(run.mean, run.covariance))
    return None if found is None else (found, log_likelihood(run, constants.gate))


def was_reset(run: FilterRun) -> bool:
    """Whether the parameters of a run were."""
    return resets_of(run).size > 0


def resets_of(run: FilterRun) -> NDArray[np.intp]:
    """The samples of a run at which the parameters were reset, (k,)."""
    return np.flatnonzero((run.mended != health.WELL) & (run.mended != health.LOCKED_OUT))


def _positive_part(matrix: Float64Array) -> Float64Array:
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T)
