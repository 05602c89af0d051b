"""A model fitted to a part of a record: Gauss-Newton on its vector to the highest likelihood (docs/diagnosis.md)."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.filter.belief import Belief
from rw_ekf.likelihood.free_path import free_trajectory
from rw_ekf.likelihood.frozen_filter import filtered_trajectory
from rw_ekf.likelihood.linearisation import Linearisation, Noise, follows_angle, linearise
from rw_ekf.likelihood.model import Model, prior_rows
from rw_ekf.likelihood.one_step import LEAST_SPREAD, Record, Trajectory
from rw_ekf.likelihood.phase_particles import LostAngle
from rw_ekf.likelihood.profile import Likelihood, as_it_stands, likelihood, value_of
from rw_ekf.likelihood.whitening import smooth
from rw_ekf.likelihood.work import FITS
from rw_ekf.model.effect import RecordFacts, Term, size_of
from rw_ekf.wheel.table import ABSENT

_FIT_TURNS = 8
_FREE_RUNS, _BETTER = 2, 1.0  # of a model with a memory, and by how much log-likelihood the second has to be better
_SETTLING_TURNS = 4
_SKETCH_TURNS = 3
_NOT_WORSE = 0.5  # log-likelihood that a step may lose to the trajectory that moved meanwhile
_LEAST_DAMPING = 0.02
_STANDSTILL_TURNS = 10
_COMPARABLE = 6.0  # log-likelihood: along different trajectories values differ by that for no reason
ROOM_SIGMAS = 2.0  # by which an effect may be larger than it was found
_LOOSER = 3.0  # than the whole record knows it, a part takes the size of an event over
_SMALL_STEP = 0.05  # standard deviations


class FittedTerm(NamedTuple):
    """A term of a fitted model, and how well it is known."""

    term: Term
    covariance: Float64Array  # of its coefficients
    shape_std: dict[str, float]  # of the shape constants that were fitted, by name


@dataclass(frozen=True)
class Fit:
    """A model fitted to a part of a record: its likelihood, and the trajectory it was linearised along."""

    model: Model
    prior: Belief | None
    likelihood: Likelihood
    linearised: Linearisation
    omit: BoolArray  # (n,) readings left out
    _refits: dict[Model, Fit] = field(default_factory=dict, init=False, repr=False, compare=False)
    _sketches: dict[Model, Fit] = field(default_factory=dict, init=False, repr=False, compare=False)

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

    def refitted(self, model: Model) -> Fit:
        """Another model fitted to the same part of the record, from where this one stands; each model once."""
        if model not in self._refits:
            record = self.linearised.record
            starts = [(model, self.trajectory)]
            if follows_angle(record, model) and self.linearised.memory_jacobian.shape[0] == 0:
                starts = self._on_likely_angles(model)
            fits = [fit_model(record, m, self.prior, path, self.noise, self.omit) for m, path in starts]
            self._refits[model] = max(fits, key=lambda fit: fit.likelihood.value)
        return self._refits[model]

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

    def worth_a_fit(self, models: list[Model], least_gain: float = -math.inf) -> list[Model]:
        """Of models that bring a memory the likeliest by sketches, if it gains so much log-likelihood; of others all.

        Starts of one effect: what a full fit of each would cost is better spent on the valley that is deepest.
        """
        brings = [model.effects.table().memory_state_at != ABSENT for model in models]
        if not any(brings) or self.model.effects.table().memory_state_at != ABSENT:
            return models
        best = max((self.sketched(model) for model in models), key=lambda fit: fit.likelihood.value)
        gain = best.likelihood.value - self.likelihood.value
        return [model for model in models if self.sketched(model) is best and gain >= least_gain]

    def sketched(self, model: Model) -> Fit:
        """A model with a memory fitted in few turns, along the path on which it runs freely; each model once."""
        if model not in self._sketches:
            self._sketches[model] = fit_along_free_runs(
                self.linearised.record, model, self.prior, self.trajectory, self.noise, self.omit,
                turns=_SKETCH_TURNS, runs=1,
            )  # fmt: skip
        return self._sketches[model]

    def without(self, effect_id: str) -> Fit:
        """The same part fitted without one effect."""
        return self.refitted(self.model.without(effect_id))

    def on_part(self, record: Record) -> Fit:
        """The same model fitted to a part of the record alone; the places of events stay, and their sizes nearly.

        An event lives in one stretch of the record: a part without it would deny it where it is. Any other effect is
        drawn towards zero by a prior as wide as it is large, as far as the part does not know it (eq. 10b): a part that
        has nothing of it may call it anything.
        """
        model, prior = self.model, self.prior
        given = () if prior is None else prior.effect_ids
        for name in model.effects.ids:
            local = model.of(name)[0].effect.local_in_time
            if local:
                model = model.settled(name)
            if prior is None or (name in given and not local):
                continue
            for item in self.terms_of(name):
                values = item.term.values
                if local:  # one coefficient
                    mean, std = values[0], _LOOSER * math.sqrt(max(float(item.covariance[0, 0]), 0.0))
                else:
                    mean, std = 0.0, item.term.size / math.sqrt(len(values))
                for _ in values if std > 0.0 else ():
                    prior = prior.with_coefficient(name, mean, std)
        return fit_model(record, model, prior, self.trajectory, self.noise, self.omit)

    def terms_of(self, effect_id: str) -> list[FittedTerm]:
        """The terms of one effect, in the order of use."""
        found = []
        for number, (term, at) in enumerate(self.model.placed):
            if term.id == effect_id:
                shapes = enumerate(self.model.refined, start=self.model.known)
                stds = {
                    term.effect.constants[j].name: float(self.std[place]) for place, (i, j) in shapes if i == number
                }
                found.append(FittedTerm(term, self.likelihood.covariance[at, at], stds))
        return found

    def knows(self, effect_id: str, sigmas: float) -> bool:
        """Whether an effect's size is known to so many sigma: a fit that ran away claims a gain, but no size."""
        size, std = self._size(effect_id)
        return std > 0.0 and size > sigmas * std

    def may_matter(self, effect_id: str, facts: RecordFacts) -> bool:
        """Whether an effect in the model is large enough to matter in practice, or not known to be smaller."""
        terms = self.model.of(effect_id)
        if not terms or not terms[0].effect.linear:
            return self.model.matters(effect_id, facts)
        size, std = self._size(effect_id)
        room = 1.0 + ROOM_SIGMAS * std / max(size, 1.0e-300)
        return terms[0].effect.matters(
            [replace(term, values=tuple(room * value for value in term.values)) for term in terms], facts
        )

    def _size(self, effect_id: str) -> tuple[float, float]:
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
        number, at = next((i, at) for i, (t, at) in enumerate(self.model.placed) if t.id == effect_id)
        own = [*range(at.start, at.stop)]
        shapes = [p for p, (i, _) in enumerate(self.model.refined, start=self.model.known) if i == number]
        block = self.likelihood.covariance[np.ix_([*own, *shapes], [*own, *shapes])]
        if shapes:
            block = np.linalg.inv(np.linalg.inv(block)[: len(own), : len(own)])
        return [float(v) for v in np.diag(block)]


def smoothed_trajectory(linearised: Linearisation, correction: Float64Array, noise: Noise) -> Trajectory:
    """The trajectory smoothed under the corrected model."""
    n = linearised.chain.reading.size
    means, variances = np.zeros((n, 2)), np.zeros((n, 2))
    chain = linearised.chain._replace(defect=linearised.chain.defect + linearised.jacobian @ correction)
    with_memory = linearised.memory_jacobian.shape[0] > 0
    if with_memory:
        chain = chain._replace(memory_defect=chain.memory_defect + linearised.memory_jacobian @ correction)
    smooth(chain, noise.ratio * noise.variance / linearised.record.period_s, noise.variance, means, variances)
    spread = np.maximum(np.sqrt(np.maximum(variances[:, 0], 0.0)), LEAST_SPREAD * math.sqrt(noise.variance))
    speed = linearised.trajectory.speed + means[:, 0]
    if linearised.follows_angle:
        return Trajectory.of_speed(speed, spread)._replace(angle=linearised.record.course.angle_rad + means[:, 1])
    if not with_memory:
        return Trajectory.of_speed(speed, spread)._replace(angle=linearised.trajectory.angle)
    coulomb = linearised.model.parameters.coulomb
    memory_spread = np.clip(np.sqrt(np.maximum(variances[:, 1], 0.0)), 0.005 * coulomb, 0.3 * coulomb)
    return Trajectory(speed, spread, linearised.trajectory.memory + means[:, 1], memory_spread)


def fit_model(
    record: Record,
    model: Model,
    prior: Belief | None,
    trajectory: Trajectory,
    noise: Noise,
    omit: BoolArray,
    *,
    turns: int = _FIT_TURNS,
) -> Fit:
    """Gauss-Newton on the model's vector to the highest likelihood seen, from a trajectory that need not be its own.

    A model with a memory is fitted along the trajectory given and along the one on which it runs freely, and where that
    is no better along the one that its own filter follows: each alone may end where the others would not.
    """
    if model.effects.table().memory_state_at == ABSENT or not np.isnan(trajectory.memory).any():
        return _gauss_newton(record, model, prior, trajectory, noise, omit, turns)
    first = _gauss_newton(record, model, prior, *_settle(record, model, trajectory, noise, omit), omit, turns)
    free = fit_along_free_runs(record, model, prior, trajectory, noise, omit, turns=turns)
    if free.likelihood.value > first.likelihood.value:
        return free
    own = filtered_trajectory(record, first.model, first.noise, omit)
    own, level = _settle(record, first.model, own, first.noise, omit)
    second = _gauss_newton(record, first.model, prior, own, level, omit, turns)
    return max(first, second, key=lambda fit: fit.likelihood.value)


def fit_along_free_runs(
    record: Record,
    model: Model,
    prior: Belief | None,
    trajectory: Trajectory,
    noise: Noise,
    omit: BoolArray,
    *,
    turns: int = _FIT_TURNS,
    runs: int = _FREE_RUNS,
) -> Fit:
    """Gauss-Newton along the path on which a model with a memory runs freely, then along that of what it led to."""
    best: Fit | None = None
    for _ in range(runs):
        path = free_trajectory(record, model, trajectory, noise)
        fit = _gauss_newton(record, model, prior, path, noise, omit, turns)
        if best is not None and fit.likelihood.value < best.likelihood.value + _BETTER:
            break
        best, model = fit, fit.model
        if not record.work.has(FITS):
            break
    assert best is not None
    return best


def _settle(
    record: Record, model: Model, trajectory: Trajectory, noise: Noise, omit: BoolArray
) -> tuple[Trajectory, Noise]:
    """A trajectory smoothed a few times under a model with a memory, as it stands."""
    for _ in range(_SETTLING_TURNS):
        linearised = linearise(record, model, trajectory, noise, omit, with_jacobian=False)
        noise = likelihood(linearised, None, noise).noise
        trajectory = smoothed_trajectory(linearised, np.zeros(0), noise)
    return trajectory, noise


def _gauss_newton(
    record: Record,
    model: Model,
    prior: Belief | None,
    trajectory: Trajectory,
    noise: Noise,
    omit: BoolArray,
    turns: int,
) -> Fit:
    """The trajectory is smoothed anew in every turn; a step that loses likelihood or prior is shortened."""
    best: Fit | None = None
    damping, highest = 1.0, 0.0
    start = model
    step = np.zeros(0)
    for turn in range(turns):
        if turn > 1 and not record.work.has(FITS):
            record.work.leave_out("the last turns of fits")
            break
        linearised = linearise(record, model, trajectory, noise, omit)
        found = likelihood(linearised, prior, noise)
        here = as_it_stands(linearised, prior, found)
        value = here.value + _log_prior(prior, model)
        if best is not None and value < highest - _NOT_WORSE:
            damping *= 0.3
            if damping < _LEAST_DAMPING:
                break
        else:
            best, highest = Fit(model, prior, here, linearised, omit), value
            std = np.sqrt(np.maximum(np.diag(found.covariance), 1.0e-300))
            if turn > 0 and bool(np.all(np.abs(found.correction) < _SMALL_STEP * std)):
                break
            start, step, noise = model, _within_reach(model, found), found.noise
            trajectory = smoothed_trajectory(linearised, found.correction, noise)
            damping = min(1.0, 2.0 * damping)
        model = start.with_vector(start.vector + damping * step)
    assert best is not None
    return best


def _log_prior(prior: Belief | None, model: Model) -> float:
    """Log of what is known beforehand of a model's vector, but for a constant."""
    if prior is None:
        return 0.0
    W, aim = prior_rows(prior, model)
    off = W @ model.vector - aim
    return -0.5 * float(off @ off)


def _within_reach(model: Model, found: Likelihood) -> Float64Array:
    """The correction no longer than the linearisation carries, (p,): where some are cut short, the best of the rest.

    An amplitude that goes with a wider bump is wrong for one that may not yet be as wide.
    """
    step = model.limited(found.correction)
    cut = step != found.correction
    if not cut.any():
        return step
    C = found.covariance
    along = C[:, cut] @ np.linalg.solve(C[np.ix_(cut, cut)], (step - found.correction)[cut])
    return model.limited(found.correction + along)


def at_standstill(fit: Fit) -> Fit:
    """The fit taken on by full steps until it stands still; as it was where it does not, or loses much by it.

    Near rest a trajectory that has not settled yet may make a model likelier, by a few units, than the one that the
    model itself asks for. A fit that keeps the likeliest turn may then end away from where its steps vanish.
    """
    linearised, model, noise, correction = fit.linearised, fit.model, fit.noise, fit.likelihood.correction
    for _ in range(_STANDSTILL_TURNS):
        trajectory = smoothed_trajectory(linearised, correction, noise)
        model = model.with_vector(model.vector + model.limited(correction))
        linearised = linearise(linearised.record, model, trajectory, noise, fit.omit)
        found = likelihood(linearised, fit.prior, noise)
        noise, correction = found.noise, found.correction
        if bool(np.all(np.abs(correction) < _SMALL_STEP * np.sqrt(np.maximum(np.diag(found.covariance), 1.0e-300)))):
            here = value_of(linearised, noise)
            if here.value < fit.likelihood.value - _COMPARABLE:
                return fit
            here = replace(here, covariance=found.covariance, correction=correction)
            return Fit(model, fit.prior, here, linearised, fit.omit)
    return fit
