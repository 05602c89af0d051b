"""What became of each effect in a search, and how strong a statistic has to be for that.

Its p-value counts the places that were searched; a fitted effect must be known, possible and large enough to matter.

Under a model that lacks nothing, twice the gain in log-likelihood is chi-square with as many degrees of freedom as the
effect has coefficients (Wilks); the best of N independent places exceeds x with probability 1 - (1 - p(x))^N. What is
not independent is counted by its resolution: onsets a decay apart, frequencies a line apart. Healthy simulated wheels
follow this law but for a factor, because crossings of zero speed are not perfectly Gaussian (`python -m
tools.proof.prove --only healthy`, docs/diagnosis-proof.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from rw_ekf.diagnosis.standing import NOT_SIGNIFICANT
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.filter.consistency import chi_square_tail
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model import Model
from rw_ekf.model.effect import Effect, RecordFacts, Term, size_of

SIGNIFICANT_P = 5.0e-4  # of one effect on the part that is searched; the held-out part must confirm it
WHOLE_P = 1.0e-5  # the same on the whole record, where nothing independent is left to confirm it
LOCAL_P = 1.0e-4  # of an event in time, which no other part can confirm
INFLATION = 1.15  # of statistics on healthy wheels, over chi-square (calibrated)
INDISTINGUISHABLE = 9.0  # two explanations whose log-likelihoods differ by less than half of this: three sigma
MAP_P = 3.0e-4  # structure left in the residual's map
EXPLAINED_SHARE = 0.8  # of all structure: with less, what was found is not the explanation


def p_value(effect: type[Effect], statistic: float, facts: RecordFacts) -> float:
    """Probability that a wheel without the effect shows as much."""
    if statistic <= 0.0:
        return 1.0
    single = chi_square_tail(statistic / INFLATION, effect.components)
    return float(-math.expm1(effect.places(facts) * math.log1p(-single))) if single < 1.0 else 1.0


def threshold(effect: type[Effect], facts: RecordFacts, p: float = SIGNIFICANT_P) -> float:
    """Statistic whose p-value is p, by bisection."""
    low, high = 0.0, 400.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        if p_value(effect, middle, facts) > p:
            low = middle
        else:
            high = middle
    return high


_LEAST_SIGMAS = 2.5


@dataclass
class Trial:
    """What became of one effect's best candidate."""

    effect: type[Effect]
    statistic: float  # in the turn that decided about it
    p_value: float
    size: float  # coefficient, or amplitude of sine and cosine
    std: float
    terms: tuple[Term, ...] = ()
    decision: str = NOT_SIGNIFICANT
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
