"""How well the numbers of an effect are known, as the report and the model's file give it.

The curvature where a fit ended is not all: an onset and a decay that were settled are not known exactly, and a bristle
that bends little is known worse on one side than its curvature says (docs/likelihood.md, "How well numbers are known").
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from rw_ekf.diagnosis.hypotheses.fixed_size_fits import may_be_held, with_coefficient, with_constant
from rw_ekf.diagnosis.hypotheses.onset import ONSET, held, moved
from rw_ekf.diagnosis.hypotheses.temperature_lag import width_of
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.thresholds import INFLATION
from rw_ekf.effects.catalogue import STRIBECK
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.linearisation import linearise
from rw_ekf.likelihood.model_vector import prior_rows
from rw_ekf.likelihood.noise_posterior import noise_posterior
from rw_ekf.likelihood.open_stribeck import over_stribeck_speeds
from rw_ekf.likelihood.profile import at_ratio
from rw_ekf.model.effect import RecordFacts
from rw_ekf.model.state import MOTOR_GAIN, STATIC

_NORMAL_95 = 1.96
_FALL = INFLATION * _NORMAL_95**2  # of twice the log-likelihood at either end of 95 %
_LEAST_STEP, _MOST_STEP = 0.02, 2.5  # of the logarithm of a number, away from where it is best
_TRIES = 3  # of one end
_NEAR = 0.3  # of a step: from there the fall goes with the square of it


def with_free_shapes(fit: Fit, name: str) -> Fit:
    """The same, its covariance that of a fit in which an effect's settled shape constants are free as well.

    Along the trajectory as it stands: an amplitude is known the less, the less onset and decay are. Free as far as a
    slope carries: the onset of a spike while the wheel rests has none, but it cannot have been long ago.
    """
    own, numbers = fit.model.of(name), fit.model.numbers_of(name)
    if not any(term.settled and term.effect.refined for term in own):
        return fit
    terms = tuple(replace(t, settled=t.settled and t not in own) for t in fit.model.effects.terms)
    model = replace(fit.model, effects=replace(fit.model.effects, terms=terms))
    linearised = linearise(fit.linearised.record, model, fit.trajectory, fit.noise, fit.omit)
    rows, aims = np.zeros((0, model.vector.size)), np.zeros(0)
    if fit.prior is not None:
        rows, aims = prior_rows(fit.prior, model)
    for place, (i, constant) in enumerate(model.refined, start=model.known):
        if i in numbers:
            reach = terms[i].effect.constants[constant].reach_at(terms[i].shape[constant])
            rows = np.vstack((rows, np.eye(1, model.vector.size, place) / reach))
            aims = np.append(aims, terms[i].shape[constant] / reach)
    found = at_ratio(linearised, (rows, aims), fit.noise.variance, fit.noise.ratio)
    value = replace(fit.likelihood, correction=found.correction, covariance=found.covariance)
    return replace(fit, model=model, linearised=linearised, likelihood=value)


def with_open_noise(fit: Fit) -> Fit:
    """The same fit, its covariance that with the ratio of noises integrated out: a torque noise is never known well."""
    return replace(fit, likelihood=replace(fit.likelihood, covariance=noise_posterior(fit).covariance))


def with_open_stribeck_speed(fit: Fit, facts: RecordFacts) -> Fit:
    """The same fit, its numbers' variances those over the Stribeck speeds that may be the machine's.

    Unchanged where the speed was given, or is fitted with the rest.
    """
    if not facts.stribeck_is_open or STRIBECK.id in fit.model.effects.ids:
        return fit
    others = over_stribeck_speeds(fit, facts.top_speed_rad_s)
    for place in np.flatnonzero(fit.std > 0.0):
        fit = fit.widened_over(
            slice(place, place + 1),
            (float(fit.model.vector[place]), float(fit.std[place])),
            [(p, float(item.model.vector[place]), float(item.std[place])) for p, item in others],
        )
    return fit


def with_known_lag(found: Found) -> Found:
    """The same with how well the lag of the temperature is known; without it where nothing goes with the temperature.

    Numbers of laws of the temperature are known by as much less. A lag that came with a model is not estimated again.
    """
    prepared, lag = found.prepared, found.prepared.temperature_lag
    if lag is None or not math.isnan(lag.std_s):
        return found
    if not any(term.goes_with_temperature for term in found.fit.model.terms):
        return replace(found, prepared=replace(prepared, temperature_lag=None))
    known, more = width_of(prepared, found.fit)
    reported = found.reported
    covariance = reported.likelihood.covariance.copy()
    size = reported.model.known  # shapes that were made free for their widths stand behind
    covariance[:size, :size] += more[:size, :size]
    return replace(
        found, prepared=replace(prepared, temperature_lag=known),
        reported=replace(reported, likelihood=replace(reported.likelihood, covariance=covariance)),
    )  # fmt: skip


def with_possible_break_away(fit: Fit) -> Fit:
    """The same fit, its break-away friction as uncertain as it lies below Coulomb friction, where no bearing has it.

    Near rest a likelihood is flat and ragged, and its curvature at one place claims a tenth of the sigma that it has.
    """
    factors = np.ones(fit.model.vector.size)
    factors[STATIC - MOTOR_GAIN] = max(fit.below_coulomb, 1.0)
    return fit.widened(factors)


def with_profiled_onset(fit: Fit, name: str, facts: RecordFacts) -> Fit:
    """The same fit, its covariance that of an event's onset as far off as the record lets it be, to either side.

    While a wheel rests an onset may be anywhere, and its slope at one end of the rest says nothing of that; nor does it
    of a place behind a reversal. What goes with the onset, its amplitude above all, is known the less by as much. Of an
    event whose shape is free.
    """
    number = fit.model.numbers_of(name)[0]
    if (number, ONSET) not in fit.model.refined:
        return fit
    place = fit.model.known + fit.model.refined.index((number, ONSET))
    std, here = float(fit.std[place]), held(fit, number, fit.model.terms[number].shape[ONSET])
    left = [item for item in moved(fit, number, facts) if 2.0 * (here.value - item.value) < _FALL]
    end = max(left, key=lambda item: abs(item.onset_s - here.onset_s), default=here)
    wider = abs(end.onset_s - here.onset_s) / _NORMAL_95
    if not wider > std > 0.0:
        return fit
    along = (end.vector - here.vector) / (end.onset_s - here.onset_s)
    covariance = fit.likelihood.covariance + (wider**2 - std**2) * np.outer(along, along)
    return replace(fit, likelihood=replace(fit.likelihood, covariance=covariance))


def with_profiled_widths(fit: Fit, name: str) -> Fit:
    """The same fit, standard deviations of one effect's numbers no smaller than their profile likelihoods are wide.

    Of an effect with one term; its coefficient must not have a prior.
    """
    item = fit.terms_of(name)[0]
    number = fit.model.terms.index(item.term)
    at = fit.model.placed[number][1].start
    factors = np.ones(fit.model.vector.size)
    if not may_be_held(fit, name):
        return fit
    factors[at] = _factor(fit, at, partial(with_coefficient, fit, item.term))
    for place, (i, constant) in enumerate(fit.model.refined, start=fit.model.known):
        if i == number:
            factors[place] = _factor(fit, place, partial(with_constant, fit, item.term, constant))
    return fit.widened(factors)


def _factor(fit: Fit, place: int, held: Callable[[float], Fit]) -> float:
    """By how much a number's standard deviation has to grow to the half-width of its profile; 1 at the least."""
    value, std = float(fit.model.vector[place]), float(fit.std[place])
    if not (value > 0.0 and std > 0.0):
        return 1.0
    ends = []
    for way in (-1.0, 1.0):
        step = min(max(_NORMAL_95 * std / value, _LEAST_STEP), _MOST_STEP)
        for _ in range(_TRIES):
            fall = 2.0 * (fit.likelihood.value - held(value * math.exp(way * step)).likelihood.value)
            ratio = math.sqrt(_FALL / max(fall, 0.1 * _FALL))
            step, before = min(max(ratio, 0.3) * step, _MOST_STEP), step
            if abs(step / before - 1.0) < _NEAR:
                break
        ends.append(value * math.exp(way * step))
    return max((ends[1] - ends[0]) / (2.0 * _NORMAL_95 * std), 1.0)
