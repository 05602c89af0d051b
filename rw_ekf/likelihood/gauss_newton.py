"""Gauss-Newton on a model's vector to the highest likelihood, the trajectory smoothed anew in every turn.

A model with a memory has several trajectories to go along, and each alone may end where the others would not
(docs/likelihood.md).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, by_identity
from rw_ekf.filter.belief import Belief
from rw_ekf.likelihood.filter_over_record import filtered_trajectory
from rw_ekf.likelihood.free_path import free_trajectory
from rw_ekf.likelihood.linearisation import Linearisation, Noise, linearise
from rw_ekf.likelihood.model_vector import Model, prior_rows
from rw_ekf.likelihood.one_step import LEAST_SPREAD, Record, Trajectory
from rw_ekf.likelihood.profile import Likelihood, as_it_stands, likelihood
from rw_ekf.likelihood.whitening import smooth
from rw_ekf.likelihood.work_budget import FITS

TURNS = 8
SMALL_STEP = 0.05  # standard deviations
_FREE_RUNS, _BETTER = 2, 1.0  # of a model with a memory, and by how much log-likelihood the second has to be better
_SETTLING_TURNS = 4
_NOT_WORSE = 0.5  # log-likelihood that a step may lose to the trajectory that moved meanwhile
_LEAST_DAMPING = 0.02


@by_identity
class Problem(NamedTuple):
    """What a model is fitted to."""

    record: Record
    prior: Belief | None
    omit: BoolArray  # (n,) readings left out


class Start(NamedTuple):
    """Where a fit begins."""

    model: Model
    trajectory: Trajectory
    noise: Noise


class Optimum(NamedTuple):
    """Where a fit ended: the likeliest model seen, and its linearisation."""

    model: Model
    likelihood: Likelihood
    linearised: Linearisation


def optimum_of(
    problem: Problem, start: Start, turns: int = TURNS, *, begun: Optimum | None = None, least: float = -math.inf
) -> Optimum:
    """The highest likelihood seen on the way from a start, whose trajectory need not be the model's own.

    A model with a memory is fitted along the path on which it runs freely and along the trajectory given, and where the
    first is no better along the one that its own filter follows. What its first free run leaves below `least` is left
    there: another path carries what is strong much further, and hardly what is weak (docs/likelihood.md).
    begun: how far the fit has come already; with a memory along the path on which it runs freely.
    """
    if not start.model.has_memory or not np.isnan(start.trajectory.memory).any():
        return _climbed(problem, start, turns) if begun is None else _continued(problem, begun, turns)
    free = along_free_runs(problem, start, turns, begun=begun, least=least)
    if free.likelihood.value < least:
        return free
    first = _climbed(problem, _settled(problem, start), turns)
    if free.likelihood.value > first.likelihood.value:
        return free
    noise = first.likelihood.noise
    own = filtered_trajectory(problem.record, first.model, noise, problem.omit)
    second = _climbed(problem, _settled(problem, Start(first.model, own, noise)), turns)
    return max(first, second, key=lambda found: found.likelihood.value)


def along_free_runs(
    problem: Problem,
    start: Start,
    turns: int = TURNS,
    runs: int = _FREE_RUNS,
    *,
    begun: Optimum | None = None,
    least: float = -math.inf,
) -> Optimum:
    """Along the path on which a model with a memory runs freely, then along that of what it led to.

    begun: how far the first of these has come already. least: log-likelihood below which there is no second.
    """
    best: Optimum | None = None
    model = start.model
    for run in range(runs):
        if run == 0 and begun is not None:
            found = _continued(problem, begun, turns)
        else:
            path = free_trajectory(problem.record, model, start.trajectory, start.noise)
            found = _climbed(problem, start._replace(model=model, trajectory=path), turns)
        if best is not None and found.likelihood.value < best.likelihood.value + _BETTER:
            break
        further = _one_step_on(problem, start, found) if found.model == model else None
        if further is not None:
            found = _continued(problem, further, turns)
        best, model = found, found.model
        if found.likelihood.value < least or not problem.record.work.has(FITS):
            break
    assert best is not None
    return best


def _one_step_on(problem: Problem, start: Start, found: Optimum) -> Optimum | None:
    """The model one step on along the path on which it runs freely itself; None where that is no likelier.

    Every step is judged along the path smoothed after it. With much noise in the readings that path may rest where the
    wheel does not, and the fit stays where it began, however far off.
    """
    noise = found.likelihood.noise
    model = found.model.with_vector(found.model.vector + _within_reach(found.model, found.likelihood))
    path = free_trajectory(problem.record, model, start.trajectory, noise)
    linearised = linearise(problem.record, model, path, noise, problem.omit)
    here = as_it_stands(linearised, problem.prior, likelihood(linearised, problem.prior, noise))
    gained = here.value - found.likelihood.value
    gained += log_prior(problem.prior, model) - log_prior(problem.prior, found.model)
    return Optimum(model, here, linearised) if gained > _BETTER else None


def _continued(problem: Problem, begun: Optimum, turns: int) -> Optimum:
    linearised = begun.linearised
    return _climbed(problem, Start(begun.model, linearised.trajectory, begun.likelihood.noise), turns, linearised)


def _climbed(problem: Problem, start: Start, turns: int, known: Linearisation | None = None) -> Optimum:
    """The trajectory is smoothed anew in every turn; a step that loses likelihood or prior is shortened.

    known: the linearisation at the start, where there is one.
    """
    record, prior, omit = problem
    model, trajectory, noise = start
    best: Optimum | None = None
    damping, highest = 1.0, 0.0
    before, step = model, np.zeros(0)
    for turn in range(turns):
        if turn > 1 and not record.work.has(FITS):
            record.work.leave_out("the last turns of fits")
            break
        linearised = known if turn == 0 and known is not None else linearise(record, model, trajectory, noise, omit)
        found = likelihood(linearised, prior, noise)
        here = as_it_stands(linearised, prior, found)
        value = here.value + log_prior(prior, model)
        if best is not None and value < highest - _NOT_WORSE:
            damping *= 0.3
            if damping < _LEAST_DAMPING:
                break
        else:
            best, highest = Optimum(model, here, linearised), value
            std = np.sqrt(np.maximum(np.diag(found.covariance), 1.0e-300))
            if turn > 0 and bool(np.all(np.abs(found.correction) < SMALL_STEP * std)):
                break
            before, step, noise = model, _within_reach(model, found), found.noise
            trajectory = smoothed_trajectory(linearised, found.correction, noise)
            damping = min(1.0, 2.0 * damping)
        model = before.with_vector(before.vector + damping * step)
    assert best is not None
    return best


def _settled(problem: Problem, start: Start) -> Start:
    """A trajectory smoothed a few times under a model with a memory, as it stands."""
    model, trajectory, noise = start
    for _ in range(_SETTLING_TURNS):
        linearised = linearise(problem.record, model, trajectory, noise, problem.omit, with_jacobian=False)
        noise = likelihood(linearised, None, noise).noise
        trajectory = smoothed_trajectory(linearised, np.zeros(0), noise)
    return Start(model, trajectory, noise)


def log_prior(prior: Belief | None, model: Model) -> float:
    """Log of what is known beforehand of a model's vector, but for a constant."""
    if prior is None:
        return 0.0
    W, aim = prior_rows(prior, model)
    off = W @ model.vector - aim
    return -0.5 * float(off @ off)


def _within_reach(model: Model, found: Likelihood) -> Float64Array:
    """The correction no longer than the linearisation carries, (p,): where some are cut short, the best of the rest.

    An amplitude that goes with a wider bump is wrong for one that may not yet be as wide.
    """
    step = model.limited(found.correction)
    cut = step != found.correction
    if not cut.any():
        return step
    C = found.covariance
    along = C[:, cut] @ np.linalg.solve(C[np.ix_(cut, cut)], (step - found.correction)[cut])
    return model.limited(found.correction + along)


def smoothed_trajectory(linearised: Linearisation, correction: Float64Array, noise: Noise) -> Trajectory:
    """The trajectory smoothed under the corrected model."""
    n = linearised.chain.reading.size
    means, variances = np.zeros((n, 2)), np.zeros((n, 2))
    chain = linearised.chain._replace(defect=linearised.chain.defect + linearised.jacobian @ correction)
    with_memory = linearised.memory_jacobian.shape[0] > 0
    if with_memory:
        chain = chain._replace(memory_defect=chain.memory_defect + linearised.memory_jacobian @ correction)
    smooth(chain, noise.ratio * noise.variance / linearised.record.period_s, noise.variance, means, variances)
    spread = np.maximum(np.sqrt(np.maximum(variances[:, 0], 0.0)), LEAST_SPREAD * math.sqrt(noise.variance))
    speed = linearised.trajectory.speed + means[:, 0]
    if linearised.follows_angle:
        return Trajectory.of_speed(speed, spread)._replace(angle=linearised.record.course.angle_rad + means[:, 1])
    if not with_memory:
        return Trajectory.of_speed(speed, spread)._replace(angle=linearised.trajectory.angle)
    coulomb = linearised.model.parameters.coulomb
    memory_spread = np.clip(np.sqrt(np.maximum(variances[:, 1], 0.0)), 0.005 * coulomb, 0.3 * coulomb)
    return Trajectory(speed, spread, linearised.trajectory.memory + means[:, 1], memory_spread)
