"""A fit in which one number of an effect stays where it is put: what its likelihood says of other sizes."""

from __future__ import annotations

from dataclasses import replace

from rw_ekf.likelihood.fitting import Fit, fit_model
from rw_ekf.likelihood.gauss_newton import Start
from rw_ekf.model.effect import Term

_TURNS = 4
_HELD_STD = 1.0e-3  # of a coefficient that a fit has to keep
_OTHER_SIZES = (0.2, 5.0)  # of a coefficient: a normal one known to 2.5 sigma is at neither


def may_be_held(fit: Fit, name: str) -> bool:
    """Whether a coefficient of an effect can be put somewhere by an a priori: there is one, and not of this effect."""
    return fit.prior is not None and name not in fit.prior.effect_ids


def with_coefficient(fit: Fit, term: Term, value: float) -> Fit:
    """The same part fitted with a coefficient that stays where it is put; the fit must have an a priori."""
    assert fit.prior is not None
    prior = fit.prior.with_coefficient(term.id, value, _HELD_STD * value)
    return _held(replace(fit, prior=prior), term, replace(term, values=(value,)))


def with_constant(fit: Fit, term: Term, constant: int, value: float) -> Fit:
    """The same with a shape constant that stays where it is put."""
    shape = list(term.shape)
    shape[constant] = value
    return _held(fit, term, replace(term, shape=(shape[0], shape[1], shape[2]), settled=True))


def knows_size(fit: Fit, name: str, sigmas: float) -> bool:
    """Whether the size of an effect is known to so many sigma: a fit that ran away claims a gain, but no size.

    By the slopes where the fit ended; of an effect that is not linear, whose slopes say little of other sizes, also by
    its likelihood at a fifth and at five times its size.
    """
    if fit.knows(name, sigmas):
        return True
    items = fit.terms_of(name)
    if len(items) != 1 or items[0].term.effect.linear or not may_be_held(fit, name):
        return False
    term = items[0].term
    value, limits = term.values[0], term.effect.coefficient
    others = [factor * value for factor in _OTHER_SIZES if limits.lower <= factor * value <= limits.upper]
    return all(
        2.0 * (fit.likelihood.value - with_coefficient(fit, term, other).likelihood.value) > sigmas**2
        for other in others
    )


def _held(fit: Fit, term: Term, changed: Term) -> Fit:
    model = fit.model.changed(term, changed)
    return fit_model(fit.problem, Start(model, fit.trajectory, fit.noise), _TURNS)
