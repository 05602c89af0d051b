"""An effect that may follow one of several laws: fitted by each of them.

The laws are near each other, so that a step from the reference hardly tells them apart; a wrong one leaves what another
effect then seems to explain.
"""

from __future__ import annotations

from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import Candidate, RecordFacts, Term

LAW = "law"  # the constant's name


def has_laws(name: str) -> bool:
    """Whether an effect may follow several laws."""
    return any(item.name == LAW for item in CATALOGUE[name].constants)


def with_each_law(less: Fit, fit: Fit, name: str) -> dict[float, Fit]:
    """The fit with the effect by each law, by the code of the law, begun from `less`, which is without the effect."""
    effect = CATALOGUE[name]
    constant = next(i for i, item in enumerate(effect.constants) if item.name == LAW)
    own = next(term for term in fit.model.terms if term.id == name)
    fits, model = {own.shape[constant]: fit}, fit.model.without(name)
    for start in effect.starts(Candidate(own.values[0], own.shape), own.values[0]):
        if start.shape[constant] not in fits:
            fits[start.shape[constant]] = less.refitted(model.with_terms(Term.at(effect, start)))
    return fits


def by_likeliest_law(less: Fit, fit: Fit, name: str, facts: RecordFacts) -> Fit:
    """The fit, or one that is likelier by another of an effect's laws and of a size that can be."""
    if not has_laws(name):
        return fit
    fits = [item for item in with_each_law(less, fit, name).values() if item.model.possible(name, facts)]
    return max([fit, *fits], key=lambda item: item.likelihood.value)
