"""Something that begins: the likeliest change at one time of a torque, a friction or the motor gain."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.hypotheses.grounds import Ground, Nameless
from rw_ekf.diagnosis.hypotheses.group import evidence_of_drawn
from rw_ekf.diagnosis.hypotheses.profiled import Profiled
from rw_ekf.diagnosis.thresholds import INDISTINGUISHABLE
from rw_ekf.effects.catalogue import CHANGE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import RecordFacts, Term
from rw_ekf.model.law import Law

_PLACES = 60  # in time, at which a change is sought
_ABRUPT_S = 0.01
_RAMPS_S = (_ABRUPT_S, 10.0, 40.0)  # over which it comes
_SEEN = 1.0e-6  # of a step's square: less is what the model itself follows
_TIME_TOLERANCE_S = 0.2  # to which the time of a change is sought


def likeliest_change(profiled: Profiled, ground: Ground, facts: RecordFacts) -> Nameless:
    """The likeliest change at one time, over when it comes and how fast."""
    begins = np.linspace(facts.first_s, facts.last_s, _PLACES + 2)[1:-1]
    tried = [(float(at), ramp) for ramp in _RAMPS_S for at in begins]
    columns = ground.slope[:, None] * np.column_stack([_step(ground.at, at, ramp) for at, ramp in tried])
    sums = [profiled.sums(i, columns) for i in range(len(profiled.ratios))]
    # What each would gain at the model's own noises tells the likeliest place; the odds are asked of that alone.
    own = sums[profiled.own]
    squares = np.diag(own.gram)
    gains = np.where(squares > _SEEN * own.whole, own.products**2 / np.maximum(squares, 1.0e-300), 0.0)
    gains *= 0.5 * profiled.count / max(profiled.rss[profiled.own], 1.0e-300)
    j = int(np.argmax(gains))
    at, ramp = tried[j]
    factor, deviation = evidence_of_drawn(
        profiled, [(one.gram[j : j + 1, j : j + 1], one.products[j : j + 1]) for one in sums]
    )
    factor += float(np.logaddexp.reduce(gains - gains[j])) - math.log(len(tried))
    law = ground.law(at - 0.5 * ramp, at + 0.5 * ramp, np.array([[0.0, 1.0]]), np.array([deviation]))
    return Nameless(ground, factor, Term(CHANGE, (0.0,), (0.0,), law=law))


def settled_change(less: Fit, fit: Fit) -> Fit:
    """A fit with a change that was found on a grid of times, at its likeliest time, which is known by the likelihood.

    less: without it. At once, unless it is clearly likelier that it takes its time.
    """
    term = fit.model.of(CHANGE.id)[-1]
    law = term.law
    assert law is not None
    slowly, std = _at_likeliest_time(less, fit, term, law)
    if law.last - law.first > _ABRUPT_S:
        middle = 0.5 * (law.first + law.last)
        at_once = replace(law, first=middle - 0.5 * _ABRUPT_S, last=middle + 0.5 * _ABRUPT_S)
        begun = less.refitted(less.model.with_terms(replace(term, law=at_once)))
        abrupt, its_std = _at_likeliest_time(less, begun, term, at_once)
        if abrupt.likelihood.value > slowly.likelihood.value - INDISTINGUISHABLE:
            slowly, std = abrupt, its_std
    placed = slowly.model.of(CHANGE.id)[-1]
    assert placed.law is not None
    return replace(slowly, model=slowly.model.changed(placed, replace(placed, law=replace(placed.law, spread=(std,)))))


def _at_likeliest_time(less: Fit, fit: Fit, term: Term, law: Law) -> tuple[Fit, float]:
    """The change at its likeliest time, and the time's standard deviation [s]."""
    fits = {law.first: fit}
    course = less.linearised.record.course
    reach = float(course.time_s[-1] - course.time_s[0]) / _PLACES
    while reach > _TIME_TOLERANCE_S:
        best = max(fits, key=lambda at: fits[at].likelihood.value)
        for at in (best - reach, best + reach):
            if at not in fits:
                moved = replace(law, first=at, last=at + law.last - law.first)
                fits[at] = less.refitted(less.model.with_terms(replace(term, law=moved)))
        reach *= 0.5
    times = np.array(sorted(fits))
    logs = np.array([fits[float(at)].likelihood.value for at in times])
    best = float(times[np.argmax(logs)])
    weights = np.exp(logs - logs.max()) * np.gradient(times)
    variance = float(np.sum(weights * (times - best) ** 2) / np.sum(weights))
    return fits[best], max(math.sqrt(variance), _TIME_TOLERANCE_S)


def _step(time_s: Float64Array, at: float, ramp_s: float) -> Float64Array:
    return np.clip((time_s - at) / ramp_s + 0.5, 0.0, 1.0)
