"""The Stribeck speeds that a record leaves possible, where nobody gave one, and what is fitted at each.

Over Stribeck speed and break-away friction together the likelihood has several tops (`open_stribeck`), and a fit of
both from one place says of a wrong one that it is known to a percent. So they are sought from places all over, and
every speed that the record does not refute has its say.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rw_ekf.effects.catalogue import STRIBECK
from rw_ekf.filter.belief import Belief
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.log_fit import LogFit
from rw_ekf.likelihood.noise_posterior import noise_posterior
from rw_ekf.likelihood.open_stribeck import likeliest_stribeck_speed, over_stribeck_speeds, within_a_step
from rw_ekf.model.state import PARAMETER_COUNT


class StribeckHypothesis(NamedTuple):
    """A Stribeck speed that may be the machine's."""

    probability: float
    omega_s: float  # [rad/s]
    fitted: Belief  # the four parameters, as fitted at this speed


def stribeck_hypotheses(found: LogFit, top_speed_rad_s: float) -> tuple[LogFit, list[StribeckHypothesis]]:
    """The fit at the likeliest Stribeck speed, and all that are possible, their probabilities summing to one.

    found: a fit in which the Stribeck speed was free, from one place. The fit's std of the speed is that over all.
    """
    likeliest = likeliest_stribeck_speed(_at_its_speed(found.fit), top_speed_rad_s)
    over = over_stribeck_speeds(likeliest, top_speed_rad_s)
    if len(over) == 1:
        over = within_a_step(likeliest)
    hypotheses = [StribeckHypothesis(p, fit.model.stribeck.omega_s, _belief(fit)) for p, fit in over]
    probabilities, speeds = np.array([h.probability for h in hypotheses]), np.array([h.omega_s for h in hypotheses])
    noises = noise_posterior(likeliest)
    fitted = replace(
        found,
        parameters=likeliest.model.parameters,
        covariance=noises.covariance[:PARAMETER_COUNT, :PARAMETER_COUNT],
        stribeck_speed_rad_s=likeliest.model.stribeck.omega_s,
        stribeck_speed_std=float(np.sqrt(probabilities @ np.square(speeds - likeliest.model.stribeck.omega_s))),
        noises=noises,
        fit=likeliest,
    )
    return fitted, hypotheses


def _at_its_speed(fit: Fit) -> Fit:
    """A fit in which the Stribeck speed was free, with it held where it ended."""
    curve, model = fit.model.of(STRIBECK.id), fit.model.without(STRIBECK.id)
    if not curve:
        return fit
    return fit.refitted(replace(model, stribeck=model.stribeck._replace(omega_s=curve[0].values[0])))


def _belief(fit: Fit) -> Belief:
    return Belief.of_known(fit.model.vector, fit.likelihood.covariance, speed_variance=fit.noise.variance)
