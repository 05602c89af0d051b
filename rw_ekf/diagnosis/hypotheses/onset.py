"""An event's onset moved to either side of where a fit has it: behind a reversal or a rest there may be another place.

While the wheel rests an onset may be anywhere, and where it reverses the likelihood has a valley on either side. A
fit, which follows slopes, sees neither.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, by_identity
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.linearisation import linearise
from rw_ekf.likelihood.model_vector import Model, prior_rows
from rw_ekf.likelihood.profile import at_ratio
from rw_ekf.model.effect import RecordFacts

ONSET = 0  # its place in an event's shape
_STEPS, _BEND = 16, 1.5  # to either side; the first of them small, the last a tenth of the way
_REACH = 0.04  # of the record, and a decay at most
_BETTER = 1.0  # log-likelihood by which another place must be better
_MOST_HOPS = 3


@by_identity
class Moved(NamedTuple):
    """A model with its event's onset held elsewhere, along the trajectory of a fit."""

    onset_s: float
    value: float  # log-likelihood
    vector: Float64Array  # (p,) of the model


def with_better_onset(fit: Fit, name: str, facts: RecordFacts) -> Fit:
    """The fit with the best onset nearby, refitted from there, if it is better for it."""
    for _ in range(_MOST_HOPS):
        number = next(iter(fit.model.numbers_of(name)), None)
        if number is None or fit.model.terms[number].settled:
            return fit
        best = max(moved(fit, number, facts), key=lambda item: item.value)
        if best.value < held(fit, number, fit.model.terms[number].shape[ONSET]).value + _BETTER:
            return fit
        tried = fit.refitted(_at(fit.model, number, best.onset_s))
        if tried.likelihood.value < fit.likelihood.value + _BETTER:
            return fit
        fit = tried
    return fit


def moved(fit: Fit, number: int, facts: RecordFacts) -> list[Moved]:
    """An event, the number-th term, with its onset held at places to either side, the denser the nearer."""
    onset, decay = fit.model.terms[number].effect.lasts(fit.model.terms[number].shape)
    away = min(_REACH * facts.duration_s, decay) * (np.arange(1, _STEPS + 1) / _STEPS) ** _BEND
    places = np.concatenate((onset - away[::-1], onset + away))
    inside = (places > facts.first_s) & (places < facts.last_s)
    return [held(fit, number, float(place)) for place in places[inside]]


def held(fit: Fit, number: int, onset_s: float) -> Moved:
    """An event with its shape held at this onset; all else corrected once, along the trajectory as it stands."""
    free = _at(fit.model, number, onset_s)
    model = free.settled(free.terms[number].id)
    rows = None if fit.prior is None else prior_rows(fit.prior, model)
    linearised = linearise(fit.linearised.record, model, fit.trajectory, fit.noise, fit.omit)
    found = at_ratio(linearised, rows, fit.noise.variance, fit.noise.ratio)
    vector = free.vector
    kept = [*range(free.known)]
    kept += [free.known + j for j, (i, _) in enumerate(free.refined) if i != number]
    vector[kept] += found.correction
    return Moved(onset_s, found.value, vector)


def _at(model: Model, number: int, onset_s: float) -> Model:
    term = model.terms[number]
    return model.changed(term, replace(term, shape=(onset_s, *term.shape[1:])))
