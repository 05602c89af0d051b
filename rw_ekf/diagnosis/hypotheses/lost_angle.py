"""Ripples where no angle is logged: their orders compared with every path of the phase integrated out.

Along an angle that was integrated from speeds a ripple of order n loses its phase n times as fast as the angle is lost,
so that a regression on its sine and cosine misses high orders, or takes them for lower ones.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from rw_ekf.diagnosis.hypotheses.candidates import Hypothesis, Score, analytic, p_value
from rw_ekf.diagnosis.thresholds import INFLATION, ORDERS_COUNT
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.phase_particles import FEW, MANY, LostAngle
from rw_ekf.model.effect import RecordFacts, Term

_SIZES = (1.5, 60.0)  # of the smallest that matters
_WORTH_MORE = 2.0  # gain in log-likelihood at a first look
_FITTED, _NEAR = 5, 6.0  # orders that are fitted in full: so many, within this of the best
_LEAST_REPORTED = 0.02  # probability of an order that is reported


@dataclass(frozen=True)
class FollowedOrder:
    """One order, followed by particles: the log-likelihood it gains, and its amplitude with standard deviation."""

    gain: float
    size: float
    size_std: float
    hypothesis: Hypothesis

    @property
    def term(self) -> Term:
        """Where a fit begins."""
        return replace(Term.at(self.hypothesis.effect, self.hypothesis.candidate), values=(self.size, 0.0))


def applies(fit: Fit) -> bool:
    """Whether the angle is integrated and not yet followed, in a model without a memory.

    Not where rounded readings share errors: particles take each reading for one by itself.
    """
    record = fit.linearised.record
    return record.angle_is_integrated and record.levels is None and fit.linearised.memory_jacobian.shape[0] == 0


def followed_orders(fit: Fit, places: list[Hypothesis], facts: RecordFacts) -> list[FollowedOrder]:
    """All orders, the most evident first; none where a first look at them sees nothing."""
    lost, low = LostAngle(fit.linearised, fit.noise), places[0].effect.smallest(facts)
    sizes = _SIZES[0] * low, _SIZES[1] * low

    def ranked(particles: int) -> list[FollowedOrder]:
        found = [(lost.followed(h.regressors, h.candidate.shape[0], sizes, particles), h) for h in places]
        return sorted(
            (FollowedOrder(item.gain, item.size, item.size_std, h) for item, h in found), key=lambda item: -item.gain
        )

    return ranked(MANY) if ranked(FEW)[0].gain > _WORTH_MORE else []


def scored_on_lost_angle(fit: Fit, places: list[Hypothesis], facts: RecordFacts) -> Score | None:
    """The best order, and those near it as starts; None where particles do not apply, or see nothing."""
    found = followed_orders(fit, places, facts) if applies(fit) else []
    if not found:
        return None
    best = found[0]
    overall = float(np.logaddexp.reduce([item.gain / INFLATION for item in found])) - math.log(len(places))
    return Score(
        effect=best.hypothesis.effect,
        candidate=best.hypothesis.candidate,
        statistic=2.0 * best.gain,
        p_value=p_value(best.hypothesis.effect, 2.0 * best.gain, facts),
        screening_gain=overall,
        size=best.size,
        std=best.size / math.sqrt(max(2.0 * best.gain, 1.0)),
        starts=tuple(item.term for item in _worth_a_fit(found)),
    )


def _worth_a_fit(found: list[FollowedOrder]) -> Iterable[FollowedOrder]:
    return [item for item in found[:_FITTED] if item.gain > found[0].gain - _NEAR]


def with_open_order(less: Fit, fit: Fit, name: str, facts: RecordFacts) -> tuple[Fit, dict[float, float]]:
    """A fit with one ripple on an integrated angle, and how probable each order is: {} where that is no question.

    less: without it. The amplitude's variance becomes that about the value given, over all orders: another order has
    another amplitude. A fit may miss an order's best valley, and particles know the model's other parameters only
    as they are without the ripple, so that the kinder of the two counts for an order, and half of it.
    """
    own = fit.terms_of(name)
    if len(own) != 1 or not applies(less):
        return fit, {}
    effect = CATALOGUE[name]
    places = analytic(less.linearised, [(effect, candidate) for candidate in effect.candidates(facts)])
    found = followed_orders(less, places, facts)
    order = own[0].term.shape[0]
    size, std = effect.amplitude(own[0].term.values, own[0].covariance)
    standing = {item.term.shape[0]: (item.gain - found[0].gain, item.size, item.size_std) for item in found}
    fits = {item.term.shape[0]: less.refitted(less.model.with_terms(item.term)) for item in _worth_a_fit(found)}
    for other, tried in (fits | {order: fit}).items():
        term = tried.terms_of(name)[0]
        behind = tried.likelihood.value - fit.likelihood.value
        if other not in standing or behind >= standing[other][0]:
            standing[other] = behind, *effect.amplitude(term.term.values, term.covariance)
    odds = {other: math.exp(ORDERS_COUNT * min(behind, 0.0)) for other, (behind, _, _) in standing.items()}
    total = sum(odds.values())
    probabilities = {other: odd / total for other, odd in sorted(odds.items(), key=lambda item: -item[1])}
    others = [(probabilities[other], its, its_std) for other, (_, its, its_std) in standing.items()]
    at = fit.model.placed_of(name)[0][1]
    return fit.widened_over(at, (size, std), others), {
        other: p for other, p in probabilities.items() if p > _LEAST_REPORTED
    }
