"""Which law an effect follows, where it has several to choose from: how probable each is, and what that leaves open."""

from __future__ import annotations

import math

from rw_ekf.diagnosis.search.candidates import INFLATION
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import Candidate, Term

LAW = "law"  # the constant's name
_LEAST_TOLD = 0.02


def has_laws(name: str) -> bool:
    """Whether an effect may follow several laws."""
    return any(item.name == LAW for item in CATALOGUE[name].constants)


def with_open_law(less: Fit, fit: Fit, name: str) -> tuple[Fit, dict[str, float]]:
    """A fit with an effect of several laws, and how probable each is by its name.

    less: without it. All laws are as likely beforehand. The coefficient's variance becomes that about the value told,
    over all of them: another law asks for another number.
    """
    effect = CATALOGUE[name]
    constant = next(i for i, item in enumerate(effect.constants) if item.name == LAW)
    own, at = next((term, at) for term, at in fit.model.placed if term.id == name)
    fits = {own.shape[constant]: fit}
    for start in effect.starts(Candidate(own.values[0], own.shape), own.values[0]):
        if start.shape[constant] not in fits:
            fits[start.shape[constant]] = less.refitted(less.model.with_terms(Term.at(effect, start)))
    best = max(item.likelihood.value for item in fits.values())
    odds = {law: math.exp((item.likelihood.value - best) / INFLATION) for law, item in fits.items()}
    total = sum(odds.values())
    others, told = [], {}
    for law, item in sorted(fits.items(), key=lambda pair: -odds[pair[0]]):
        found = item.terms_of(name)[0]
        others.append((odds[law] / total, found.term.values[0], math.sqrt(float(found.covariance[0, 0]))))
        told[str(effect.described(1.0, 1.0, found.term.shape)[LAW]["value"])] = odds[law] / total
    wider = fit.widened_over(at, (own.values[0], float(fit.std[at.start])), others)
    return wider, {law: p for law, p in told.items() if p > _LEAST_TOLD}
