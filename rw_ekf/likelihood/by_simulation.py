"""A model's numbers by simulation: those by which it runs free nearest to the readings (output error).

The likelihood takes what a model misses for torque noise, each moment's by itself. Where that is true nothing is better
known than by it. Where it is not, where a model errs the same way each time it speeds up, say, the likelihood sees what
acts within one reading, and a bias of a percent that a free run adds up for minutes is nothing to it. Output error
(Ljung, System Identification, 1999, eq. 7.40 with H = 1) needs nothing but the run:

    minimise  sum (y_i - omega_i(p))^2,   omega(p) by the model alone, from where each stretch begins.

It is the same linear filter, along the path on which the model runs free, with a torque noise that moves the speed by
a tenth of a reading's noise over the whole record: the ratio of the two is .01 over the number of readings
(docs/likelihood.md, eq. 19). Levenberg and Marquardt: each turn takes the best of steps that are
damped more and more, since what is linear along one run is not along the next.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.free_path import free_trajectory
from rw_ekf.likelihood.gauss_newton import log_prior, smoothed_trajectory
from rw_ekf.likelihood.linearisation import Linearisation, linearise
from rw_ekf.likelihood.model_vector import Model, prior_rows
from rw_ekf.likelihood.profile import Likelihood, at_ratio, uncorrected

_TURNS = 12
_LITTLE = 5.0e-4  # of the readings: a run that is nearer by a thousandth of its variance
_DAMPING = (0.0, 1.0e-3, 1.0e-2, 0.1, 1.0, 10.0)  # of the curvature of each number
_WANDER = 0.01  # of a reading's variance, over the whole record
_SETTLING = 3  # smoothed paths, until one goes with the numbers


def by_simulation(fit: Fit) -> Fit:
    """The same model with the numbers by which it runs free best; noises are the likelihood's, at those numbers.

    The covariance is that of the fit, which supposes what is not so where it pays to fit this way.
    """
    return at_given_numbers(fit, _nearest(fit), fit.likelihood.covariance)


def at_given_numbers(fit: Fit, model: Model, covariance: Float64Array) -> Fit:
    """A model with numbers that are given, at its own best noises on the record of a fit, which it begins from."""
    record, noise, path = fit.linearised.record, fit.noise, fit.trajectory
    for _ in range(_SETTLING):
        linearised = linearise(record, model, path, noise, fit.omit, with_jacobian=False)
        noise = uncorrected(linearised, noise).noise
        path = smoothed_trajectory(linearised, np.zeros(0), noise)
    linearised = linearise(record, model, path, noise, fit.omit)
    here = uncorrected(linearised, noise)
    likelihood = replace(here, correction=np.zeros(model.vector.size), covariance=covariance)
    return Fit(model, fit.prior, likelihood, linearised, fit.omit, simulated=True)


def _nearest(fit: Fit) -> Model:
    """The model whose free run is nearest to the readings, sought from where the fit stands."""
    record, ratio = fit.linearised.record, _WANDER / max(int(fit.linearised.innovation_at.size), 1)

    def run(model: Model, *, sloped: bool) -> Linearisation:
        path = free_trajectory(record, model, fit.trajectory, fit.noise)
        return linearise(record, model, path, fit.noise, fit.omit, with_jacobian=sloped)

    def value(model: Model) -> float:
        """Log-likelihood of the run, where each stretch begins at its own best speed, and of the prior."""
        here = at_ratio(run(model, sloped=False), None, fit.noise.variance, ratio, corrected=False)
        return here.value + log_prior(fit.prior, model)

    model, highest = fit.model, value(fit.model)
    for _ in range(_TURNS):
        known = None if fit.prior is None else prior_rows(fit.prior, model)
        found = at_ratio(run(model, sloped=True), known, fit.noise.variance, ratio)
        best, reached = model, highest
        for tried in _steps(model, found):
            here = value(tried)
            if here > reached:
                best, reached = tried, here
            elif best is not model:  # damped further it only gets shorter
                break
        gained, model, highest = reached - highest, best, reached
        if gained < _LITTLE * fit.linearised.innovation_at.size:
            break
    return model


def error_of_run(fit: Fit, model: Model) -> Float64Array:
    """Readings less the free run of a model, from the smoothed speed where each stretch of a fit's record begins."""
    record = fit.linearised.record
    path = free_trajectory(record, model, fit.trajectory, fit.noise)
    error: Float64Array = (record.course.speed_rad_s - path.speed)[fit.linearised.innovation_at]
    return error


def _steps(model: Model, found: Likelihood) -> list[Model]:
    """The model one step on, damped more and more: (N + l diag N) step = N correction, N the information."""
    scale = np.sqrt(np.maximum(np.diag(found.covariance), 1.0e-300))
    N: Float64Array = np.linalg.pinv(found.covariance / np.outer(scale, scale), rcond=1.0e-12, hermitian=True)
    aim = N @ (found.correction / scale)
    found_steps = []
    for damping in _DAMPING:
        step: Float64Array = scale * np.linalg.lstsq(N + damping * np.diag(np.diag(N)), aim, rcond=None)[0]
        found_steps.append(_not_easier_to_start(model.with_vector(model.vector + model.limited(step))))
    return found_steps


def _not_easier_to_start(model: Model) -> Model:
    """The model; where it would take less to start than to keep going, one that takes as much."""
    known = model.parameters
    if known.static >= known.coulomb:
        return model
    return replace(model, parameters=known._replace(static=known.coulomb))
