"""How much a part of a record can say of the simple effects at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rw_ekf.diagnosis.hypotheses.candidates import analytic
from rw_ekf.diagnosis.hypotheses.noise_ratios import basis
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.one_step import Record
from rw_ekf.likelihood.profile import LEAST_RATIO
from rw_ekf.model.effect import Candidate, Effect, RecordFacts
from rw_ekf.model.effect_kinds import StaticEffect


def information(fit: Fit, part: Record, facts: RecordFacts) -> dict[str, float]:
    """How much a part of a record can say of each simple linear effect: its squared length beside the model's own.

    No residual enters: this is about excitation alone.
    """
    places: list[tuple[type[Effect], Candidate]] = [
        (effect, effect.candidates(facts)[0])
        for effect in CATALOGUE.values()
        if issubclass(effect, StaticEffect)
        and effect.linear
        and effect.components == 1
        and not effect.local_in_time
        and effect.untestable(facts) is None
    ]
    if not places:
        return {}
    chain = fit.linearised.chain._replace(follows=part.follows)
    linearised = replace(fit.linearised, record=part, chain=chain)
    group = analytic(linearised, places)
    regressors = np.concatenate([h.regressors for h in group], axis=1)
    variance = fit.noise.variance
    _, A, _ = linearised.whitened(LEAST_RATIO, variance, regressors)
    _, own, _ = linearised.whitened(LEAST_RATIO, variance, linearised.jacobian, linearised.memory_jacobian)
    Q = basis(own, fit)
    lengths = np.einsum("ij,ij->j", A - Q @ (Q.T @ A), A)
    return {h.effect.id: float(length) for h, length in zip(group, lengths, strict=True)}
