"""`identification`: 600 s that show what the published profiles leave in the dark. Open loop, so it needs no estimate.

Built for the wheel of [CK13] (Coulomb friction 38.6 mA) and checked for motor gain and friction 20 % off: such a wheel
still reverses at every block and stays under 3000 rpm; no more than 0.4 A is ever requested, and no change faster than
4 A/s, so that the wheel gets what was requested (the default `limits.slew_A_per_s` is 5).

reversals   constant currents of both signs at several levels: motor gain, Coulomb friction, dead zone
dwells      a kick, then just the Coulomb current: low speeds that hardly change
creep       slow ramps through break-away in both directions: static friction, Stribeck speed, presliding, friction lag
bursts      short strong currents: saturation, actuator lag, delay
coast-downs from about 2000 rpm in both directions, current zero: viscous friction, windage, drag polynomials

A wheel whose gain and friction are known by about gets the same motion by currents of its own (`law_for`): what
drives is shifted by its friction, what balances friction is scaled with it, and the coast-downs begin where its speed
limit allows.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from itertools import accumulate
from typing import NamedTuple

from rw_ekf.control.profiles.profile_pieces import Piece, PiecewiseLinear, hold, ramped

STRONG_A = 0.4
SLEW_A_PER_S = 4.0  # of every change: the default limit is 5, and a tick may come a fifth too soon after the one before
GAIN, VISCOUS, COULOMB = 15.205, 0.00322, 0.5863  # [CK13]
COULOMB_A = COULOMB / GAIN  # the current that balances Coulomb friction
_FASTEST_RAD_S = 209.0  # 2000 rpm
_COAST_S = 81.0
_SPIN_UP_S, _BRAKE_S = (6.0, 45.0), (3.0, 30.0)  # shortest and longest, of another wheel


class Sizes(NamedTuple):
    """What the profile needs to know of a wheel; as it stands, of that of [CK13]."""

    drive: Callable[[float], float] = lambda current_A: current_A  # the current [A] that moves it as one moves [CK13]'s
    balance: Callable[[float], float] = lambda current_A: current_A  # the one whose share of its friction is the same
    spin_up_s: float = 39.0
    brake_s: float = 21.0


def sizes_of(gain: float, coulomb: float, most_A: float, fastest_rad_s: float) -> Sizes:
    """For a wheel of so much gain [rad/s^2/A] and friction [rad/s^2], within a current [A] and a speed [rad/s]."""

    def drive(current_A: float) -> float:
        return math.copysign(min((abs(current_A) * GAIN - COULOMB + coulomb) / gain, most_A), current_A)

    def balance(current_A: float) -> float:
        return math.copysign(min(abs(current_A) / COULOMB_A * coulomb / gain, most_A), current_A)

    fastest = min(fastest_rad_s, _FASTEST_RAD_S)
    net = gain * drive(STRONG_A) - coulomb  # less viscous friction, of which nothing is known yet but [CK13]'s
    left = 1.0 - VISCOUS * fastest / net if net > 0.0 else 0.0
    spin_up_s = -math.log(left) / VISCOUS if left > 0.0 else _SPIN_UP_S[1]
    slowed = (fastest + coulomb / VISCOUS) * math.exp(-VISCOUS * _COAST_S) - coulomb / VISCOUS
    brake_s = max(slowed, 0.0) / (gain * drive(0.3) + coulomb)
    return Sizes(
        drive, balance, min(max(spin_up_s, _SPIN_UP_S[0]), _SPIN_UP_S[1]), min(max(brake_s, _BRAKE_S[0]), _BRAKE_S[1])
    )


def _both_ways(*pieces: Piece) -> list[Piece]:
    """Give the pieces, then the same with the sign turned."""
    return [*pieces, *(Piece(piece.duration_s, 0.0 - piece.start_A, 0.0 - piece.end_A) for piece in pieces)]


def _reversals(of: Sizes) -> list[Piece]:
    """Three levels, each forward and back; the second half of a pair is longer, for it first has to stop the wheel."""
    return [
        *_both_ways(hold(12.0, of.drive(0.08))),
        *_both_ways(hold(12.0, of.drive(0.14))),
        *_both_ways(hold(8.0, of.drive(0.24))),
    ]


def _creep(of: Sizes) -> list[Piece]:
    """Ramps through break-away at 3 and 6 mA/s; a wheel 20 % off breaks loose later or earlier, but does."""
    slow = Piece(30.0, of.balance(-0.045), of.balance(0.075))
    quick = Piece(16.0, of.balance(0.06), of.balance(-0.07))
    return [slow, quick, *(Piece(p.duration_s, 0.0 - p.start_A, 0.0 - p.end_A) for p in (quick, slow))]


def _burst(of: Sizes, seconds: float) -> list[Piece]:
    """Strong current forward and back, then rest."""
    strong_A = of.drive(STRONG_A)
    return [hold(seconds, strong_A), hold(2.0 * seconds, -strong_A), hold(seconds, strong_A), hold(2.0, 0.0)]


def _coast_down(of: Sizes) -> list[Piece]:
    """Up to about 2000 rpm, coast, brake until nearly at rest."""
    return [hold(of.spin_up_s, of.drive(STRONG_A)), hold(_COAST_S, 0.0), hold(of.brake_s, of.drive(-0.3))]


def _dwells(of: Sizes) -> list[Piece]:
    """A wheel on the mark turns on at some 12 rpm; one that is off gains or loses speed slowly."""
    return _both_ways(hold(4.0, of.drive(0.06)), hold(12.0, of.balance(COULOMB_A)))


def _blocks(of: Sizes) -> tuple[tuple[str, list[Piece]], ...]:
    return (
        ("reversals", _reversals(of)),
        ("creep", _creep(of)),
        ("dwells", _dwells(of)),
        ("bursts", _burst(of, 2.0)),
        ("coast-downs", _both_ways(*_coast_down(of))),
        ("rest", [hold(22.0, 0.0)]),
        ("bursts", _burst(of, 1.0)),
        ("creep", _creep(of)),
    )


def law_for(of: Sizes, slew_A_per_s: float) -> tuple[PiecewiseLinear, Callable[[float], str]]:
    """The current over time, and what it is at by its time [s]; slew_A_per_s: of every change."""
    blocks = _blocks(of)
    ends_s = tuple(accumulate(sum(piece.duration_s for piece in block) for _, block in blocks))
    law = PiecewiseLinear(ramped([piece for _, block in blocks for piece in block], slew_A_per_s))
    return law, lambda time_s: blocks[min(bisect_right(ends_s, time_s), len(blocks) - 1)][0]


LAW, phase = law_for(Sizes(), SLEW_A_PER_S)
