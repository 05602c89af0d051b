"""What is believed at the end of a log that nobody configured a filter for: all that it says, and no more.

A run's filter has to follow a wheel that ages, and is told its noises: what it believes, `replay --as-run` gives. A log
seen as a whole says itself whether its parameters wander, how much torque noise there was, and where its break-aways
are to be linearised (docs/filter.md, "In hindsight").
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from rw_ekf.course.course import Course
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.frozen import without_drift
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.filter.second_look import log_likelihood, second_look, was_reset
from rw_ekf.starting_point import FilterSetup

_CLEARLY = 2.0  # log-likelihood: parameters wander where that makes the readings likelier by so much
_ASTRAY = 10.0  # log-likelihood: other noises may cost some of it, a filter that went astray more


def run_of_log(
    course: Course, setup: FilterSetup, *, keep_states: bool = False, keep_history: bool = False
) -> tuple[FilterRun, FilterSetup]:
    """The filter over a log, and what it was told: parameters wander only where that makes the readings likelier."""
    steady = replace(setup, constants=without_drift(setup.constants))
    run = filtered(course, steady, keep_states=keep_states, keep_history=keep_history)
    gate = setup.constants.gate
    if log_likelihood(filtered(course, setup), gate) < log_likelihood(run, gate) + _CLEARLY:
        return run, steady
    return filtered(course, setup, keep_states=keep_states, keep_history=keep_history), setup


def belief_of_log(course: Course, setup: FilterSetup, run: FilterRun) -> Belief:
    """What is believed at the end: the moments of a mixture over what is not known beside the parameters."""
    return _mixture(list(_parts(course, setup, run)))


def belief_of_fit(course: Course, setup: FilterSetup, fitted: Belief, noises: Sequence[float]) -> Belief:
    """What is believed after a fit: the filter's word on it, linearised where the fit ended.

    A fit regresses friction on a speed that the same readings gave: near rest, where friction depends on it, that
    biases it by more than a sigma. A filter predicts each reading from those before it. setup: with the speed noise
    that the fit found; noises: torque noises of equal weight. The fit's own word where the filter has none.
    """
    parts = []
    for noise in noises:
        constants = without_drift(setup.constants).with_acceleration_noise(noise)
        again = second_look(course, constants, setup.prior, fitted, setup.effects)
        if again is None:
            return fitted
        parts.append((1.0 / len(noises), again[0]))
    return _mixture(parts)


def _mixture(parts: Sequence[tuple[float, Belief]]) -> Belief:
    if len(parts) == 1:
        return parts[0][1]
    mean = sum((weight * part.mean for weight, part in parts), np.zeros_like(parts[0][1].mean))
    covariance = np.zeros_like(parts[0][1].covariance)
    for weight, part in parts:
        off = part.mean - mean
        covariance += weight * (part.covariance + np.outer(off, off))
    return Belief(mean, covariance)


def _parts(course: Course, setup: FilterSetup, run: FilterRun) -> Iterator[tuple[float, Belief]]:
    """Beliefs and their weights: one for each torque noise or Stribeck speed that may be the record's.

    Torque noise: five values of equal weight (`noise_posterior`). A Stribeck speed that was not given: three, those of
    Gauss and Hermite's rule for its logarithm (0 and +- sqrt(3) sigma, weights 2/3 and 1/6).
    """
    constants = setup.constants
    if setup.stribeck_speed_std > 0.0:
        spread = min(setup.stribeck_speed_std / constants.stribeck.omega_s, 0.5)
        for weight, sigmas in ((2.0 / 3.0, 0.0), (1.0 / 6.0, -math.sqrt(3.0)), (1.0 / 6.0, math.sqrt(3.0))):
            omega_s = constants.stribeck.omega_s * math.exp(sigmas * spread)
            there = replace(setup, constants=constants.with_stribeck_speed(omega_s)) if sigmas else setup
            first = filtered(course, there) if sigmas else run
            yield weight, _looked_at_again(course, there, first)
        return
    noises = setup.acceleration_noises or (constants.acceleration_noise,)
    for noise in noises:
        there = replace(setup, constants=constants.with_acceleration_noise(noise))
        first = filtered(course, there) if constants.wanders and len(noises) > 1 else run
        yield 1.0 / len(noises), _looked_at_again(course, there, first)


def filtered(course: Course, setup: FilterSetup, *, keep_states: bool = False, keep_history: bool = False) -> FilterRun:
    """The filter over a log as it was set up, reset where it breaks, as the daemon does."""
    prior = setup.prior
    return filter_log(
        course, setup.constants, prior.mean, prior.covariance, setup.effects, setup.effect_drift,
        keep_states=keep_states, keep_history=keep_history, mends=True,
    )  # fmt: skip


def _looked_at_again(course: Course, setup: FilterSetup, first: FilterRun) -> Belief:
    """A second look, or the first where parameters wander or were reset, or where the second made readings unlikely."""
    found = Belief(first.mean, first.covariance)
    if setup.constants.wanders or was_reset(first):
        return found
    again = second_look(course, setup.constants, setup.prior, found, setup.effects)
    if again is None or again[1] < log_likelihood(first, setup.constants.gate) - _ASTRAY:
        return found
    return again[0]
