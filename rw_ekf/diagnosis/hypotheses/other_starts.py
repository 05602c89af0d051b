"""The same effect fitted again from elsewhere: by each of its laws, from its other places, from all its valleys.

A step from where a fit stands says little of what is far away. The laws that an effect may follow are near each other,
and a wrong one leaves what another effect then seems to explain. A bump that noise makes likeliest where it is narrow
shrinks there until no reading resolves it, however likely a wide one beside it is. Near rest the likelihood of a
bristle has several valleys in deflection and damping, and the slope in a wrong one says of a size many sigmas off that
it is known to a percent: so a fit is sketched from each place, along the path on which the model runs freely there,
which knows nothing of where the first fit ended.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from rw_ekf.diagnosis.hypotheses.candidates import Score
from rw_ekf.diagnosis.hypotheses.event import fitted_at
from rw_ekf.diagnosis.hypotheses.scorer import Scorer
from rw_ekf.diagnosis.hypotheses.selection import Selection, Trial
from rw_ekf.diagnosis.thresholds import OWN_GAIN, TIE
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood import work_budget
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import Candidate, RecordFacts, Term

LAW = "law"  # the constant's name
_NEARLY = 0.7  # of the strongest place's statistic
_FITTED = 2
_APART = 1.5  # factor between shape constants of two places that are not one


def has_laws(name: str) -> bool:
    """Whether an effect may follow several laws."""
    return any(item.name == LAW for item in CATALOGUE[name].constants)


def with_each_law(less: Fit, fit: Fit, name: str) -> dict[float, Fit]:
    """The fit with the effect by each law, by the code of the law, begun from `less`, which is without the effect."""
    effect = CATALOGUE[name]
    constant = next(i for i, item in enumerate(effect.constants) if item.name == LAW)
    own = fit.model.of(name)[0]
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


def with_laws_tried_again(fit: Fit, names: Iterable[str], facts: RecordFacts) -> Fit:
    """The fit, or a likelier one by other laws of effects that were there before the last one entered.

    Alone the straight line of a law may do a part of what another effect does.
    """
    for name in names:
        if has_laws(name):
            fit = by_likeliest_law(fit, fit, name, facts)
    return fit


def possible_fit(current: Fit, impossible: Fit, score: Score, facts: RecordFacts) -> Fit:
    """The likeliest possible fit from other places of an effect, or the impossible one where there is none."""
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

    Tried where the size is known far worse than the gain would have it.
    """
    name = trial.effect.id
    if trial.effect.local_in_time or fit.knows(name, OWN_GAIN * math.sqrt(trial.statistic)):
        return None
    less = fit.without(name)
    return less if less.likelihood.value - current.likelihood.value > OWN_GAIN * 0.5 * trial.statistic else None


def in_deepest_valleys(selection: Selection, facts: RecordFacts) -> Selection:
    """What was chosen and has several valleys fitted again from all of them; what lies deeper stands in its place."""
    for name in selection.new_ids:
        selection = _in_deepest_valley(selection, name, facts)
    return selection


def _in_deepest_valley(selection: Selection, name: str, facts: RecordFacts) -> Selection:
    effect, final = CATALOGUE[name], selection.final
    starts = effect.valleys(final.model.seen_by(effect, facts))
    record = final.linearised.record
    if not starts:
        return selection
    if not record.work.has(work_budget.FITS):
        record.work.leave_out(f"other valleys of {name}")
        return selection
    less, model = selection.without(name), final.model.without(name)
    sketches = [less.sketched(model.with_terms(Term.at(effect, start))) for start in starts]
    best = max(sketches, key=lambda fit: fit.likelihood.value)
    if best.likelihood.value < final.likelihood.value + TIE:
        return selection
    deepest = best.refitted(best.model)
    trial = selection.trials[name].found_by(2.0 * (deepest.likelihood.value - less.likelihood.value), facts)
    return replace(selection.tried(trial), final=deepest)
