"""Model predictive crossing: the estimator's own propagation, inverted over the interval in which a current acts.

A current that is commanded now acts from t + d until the next one does, T later; until t + d the old one holds. The
one is sought with which the propagation ends where the request leads,

    Phi(omega(t + d); I, T) = omega(t + d) + a T + p,

Phi with the located crossing, stick and break-away, effects and hidden states (docs/model.md). It rises with I, and is
flat where the wheel would come to rest and stay. p pays back what the intervals before fell short of (`Payback`).
Drag that the model lacks (`unmodelled_drag`) is added by its mean over the interval.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from rw_ekf.control.compensation.followed_wheel import FollowedWheel
from rw_ekf.control.compensation.known import WheelKnown, signed_friction
from rw_ekf.control.compensation.tick_intervals import Timeline
from rw_ekf.control.compensation.unmodelled_drag import SpeedNoise, mean_sign
from rw_ekf.model.friction import Stribeck
from rw_ekf.model.state import FrictionParameters
from rw_ekf.records import Outlook, Tick

_EXACT = 1.0e-9  # rad/s, and of the speed
_MOST_A = 1.0e3  # no wheel takes more
_LEAST_SLOPE = 1.0e-12  # rad/s/A: a motor gain times an interval may be as little as nothing
_TURNS = 100
_REST_SIGMAS = 3.0  # within so many the belief allows a wheel to stand


class Payback(NamedTuple):
    """How a shortfall of momentum is paid back: what was requested, less what the believed speed gained.

    The noise of the belief must not reach the current: what lies within so many of its sigmas is not paid, and a wheel
    at rest is not moved for less than `least_rad_s`.
    """

    share: float = 0.5  # of the shortfall in one interval; stable where the current acts a period later than believed
    sigmas: float = 2.0
    forgotten_s: float = 10.0  # what attitude control has made up for by itself by then
    least_rad_s: float = 0.02
    most_rad_s: float = 0.5


class PredictiveCrossing:
    """The current with which the believed wheel ends the next interval with the momentum that was requested."""

    def __init__(self, rate_hz: float, noise: SpeedNoise | None = None, payback: Payback | None = None) -> None:
        """rate_hz: of the loop, whose period a current acts. noise: of the readings; None: the model is all."""
        self._period_s = 1.0 / rate_hz
        self._wheel = None if noise is None else FollowedWheel(noise)
        self._payback = Payback() if payback is None else payback
        self._timeline = Timeline()
        self._promised_rad_s: float | None = None  # speed where the next command acts, if the request is met
        self._owed_rad_s = 0.0
        self._stood = False

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2]; none while the motor gain is believed not to be positive."""
        span = self._timeline.step(tick)
        if span is None:
            self._promised_rad_s, self._owed_rad_s = None, 0.0
        if not known.parameters.motor_gain > 0.0:
            self._promised_rad_s = None
            if self._wheel is not None:
                self._wheel.forget()
            return self._timeline.wanted(0.0)
        wanted = request_rad_s2 * self._period_s
        stands = self._stands(tick, known, wanted)
        ahead = self._ahead(tick, known, span, stands)
        begin = ahead.begin_rad_s
        if stands and not self._stood:
            self._promised_rad_s = None  # what the belief was off is not owed
        self._stood = stands
        if self._promised_rad_s is not None:
            self._owed_rad_s = owed_after(self._owed_rad_s, self._promised_rad_s, begin, self._period_s, self._payback)
        self._promised_rad_s = begin + wanted
        sigma = 0.0 if known.estimate is None else known.estimate.std.speed_rad_s
        target = begin + wanted + paid(self._owed_rad_s, wanted, begin, sigma, self._payback)
        if begin == target == 0.0:
            return self._timeline.wanted(0.0)
        current_A = inverted(
            lambda current: ahead.end_rad_s(current, self._period_s),
            target,
            guess(begin, target, self._period_s, known.parameters, known.stribeck),
            known.parameters.motor_gain * self._period_s,
        )
        if self._wheel is not None:
            current_A += mean_sign(begin, target) * self._wheel.drag_rad_s2 / known.parameters.motor_gain
        return self._timeline.wanted(current_A)

    def _ahead(self, tick: Tick, known: WheelKnown, span: tuple[float, float] | None, stands: bool) -> Outlook:
        """What follows, from the believed speed or, where readings are followed beside it, from that."""
        if self._wheel is None:
            return known.outlook(0.0 if stands else known.speed_rad_s)
        self._wheel.follow(tick, known, span)
        if stands:
            self._wheel.stand()
        return self._wheel.ahead(known)

    def _stands(self, tick: Tick, known: WheelKnown, wanted: float) -> bool:
        """Whether the wheel is taken to stand: its belief allows that, and says it, or nothing is requested.

        At rest the belief follows the noise of the readings about zero; friction that changed its sign with it, or that
        held a speed which is none, would never end. A wheel that does move loses no more by it than the belief's noise.
        """
        estimate = known.estimate
        if estimate is None or estimate is not tick.estimate:
            return known.speed_rad_s == 0.0
        due = self._owed_rad_s + wanted
        predicted = estimate.predicted_speed_rad_s
        return is_taken_to_stand(known.speed_rad_s, estimate.std.speed_rad_s, predicted, due, self._payback)


def is_taken_to_stand(speed: float, sigma: float, predicted: float, due: float, pay: Payback) -> bool:
    """Whether a wheel is taken to stand; predicted [rad/s]: before the reading, due: what it is to gain [rad/s]."""
    if not abs(speed) <= _REST_SIGMAS * sigma:
        return False
    return predicted == 0.0 or abs(due) <= pay.least_rad_s


def owed_after(owed: float, promised: float, begin: float, period_s: float, pay: Payback) -> float:
    """What is owed [rad/s] where a command acts, of which another speed was promised."""
    owed = owed * math.exp(-period_s / pay.forgotten_s) + promised - begin
    return max(-pay.most_rad_s, min(pay.most_rad_s, owed))


def paid(owed: float, wanted: float, begin: float, sigma: float, pay: Payback) -> float:
    """What this interval gives beyond what is requested [rad/s]; at rest all of what is due, or nothing of it."""
    if begin == 0.0:
        return owed if abs(owed + wanted) > pay.least_rad_s else -wanted
    return math.copysign(pay.share * max(abs(owed) - pay.sigmas * sigma, 0.0), owed)


def guess(begin: float, target: float, period_s: float, parameters: FrictionParameters, stribeck: Stribeck) -> float:
    """The current [A] of the base model: friction at the begin, or break-away where the wheel starts or turns."""
    if begin * target > 0.0:
        friction = signed_friction(
            begin, parameters.viscous, parameters.coulomb, parameters.static, stribeck.omega_s, stribeck.law
        )
    else:
        friction = math.copysign(parameters.static, begin if target == 0.0 else target)
    return ((target - begin) / period_s + friction) / parameters.motor_gain


def inverted(end: Callable[[float], float], target: float, tried: float, slope: float) -> float:
    """The current [A] at which `end`, which rises with it, reaches the target [rad/s]; what lies nearest if none does.

    slope >= 0 [rad/s/A]: what it is far from zero speed. From the current that is tried first steps that grow until
    the target lies between two currents, then regula falsi as in the Illinois method, the end that stays at half its
    weight, and bisections.
    """
    exact = _EXACT * (1.0 + abs(target))
    low = high = max(-_MOST_A, min(_MOST_A, tried))
    below = above = end(low) - target
    step = max(abs(below), exact) / max(slope, _LEAST_SLOPE)
    while above < -exact and high < _MOST_A:
        low, below = high, above
        high = min(high + step, _MOST_A)
        above = end(high) - target
        step *= 2.0
    while below > exact and low > -_MOST_A:
        high, above = low, below
        low = max(low - step, -_MOST_A)
        below = end(low) - target
        step *= 2.0
    weigh_low = weigh_high = 1.0
    for turn in range(_TURNS):
        if above <= exact:
            return high
        if below >= -exact or high - low <= 1.0e-15 * (abs(high) + abs(low)):
            return low
        middle = low - weigh_low * below * (high - low) / (weigh_high * above - weigh_low * below)
        if turn % 4 == 3 or not low < middle < high:
            middle = 0.5 * (low + high)
        error = end(middle) - target
        if error < 0.0:
            low, below, weigh_low, weigh_high = middle, error, 1.0, 0.5 * weigh_high
        else:
            high, above, weigh_low, weigh_high = middle, error, 0.5 * weigh_low, 1.0
    return 0.5 * (low + high)
