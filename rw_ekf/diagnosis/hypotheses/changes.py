"""Something that begins, or lasts a while: the likeliest change of a torque, a friction or the motor gain in time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.hypotheses.candidates import places_at_once
from rw_ekf.diagnosis.hypotheses.joint_regressors import evidence_of_drawn
from rw_ekf.diagnosis.hypotheses.law_grounds import Ground, Nameless
from rw_ekf.diagnosis.hypotheses.noise_ratios import Profiled
from rw_ekf.diagnosis.thresholds import INDISTINGUISHABLE
from rw_ekf.effects.catalogue import CHANGE, SPELL
from rw_ekf.effects.spell import VALUES
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import RecordFacts, Term
from rw_ekf.model.law import Law

_PLACES = 60  # in time, at which a change is sought
_STEP = (0.0, 1.0)
_ABRUPT_S = 0.01
_RAMPS_S = (_ABRUPT_S, 10.0, 40.0)  # over which it comes
_SEEN = 1.0e-6  # of a step's square: less is what the model itself follows
_NEARER = 9  # places to either side of a spell's begin and end, within a step of the grid
_LEAST_SPELL_S = 1.0
_TIME_TOLERANCE_S = 0.2  # to which the time of a change is sought
_FINER = 1.0 / 16.0  # of the places' distance, in a record of seconds


def likeliest_change(profiled: Profiled, ground: Ground, facts: RecordFacts) -> Nameless:
    """The likeliest change at one time, over when it comes and how fast."""
    begins = np.linspace(facts.first_s, facts.last_s, _PLACES + 2)[1:-1]
    tried = [(float(at), ramp) for ramp in _RAMPS_S for at in begins]
    whole, squares, products = (
        np.concatenate(parts, axis=1) for parts in zip(*_sums(profiled, ground, tried), strict=True)
    )
    # What each would gain at the model's own noises gives the likeliest place; the odds are computed for that alone.
    own = profiled.own
    seen = squares[own] > _SEEN * whole[own]
    gains = profiled.own_gains(squares[own], np.where(seen, products[own], 0.0))
    j = int(np.argmax(gains))
    at, ramp = tried[j]
    factor, deviation = evidence_of_drawn(
        profiled, [(squares[i, j : j + 1, None], products[i, j : j + 1]) for i in range(len(profiled.ratios))]
    )
    factor += float(np.logaddexp.reduce(gains - gains[j])) - math.log(len(tried))
    law = ground.law(at - 0.5 * ramp, at + 0.5 * ramp, np.array([_STEP]), np.array([deviation]))
    return Nameless(ground, factor, Term(CHANGE, (0.0,), (0.0,), law=law))


def likeliest_spell(profiled: Profiled, ground: Ground, facts: RecordFacts) -> Nameless | None:
    """The likeliest change that is over after a while: one that neither half of it shows as a step does.

    A spell is the difference of two steps, so that all pairs of places come of one Gram matrix (circular binary
    segmentation: Olshen, Venkatraman et al. 2004, Biostatistics 5, 557, eq. 1, beside a model's own regressors).
    """
    count = min(_PLACES, places_at_once(ground.at.size))
    grid = np.linspace(facts.first_s, facts.last_s, count + 2)[1:-1]
    first, last = np.triu_indices(count, 1)
    rough = _gains_of_spells(profiled, ground, grid[first], grid[last])
    near = float(grid[1] - grid[0]) * np.linspace(-1.0, 1.0, _NEARER)
    j = int(np.argmax(rough))
    begins, ends = (part.ravel() for part in np.meshgrid(grid[first[j]] + near, grid[last[j]] + near))
    there = _is_seen(begins, ends, facts.first_s, facts.last_s) & (ends - begins > _LEAST_SPELL_S)
    begins, ends = begins[there], ends[there]
    if not begins.size:  # of a record of seconds
        return None
    gains = _gains_of_spells(profiled, ground, begins, ends)
    best = int(np.argmax(gains))
    if gains[best] <= 0.0:
        return None
    column = _steps(ground, begins[best : best + 1]) - _steps(ground, ends[best : best + 1])
    of_each = [profiled.sums(i, column) for i in range(len(profiled.ratios))]
    factor, deviation = evidence_of_drawn(profiled, [(sums.gram, sums.products) for sums in of_each])
    # All that was evaluated lay somewhere between any two places of the grid; near the best the grid was finer.
    factor += float(np.logaddexp.reduce(rough - rough[j])) - math.log(rough.size)
    law = ground.law(float(begins[best]), float(ends[best]), np.array([VALUES]), np.array([deviation]))
    return Nameless(ground, factor, Term(SPELL, (0.0,), (0.0,), law=law))


def _gains_of_spells(profiled: Profiled, ground: Ground, begins: Float64Array, ends: Float64Array) -> Float64Array:
    """What spells (m,) gain beside the model's own, at its own noises."""
    at = np.unique(np.concatenate((begins, ends)))
    first, last = np.searchsorted(at, begins), np.searchsorted(at, ends)
    sums = profiled.sums(profiled.own, _steps(ground, at))
    own = np.diagonal(sums.gram)
    squares = own[first] + own[last] - 2.0 * sums.gram[first, last]
    seen = squares > _SEEN * np.maximum(sums.whole[first], sums.whole[last])
    products = np.where(seen, sums.products[first] - sums.products[last], 0.0)
    return profiled.own_gains(np.where(seen, squares, 1.0), products)


def _steps(ground: Ground, at: Float64Array) -> Float64Array:
    """Regressors (n, m) of changes for good."""
    return ground.slope[:, None] * np.column_stack([_step(ground.at, time, _ABRUPT_S) for time in at])


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


def settled_change(less: Fit, fit: Fit, found: Term) -> tuple[Fit, Term]:
    """A fit with a change that was found on a grid of times, at its likeliest time, which is known by the likelihood.

    less: without it. At once, unless it is clearly likelier that it takes its time; of a spell begin and end in turn.
    With what it is: a spell that the record shows no end of, or no begin, is a change.
    """
    law = _law_of(fit, found)
    if law.spread:  # of an impulse, whose time is known already
        return fit, found
    if found.effect is SPELL:
        begun, begins_std = _at_likeliest_time(less, fit, found, law, _BEGIN)
        ended, ends_std = _at_likeliest_time(less, begun, found, _law_of(begun, found), _END)
        lasting = max(_lasting(ended, found), key=lambda item: item[0].likelihood.value)
        if lasting[0].likelihood.value > ended.likelihood.value - INDISTINGUISHABLE:
            return settled_change(less, *lasting)
        return _settled(ended, found, begins_std, ends_std)
    slowly, std = _at_likeliest_time(less, fit, found, law)
    if law.last - law.first > _ABRUPT_S:
        middle = 0.5 * (law.first + law.last)
        at_once = replace(law, first=middle - 0.5 * _ABRUPT_S, last=middle + 0.5 * _ABRUPT_S)
        begun = less.refitted(less.model.with_terms(replace(found, law=at_once)))
        abrupt, its_std = _at_likeliest_time(less, begun, found, at_once)
        if abrupt.likelihood.value > slowly.likelihood.value - INDISTINGUISHABLE:
            slowly, std = abrupt, its_std
    return _settled(slowly, found, std)


def _lasting(spell: Fit, found: Term) -> list[tuple[Fit, Term]]:
    """Fits with what a spell is if it never ends, and if it was there from before the record: a change at one time."""
    placed, law, changes = spell.model.of(found.id)[-1], _law_of(spell, found), []
    half_s = 0.5 * (law.last - law.first) / (len(VALUES) - 1)  # it comes and goes from one knot to the next
    for at in (law.first + half_s, law.last - half_s):
        step = replace(law, first=at - 0.5 * _ABRUPT_S, last=at + 0.5 * _ABRUPT_S, functions=(_STEP,))
        term = Term(CHANGE, found.values, found.stds, law=step)
        changes.append((spell.refitted(spell.model.changed(placed, term)), term))
    return changes


def _law_of(fit: Fit, found: Term) -> Law:
    law = fit.model.of(found.id)[-1].law
    assert law is not None
    return law


def _settled(fit: Fit, found: Term, *stds: float) -> tuple[Fit, Term]:
    """A fit with the standard deviations of its change's times [s], and the change at these times."""
    placed, law = fit.model.of(found.id)[-1], replace(_law_of(fit, found), spread=stds)
    return replace(fit, model=fit.model.changed(placed, replace(placed, law=law))), replace(found, law=law)


_BEGIN, _END = (1.0, 0.0), (0.0, 1.0)  # by how much the first and the last knot go with a time that is moved


def _at_likeliest_time(
    less: Fit, fit: Fit, term: Term, law: Law, goes: tuple[float, float] = (1.0, 1.0)
) -> tuple[Fit, float]:
    """The change at its likeliest time, and the time's standard deviation [s]. goes: what of it is moved."""
    fits = {0.0: fit}
    time_s = less.linearised.record.course.time_s
    begin_s, end_s = float(time_s[0]), float(time_s[-1])
    reach = (end_s - begin_s) / _PLACES
    of_seconds = reach < 2.0 * _TIME_TOLERANCE_S  # such a record resolves its times more finely
    tolerance_s = _FINER * reach if of_seconds else _TIME_TOLERANCE_S
    while reach > tolerance_s:
        best = max(fits, key=lambda by: fits[by].likelihood.value)
        for by in (best - reach, best + reach):
            first, last = law.first + by * goes[0], law.last + by * goes[1]
            if term.effect is SPELL:
                inside = _is_seen(first, last, begin_s, end_s)
            else:
                inside = begin_s < 0.5 * (first + last) < end_s
            if by not in fits and last - first > 0.5 * _ABRUPT_S and inside:
                moved = replace(law, first=first, last=last)
                fits[by] = less.refitted(less.model.with_terms(replace(term, law=moved)))
        reach *= 0.5
    if len(fits) == 1:  # a spell so short that no time of it can be moved
        return fit, _TIME_TOLERANCE_S
    times = np.array(sorted(fits))
    logs = np.array([fits[float(by)].likelihood.value for by in times])
    best = float(times[np.argmax(logs)])
    weights = np.exp(logs - logs.max()) * np.gradient(times)
    variance = float(np.sum(weights * (times - best) ** 2) / np.sum(weights))
    return fits[best], max(math.sqrt(variance), tolerance_s)


def _is_seen(begins: Any, ends: Any, first_s: float, last_s: float) -> Any:
    """Whether a record has something before and after a spell: else it has one edge, and is a change."""
    least_s = min(_LEAST_SPELL_S, (last_s - first_s) / _PLACES)
    return (begins > first_s + least_s) & (ends < last_s - least_s) & (ends > begins)


def _step(time_s: Float64Array, at: float, ramp_s: float) -> Float64Array:
    return np.clip((time_s - at) / ramp_s + 0.5, 0.0, 1.0)
