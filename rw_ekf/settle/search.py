"""The search for the motion: many drawn at random, the best of them changed a little again and again."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.model.state import FrictionParameters
from rw_ekf.settle.motion_limits import MotionLimits
from rw_ekf.settle.named_moves import Bounds, Move, currents, draw_move
from rw_ekf.settle.predicted import Scene, divergences

LOOKED_AT = 240  # motions, those of `_usual` among them
_DRAWN_SHARE = 0.4
_KEPT = 8  # of those drawn, and from turn to turn
_ENOUGH = 16.0  # of a divergence: odds of 3000 to 1, evidence being halved; more is worth little
_REPORTED_APART = 1.0  # of a divergence: a pair with less under the best motion is one and the same to it
_EVENTUALLY = 0.02  # weight of what a motion is worth beyond that, so that there is always a better one


@dataclass(eq=False, frozen=True)
class Design:
    """A motion and what it is expected to show."""

    moves: tuple[Move, ...]
    current_A: Float64Array  # (ticks,)
    divergence: Float64Array  # (k, k, checks) by which explanation i, if it is true, gains over j
    alike: BoolArray  # (k, k) which no motion that was looked at distinguishes

    @property
    def pairs(self) -> Float64Array:
        """Mean of both ways, (k, k, checks)."""
        return 0.5 * (self.divergence + self.divergence.transpose(1, 0, 2))

    @property
    def merit(self) -> float:
        """The smallest divergence of a pair that can be distinguished, early rather than late (eq. 4)."""
        if self.alike.all():
            return 0.0
        least = self.pairs[~self.alike].min(axis=0)
        return float(np.mean(np.minimum(least, _ENOUGH)) + _EVENTUALLY * math.log1p(float(least[-1])))


def design_motion(
    scene: Scene,
    base: FrictionParameters,
    bounds: Bounds,
    limits: MotionLimits,
    seed: int,
    advance: Callable[[], object] = lambda: None,
    *,
    looked_at: int = LOOKED_AT,
) -> Design | None:
    """The best of so many motions; None where none of them keeps the limits. base: what moves are made with."""
    draws, alike = np.random.default_rng(seed), np.eye(len(scene.standing.explanations), dtype=bool)

    def look(moves: tuple[Move, ...]) -> Design | None:
        advance()
        return _looked_at(moves, scene, base, bounds, limits, alike)

    usual = _usual(base, bounds)
    drawn = max(round(_DRAWN_SHARE * looked_at) - len(usual), 1)
    starts = [*usual, *(_drawn(draws, base, bounds) for _ in range(drawn))]
    seen = list(filter(None, map(look, starts)))
    if not seen:
        return None
    alike = _alike(np.stack([item.pairs[:, :, -1] for item in seen]).max(axis=0))
    found = sorted((replace(item, alike=alike) for item in seen), key=lambda item: -item.merit)[:_KEPT]
    for turn in range(looked_at - len(starts)):
        parent = found[min(int(draws.exponential(2.0)), len(found) - 1)]
        other = found[int(draws.integers(len(found)))]
        child = look(_changed(draws, parent.moves, other.moves, base, bounds, 0.5 * 0.99**turn))
        if child is not None:
            found = sorted([*found, child], key=lambda item: -item.merit)[:_KEPT]
    return found[0]


def _alike(most: Float64Array) -> BoolArray:
    """Which explanations no motion distinguishes, (k, k), from the largest divergence of each pair."""
    alike = most < _REPORTED_APART
    for _ in range(alike.shape[0]):
        alike = alike | (alike.astype(int) @ alike.astype(int) > 0)
    return alike


def _looked_at(
    moves: tuple[Move, ...],
    scene: Scene,
    base: FrictionParameters,
    bounds: Bounds,
    limits: MotionLimits,
    alike: BoolArray,
) -> Design | None:
    """What a motion would show; None where it does not keep the limits."""
    current = currents(moves, base, bounds)
    explanations = scene.standing.explanations
    if not limits.kept(scene, current):
        return None
    k, checks = len(explanations), bounds.ticks // scene.checks
    found = np.zeros((k, k, checks))
    for i, truth in enumerate(explanations):
        others = [j for j in range(k) if j != i]
        found[i, others] = divergences(truth, [explanations[j] for j in others], scene, current)
    return Design(moves, current, found, alike)


def _drawn(draws: np.random.Generator, base: FrictionParameters, bounds: Bounds) -> tuple[Move, ...]:
    """Moves at random until the time is full."""
    moves: list[Move] = []
    while sum(move.seconds for move in moves) < bounds.seconds:
        moves.append(draw_move(draws, base, bounds))
    return tuple(moves)


def _changed(
    draws: np.random.Generator,
    moves: tuple[Move, ...],
    other: tuple[Move, ...],
    base: FrictionParameters,
    bounds: Bounds,
    width: float,
) -> tuple[Move, ...]:
    """The same motion with a move or two otherwise, left out, put in, taken from another, or in another place."""
    found = list(moves)
    for _ in range(1 + int(draws.integers(3))):
        at, way = int(draws.integers(len(found))), draws.random()
        if way < 0.45:
            found[at] = _moved(draws, found[at], width, bounds)
        elif way < 0.6:
            found[at] = draw_move(draws, base, bounds)
        elif way < 0.7:
            found.insert(at, other[int(draws.integers(len(other)))])
        elif way < 0.8 and len(found) > 1:
            found.insert(int(draws.integers(len(found))), found.pop(at))
        elif way < 0.9 and len(found) > 1:
            del found[at]
        else:
            found.insert(at, draw_move(draws, base, bounds))
    while sum(move.seconds for move in found) < bounds.seconds:
        found.append(draw_move(draws, base, bounds))
    total, kept = 0.0, []
    for move in found:
        if total < bounds.seconds:
            kept.append(move)
        total += move.seconds
    return tuple(kept)


def _moved(draws: np.random.Generator, move: Move, width: float, bounds: Bounds) -> Move:
    """A move with other numbers."""
    longer, faster, stronger = np.exp(width * draws.standard_normal(3))
    side = -1.0 if draws.random() < 0.15 else 1.0
    period = move.period_s
    if period > 0.0:
        period = 2.0 * bounds.period_s * max(round(0.5 * period / bounds.period_s * float(faster)), 1)
    return replace(
        move,
        seconds=max(move.seconds * float(longer), bounds.period_s),
        speed_rad_s=side * min(move.speed_rad_s * float(faster), bounds.speed_rad_s),
        current_A=(side if move.kind in {"push", "creep"} else 1.0)
        * min(move.current_A * float(stronger), bounds.current_A),
        period_s=period,
    )


def _usual(base: FrictionParameters, bounds: Bounds) -> list[tuple[Move, ...]]:
    """Motions that a person would try: strong reversals, dithers, creep both ways, fast both ways, slow dwells."""
    friction = base.coulomb / max(base.motor_gain, 1.0e-9)
    strong, fast = 0.8 * bounds.current_A, bounds.speed_rad_s
    tick = bounds.period_s
    pushes = [Move("push", 1.0, 0.0, side * strong) for side in (1.0, -1.0, -1.0, 1.0)]
    creep = [Move("creep", 15.0, 0.0, side * 1.5 * friction) for side in (1.0, -1.0)]
    dwell = [Move("turn", 6.0, side * share * fast, strong) for share in (0.01, 0.03, 0.1) for side in (1.0, -1.0)]
    quick = [
        Move("turn", 20.0, 0.1 * fast, strong),
        *(Move("dither", 10.0, 0.0, strong, ticks * tick) for ticks in (2.0, 4.0, 10.0, 20.0)),
    ]
    both = [Move("turn", 30.0, side * 0.6 * fast, strong) for side in (1.0, -1.0)]
    small = [Move("push", 2.0, 0.0, side * 2.5 * friction) for side in (1.0, -1.0)]
    found = []
    for group in (pushes, creep, dwell, quick, both, small):
        length = sum(move.seconds for move in group)
        found.append(tuple(group * math.ceil(bounds.seconds / length)))
    return found
