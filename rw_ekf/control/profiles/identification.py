"""`identification`: 600 s that show what the published profiles leave in the dark. Open loop, so it needs no estimate.

Built for the wheel of [CK13] (Coulomb friction 38.6 mA) and checked for motor gain and friction 20 % off: such a wheel
still reverses at every block and stays under 3000 rpm; no more than 0.4 A is ever asked for, and no change faster than
4 A/s, so that the wheel gets what was asked for (the default `limits.slew_A_per_s` is 5).

reversals   constant currents of both signs at several levels: motor gain, Coulomb friction, dead zone
dwells      a kick, then just the Coulomb current: low speeds that hardly change
creep       slow ramps through break-away in both directions: static friction, Stribeck speed, presliding, friction lag
bursts      short strong currents: saturation, actuator lag, delay
coast-downs from about 2000 rpm in both directions, current zero: viscous friction, windage, drag polynomials
"""

from __future__ import annotations

from bisect import bisect_right
from itertools import accumulate

from rw_ekf.control.profiles.profile_pieces import Piece, PiecewiseLinear, hold, ramped

STRONG_A = 0.4
SLEW_A_PER_S = 4.0  # of every change: the default limit is 5, and a tick may come a fifth too soon after the one before
COULOMB_A = 0.5863 / 15.205  # [CK13]: the current that balances Coulomb friction


def _both_ways(*pieces: Piece) -> list[Piece]:
    """Give the pieces, then the same with the sign turned."""
    return [*pieces, *(Piece(piece.duration_s, 0.0 - piece.start_A, 0.0 - piece.end_A) for piece in pieces)]


def _reversals() -> list[Piece]:
    """Three levels, each forward and back; the second half of a pair is longer, for it first has to stop the wheel."""
    return [
        *_both_ways(hold(12.0, 0.08)),
        *_both_ways(hold(12.0, 0.14)),
        *_both_ways(hold(8.0, 0.24)),
    ]


def _creep() -> list[Piece]:
    """Ramps through break-away at 3 and 6 mA/s; a wheel 20 % off breaks loose later or earlier, but does."""
    slow = Piece(30.0, -0.045, 0.075)
    quick = Piece(16.0, 0.06, -0.07)
    return [slow, quick, Piece(16.0, -0.06, 0.07), Piece(30.0, 0.045, -0.075)]


def _burst(seconds: float) -> list[Piece]:
    """Strong current forward and back, then rest."""
    return [hold(seconds, STRONG_A), hold(2.0 * seconds, -STRONG_A), hold(seconds, STRONG_A), hold(2.0, 0.0)]


def _coast_down() -> list[Piece]:
    """Up to about 2000 rpm, coast, brake until nearly at rest."""
    return [hold(39.0, STRONG_A), hold(81.0, 0.0), hold(21.0, -0.3)]


def _dwells() -> list[Piece]:
    """A wheel on the mark turns on at some 12 rpm; one that is off gains or loses speed slowly."""
    return _both_ways(hold(4.0, 0.06), hold(12.0, COULOMB_A))


_BLOCKS = (
    ("reversals", _reversals()),
    ("creep", _creep()),
    ("dwells", _dwells()),
    ("bursts", _burst(2.0)),
    ("coast-downs", _both_ways(*_coast_down())),
    ("rest", [hold(22.0, 0.0)]),
    ("bursts", _burst(1.0)),
    ("creep", _creep()),
)
_ENDS_S = tuple(accumulate(sum(piece.duration_s for piece in block) for _, block in _BLOCKS))

LAW = PiecewiseLinear(ramped([piece for _, block in _BLOCKS for piece in block], SLEW_A_PER_S))


def phase(time_s: float) -> str:
    """What the profile is at, by its time [s]."""
    return _BLOCKS[min(bisect_right(_ENDS_S, time_s), len(_BLOCKS) - 1)][0]
