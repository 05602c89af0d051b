"""Something that begins: the likeliest change at one time of a torque, a friction or the motor gain."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.hypotheses.candidates import places_at_once
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
    whole, squares, products = (
        np.concatenate(parts, axis=1) for parts in zip(*_sums(profiled, ground, tried), strict=True)
    )
    # What each would gain at the model's own noises tells the likeliest place; the odds are asked of that alone.
    own = profiled.own
    seen = squares[own] > _SEEN * whole[own]
    gains = np.where(seen, products[own] ** 2 / np.maximum(squares[own], 1.0e-300), 0.0)
    gains *= 0.5 * profiled.count / max(profiled.rss[own], 1.0e-300)
    j = int(np.argmax(gains))
    at, ramp = tried[j]
    factor, deviation = evidence_of_drawn(
        profiled, [(squares[i, j : j + 1, None], products[i, j : j + 1]) for i in range(len(profiled.ratios))]
    )
    factor += float(np.logaddexp.reduce(gains - gains[j])) - math.log(len(tried))
    law = ground.law(at - 0.5 * ramp, at + 0.5 * ramp, np.array([[0.0, 1.0]]), np.array([deviation]))
    return Nameless(ground, factor, Term(CHANGE, (0.0,), (0.0,), law=law))


def _sums(
    profiled: Profiled, ground: Ground, tried: list[tuple[float, float]]
) -> Iterator[tuple[Float64Array, Float64Array, Float64Array]]:
    """Sums (ratios, m) of `Profiled.sums_of_each` over steps of some times and ramps, as many at once as have room."""
    at_once = places_at_once(ground.at.size)
    for first in range(0, len(tried), at_once):
        some = tried[first : first + at_once]
        columns = ground.slope[:, None] * np.column_stack([_step(ground.at, at, ramp) for at, ramp in some])
        of_each = [profiled.sums_of_each(i, columns) for i in range(len(profiled.ratios))]
        whole, squares, products = (np.array(sums) for sums in zip(*of_each, strict=True))
        yield whole, squares, products


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
