"""Which of the two parts of a record is searched: the one that can say more, by its excitation alone."""

from __future__ import annotations

import math

import numpy as np

from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.search.candidates import analytic
from rw_ekf.diagnosis.search.scorer import basis
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import LEAST_RATIO, Fit
from rw_ekf.model.effect import Candidate, Effect, RecordFacts
from rw_ekf.model.effect_kinds import StaticEffect


def richer_part(prepared: Prepared) -> Prepared:
    """Exchange the parts where the one that is held out can say more; halves are taken as they are."""
    if prepared.split.kind == "halves":
        return prepared
    other = prepared.swapped()
    if int(other.split.fit.sum()) > 2 * int(prepared.split.fit.sum()):
        return prepared  # a long record, of which only some blocks are searched
    parts = [_information(p.base, prepared.base.noise.variance, prepared.facts) for p in (prepared, other)]
    ratios = [math.log(parts[1][name] / parts[0][name]) for name in parts[0] if parts[0][name] > 0.0 < parts[1][name]]
    return other if ratios and sum(ratios) > 0.0 else prepared


def _information(fit: Fit, variance: float, facts: RecordFacts) -> dict[str, float]:
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
    frame = fit.frame
    group = analytic(frame, places)
    columns = np.concatenate([h.columns for h in group], axis=1)
    _, A, _ = frame.whitened(LEAST_RATIO, variance, columns)
    _, own, _ = frame.whitened(LEAST_RATIO, variance, frame.columns, frame.memory_columns)
    Q = basis(own, fit)
    lengths = np.einsum("ij,ij->j", A - Q @ (Q.T @ A), A)
    return {h.effect.id: float(length) for h, length in zip(group, lengths, strict=True)}
