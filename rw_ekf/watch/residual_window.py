"""Sums over blocks of samples, and what a window of blocks says: dependences, correlation in time, size."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, by_identity
from rw_ekf.watch.dependences import MODEL_TERMS, TORQUES

LAGS = 8
_CLIP = 4.0  # standard deviations that one reading counts for at most
_SLOW = [i for i, d in enumerate(TORQUES) if d.name in ("temperature", "time")]
_COLLINEAR = 0.02  # share of a torque that must be left beside the model's own
_BETTER = 1.1  # what the model lacks must explain more than a change of what it has by this, ...
_BETTER_BY = 10.0  # ... and by this in chi-square


@by_identity
class BlockSums(NamedTuple):
    """Sums over some samples; they add up over blocks."""

    begin_s: float
    samples: int
    squares: float  # of the normalised innovations
    lagged: Float64Array  # (LAGS,) products with the one so many samples before
    information: Float64Array  # (q, q)
    score: Float64Array  # (q,)


class Finding(NamedTuple):
    """The largest dependence of a window."""

    column: int
    deviation: float  # of its coefficient, in standard deviations [-]
    beside_model: bool  # judged with the model's own terms fitted along


def block_sums(
    begin_s: float, responses: Float64Array, normalised: Float64Array, before: Float64Array
) -> tuple[BlockSums, Float64Array]:
    """Sum one block; before: the last LAGS normalised innovations of the block before, NaN where there are none.

    Returns the sums, and the last LAGS of this one.
    """
    z = np.clip(normalised, -_CLIP, _CLIP)
    used = ~np.isnan(z)
    chain = np.nan_to_num(np.concatenate((before, z)))
    lagged = np.array([float(chain[LAGS:] @ chain[LAGS - k : -k]) for k in range(1, LAGS + 1)])
    g = responses[used]
    sums = BlockSums(begin_s, int(used.sum()), float(z[used] @ z[used]), lagged, g.T @ g, g.T @ z[used])
    return sums, np.concatenate((before, z))[-LAGS:]


def total(blocks: Sequence[BlockSums]) -> BlockSums:
    """Sum of blocks, oldest first."""
    return BlockSums(
        blocks[0].begin_s,
        sum(b.samples for b in blocks),
        sum(b.squares for b in blocks),
        np.sum([b.lagged for b in blocks], axis=0),
        np.sum([b.information for b in blocks], axis=0),
        np.sum([b.score for b in blocks], axis=0),
    )


def spread(window: BlockSums) -> float:
    """Root mean square of the normalised innovations [-]: 1 where the configured noises are right."""
    return math.sqrt(window.squares / window.samples) if window.squares > 0.0 else 1.0


def whiteness(window: BlockSums) -> float:
    """Box and Pierce's sum over LAGS lags: chi-square of as many degrees for noise (docs/watch.md eq. 12)."""
    if window.squares <= 0.0:
        return 0.0
    correlation = window.lagged / window.squares
    return float(window.samples * (correlation @ correlation))


def chi_square_limit(deviation: float) -> float:
    """The whiteness that noise exceeds as rarely as a dependence exceeds `deviation` (Wilson and Hilferty's cube).

    A fifth is added for what a filter that expects more disturbance than there is puts into its innovations itself.
    """
    normal = -NormalDist().inv_cdf(math.exp(-0.5 * deviation * deviation))
    share = 2.0 / (9.0 * LAGS)
    return float(1.2 * LAGS * (1.0 - share + normal * math.sqrt(share)) ** 3)


def largest_dependence(window: BlockSums, *, slow_too: bool) -> Finding:
    """The dependence that explains most, in standard deviations scaled by the spread found (docs/watch.md eq. 11).

    slow_too: the window is long enough for temperature and time, which in a short one are nothing but its slope.
    """
    scale = spread(window)
    alone, beside = explained(window)
    if not slow_too:
        alone[_SLOW] = beside[_SLOW] = 0.0
    own = int(np.argmax(alone[:MODEL_TERMS]))
    lacking = np.maximum(alone, beside)
    lacking[:MODEL_TERMS] = 0.0
    other = int(np.argmax(lacking))
    if lacking[other] > _BETTER * alone[own] + _BETTER_BY * scale**2:
        return Finding(other, math.sqrt(lacking[other]) / scale, beside_model=bool(beside[other] > alone[other]))
    return Finding(own, math.sqrt(alone[own]) / scale, beside_model=False)


def deviation_of(window: BlockSums, finding: Finding) -> float:
    """The deviation of a finding's dependence in another window."""
    alone, beside = explained(window)
    chi_square = (beside if finding.beside_model else alone)[finding.column]
    return math.sqrt(float(chi_square)) / spread(window)


def deviation_of_name(window: BlockSums, name: str) -> float:
    """The largest deviation of all dependences that go by a name; 0 for a name that is none of theirs."""
    alone, beside = explained(window)
    chi_square = max((max(alone[i], beside[i]) for i, d in enumerate(TORQUES) if d.name == name), default=0.0)
    return math.sqrt(float(chi_square)) / spread(window)


def without_largest(blocks: Sequence[BlockSums], weight: Sequence[float]) -> BlockSums | None:
    """Sum of the blocks without the two neighbours of largest weight: what one event did, a late break-away say.

    None where fewer than two blocks would be left.
    """
    if len(blocks) < 4:
        return None
    worst = max(range(len(blocks) - 1), key=lambda i: weight[i] + weight[i + 1])
    return total([*blocks[:worst], *blocks[worst + 2 :]])


def explained(window: BlockSums) -> tuple[Float64Array, Float64Array]:
    """Chi-square that each dependence explains, (q,) each: alone, and beside the model's own terms (0 for these)."""
    size = len(TORQUES)
    information, score = window.information, window.score
    diagonal = np.diag(information)
    seen = diagonal > 0.0
    alone = np.divide(score**2, diagonal, out=np.zeros(size), where=seen)
    scale = np.sqrt(np.where(seen, diagonal, 1.0))
    own = slice(0, MODEL_TERMS)
    scaled = information / np.outer(scale, scale)
    core = scaled[own, own] + 1.0e-9 * np.eye(MODEL_TERMS)
    weights = np.linalg.solve(core, scaled[own, :])  # (terms, q)
    left = np.diag(scaled) - np.einsum("iq,iq->q", scaled[own, :], weights)
    rest = score / scale - (score[own] / scale[own]) @ weights
    reported = left > _COLLINEAR
    reported[own] = False
    beside = np.divide(rest**2, left, out=np.zeros(size), where=reported & seen)
    return alone, beside
