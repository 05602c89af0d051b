"""Laws that have no formula: where they may be, how likely the smoothest of each is, and the law itself as a term.

A law is a function of one quantity under a Gaussian-process prior (Matern 5/2; Rasmussen & Williams 2006, eq. 4.17),
what the four parameters follow taken out. Its size and smoothness are those of the highest marginal likelihood, so that
it pays for its freedom and is flat where the record says nothing (docs/likelihood.md, "Laws without a formula").
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.hypotheses.changes import likeliest_change, likeliest_spell
from rw_ekf.diagnosis.hypotheses.confounding import one_and_the_same
from rw_ekf.diagnosis.hypotheses.impulse import likeliest_impulse
from rw_ekf.diagnosis.hypotheses.joint_regressors import evidence_of_drawn
from rw_ekf.diagnosis.hypotheses.law_grounds import BOTH_SIDES, Ground, Nameless, grounds
from rw_ekf.diagnosis.hypotheses.noise_ratios import Profiled
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.thresholds import CHOSEN_LOG, INDISTINGUISHABLE
from rw_ekf.effects.catalogue import LEARNED, SPELL
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.structure import hats
from rw_ekf.model.effect import RecordFacts, Term
from rw_ekf.model.law import OF_SPEED, TURN, Law

Smooth = tuple[float, float]  # over how much of a range a law bends; as log(1 + x/that share of the range), or 0

_HATS = 25  # with which a quantity is screened
_KNOTS = 66  # of a law that is fitted; even, so that none is at zero speed, where a law may jump
_SPEED_KNOTS = 132  # most friction changes most at low speeds
_TURN_KNOTS = 385
_SMOOTH: tuple[Smooth, ...] = ((1.0, 0.0), (0.5, 0.0), (0.25, 0.0), (0.12, 0.0))
_SMOOTH_OVER_SPEED: tuple[Smooth, ...] = (*_SMOOTH, (1.0, 0.05), (0.5, 0.05), (0.25, 0.05))
_ORDERS = (2, 4, 8, 16)  # harmonics of the angle
_LEAST_SHARE = 1.0e-6  # of a law's greatest variance: curves with less are left out
_MOST_CURVES = 14


def laws_beside(prepared: Prepared, fit: Fit) -> list[Nameless]:
    """`likeliest_laws` beside a fit of a whole record, worked out once."""
    return prepared.remembered("laws", fit, lambda: likeliest_laws(fit, prepared.facts, prepared.source.columns))


def likeliest_laws(fit: Fit, facts: RecordFacts, columns: Sequence[str] = ()) -> list[Nameless]:
    """The likeliest law of each ground beside a fitted model, the likeliest first."""
    profiled = Profiled(fit)
    taken = {term.law.number for term in fit.model.terms if term.law is not None}
    # Else a law of the speed, which holds at any time, goes first.
    found, has_a_clock = [], not one_and_the_same(fit, "time", "speed")
    wanted = [*grounds(fit, facts, columns)]
    # Where it turns one way no torque is sought: a torque is a drag.
    torques = any(ground.quantity == "time" and ground.acts_as == "torque" for ground in wanted)
    for ground in wanted:
        if ground.quantity == "time":
            spell = likeliest_spell(profiled, ground, facts)
            found += [] if spell is None else [spell]
            is_drag = ground.acts_as == "drag"  # that goes with time otherwise is the catalogue's drift
            if not (is_drag and torques):
                found.append(likeliest_change(profiled, ground, facts))
            if is_drag or not has_a_clock:
                continue
        law = _angle_law(profiled, ground) if ground.turned is not None else _smooth_law(profiled, ground)
        if law is not None and law.term.law is not None and law.term.law.number not in taken:
            found.append(law)
    return sorted(_briefest(profiled, wanted, _of_either_direction(found)), key=lambda item: -item.weight)


def _of_either_direction(found: list[Nameless]) -> list[Nameless]:
    """The same with one motor gain over speed: by its size, unless that by the signed speed is clearly likelier.

    Each direction then has a law of its own, which is chosen once more; and few of the likeliest laws are tried.
    """
    gains = {item.ground.quantity: item for item in found if item.ground.acts_as == "motor_gain"}
    if "speed" not in gains or "speed_size" not in gains:
        return found
    differs = gains["speed"].weight > gains["speed_size"].weight + CHOSEN_LOG + INDISTINGUISHABLE
    left_out = gains["speed_size" if differs else "speed"]
    return [item for item in found if item is not left_out]


def _briefest(profiled: Profiled, wanted: Sequence[Ground], found: list[Nameless]) -> list[Nameless]:
    """The same with an impulse in the place of spells about it that are not clearly likelier: other words for it."""
    spell = max((item for item in found if item.term.effect is SPELL), key=lambda item: item.weight, default=None)
    impulse = None if spell is None else likeliest_impulse(profiled, wanted, *spell.times_s)
    if impulse is None:
        return found
    begins_s, ends_s = impulse.times_s

    def is_it(item: Nameless) -> bool:
        return item.term.effect is SPELL and item.times_s[0] < ends_s and item.times_s[1] > begins_s

    least = impulse.weight + INDISTINGUISHABLE
    return [impulse, *(item for item in found if not is_it(item) or item.weight > least)]


def _smooth_law(profiled: Profiled, ground: Ground) -> Nameless | None:
    """The likeliest smooth law of a ground, over all smoothnesses."""
    low, high = ground.range
    columns = ground.slope[:, None] * hats(ground.at, _HATS, low, high)
    of_speed = ground.quantity in OF_SPEED
    smooths = _SMOOTH_OVER_SPEED if of_speed else _SMOOTH
    count = _SPEED_KNOTS if of_speed else _KNOTS
    count += ground.quantity == "current_along_motion"  # which is nothing at zero, and may bend there
    places, knots = np.linspace(low, high, _HATS), np.linspace(low, high, count)
    roots = [_root(_unfollowed(_covariance(ground, places, smooth), ground, places)) for smooth in smooths]
    if not all(root.size for root in roots):
        return None
    number, deviation, factor = _likeliest(profiled, columns, roots)
    functions, stds = _curves(_unfollowed(_covariance(ground, knots, smooths[number]), ground, knots))
    return Nameless(ground, factor, _term(ground.law(low, high, functions, deviation * stds)))


def _angle_law(profiled: Profiled, ground: Ground) -> Nameless:
    """The likeliest law of the angle, over how many harmonics it has."""
    assert ground.turned is not None
    most = max(_ORDERS)
    orders = np.arange(1, most + 1)
    averaged = np.sinc(np.outer(ground.turned, orders) / TURN)  # sin(n turned/2) / (n turned/2)
    phases = np.outer(ground.at + 0.5 * ground.turned, orders)
    columns = ground.slope[:, None] * np.concatenate((averaged * np.sin(phases), averaged * np.cos(phases)), axis=1)
    each = np.eye(2 * most)
    roots = [np.concatenate((each[:, :count], each[:, most : most + count]), axis=1) for count in _ORDERS]
    number, deviation, factor = _likeliest(profiled, columns, roots)
    count = _ORDERS[number]
    waves = np.outer(np.arange(1, count + 1), np.linspace(0.0, TURN, _TURN_KNOTS))
    functions = np.concatenate((np.sin(waves), np.cos(waves)))
    return Nameless(ground, factor, _term(ground.law(0.0, TURN, functions, np.full(2 * count, deviation))))


def _likeliest(profiled: Profiled, columns: Float64Array, roots: Sequence[Float64Array]) -> tuple[int, float, float]:
    """Which prior of coefficients of columns (n, m) is likeliest, with what deviation; and log of all their factors.

    roots: R (m, r) of each, whose covariance is R R' times the square of the deviation.
    """
    sums = [profiled.sums(i, columns) for i in range(len(profiled.ratios))]
    found = [
        evidence_of_drawn(profiled, [(root.T @ one.gram @ root, root.T @ one.products) for one in sums])
        for root in roots
    ]
    factors = np.array([factor for factor, _ in found])
    number = int(np.argmax(factors))
    return number, found[number][1], float(np.logaddexp.reduce(factors)) - math.log(len(roots))


def _term(law: Law) -> Term:
    nothing = (0.0,) * len(law.functions)
    return Term(LEARNED, nothing, nothing, law=law)


def _covariance(ground: Ground, places: Float64Array, smooth: Smooth) -> Float64Array:
    """Matern 5/2 of unit variance. Either side of zero is its own; of a current both begin with nothing there."""
    share, knee = smooth
    sides = np.sign(places)
    if knee:
        places = sides * np.log1p(np.abs(places) / (knee * float(np.max(np.abs(places)))))
    length = share * float(np.ptp(np.abs(places) if ground.quantity in BOTH_SIDES else places))

    def alike(apart: Float64Array) -> Float64Array:
        scaled = math.sqrt(5.0) * np.abs(apart) / length
        return np.asarray((1.0 + scaled + scaled**2 / 3.0) * np.exp(-scaled))

    found = alike(places[:, None] - places)
    if ground.quantity not in BOTH_SIDES:
        return found
    if ground.quantity == "current_along_motion":
        found = found - np.outer(alike(places), alike(places))
    return np.where(sides[:, None] == sides, found, 0.0)


def _unfollowed(covariance: Float64Array, ground: Ground, places: Float64Array) -> Float64Array:
    """A covariance over places (k, k) without what the four parameters follow, weighed by where the record was."""
    if not ground.followed:
        return covariance
    edges = np.concatenate(([-np.inf], 0.5 * (places[1:] + places[:-1]), [np.inf]))
    weights = np.histogram(ground.at, edges)[0] + 1.0e-3 * ground.at.size / places.size
    if ground.quantity in BOTH_SIDES:  # what is even has no odd part then
        weights = weights + weights[::-1]
    sizes = np.abs(places) if ground.quantity == "speed" else places  # Coulomb and viscous friction; a motor gain
    F = np.column_stack([(sizes / max(float(np.max(np.abs(sizes))), 1.0e-300)) ** power for power in ground.followed])
    free = np.eye(places.size) - F @ np.linalg.solve(F.T @ (weights[:, None] * F), F.T * weights)
    return free @ covariance @ free.T


def _root(covariance: Float64Array) -> Float64Array:
    """R (k, r) with R R' the covariance, but for what is next to nothing of it."""
    sizes, curves = np.linalg.eigh(covariance)
    kept = sizes > 1.0e-6 * sizes[-1]
    return np.asarray(curves[:, kept] * np.sqrt(sizes[kept]))


def _curves(covariance: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Independent functions (m, k) of unit mean square, and their deviations (m,), the greatest first."""
    sizes, curves = np.linalg.eigh(covariance)
    order = np.argsort(-sizes)[:_MOST_CURVES]
    order = order[sizes[order] > _LEAST_SHARE * sizes[order[0]]]
    count = covariance.shape[0]
    return math.sqrt(count) * curves[:, order].T, np.sqrt(sizes[order] / count)
