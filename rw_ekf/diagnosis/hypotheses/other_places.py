"""A fit that ran to where no machine is: the same effect from other places, or the model before it from there.

A bump that noise makes likeliest where it is narrow shrinks there until no reading resolves it, however likely a wide
one beside it is.
"""

from __future__ import annotations

import math

from rw_ekf.diagnosis.hypotheses.candidates import Score
from rw_ekf.diagnosis.hypotheses.event import fitted_at
from rw_ekf.diagnosis.hypotheses.scorer import Scorer
from rw_ekf.diagnosis.hypotheses.selection import Trial
from rw_ekf.diagnosis.thresholds import OWN_GAIN
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import RecordFacts

_NEARLY = 0.7  # of the strongest place's statistic
_FITTED = 2
_APART = 1.5  # factor between shape constants of two places that are not one


def possible_fit(current: Fit, impossible: Fit, score: Score, facts: RecordFacts) -> Fit:
    """The likeliest possible fit from other places of an effect, or the one that went astray where there is none."""
    effect = score.effect
    if not effect.refined or effect.local_in_time:
        return impossible
    bank = Scorer(current).all_at(facts, [(effect, candidate) for candidate in effect.candidates(facts)])
    tried = [score]
    for place in sorted(bank, key=lambda item: -item.statistic):
        if len(tried) <= _FITTED and place.statistic > _NEARLY * score.statistic:
            tried += [place] if all(_apart(place, other) for other in tried) else []
    fits = [fitted_at(current, place) for place in tried[1:]]
    possible = [fit for fit in fits if fit.model.possible(effect.id, facts)]
    return max(possible, key=lambda fit: fit.likelihood.value, default=impossible)


def _apart(one: Score, other: Score) -> bool:
    """Whether two places differ in the last shape constant that a fit moves: that of scale, such as a width."""
    last = one.effect.refined[-1]
    a, b = one.candidate.shape[last], other.candidate.shape[last]
    return max(a, b) > _APART * min(a, b)


def lower_valley(current: Fit, fit: Fit, trial: Trial) -> Fit | None:
    """The model before an effect entered, from where the fit with it stands, if the effect's gain is that of the way.

    Asked where the size is known far worse than the gain would have it.
    """
    name = trial.effect.id
    if trial.effect.local_in_time or fit.knows(name, OWN_GAIN * math.sqrt(trial.statistic)):
        return None
    less = fit.without(name)
    return less if less.likelihood.value - current.likelihood.value > OWN_GAIN * 0.5 * trial.statistic else None
