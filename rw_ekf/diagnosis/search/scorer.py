"""What each hypothesis would add to the likelihood of a fitted model (docs/diagnosis.md, "Evidence").

Nothing is refitted: a candidate's gain is that of a linear regression, joint with the corrections of everything already
in the model, at each of a few ratios of noises.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.search.candidates import Hypothesis, Score, analytic, hypotheses, screened
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model import prior_rows
from rw_ekf.likelihood.one_step import Record
from rw_ekf.likelihood.profile import LEAST_RATIO, torque_noise_term
from rw_ekf.model.effect import Candidate, Effect, RecordFacts
from rw_ekf.model.effect_kinds import StaticEffect

_RATIOS_BELOW = 6
_GROUP_RANK = 0.02  # of a unit regressor: less is what the model's own parameters do
_SIGNALS, _SIGNAL_STEPS = (0.3, 300.0), 16  # of random coefficients, of the regressor best seen, in sigmas of noise
_MOST_CONDITIONED = 1.0e10
_SEEN = 1.0e-4  # a regressor that the model's own explain to this share of its length says nothing


@dataclass(frozen=True)
class _Gain:
    """What a hypothesis would add, and the regression's coefficients in its units."""

    hypothesis: Hypothesis
    statistic: float
    coefficients: Float64Array
    std: Float64Array


@dataclass(frozen=True)
class GroupFit:
    """A regression on many regressors at once, beside all that the model has."""

    statistic: float  # twice the gain in log-likelihood
    freedom: int  # of the combinations that say something
    coefficients: Float64Array  # (m,) the smallest that give the same prediction beside the model's own
    covariance: Float64Array  # (m, m) of as much of them as the record decides


class Scorer:
    """Scores hypotheses beside a fit, at a few ratios of noises from the model's own downwards.

    Which ratio goes with which regressors is decided by the restricted likelihood (Patterson & Thompson 1971; eq. 6a):
    regressors that follow a wandering speed would otherwise make it look as if it wandered less, and gain by that.
    """

    def __init__(self, fit: Fit, beside: Float64Array | None = None) -> None:
        """beside: more regressors (n, m) that are free, as the model's own are."""
        linearised = self.linearised = fit.linearised
        variance = self.variance = fit.noise.variance
        self.ratios = _ratios(fit.noise.ratio)
        self.bases: list[Float64Array] = []
        self.residuals: list[Float64Array] = []
        self.rss: list[float] = []
        self.logs: list[float] = []
        self.restrictions: list[float] = []  # half the log-determinant of the model's own regressors
        for value in self.ratios:
            r, A, logs = linearised.whitened(value, variance, linearised.jacobian, linearised.memory_jacobian)
            self.places = linearised.innovation_at
            if beside is not None:
                A = np.concatenate((A, linearised.whitened(value, variance, beside)[1]), axis=1)
            Q = _basis(A, fit)
            self.restrictions.append(_restriction(A, fit))
            left = r - Q @ (Q.T @ r)
            self.bases.append(Q)
            self.residuals.append(left)
            self.rss.append(float(left @ left))
            self.logs.append(logs)
        self.count = self.residuals[0].size
        self.own = max(range(len(self.ratios)), key=lambda i: float(self._restricted(i, 0.0, 0, 0.0)))
        self.without = float(self._value(self.own, 0.0))

    def _left(self, i: int, gain: float | Float64Array) -> Float64Array:
        """Variance left at the i-th ratio after gains (any shape) in the sum of squares."""
        return np.asarray(np.maximum(self.rss[i] - gain, 1.0e-9) / self.count)

    def _value(self, i: int, gain: float | Float64Array) -> Float64Array:
        left = self._left(i, gain)
        known = torque_noise_term(self.linearised, left * self.variance, self.ratios[i])
        return np.asarray(known - 0.5 * (self.count * np.log(left) + self.logs[i]))

    def _restricted(
        self, i: int, gain: float | Float64Array, added: int, information: float | Float64Array
    ) -> Float64Array:
        """Restricted log-likelihoods (eq. 6a) of the model and `added` regressors, of the shape of `gain`.

        information: half the log-determinants of theirs, beside the model's own.
        """
        free = int(self.bases[i].shape[1]) + added
        known = 0.5 * free * np.log(self._left(i, gain)) - self.restrictions[i]
        return np.asarray(self._value(i, gain) + known - information)

    def _gains(self, group: list[Hypothesis]) -> list[_Gain]:
        """What hypotheses that came in one chunk would add; those that the model follows already are left out."""
        regressors = np.concatenate([h.regressors for h in group], axis=1)
        first = np.cumsum([0, *(h.regressors.shape[1] for h in group)])
        alike = [
            (numbers, first[numbers][:, None] + np.arange(size))  # and the columns of each, (g, size)
            for size in (1, 2)
            if (numbers := np.flatnonzero(np.diff(first) == size)).size
        ]
        best: list[_Gain | None] = [None] * len(group)
        merits = np.full(len(group), -math.inf)
        for i, ratio in enumerate(self.ratios):
            _, A, _ = self.linearised.whitened(ratio, self.variance, regressors)
            Q, left = self.bases[i], self.residuals[i]
            shadow = Q.T @ A  # what the model's own regressors have of them
            taken = 2.0 * shadow - (Q.T @ Q) @ shadow  # Q is not quite orthonormal: the rows of the prior are cut off
            products = A.T @ left - shadow.T @ (Q.T @ left)
            for numbers, columns in alike:
                gram = _grams(A, shadow, taken, columns)
                for number, gain, merit in self._regressed(i, [group[g] for g in numbers], gram, products[columns]):
                    g = numbers[number]
                    if merit > merits[g]:
                        best[g], merits[g] = gain, merit
        return [found for found in best if found is not None]

    def _regressed(
        self, i: int, group: list[Hypothesis], gram: Float64Array, products: Float64Array
    ) -> list[tuple[int, _Gain, float]]:
        """Hypotheses by their places in the group, with what each adds at the i-th ratio and its merit there.

        gram (g, k, k), products (g, k): those of their regressors beside the model's own.
        """
        kept = np.flatnonzero(np.linalg.cond(gram) <= _MOST_CONDITIONED)
        inverse = np.linalg.inv(gram[kept])
        solutions = np.einsum("gab,gb->ga", inverse, products[kept])
        gains = np.einsum("ga,ga->g", products[kept], solutions)
        values = self._value(i, gains)
        merits = self._restricted(i, gains, gram.shape[1], 0.5 * np.linalg.slogdet(gram[kept])[1])
        stds = np.sqrt(self._left(i, gains)[:, None] * np.diagonal(inverse, axis1=1, axis2=2))
        return [
            (int(g), _Gain(group[g], 2.0 * (float(value) - self.without), solution, std), float(merit))
            for g, value, merit, solution, std in zip(kept, values, merits, solutions, stds, strict=True)
            if group[g].effect.admits(float(solution[0]) * group[g].unit)
        ]

    def fit_group(self, regressors: Float64Array) -> GroupFit:
        """Many regressors (n, m) taken together, those without content left out."""
        independent, mixing = self._independent(regressors)
        count = regressors.shape[1]
        if independent.shape[1] == 0:
            return GroupFit(0.0, 0, np.zeros(count), np.zeros((count, count)))
        best_merit, statistic = -math.inf, 0.0
        solution, covariance = np.zeros(independent.shape[1]), np.zeros((independent.shape[1],) * 2)
        for i in range(len(self.ratios)):
            G = self._beside_own(i, independent)
            U, sizes, Vt = np.linalg.svd(G, full_matrices=False)
            along = U.T @ self.residuals[i]
            gain = float(np.sum(along**2))
            value = float(self._value(i, gain))
            merit = float(self._restricted(i, gain, sizes.size, float(np.sum(np.log(np.maximum(sizes, 1.0e-300))))))
            if merit > best_merit:
                best_merit, statistic = merit, 2.0 * (value - self.without)
                back = Vt.T / np.maximum(sizes, 1.0e-300)
                solution = back @ along
                covariance = max(self.rss[i] - gain, 1.0e-9) / self.count * (back @ back.T)
        return GroupFit(statistic, independent.shape[1], mixing @ solution, mixing @ covariance @ mixing.T)

    def statistics_alone(
        self, regressors: Float64Array, speed_draws: Float64Array, memory_draws: Float64Array
    ) -> Float64Array:
        """Statistics (k,) that `fit_group` would give to regressors (n, m) in k records of noise alone.

        speed_draws (n, k), memory_draws: increments that the noises make.
        """
        independent, _ = self._independent(regressors)
        shape = (len(self.ratios), speed_draws.shape[1])
        nothing, without, merits, values = (np.full(shape, -math.inf) for _ in range(4))
        for i, ratio in enumerate(self.ratios):
            draws = self.linearised.whitened(ratio, self.variance, speed_draws, memory_draws)[1]
            left = draws - self.bases[i] @ (self.bases[i].T @ draws)
            U, sizes, _ = np.linalg.svd(self._beside_own(i, independent), full_matrices=False)
            lost = self.rss[i] - np.sum(left**2, axis=0)  # as if this record's sum of squares had gained so much
            gains = lost + np.sum((U.T @ left) ** 2, axis=0)
            nothing[i], without[i] = self._restricted(i, lost, 0, 0.0), self._value(i, lost)
            information = float(np.sum(np.log(np.maximum(sizes, 1.0e-300))))
            merits[i], values[i] = self._restricted(i, gains, sizes.size, information), self._value(i, gains)
        every = np.arange(shape[1])
        found: Float64Array = values[np.argmax(merits, axis=0), every] - without[np.argmax(nothing, axis=0), every]
        return 2.0 * found

    def score_random(self, regressors: Float64Array) -> tuple[float, float]:
        """Statistic of regressors (n, m) whose coefficients are drawn from one normal distribution, and its deviation.

        The coefficients are integrated out, so that their number costs nothing: one number more is fitted, which the
        model without them has at the edge of what it may be. Restricted likelihoods on either side.
        """
        best = nothing = float(self._restricted(self.own, 0.0, 0, 0.0))
        deviation = 0.0
        for i in range(len(self.ratios)):
            U, sizes, _ = np.linalg.svd(self._beside_own(i, regressors), full_matrices=False)
            powers = (U.T @ self.residuals[i]) ** 2
            for signal in np.geomspace(*_SIGNALS, _SIGNAL_STEPS) / max(float(sizes[0]), 1.0e-300):
                x = (signal * sizes) ** 2
                gain = float(np.sum(powers * x / (1.0 + x)))
                merit = float(self._restricted(i, gain, 0, 0.5 * float(np.sum(np.log1p(x)))))
                if merit > best:
                    best, deviation = merit, float(signal) * math.sqrt((self.rss[i] - gain) / self.count)
        return 2.0 * (best - nothing), deviation

    def _beside_own(self, i: int, regressors: Float64Array) -> Float64Array:
        """Columns whitened at the i-th ratio, the model's own projected out."""
        _, A, _ = self.linearised.whitened(self.ratios[i], self.variance, regressors)
        Q = self.bases[i]
        return A - Q @ (Q.T @ A)

    def _independent(self, regressors: Float64Array) -> tuple[Float64Array, Float64Array]:
        """Combinations of regressors (n, m) that say something, of unit length at the model's own ratio.

        With the matrix (m, r) that makes r of them of the regressors; what the model itself follows is in none of them.
        """
        _, A, _ = self.linearised.whitened(self.ratios[self.own], self.variance, regressors)
        lengths = np.linalg.norm(A, axis=0)
        seen = lengths > 0.0
        scaled = regressors[:, seen] / lengths[seen]
        _, sizes, Vt = np.linalg.svd(self._beside_own(self.own, scaled), full_matrices=False)
        combined = Vt[sizes > _GROUP_RANK].T
        mixing = np.zeros((regressors.shape[1], combined.shape[1]))
        mixing[seen] = combined / lengths[seen, None]
        return np.ascontiguousarray(scaled @ combined), mixing

    def best_of_each(self, facts: RecordFacts, effects: list[type[Effect]]) -> dict[str, Score]:
        """The best place of each effect, by id; its evidence is averaged over all of them."""
        places, among = [], {}
        for effect in effects:
            found = effect.candidates(facts) if effect.in_state else []
            among[effect.id] = len(found)
            places += [(effect, c) for c in (self._screened(found) if effect.clocked else found)]
        return self._best(facts, places, among)

    def best_at(self, facts: RecordFacts, places: list[tuple[type[Effect], Candidate]]) -> dict[str, Score]:
        """The best of the places given for each effect, by id."""
        return self._best(facts, places, {})

    def all_at(self, facts: RecordFacts, places: list[tuple[type[Effect], Candidate]]) -> list[Score]:
        """All of the places given, the strongest first; those left out that the model itself follows."""
        gains = [gain for group in hypotheses(self.linearised, places) for gain in self._gains(group)]
        gains.sort(key=lambda gain: -gain.statistic)
        return [
            gain.hypothesis.scored(
                gain.statistic,
                gain.hypothesis.evidence(gain.statistic, gain.std, facts),
                gain.coefficients,
                gain.std,
                facts,
            )
            for gain in gains
        ]

    def _best(
        self, facts: RecordFacts, places: list[tuple[type[Effect], Candidate]], among: dict[str, int]
    ) -> dict[str, Score]:
        """among: how many places of each effect there are, of which those left out are worth nothing; else those."""
        found: dict[str, list[_Gain]] = {}
        for group in hypotheses(self.linearised, places):
            for gain in self._gains(group):
                found.setdefault(gain.hypothesis.effect.id, []).append(gain)
        scores = {}
        for name, gains in found.items():
            evidences = np.array([gain.hypothesis.evidence(gain.statistic, gain.std, facts) for gain in gains])
            evidence = float(np.logaddexp.reduce(evidences)) - math.log(among.get(name, len(gains)))
            best = max(gains, key=lambda gain: gain.statistic)
            scores[name] = best.hypothesis.scored(best.statistic, evidence, best.coefficients, best.std, facts)
        return scores

    def _screened(self, candidates: list[Candidate]) -> list[Candidate]:
        """The frequencies worth a score, by what is left at the model's own ratio's neighbours."""
        left = []
        for i in (0, len(self.ratios) - 1):
            white = np.zeros(self.linearised.chain.reading.size)
            white[self.places] = self.residuals[i]
            left.append((self.ratios[i], white))
        return screened(candidates, self.linearised, left, self.variance)


def _grams(A: Float64Array, shadow: Float64Array, taken: Float64Array, columns: NDArray[np.intp]) -> Float64Array:
    """Gram matrices (g, k, k) of the columns (g, k) of A beside the model's own; 0 where those have them whole.

    shadow, taken (p, m): with G = A - Q Q'A, G'G = A'A - shadow' taken, and G (n, m) need not be made.
    """
    whole = np.einsum("ij,ij->j", A, A)[columns]
    gram = np.empty((*columns.shape, columns.shape[1]))
    for a, left in enumerate(columns.T):
        for b, right in enumerate(columns.T):
            product = whole[:, a] if a == b else np.einsum("ij,ij->j", A[:, left], A[:, right])
            gram[:, a, b] = product - np.einsum("ij,ij->j", shadow[:, left], taken[:, right])
    gram[np.any(np.diagonal(gram, axis1=1, axis2=2) <= _SEEN**2 * whole, axis=1)] = 0.0
    return gram


def _restriction(A: Float64Array, fit: Fit) -> float:
    """Half the log-determinant of the information on the model's own vector."""
    normal = A.T @ A
    pull = _parameter_rows(fit, A.shape[1])
    normal += pull.T @ pull
    scale = np.sqrt(np.maximum(np.diag(normal), 1.0e-300))
    return float(0.5 * np.linalg.slogdet(normal / np.outer(scale, scale) + 1.0e-12 * np.eye(scale.size))[1]
                 + np.sum(np.log(scale)))  # fmt: skip


def _ratios(ratio: float) -> list[float]:
    """The model's own ratio, one above, and several below down to hardly any process noise."""
    low = math.log(LEAST_RATIO)
    top = max(math.log(ratio), low)
    steps = np.linspace(low, top, _RATIOS_BELOW + 1) if top > low + 1.0 else np.array([low, top])
    return [math.exp(v) for v in sorted({*steps.tolist(), top + 1.0})]


def _basis(A: Float64Array, fit: Fit) -> Float64Array:
    """Orthonormal basis (n, p) of the span of A, the a priori of the parameters counted as rows, then cut off."""
    weights = np.linalg.norm(A, axis=0)
    weights[weights == 0.0] = 1.0
    pull = _parameter_rows(fit, A.shape[1])
    U, sizes, _ = np.linalg.svd(np.vstack((A, pull)) / weights, full_matrices=False)
    return np.asarray(U[: A.shape[0], sizes > 1.0e-8 * sizes[0]])


def _parameter_rows(fit: Fit, count: int) -> Float64Array:
    """What is known of the four parameters beforehand, as rows of unit variance over all that is free, (4, count)."""
    known = np.zeros((0, 0)) if fit.prior is None else prior_rows(fit.prior.core, fit.model)[0]
    rows = np.zeros((known.shape[0], count))
    rows[:, : known.shape[1]] = known
    return rows


def information(fit: Fit, part: Record, facts: RecordFacts) -> dict[str, float]:
    """How much a part of a record can say of each simple linear effect: its squared length beside the model's own.

    No residual enters: this is about excitation alone.
    """
    places: list[tuple[type[Effect], Candidate]] = [
        (effect, effect.candidates(facts)[0])
        for effect in CATALOGUE.values()
        if issubclass(effect, StaticEffect)
        and effect.linear
        and effect.components == 1
        and not effect.local_in_time
        and effect.untestable(facts) is None
    ]
    if not places:
        return {}
    chain = fit.linearised.chain._replace(follows=part.follows)
    linearised = replace(fit.linearised, record=part, chain=chain)
    group = analytic(linearised, places)
    regressors = np.concatenate([h.regressors for h in group], axis=1)
    variance = fit.noise.variance
    _, A, _ = linearised.whitened(LEAST_RATIO, variance, regressors)
    _, own, _ = linearised.whitened(LEAST_RATIO, variance, linearised.jacobian, linearised.memory_jacobian)
    Q = _basis(own, fit)
    lengths = np.einsum("ij,ij->j", A - Q @ (Q.T @ A), A)
    return {h.effect.id: float(length) for h, length in zip(group, lengths, strict=True)}
