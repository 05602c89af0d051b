"""What became of each effect in a search, and whether a fitted effect is known and matters."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model import Model
from rw_ekf.model.effect import Effect, RecordFacts, Term, size_of

_LEAST_SIGMAS = 2.5
IMPOSSIBLE = "of a size that no machine has"


@dataclass
class Trial:
    """What became of one effect's best candidate."""

    effect: type[Effect]
    statistic: float  # in the turn that decided about it
    p_value: float
    size: float  # coefficient, or amplitude of sine and cosine
    std: float
    terms: tuple[Term, ...] = ()
    decision: str = "not significant"
    shape_std: dict[str, float] = field(default_factory=dict)  # of constants that the whole record settled, by name


@dataclass
class Selection:
    """The outcome of the search."""

    base: Fit
    final: Fit
    trials: dict[str, Trial] = field(default_factory=dict)
    rivals: dict[str, list[Fit]] = field(default_factory=dict)  # chosen id -> fits with another in its place
    whole_record: list[str] = field(default_factory=list)  # ids sought there, held-out part included
    constructed: dict[str, set[str]] = field(default_factory=dict)  # chosen id -> rivals no likelihood decides about

    @property
    def new_ids(self) -> list[str]:
        """Effects of the final model that the base did not have."""
        before = set(self.base.model.effects.ids)
        return [name for name in self.final.model.effects.ids if name not in before]


def terms_in(model: Model) -> set[tuple[str, float]]:
    """What is in a model: ids, each order or frequency of a periodic one for itself."""
    return {(term.id, round(term.shape[0], 6) if term.effect.repeats else 0.0) for term in model.terms}


def determined(fit: Fit, name: str, sigmas: float = _LEAST_SIGMAS) -> bool:
    """Whether the fit knows the coefficient at all: a fit that ran away claims a gain, but no size."""
    stds = [float(std) for term, at in fit.model.placed if term.id == name for std in fit.std[at]]
    return bool(stds) and size_of(fit.model.of(name)) > sigmas * math.hypot(*stds) / math.sqrt(len(stds))


def matters(model: Model, name: str, facts: RecordFacts) -> bool:
    """Whether an effect in a fitted model is large enough to matter in practice."""
    return CATALOGUE[name].matters(model.of(name), facts)


def possible(model: Model, name: str, facts: RecordFacts) -> bool:
    """Whether an effect in a fitted model has a size and shape that a machine can have."""
    return CATALOGUE[name].possible(model.of(name), facts, model.parameters.coulomb)
