"""Which law an effect follows, where it has several to choose from: how probable each is, and what that leaves open."""

from __future__ import annotations

import math

from rw_ekf.diagnosis.hypotheses.other_starts import LAW, with_each_law
from rw_ekf.diagnosis.thresholds import INFLATION
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.state import PARAMETER_COUNT

_LEAST_TOLD = 0.02


def with_open_law(less: Fit, fit: Fit, name: str) -> tuple[Fit, dict[str, float]]:
    """A fit with an effect of several laws, and how probable each is by its name.

    less: without it. All laws are as likely beforehand. The variances of the coefficient and of the four parameters
    become those about the values told, over all laws: another one asks for other numbers.
    """
    effect = CATALOGUE[name]
    fits = with_each_law(less, fit, name)
    best = max(item.likelihood.value for item in fits.values())
    odds = {law: math.exp((item.likelihood.value - best) / INFLATION) for law, item in fits.items()}
    total = sum(odds.values())
    likeliest_first = sorted(odds, key=lambda law: -odds[law])
    probabilities = {
        str(effect.described(1.0, 1.0, fits[law].terms_of(name)[0].term.shape)[LAW]["value"]): odds[law] / total
        for law in likeliest_first
    }
    wider, places = fit, _places(fit, name)
    for number, place in enumerate(places):
        others = [(odds[law] / total, *_known(item, _places(item, name)[number])) for law, item in fits.items()]
        wider = wider.widened_over(slice(place, place + 1), _known(fit, place), others)
    return wider, {law: p for law, p in probabilities.items() if p > _LEAST_TOLD}


def _places(fit: Fit, name: str) -> list[int]:
    """Where the four parameters and the effect's coefficient stand in a model's vector."""
    return [*range(PARAMETER_COUNT), next(at.start for term, at in fit.model.placed if term.id == name)]


def _known(fit: Fit, place: int) -> tuple[float, float]:
    """A number of a fit and its standard deviation."""
    return float(fit.model.vector[place]), float(fit.std[place])
