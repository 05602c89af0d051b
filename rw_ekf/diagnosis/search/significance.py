"""How strong a statistic has to be: its p-value with the number of places that were searched, and a practical size.

Under a model that lacks nothing, twice the gain in log-likelihood is chi-square with as many degrees of freedom as the
effect has coefficients (Wilks); the best of N independent places exceeds x with probability 1 - (1 - p(x))^N. What is
not independent is counted by its resolution: onsets a decay apart, frequencies a line apart. Healthy simulated wheels
follow this law but for a factor, because crossings of zero speed are not perfectly Gaussian (`python -m
tools.proof.prove --only healthy`, docs/diagnosis-proof.md).
"""

from __future__ import annotations

import math

from rw_ekf.filter.consistency import chi_square_tail
from rw_ekf.model.effect import Effect, RecordFacts

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
