"""What each hypothesis would add to the likelihood of a fitted model (docs/likelihood.md, "Evidence").

Nothing is refitted: a candidate's gain is that of a linear regression, joint with the corrections of everything already
in the model, at each of a few ratios of noises.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.hypotheses.candidates import Hypothesis, Score, hypotheses, screened
from rw_ekf.diagnosis.hypotheses.lost_angle import scored_on_lost_angle
from rw_ekf.diagnosis.hypotheses.noise_ratios import Profiled
from rw_ekf.model.effect import Candidate, Effect, RecordFacts

_MOST_CONDITIONED = 1.0e10
_SEEN = 1.0e-4  # a regressor that the model's own explain to this share of its length says nothing


@dataclass(eq=False, frozen=True)
class _Gain:
    """What a hypothesis would add, and the regression's coefficients in its units."""

    hypothesis: Hypothesis
    statistic: float
    coefficients: Float64Array
    std: Float64Array


class Scorer(Profiled):
    """Scores hypotheses beside a fit, each by itself."""

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
            shadow, taken, products = self.seen_by_own(i, A)
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
        values = self.value(i, gains)
        merits = self.restricted(i, gains, gram.shape[1], 0.5 * np.linalg.slogdet(gram[kept])[1])
        stds = np.sqrt(self.left(i, gains)[:, None] * np.diagonal(inverse, axis1=1, axis2=2))
        return [
            (int(g), _Gain(group[g], 2.0 * (float(value) - self.without), solution, std), float(merit))
            for g, value, merit, solution, std in zip(kept, values, merits, solutions, stds, strict=True)
            if group[g].effect.admits(float(solution[0]) * group[g].unit)
        ]

    def best_of_each(self, facts: RecordFacts, effects: list[type[Effect]]) -> dict[str, Score]:
        """The best place of each effect, by id; its screening gain is averaged over all of them."""
        places, among = [], {}
        for effect in effects:
            found = effect.candidates(self.linearised.model.seen_by(effect, facts)) if effect.in_state else []
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
                gain.hypothesis.screening_gain(gain.statistic, gain.std, facts),
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
            screened = np.array([gain.hypothesis.screening_gain(gain.statistic, gain.std, facts) for gain in gains])
            overall = float(np.logaddexp.reduce(screened)) - math.log(among.get(name, len(gains)))
            best = max(gains, key=lambda gain: gain.statistic)
            scores[name] = best.hypothesis.scored(best.statistic, overall, best.coefficients, best.std, facts)
            if best.hypothesis.effect.angular:
                lost = scored_on_lost_angle(self.fit, [gain.hypothesis for gain in gains], facts)
                if lost is not None and lost.screening_gain > overall:
                    scores[name] = lost
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

    The columns of one stand side by side. shadow, taken (p, m): with G = A - Q Q'A, G'G = A'A - shadow' taken, and
    G (n, m) need not be made.
    """
    size = columns.shape[1]
    # Of neighbours so far apart, all at once: columns that are picked would be copied, one by one.
    products = [np.einsum("ij,ij->j", A[:, : A.shape[1] - apart], A[:, apart:]) for apart in range(size)]
    whole = products[0][columns]
    gram = np.empty((*columns.shape, size))
    for a in range(size):
        for b in range(a, size):
            left, right = columns[:, a], columns[:, b]
            both = products[b - a][left] - np.einsum("ij,ij->j", shadow[:, left], taken[:, right])
            gram[:, a, b] = gram[:, b, a] = both
    gram[np.any(np.diagonal(gram, axis1=1, axis2=2) <= _SEEN**2 * whole, axis=1)] = 0.0
    return gram
