"""Is the readings' noise one and the same, and normal? What sigmas rest on beside a residual that is white.

A sensor that loses counts reads low whichever way the wheel turns; one whose timing is poor is noisier at speed; one
that slips now and then has long tails. None of these is correlated in time, and a filter that does not know of them has
sigmas that hold less often than they say. Tested by first and second moments alone, which are normal in a few hundred
readings; a test of third and fourth ones is not.
"""

from __future__ import annotations

import math

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.filter.tails import chi_square_tail
from rw_ekf.numbers import p_text

# Of all three together, so that a record is reported at one in a million: noise that is a little uneven, as any real
# one is, costs little. In the 8,000 readings that are judged at most, one sigma apart from the other is then 4 % of it.
UNEVEN_P = 1.0e-6
_LEAST = 200
_MOST = 8_000
_NORMAL = math.sqrt(2.0 / math.pi)  # mean |z|
_LEAN = 2.0 * _NORMAL  # slope of z |z| by z
_WORDS = (
    ("reads low, whichever way the wheel turns, more often than noise does, as of an encoder that loses counts",
     "reads high, whichever way the wheel turns, more often than noise does"),
    ("is larger at low speed", "is larger the faster the wheel turns"),
    ("has long tails, or is not always as large, as of a sensor that slips at times", "has no tails, as of rounding"),
)  # fmt: skip


def unevenness(white: Float64Array, speed_rad_s: Float64Array) -> str | None:
    """What is odd about whitened residuals (n,) at speeds (n,), 0 near rest, in a sentence; None where nothing is."""
    good = np.flatnonzero(np.isfinite(white) & np.isfinite(speed_rad_s) & (speed_rad_s != 0.0))
    good = good[:: max(1, math.ceil(good.size / _MOST))]
    if good.size < _LEAST:
        return None
    z, speed = white[good], speed_rad_s[good]
    z = z - z.mean()
    spread = float(z.std())
    if not spread > 0.0:
        return None
    z = z / spread
    size = np.abs(z)
    scores = np.array([_lean(z * np.sign(speed)), _correlation(size, np.abs(speed)), _tails(size)])
    p_value = chi_square_tail(float(scores @ scores), scores.size)
    if p_value >= UNEVEN_P:
        return None
    most = int(np.argmax(np.abs(scores)))
    return (
        f"the noise of the readings is not the same throughout: it {_WORDS[most][int(scores[most] > 0.0)]} "
        f"({p_text(p_value)}). The sigmas, which suppose one that is, are not to be relied upon."
    )


def _lean(along: Float64Array) -> float:
    """Score of long tails on one side alone, a mean taken off; along: residuals in the direction of motion."""
    return float(np.mean(along * np.abs(along) - _LEAN * along)) * math.sqrt(along.size / (3.0 - _LEAN**2))


def _correlation(size: Float64Array, fast: Float64Array) -> float:
    if not np.ptp(fast) > 0.0:
        return 0.0
    return float(np.corrcoef(size, fast)[0, 1]) * math.sqrt(size.size)


def _tails(size: Float64Array) -> float:
    """Geary's ratio of mean size to spread, as a score: below 0 for long tails."""
    return (float(size.mean()) - _NORMAL) * math.sqrt(size.size / (1.0 - 3.0 / math.pi))
