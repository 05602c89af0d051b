"""A model fitted to a part of a record: what it says of each effect, and what else is fitted from where it stands."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, by_identity
from rw_ekf.filter.belief import Belief
from rw_ekf.likelihood.gauss_newton import (
    SMALL_STEP,
    TURNS,
    Optimum,
    Problem,
    Start,
    along_free_runs,
    optimum_of,
    smoothed_trajectory,
)
from rw_ekf.likelihood.linearisation import Linearisation, Noise, follows_angle, linearise
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import Record, Trajectory
from rw_ekf.likelihood.phase_particles import LostAngle
from rw_ekf.likelihood.profile import Likelihood, likelihood, value_of
from rw_ekf.model.effect import RecordFacts, Term, size_of
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, STATIC

_SKETCH_TURNS = 3
_NEARLY_AS_LIKELY, _SAME_PLACE = 3.0, 0.5  # log-likelihood, and standard deviations, between two sketches
_STANDSTILL_TURNS = 10
_BELOW_SIGMAS = 2.0  # that break-away friction may lie below Coulomb friction by chance
_COMPARABLE = 6.0  # log-likelihood: along different trajectories values differ by that for no reason
ROOM_SIGMAS = 2.0  # by which an effect may be larger than it was found
_LOOSER = 3.0  # than the whole record knows it, a part takes the size of an event over


@by_identity
class FittedTerm(NamedTuple):
    """A term of a fitted model, and how well it is known."""

    term: Term
    covariance: Float64Array  # of its coefficients
    shape_std: dict[str, float]  # of the shape constants that were fitted, by name


@dataclass(eq=False, frozen=True)
class Fit:
    """A model fitted to a part of a record: its likelihood, and the trajectory it was linearised along."""

    model: Model
    prior: Belief | None
    likelihood: Likelihood
    linearised: Linearisation
    omit: BoolArray  # (n,) readings left out
    simulated: bool = False  # its numbers are those by which it runs free best (`by_simulation`), not the likeliest
    _refits: dict[Model, Fit] = field(default_factory=dict, init=False, repr=False, compare=False)
    _sketches: dict[Model, Fit] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def problem(self) -> Problem:
        """What it was fitted to."""
        return Problem(self.linearised.record, self.prior, self.omit)

    @property
    def noise(self) -> Noise:
        """Its own best noises."""
        return self.likelihood.noise

    @property
    def trajectory(self) -> Trajectory:
        """What it was linearised along."""
        return self.linearised.trajectory

    @property
    def std(self) -> Float64Array:
        """Standard deviations of the model's vector."""
        return np.sqrt(np.maximum(np.diag(self.likelihood.covariance), 0.0))

    @property
    def below_coulomb(self) -> float:
        """By how many standard deviations break-away friction lies below Coulomb friction."""
        known, apart = self.model.parameters, np.zeros(self.model.vector.size)
        apart[[COULOMB - MOTOR_GAIN, STATIC - MOTOR_GAIN]] = 1.0, -1.0
        variance = float(apart @ self.likelihood.covariance @ apart)
        return (known.coulomb - known.static) / math.sqrt(max(variance, 1.0e-300))

    def refitted(self, model: Model, least_gain: float = -math.inf) -> Fit:
        """Another model fitted to the same part of the record, from where this one stands; each model once.

        One that has been sketched continues from there. least_gain: see `optimum_of`; in log-likelihood over this fit.
        """
        if model not in self._refits:
            if self._turns_with(model):
                starts = [Start(m, path, self.noise) for m, path in self._on_likely_angles(model)]
                fits = [fit_model(self.problem, start) for start in starts]
                self._refits[model] = max(fits, key=lambda fit: fit.likelihood.value)
            else:
                sketch, least = self._sketches.get(model), self.likelihood.value + least_gain
                begun = None if sketch is None else Optimum(sketch.model, sketch.likelihood, sketch.linearised)
                start = Start(model, self.trajectory, self.noise)
                found = optimum_of(self.problem, start, begun=begun, least=least)
                self._refits[model] = _breaking_away(_fit_of(self.problem, found))
        return self._refits[model]

    def _turns_with(self, model: Model) -> bool:
        """Whether a model follows an angle that is lost slowly, so that its fits begin from likely ones."""
        return follows_angle(self.linearised.record, model) and self.linearised.memory_jacobian.shape[0] == 0

    def _on_likely_angles(self, model: Model) -> list[tuple[Model, Trajectory]]:
        """A model with a ripple that this one has not, turned, and trajectories with angles that go with it."""
        new = next((item for item in model.placed if item[0].effect.angular and item[0].size > 0.0), None)
        if new is None:
            return [(model, self.trajectory)]
        term, at = new
        linearised = linearise(self.linearised.record, model, self.trajectory, self.noise, self.omit)
        regressors = np.ascontiguousarray(linearised.jacobian[:, at])
        order, found = term.shape[0], []
        for path in LostAngle(self.linearised, self.noise).paths(regressors, order, term.size):
            turned = replace(term, values=(term.size * math.cos(path[0]), term.size * math.sin(path[0])))
            angle = self.linearised.record.course.angle_rad + (path - path[0]) / order
            found.append((model.changed(term, turned), self.trajectory._replace(angle=angle)))
        return found

    def widened(self, factors: Float64Array) -> Fit:
        """The same fit, the standard deviations of its vector times factors (p,)."""
        covariance = self.likelihood.covariance * np.outer(factors, factors)
        return replace(self, likelihood=replace(self.likelihood, covariance=covariance))

    def widened_over(
        self, at: slice, reported: tuple[float, float], others: Iterable[tuple[float, float, float]]
    ) -> Fit:
        """The same fit, a number at `at` as uncertain as what others make of it.

        reported: its value and standard deviation; others: probability, value and standard deviation of each
        alternative, the one reported among them. The variance about that value becomes theirs, and no less than it was.
        """
        value, std = reported
        variance = math.fsum(p * (its_std**2 + (its - value) ** 2) for p, its, its_std in others)
        factors = np.ones(self.model.vector.size)
        factors[at] = max(math.sqrt(variance) / std, 1.0)
        return self.widened(factors)

    def worth_a_fit(self, models: list[Model], least_gain: float = -math.inf) -> list[Model]:
        """Of models that are starts of one effect those worth a full fit, by sketches.

        Of those that bring a memory the likeliest, if it gains least_gain in log-likelihood: what a full fit of each
        would cost is better spent on the valley that is deepest. Of others it and what is nearly as likely elsewhere.
        """
        brings = any(model.has_memory for model in models)
        if brings and not self.model.has_memory:
            best = max((self.sketched(model) for model in models), key=lambda fit: fit.likelihood.value)
            gain = best.likelihood.value - self.likelihood.value
            return [model for model in models if self.sketched(model) is best and gain >= least_gain]
        if brings or len(models) < 2 or any(self._turns_with(model) for model in models):
            return models
        sketches = sorted(((self.sketched(m), m) for m in models), key=lambda item: -item[0].likelihood.value)
        kept: list[tuple[Fit, Model]] = []
        for sketch, model in sketches:
            near = sketch.likelihood.value > sketches[0][0].likelihood.value - _NEARLY_AS_LIKELY
            if near and not any(sketch.is_at(other) for other, _ in kept):
                kept.append((sketch, model))
        return [model for _, model in kept]

    def is_at(self, other: Fit) -> bool:
        """Whether a fit of the same kind of model has come to the same place, to half a standard deviation."""
        apart = np.abs(self.model.vector - other.model.vector)
        return apart.size == other.std.size and bool(np.all(apart < _SAME_PLACE * other.std))

    def sketched(self, model: Model) -> Fit:
        """A model fitted in few turns, with a memory along the path on which it runs freely; each model once."""
        if model not in self._sketches:
            start = Start(model, self.trajectory, self.noise)
            if model.has_memory:
                found = along_free_runs(self.problem, start, _SKETCH_TURNS, runs=1)
            else:
                found = optimum_of(self.problem, start, _SKETCH_TURNS)
            self._sketches[model] = _fit_of(self.problem, found)
        return self._sketches[model]

    def without(self, effect_id: str) -> Fit:
        """The same part fitted without one effect."""
        return self.refitted(self.model.without(effect_id))

    def on_part(self, record: Record) -> Fit:
        """The same model fitted to a part of the record alone; the places of events stay, and their sizes nearly.

        An event lives in one stretch of the record: a part without it would deny it where it is. Any other effect is
        drawn towards zero by a prior as wide as it is large, as far as the part does not know it: a part that
        has nothing of it may call it anything.
        """
        model, prior = self.model, self.prior
        given = () if prior is None else prior.effect_ids
        for name in dict.fromkeys(term.id for term in model.terms):
            local = model.of(name)[0].effect.local_in_time
            if local:
                model = model.settled(name).with_found_laws(name)
            is_known = name in given and all(term.given for term in model.of(name))
            if prior is None or (is_known and not local):
                continue
            for item in self.terms_of(name):
                values = item.term.values
                if item.term.law is not None and item.term.law.prior_std and not local:
                    continue
                if local:  # one coefficient
                    mean, std = values[0], _LOOSER * math.sqrt(max(float(item.covariance[0, 0]), 0.0))
                else:
                    mean, std = 0.0, item.term.size / math.sqrt(len(values))
                for _ in values if std > 0.0 else ():
                    prior = prior.with_coefficient(name, mean, std)
        return fit_model(Problem(record, prior, self.omit), Start(model, self.trajectory, self.noise))

    def terms_of(self, effect_id: str) -> list[FittedTerm]:
        """The terms of one effect, in the order of use."""
        found = []
        for number, (term, at) in zip(self.model.numbers_of(effect_id), self.model.placed_of(effect_id), strict=True):
            shapes = enumerate(self.model.refined, start=self.model.known)
            stds = {term.effect.constants[j].name: float(self.std[place]) for place, (i, j) in shapes if i == number}
            found.append(FittedTerm(term, self.likelihood.covariance[at, at], stds))
        return found

    def knows(self, effect_id: str, sigmas: float) -> bool:
        """Whether an effect's size is known to so many sigma: a fit that ran away claims a gain, but no size."""
        return self.sigmas_of(effect_id) > sigmas

    def sigmas_of(self, effect_id: str) -> float:
        """By how many standard deviations an effect is there at all; of laws, and of several tones, the least of each.

        A law has coefficients that the record says nothing of beside those that it knows: sqrt(v' V^-1 v) of all. Tones
        nearer to each other than a record resolves may be as large as they like, one against the other.
        """
        items = self.terms_of(effect_id)
        laws = [item for item in items if item.term.law is not None]
        if laws:
            return min(_sigmas(np.array(item.term.values), item.covariance) for item in laws)
        if len(items) > 1 and items[0].term.effect.repeats:
            described = [item.term.effect.amplitude(item.term.values, item.covariance) for item in items]
            return min(size / std if std > 0.0 else 0.0 for size, std in described)
        size, std = self.size_of(effect_id)
        return size / std if std > 0.0 else 0.0

    def may_matter(self, effect_id: str, facts: RecordFacts) -> bool:
        """Whether an effect in the model is large enough to matter in practice, or not known to be smaller."""
        terms = self.model.of(effect_id)
        if not terms or facts.any_size or not terms[0].effect.linear:
            return self.model.matters(effect_id, facts)
        size, std = self.size_of(effect_id)
        room = 1.0 + ROOM_SIGMAS * std / max(size, 1.0e-300)
        return terms[0].effect.matters(
            [replace(term, values=tuple(room * value for value in term.values)) for term in terms],
            self.model.seen_by(terms[0].effect, facts),
        )

    def size_of(self, effect_id: str) -> tuple[float, float]:
        """Size of an effect, all its terms taken together, and the standard deviation of a coefficient."""
        terms = self.terms_of(effect_id)
        variances = [float(v) for item in terms for v in np.maximum(np.diag(item.covariance), 0.0)]
        if terms and terms[0].term.effect.angular and self.linearised.follows_angle:
            # Where it is lost the phase is anybody's guess, and sine and cosine with it; the amplitude is not.
            variances = [item.term.effect.amplitude(item.term.values, item.covariance)[1] ** 2 for item in terms]
        if terms and terms[0].term.effect.refined:
            # How far a bristle bends and how it is damped, how high a bump is and how wide, are one question: that it
            # bends, or is there, is what counts here.
            variances = self._variances_of_given_shapes(effect_id)
        return size_of([item.term for item in terms]), math.sqrt(math.fsum(variances) / max(len(variances), 1))

    def _variances_of_given_shapes(self, effect_id: str) -> list[float]:
        """Variances of the coefficients of an effect with one term, were its refined shape constants known."""
        number, (_, at) = self.model.numbers_of(effect_id)[0], self.model.placed_of(effect_id)[0]
        own = [*range(at.start, at.stop)]
        shapes = [p for p, (i, _) in enumerate(self.model.refined, start=self.model.known) if i == number]
        block = self.likelihood.covariance[np.ix_([*own, *shapes], [*own, *shapes])]
        if shapes:
            block = np.linalg.inv(np.linalg.inv(block)[: len(own), : len(own)])
        return [float(v) for v in np.diag(block)]


def _sigmas(values: Float64Array, covariance: Float64Array) -> float:
    """The length of values (m,) by the measure of their covariance (m, m)."""
    return math.sqrt(max(float(values @ np.linalg.lstsq(covariance, values, rcond=None)[0]), 0.0))


def fit_model(problem: Problem, start: Start, turns: int = TURNS) -> Fit:
    """A model fitted to the highest likelihood, from a start that need not be near."""
    return _fit_of(problem, optimum_of(problem, start, turns))


def _breaking_away(fit: Fit) -> Fit:
    """The fit; where it breaks away below Coulomb friction, a likelier one begun from where the two are one.

    No bearing takes less to start than to keep going. A model that lacks something may say so, and leave break-away
    friction near nothing; on a record that hardly rests no single step leads from there to where it belongs, even once
    the model lacks nothing any more.
    """
    if fit.below_coulomb <= _BELOW_SIGMAS:
        return fit
    known = fit.model.parameters
    model = replace(fit.model, parameters=known._replace(static=known.coulomb))
    other = _fit_of(fit.problem, optimum_of(fit.problem, Start(model, fit.trajectory, fit.noise)))
    return max(fit, other, key=lambda item: item.likelihood.value)


def _fit_of(problem: Problem, found: Optimum) -> Fit:
    return Fit(found.model, problem.prior, found.likelihood, found.linearised, problem.omit)


def at_standstill(fit: Fit) -> Fit:
    """The fit taken on by full steps until it stands still; as it was where it does not, or loses much by it.

    Near rest a trajectory that has not settled yet may make a model likelier, by a few units, than the one that the
    model itself leads to. A fit that keeps the likeliest turn may then end away from where its steps vanish.
    """
    linearised, model, noise, correction = fit.linearised, fit.model, fit.noise, fit.likelihood.correction
    for _ in range(_STANDSTILL_TURNS):
        trajectory = smoothed_trajectory(linearised, correction, noise)
        model = model.with_vector(model.vector + model.limited(correction))
        linearised = linearise(linearised.record, model, trajectory, noise, fit.omit)
        found = likelihood(linearised, fit.prior, noise)
        noise, correction = found.noise, found.correction
        if bool(np.all(np.abs(correction) < SMALL_STEP * np.sqrt(np.maximum(np.diag(found.covariance), 1.0e-300)))):
            here = value_of(linearised, noise)
            if here.value < fit.likelihood.value - _COMPARABLE:
                return fit
            here = replace(here, covariance=found.covariance, correction=correction)
            return Fit(model, fit.prior, here, linearised, fit.omit)
    return fit
