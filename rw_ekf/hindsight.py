"""What is believed at the end of a log that nobody configured a filter for: all that it says, and no more.

A run's filter has to follow a wheel that ages, with given noises: what it believes, `replay --as-run` gives. A log
seen as a whole says itself whether its parameters wander, how much torque noise there was, and where its break-aways
are to be linearised (docs/filter.md, "In hindsight").
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from rw_ekf.arrays import scaled_root
from rw_ekf.course.course import Course
from rw_ekf.errors import FilterError
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.filter.parameters_held import without_drift
from rw_ekf.filter.second_pass import log_likelihood, second_look, was_reset
from rw_ekf.identify.record_scale import busiest, top_speed_of
from rw_ekf.likelihood.record_stribeck import stribeck_hypotheses
from rw_ekf.model.state import PARAMETERS, SPEED
from rw_ekf.starting_point import LEAST_NOISE_RATIO, FilterSetup, note_of_foreign_machine

CLEARLY = 2.0  # log-likelihood: parameters wander where that makes the readings likelier by so much
# Of the first look's sigmas: lags that come out right have 0.75 and more, one that was 12 sigma off had 0.32.
_AS_SURE = 0.5
_DIVERGED = 10.0  # log-likelihood: other noises may cost some of it, a filter that diverged more
_PART, _LONG = 8_000, 4  # samples that show how much wider other noises make it, and how often a long log has these


def run_of_log(
    course: Course, setup: FilterSetup, *, keep_states: bool = False, keep_history: bool = False
) -> tuple[FilterRun, FilterSetup]:
    """The filter over a log, and what it was given: parameters wander only where that makes the readings likelier."""
    steady = replace(setup, constants=without_drift(setup.constants))
    run = filtered(course, steady, keep_states=keep_states, keep_history=keep_history)
    gate = setup.constants.gate
    likelihoods = [log_likelihood(run, gate)]
    for hypothesis in setup.stribeck_hypotheses[:1]:  # a first pass may have lost its way where nothing is known at all
        again = second_look(course, steady.constants, setup.prior, hypothesis.fitted, setup.effects)
        likelihoods += [] if again is None else [again[1]]
    if log_likelihood(filtered(course, setup), gate) < max(likelihoods) + CLEARLY:
        return run, steady
    return filtered(course, setup, keep_states=keep_states, keep_history=keep_history), setup


def with_stribeck_speeds(course: Course, setup: FilterSetup) -> FilterSetup:
    """The setup at the likeliest Stribeck speed, with all that are possible.

    Unchanged where somebody gave one, and where the record is so odd that no fit comes about at another.
    """
    if setup.stribeck_speed_std == 0.0 or setup.fit_of_record is None:
        return setup
    try:
        fit, hypotheses = stribeck_hypotheses(setup.fit_of_record, top_speed_of(course))
    except (FilterError, np.linalg.LinAlgError):
        return setup
    noises = fit.noises
    least = LEAST_NOISE_RATIO * noises.speed_noise_rad_s
    constants = (
        setup.constants.with_stribeck_speed(fit.stribeck_speed_rad_s)
        .with_speed_noise(noises.speed_noise_rad_s)
        .with_acceleration_noise(max(noises.acceleration_noise, least))
    )
    return replace(
        setup,
        constants=constants,
        notes=(note_of_foreign_machine(course, fit.parameters, constants),),
        fit_of_record=fit,
        stribeck_speed_std=fit.stribeck_speed_std,
        stribeck_hypotheses=tuple(hypotheses),
        acceleration_noises=tuple(float(noise) for noise in noises.acceleration_noise_quantiles),
    )


def belief_of_log(course: Course, setup: FilterSetup, run: FilterRun) -> Belief:
    """What is believed at the end: the moments of a mixture over what is not known beside the parameters."""
    return _mixture(list(_over_stribeck_speeds(course, setup)) or list(_parts(course, setup, run)))


@dataclass(frozen=True, eq=False)
class PartHindsight:
    """What a part of a log says, from which the whole of it is looked at."""

    setup: FilterSetup  # the likeliest of what the part leaves open, at the middle of its torque noises
    middle: Belief  # of that alone
    over_noises: tuple[tuple[float, Belief], ...]  # weights and beliefs
    over_shapes: tuple[tuple[float, Belief], ...]  # over Stribeck speeds, or over shapes of effects

    def of_whole(self, belief: Belief) -> Belief:
        """A belief that the whole log comes to, with what the part leaves open as uncertainty.

        What another torque noise changes becomes less as a log becomes longer, like its sigmas. A bias by another
        Stribeck speed stays as large as it is.
        """
        with contextlib.suppress(np.linalg.LinAlgError):  # a part that says nothing of some number
            belief = wider_as(self.over_noises, self.middle, belief) if len(self.over_noises) > 1 else belief
        known = slice(SPEED + 1, None)
        mean = sum((weight * part.mean[known] for weight, part in self.over_shapes), np.zeros(belief.mean.size - 1))
        covariance = belief.covariance.copy()
        for weight, part in self.over_shapes:
            off = part.mean[known] - mean
            covariance[known, known] += weight * np.outer(off, off)
        return Belief(belief.mean, covariance)


def hindsight_of_part(course: Course, setup: FilterSetup) -> PartHindsight:
    """Look back on a part as on a log of its own."""
    noises = setup.acceleration_noises or (setup.constants.acceleration_noise,)
    constants = without_drift(setup.constants).with_acceleration_noise(noises[len(noises) // 2])
    alone = replace(setup, acceleration_noises=(), stribeck_hypotheses=(), effect_hypotheses=())
    steady, first = replace(alone, constants=constants), None
    over_shapes: list[tuple[float, Belief]] = []
    for hypothesis in setup.stribeck_hypotheses:
        at_speed = constants.with_stribeck_speed(hypothesis.omega_s)
        again = second_look(course, at_speed, setup.prior, hypothesis.fitted, setup.effects)
        if again is not None:
            over_shapes.append((hypothesis.probability, again[0]))
            if hypothesis.probability == max(weight for weight, _ in over_shapes):
                steady, first = replace(alone, constants=at_speed), again[0]
    for effects in setup.effect_hypotheses:
        of_shape = replace(steady, effects=effects)
        over_shapes.append((1.0, _looked_at_again(course, of_shape, filtered(course, of_shape))))
    if first is None:
        first = _looked_at_again(course, steady, filtered(course, steady))
    over_noises = []
    for noise in noises if len(noises) > 1 else ():
        again = second_look(course, steady.constants.with_acceleration_noise(noise), setup.prior, first, setup.effects)
        over_noises += [] if again is None else [(1.0, again[0])]
    wandering = setup.constants.with_stribeck_speed(steady.constants.stribeck.omega_s)
    middle = replace(alone, constants=wandering.with_acceleration_noise(steady.constants.acceleration_noise))
    return PartHindsight(middle, first, _weighed(over_noises), _weighed(over_shapes))


def _weighed(parts: Sequence[tuple[float, Belief]]) -> tuple[tuple[float, Belief], ...]:
    """The same with weights that add up to one."""
    total = math.fsum(weight for weight, _ in parts)
    return tuple((weight / total, belief) for weight, belief in parts)


def belief_of_fit(course: Course, setup: FilterSetup, fitted: Belief, noises: Sequence[float]) -> Belief:
    """What is believed after a fit: the filter's word on it, linearised where the fit ended.

    A fit regresses friction on a speed that the same readings gave: near rest, where friction depends on it, that
    biases it by more than a sigma. A filter predicts each reading from those before it. setup: with the speed noise
    that the fit found, and with the shapes that the record leaves open, if it does; noises: torque noises of equal
    weight. The fit's own word where the filter has none.
    """
    setup = replace(setup, constants=without_drift(setup.constants))
    over = list(_over_stribeck_speeds(course, setup))
    if over:
        return _mixture(over)
    shapes = setup.effect_hypotheses or (setup.effects,)
    parts = []
    for effects, noise in product(shapes, noises):
        constants = setup.constants.with_acceleration_noise(noise)
        again = second_look(course, constants, setup.prior, fitted, effects)
        if again is None:
            return fitted
        parts.append((1.0 / (len(noises) * len(shapes)), again[0]))
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


def _over_stribeck_speeds(course: Course, setup: FilterSetup) -> Iterator[tuple[float, Belief]]:
    """Beliefs and weights, one for each Stribeck speed and torque noise; none where somebody gave the speed."""
    found = []
    for hypothesis in setup.stribeck_hypotheses:
        constants = setup.constants.with_stribeck_speed(hypothesis.omega_s)
        if constants.wanders:  # where a run ended, not what fits all of it
            run = filtered(course, replace(setup, constants=constants))
            found.append((hypothesis.probability, Belief(run.mean, run.covariance)))
            continue
        for noise in setup.acceleration_noises:
            there = constants.with_acceleration_noise(noise)
            again = second_look(course, there, setup.prior, hypothesis.fitted, setup.effects)
            if again is not None:
                found.append((hypothesis.probability, again[0]))
    total = math.fsum(weight for weight, _ in found)
    yield from ((weight / total, belief) for weight, belief in found)


def _parts(course: Course, setup: FilterSetup, run: FilterRun) -> Iterator[tuple[float, Belief]]:
    """Beliefs and their weights: one for each torque noise, five values of equal weight (`noise_posterior`).

    And for each set of effects, where the shapes of these are known no better (`rw_ekf.second_record`). Of a long log
    one, at the middle of the noises: by how much wider all of them make it is seen on a part.
    """
    if setup.effect_hypotheses:
        for effects in setup.effect_hypotheses:
            there = replace(setup, effects=effects, effect_hypotheses=())
            for weight, part in _parts(course, there, filtered(course, there)):
                yield weight / len(setup.effect_hypotheses), part
        return
    noises = setup.acceleration_noises or (setup.constants.acceleration_noise,)
    if len(noises) > 1 and not setup.constants.wanders and course.samples > _LONG * _PART:
        middle = _at_noise(course, setup, run, noises[len(noises) // 2])
        with contextlib.suppress(np.linalg.LinAlgError):  # a part that says nothing of some number
            found = list(_over_part(course, setup, noises))
            yield 1.0, wider_as([(1.0 / len(found), part) for part in found], found[len(found) // 2], middle)
            return
    for noise in noises:
        yield 1.0 / len(noises), _at_noise(course, setup, run, noise, alone=len(noises) == 1)


def _at_noise(course: Course, setup: FilterSetup, run: FilterRun, noise: float, *, alone: bool = False) -> Belief:
    """What is believed at one torque noise. run: the first look, where that need not be another at this noise."""
    there = replace(setup, constants=setup.constants.with_acceleration_noise(noise))
    first = filtered(course, there) if setup.constants.wanders and not alone else run
    return _looked_at_again(course, there, first)


def _over_part(course: Course, setup: FilterSetup, noises: Sequence[float]) -> Iterator[Belief]:
    """What is believed at each torque noise after the part of a long log where the wheel moves most."""
    part = busiest(course, _PART)
    first = filtered(part, setup)
    return (_at_noise(part, setup, first, noise) for noise in noises)


def wider_as(found: Sequence[tuple[float, Belief]], middle: Belief, whole: Belief) -> Belief:
    """A belief whose parameters are as much wider as those of a mixture are than those of its middle component.

    In the middle one's standard deviations sigmas and what moves the means go with the torque noise alike however long
    a log is: both fall as the root of its length. What moved the means of the part is no guide to where those of the
    whole would move, so that it counts as uncertainty alone. found: weights and components. Raises LinAlgError where
    one of the beliefs knows something for certain.
    """
    # A record that has to show its torque noise comes without a model, and so without effects; and of effects whose
    # shape is open the parameters are what the shapes have in common.
    known, P = PARAMETERS, whole.covariance
    spread = np.zeros_like(P[known, known])
    for weight, part in found:
        off = (part.mean - middle.mean)[known]
        spread += weight * (part.covariance[known, known] + np.outer(off, off))
    of_part, of_whole = scaled_root(middle.covariance[known, known]), scaled_root(P[known, known])
    shares = np.linalg.solve(of_part, np.linalg.solve(of_part, spread).T)
    wider = of_whole @ (0.5 * (shares + shares.T)) @ of_whole.T
    follows = np.linalg.solve(P[known, known], P[known]).T  # the speed and hidden states follow the parameters
    return Belief(whole.mean, P + follows @ (wider - P[known, known]) @ follows.T)


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
    if again is None or again[1] < log_likelihood(first, setup.constants.gate) - _DIVERGED:
        return found
    # Friction with a memory bends more than a second look makes up for: from the same readings it cannot know more.
    if setup.effects.table().hidden and np.any(again[0].std[PARAMETERS] < _AS_SURE * found.std[PARAMETERS]):
        return found
    return again[0]
