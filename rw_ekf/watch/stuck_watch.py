"""Readings that stand still although the wheel must have moved: a stuck reading, and no wheel at steady speed.

The proof is by contradiction. As long as a reading repeats to the last bit, either it is alive, and then the wheel
still turns at that speed v, or it is stuck. If it is alive, the torque at v is known from the estimator's belief of
*before* the reading began to repeat (what it has learnt since, it has learnt from the reading in question):

    a = k I - sgn(v) [b |v| + c + (s - c) g(v)],          sd(a)^2 = phi' P phi + (0.05 k I)^2 + (0.1 R)^2       (1)

with phi = da/d(k, b, c, s), P their covariance and R the friction (model: [CK13 (1), (4)]). The last two terms are
what a wheel may have beyond the model; at rest, where friction is known worst, a half of R stands in place of a
tenth. No wheel has a gain or a friction that is negative by more than its sigma: there what the configuration
believes is taken, not what runs before have learned. What the effects of an augmented model add is taken from the
estimator's own predictions, and half of it doubted. The least that the wheel must have moved, upward and, likewise,
downward, is a cumulative sum ([Page 1954], CUSUM) of the lower bound of (1),

    m_i = max(0, m_(i-1) + (a_i - 2 sd(a_i)) dt_i).                                                             (2)

Several steps of the reading in m, and the reading has not moved: it does not measure this wheel. At steady speed a
is zero within its bounds, and the sum stays at zero for any length of time, whatever the resolution.

Under a current that changes its sign the sum begins anew with every half period, and (1) doubts the gain at each
instant as if it were another one. What all currents say together is tested beside it (eq. 3 and 4, `standing_proof`):
at three standard deviations from the nearest wheel that would not have moved, the reading is stuck as well.

A dead line may hum: the reading stays within some noises of one value and never repeats to the last bit. Tested with
`within_rad_s`, the same proof takes every reading within that of the first for a repetition; the bounds grow by as
much, and the proof begins anew every half minute, for a speed that a controller holds is alive, and its friction ages.

[CK13]: docs/model.md. [Page 1954]: Continuous inspection schemes, Biometrika 41, 100-115.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, by_identity
from rw_ekf.model.friction import acceleration, stribeck
from rw_ekf.model.state import FrictionParameters
from rw_ekf.watch.standing_proof import StandingProof

_SIGMAS = 2.0
_DRIVE_SHARE = 0.05  # eq. 1
_FRICTION_SHARE = 0.1
_REST_SHARE = 0.5
_STEPS = 4.0  # so many steps of the reading, or standard deviations where those are larger, are "several"
_REPEATS = 4  # fewer repetitions prove nothing: telemetry may be refreshed more slowly than it is read
_APART_STEPS = 2.0  # standard deviation of how far apart two speeds are that read the same, in steps (eq. 3)
_SQUARED_DISTANCE = 9.0  # eq. 4: beyond it no wheel stands at its reading
_EFFECTS_SHARE = 0.5  # of the torque of a model's effects that may be wrong where the reading repeats
_EFFECTS_OVER_S = 1.0
_LONGEST_HUM_S = 30.0
_OF_HUM = 2.0  # widths: the first reading's noise and the last one's may both hide a motion
_ALIVE_AFTER = 2.0  # a reading that moves again must have been plausible for so many times the silence


@by_identity
class ParameterBelief(NamedTuple):
    """What the estimator believes of the parameters: a copy."""

    parameters: FrictionParameters
    covariance: Float64Array  # (4, 4)

    @property
    def is_physical(self) -> bool:
        """Whether they can be a wheel's: an undeclared effect may have led the filter anywhere."""
        spread = (math.sqrt(max(variance, 0.0)) for variance in self.covariance.diagonal().tolist())
        return all(value > -std for value, std in zip(self.parameters, spread, strict=True))

    def friction(self, speed_rad_s: float, omega_s: float, law: int) -> tuple[float, float]:
        """R of eq. 1 at a speed, against the motion, and its sd [rad/s^2]."""
        friction, phi = _friction_and_slopes(self.parameters, abs(speed_rad_s), 0.0, omega_s, law)
        variance = float(np.array(phi) @ self.covariance @ np.array(phi))
        return friction, math.hypot(math.sqrt(max(variance, 0.0)), _FRICTION_SHARE * friction)


def _friction_and_slopes(
    parameters: FrictionParameters, v: float, along_A: float, omega_s: float, law: int
) -> tuple[float, tuple[float, float, float, float]]:
    """R and phi of eq. 1, both along the motion; v: its size, along_A: the current that drives the wheel on."""
    _, b, c, s = parameters
    g = stribeck(v / omega_s, law)
    return max(b * v + c + (s - c) * g, 0.0), (along_A, -v, g - 1.0, -g)


class Judged(NamedTuple):
    """What a reading is worth."""

    used: bool  # False: it is not a measurement
    stuck: bool  # True: the wheel must not be driven by it
    news: str | None = None  # "stuck" or "alive" where that begins


class StuckWatch:
    """Takes every reading with the mean current of the interval before it. One of these per run."""

    def __init__(
        self,
        step_rad_s: float,
        noise_rad_s: float,
        silence_s: float,
        stribeck_speed_rad_s: float,
        law: int,
        within_rad_s: float = 0.0,
        first: ParameterBelief | None = None,
    ) -> None:
        """step_rad_s: resolution of a reading; noise_rad_s: its noise; silence_s: the age at which a reading is old.

        within_rad_s: how far readings may lie apart and still count as one that repeats. first: what the configuration
        believes of the wheel, for where the estimator's belief can be no wheel's; else its belief at the first reading,
        which may have been corrupted by an earlier run.
        """
        self._step = max(step_rad_s, noise_rad_s)
        self._within = within_rad_s
        self._silence_s = silence_s
        self._omega_s = stribeck_speed_rad_s
        # Below it a wheel may be at rest: few tachometers count so slowly, and some are a step or two off zero.
        self._near_rest = max(stribeck_speed_rad_s, 2.0 * step_rad_s) + within_rad_s
        self._law = law
        self._value: float | None = None
        self._last_s = self._since_s = 0.0
        self._repeats = 0
        self._belief: ParameterBelief | None = None
        self._first = first  # that of before any reading
        self._counts: ParameterBelief | None = None  # the belief that counts, once a reading repeats,
        self._P: list[list[float]] = []  # and its covariance
        self._up = self._down = 0.0
        self._standing: StandingProof | None = None
        self._alive_since_s: float | None = None
        self._beyond = self._beyond_now = 0.0
        self.stuck = False
        self.moved_rad_s = 0.0  # at least so far the wheel must have moved since it began to repeat; 0: found by eq. 4
        self.distance = 0.0  # standard deviations to the nearest wheel that would not have moved (eq. 4)
        self.repeated_s = 0.0
        self.value_rad_s = 0.0  # the reading that repeats

    @property
    def hums(self) -> bool:
        """Whether readings that are nearly the same repeat."""
        return self._within > 0.0

    def note_prediction(self, speed_rad_s: float, current_A: float, predicted_rad_s: float, dt_s: float) -> None:
        """Note what the estimator's effects did in an interval: its prediction beyond that of the four parameters.

        speed_rad_s: believed at the interval's start; predicted_rad_s: at its end. Only for an estimator with effects.
        """
        if self._belief is None or not dt_s > 0.0:
            return
        k, b, c, s = self._belief.parameters
        base = acceleration(speed_rad_s, k * current_A, b, c, s, self._omega_s, self._law)
        beyond = (predicted_rad_s - speed_rad_s) / dt_s - base
        self._beyond_now += min(dt_s / _EFFECTS_OVER_S, 1.0) * (beyond - self._beyond_now)

    def forget(self) -> None:
        """A new segment, or an unknown current: what came before says nothing about what follows."""
        self._value, self._alive_since_s = None, None

    def add(
        self, time_s: float, speed_rad_s: float, current_A: float | None, belief: Callable[[], ParameterBelief]
    ) -> Judged:
        """Judge a reading. current_A: mean over the interval that ends with it; None: not known.

        belief: gives what the estimator believed before this reading.
        """
        if self._value is None or current_A is None:
            self._begin(time_s, speed_rad_s, belief)
            return Judged(not self.stuck, self.stuck)
        dt_s, self._last_s = time_s - self._last_s, time_s
        hums = self._within > 0.0 and time_s - self._since_s > _LONGEST_HUM_S and not self.stuck
        if abs(speed_rad_s - self._value) > self._within or hums:
            return self._changed(time_s, dt_s, speed_rad_s, current_A, belief)
        self._repeats += 1
        if self.stuck and self._alive_since_s is None:
            return Judged(used=False, stuck=True)
        a, sd = self._acceleration(current_A)
        self._up = max(0.0, self._up + (a[0] - _SIGMAS * sd) * dt_s)
        self._down = max(0.0, self._down - (a[1] + _SIGMAS * sd) * dt_s)
        return self._repeated(time_s, self._stands(current_A, dt_s))

    def _repeated(self, time_s: float, stands: float) -> Judged:
        """Judge a reading that repeats. stands: D^2 of eq. 4."""
        moved = max(self._up, self._down)
        assert self._value is not None
        rest = self._near_rest if abs(self._value) <= self._near_rest else 0.0
        has_moved = moved > _STEPS * self._step + rest + _OF_HUM * self._within
        if self._repeats < _REPEATS or not (has_moved or stands > _SQUARED_DISTANCE):
            return self._settled(time_s)
        if self.stuck:
            self._alive_since_s = None
            return Judged(used=False, stuck=True)
        if time_s - self._since_s < self._silence_s:
            return Judged(used=False, stuck=False)
        self.stuck = True
        self.repeated_s, self.value_rad_s = time_s - self._since_s, self._value
        self.moved_rad_s, self.distance = moved if has_moved else 0.0, math.sqrt(stands)
        return Judged(used=False, stuck=True, news="stuck")

    def _changed(
        self, time_s: float, dt_s: float, speed_rad_s: float, current_A: float, belief: Callable[[], ParameterBelief]
    ) -> Judged:
        """A reading that moves is alive; one that was stuck has to show that it moves as the wheel does."""
        assert self._value is not None
        before = self._value
        if not self.stuck:
            self._begin(time_s, speed_rad_s, belief)
            return Judged(used=True, stuck=False)
        a, sd = self._acceleration(current_A)
        apart = speed_rad_s - before
        within = 3.0 * _SIGMAS * self._step + 3.0 * sd * dt_s
        plausible = min(a[1], a[0], 0.0) * dt_s - within <= apart <= max(a[0], a[1], 0.0) * dt_s + within
        if self._alive_since_s is None or not plausible:  # the first step away may be of any size: time has passed
            self._alive_since_s = time_s
        self._begin(time_s, speed_rad_s, belief)
        return self._settled(time_s)

    def _settled(self, time_s: float) -> Judged:
        """Whether a reading that was stuck has been plausible for long enough."""
        if not self.stuck:
            return Judged(used=True, stuck=False)
        if self._alive_since_s is None or time_s - self._alive_since_s < _ALIVE_AFTER * self._silence_s:
            return Judged(used=False, stuck=True)
        self.stuck, self._alive_since_s = False, None
        return Judged(used=True, stuck=False, news="alive")

    def _begin(self, time_s: float, speed_rad_s: float, belief: Callable[[], ParameterBelief]) -> None:
        self._value = speed_rad_s
        self._last_s = self._since_s = time_s
        self._repeats = 0
        self._up = self._down = 0.0
        self._standing = None
        if not self.stuck:  # while it is, the filter predicts on and learns nothing: the old belief is the better one
            self._belief = belief()
            self._first = self._belief if self._first is None else self._first
            self._beyond = self._beyond_now
            self._counts = None

    def _stands(self, current_A: float, dt_s: float) -> float:
        """D^2 of eq. 4 with this interval; zero near rest, where a wheel may well stand through many currents."""
        assert self._value is not None
        if not abs(self._value) > self._near_rest:
            return 0.0
        way = math.copysign(1.0, self._value)
        friction, phi = self._friction_and_slopes(way * current_A)
        if self._standing is None:
            believed = self._believed()
            of_friction = math.hypot(_FRICTION_SHARE * friction, _EFFECTS_SHARE * self._beyond)
            lacking = np.square([_DRIVE_SHARE * believed.parameters.motor_gain, 0.0, of_friction, 0.0])
            P = believed.covariance + np.diag(lacking)
            self._standing = StandingProof(believed.parameters, P, _APART_STEPS * self._step + self._within)
        return self._standing.add(phi, way * self._beyond, dt_s)

    def _believed(self) -> ParameterBelief:
        """What counts while a reading repeats: the belief of before, where a wheel can be like that."""
        if self._counts is None:
            assert self._belief is not None
            self._counts = self._belief if self._first is None or self._belief.is_physical else self._first
            self._P = self._counts.covariance.tolist()
        return self._counts

    def _friction_and_slopes(self, along_A: float) -> tuple[float, tuple[float, float, float, float]]:
        assert self._value is not None
        return _friction_and_slopes(self._believed().parameters, abs(self._value), along_A, self._omega_s, self._law)

    def _acceleration(self, current_A: float) -> tuple[tuple[float, float], float]:
        """Eq. 1: accelerations of a wheel that moves up and one that moves down (the same unless at rest), and sd."""
        assert self._value is not None
        moves = abs(self._value) > self._near_rest
        drive = self._believed().parameters.motor_gain * current_A
        forward = self._value > 0.0 if moves else drive > 0.0
        friction, phi = self._friction_and_slopes(current_A if forward else -current_A)
        share = _FRICTION_SHARE if moves else _REST_SHARE
        variance = (_DRIVE_SHARE * drive) ** 2 + (share * friction) ** 2
        for slope, row in zip(phi, self._P, strict=True):
            variance += slope * (row[0] * phi[0] + row[1] * phi[1] + row[2] * phi[2] + row[3] * phi[3])
        sd = math.sqrt(max(variance, 0.0))
        sd = math.hypot(sd, _EFFECTS_SHARE * self._beyond)
        drive += self._beyond
        if not moves:
            return (drive - friction, drive + friction), sd
        a = drive - math.copysign(friction, self._value)
        return (a, a), sd
