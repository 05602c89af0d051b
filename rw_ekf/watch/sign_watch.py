"""Which way a current turns the wheel, and about how strongly: from the readings alone, whatever the filter believes.

Over pieces of half a second or more, with omega and I as measured and commanded, the speed changed by

    d omega = kappa int I dt - b int omega dt - c int sgn(omega) dt + d T + e                                     (1)

which is the model [CK13 (1), (4)] integrated once, linear in kappa, b, c and d. kappa starts from 0 with ten times the
expected gain as its standard deviation, so that neither sign is preferred; c from what is expected, as wide as that
itself, b twice as wide; d, all that is neither, from 0 with 0.3 c, and it wanders by 0.1 c per sqrt(s), so that no
torque from outside passes for the current's. e: the noise of two readings, and 0.15 c T of torque besides. A Kalman
filter over (kappa, b, c, d), recursive least squares, carries it; its sigmas are widened where the innovations are
larger than it expects. It forgets in half a minute of motion, for a sign may turn and a scale halve at any time.

The sign is wrong where kappa is negative by five sigmas, c being not negative, and by a fifth of the expected gain. The
size is odd where kappa is more than four times what is expected, or less than a quarter of it, by three sigmas. Both
are right where kappa is positive by five sigmas in the same way, and by three sigmas within those four times. A
current too small to move the wheel says nothing about either: pieces in which the wheel stands are left out. A
reading that leaps farther than a wheel twenty times as strong could waits for the next, and counts as the median of
itself and the two beside it: of a wheel that only speeds up or only slows down that is the reading itself, and one wild
reading in five makes no gain of its own.

[CK13]: docs/model.md.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.driver import OPPOSITE
from rw_ekf.model.friction import CREEP_STRIBECK_SPEEDS
from rw_ekf.model.state import FrictionParameters
from rw_ekf.records import IssuedCommand, Tick, WheelSample

PIECE_S = 0.5
LONGEST_STEP_S = 5.0  # a longer interval between readings is a gap
_LEAST_PIECES = 6
_SIGN_SIGMAS = 5.0
_SIGN_SHARE = 0.2
_SIZE_SIGMAS = 3.0
_SIZE_FACTOR = 4.0
_NO_WHEEL = 20.0  # times what is expected: beyond a scale that is ten times off, and short of a wild reading
_OUTSIDE_SHARE = 0.3
_WANDER_SHARE = 0.1
_ERROR_SHARE = 0.15
_MOVES = 4.0  # noises or steps of a reading: a piece that never gets so far from zero may be one of a wheel at rest
_INNOVATIONS_KEPT = 20.0
_LEAPS = 5.0  # sigmas; one piece alone, for what persists is the wheel
_FORGETS_S = 30.0  # of motion: what flips after ten healthy minutes is found as soon as what flips at once
_GAIN, _COULOMB, _OUTSIDE = 0, 2, 3  # places in the regression (eq. 1); viscous friction is 1
_FOR_CERTAIN = 5  # commands running


class SignWatch:
    """Takes the loop's samples with the command that followed each. Time comes with the data."""

    def __init__(
        self,
        expected: FrictionParameters,
        stribeck_speed_rad_s: float,
        step_rad_s: float,
    ) -> None:
        """expected: of the model that the run starts from; step_rad_s: of a reading (or noise)."""
        self.expected = expected
        k, b, c, _ = (abs(value) for value in expected)
        self._expected, self._coulomb = k, c
        self._step = step_rad_s
        self._at_rest = _MOVES * step_rad_s
        self._slow = CREEP_STRIBECK_SPEEDS * stribeck_speed_rad_s + 2.0 * step_rad_s
        self._x = np.array([0.0, b, c, 0.0])
        self._P = np.diag([(10.0 * k) ** 2, (2.0 * b) ** 2 + 1.0e-12, c * c, (_OUTSIDE_SHARE * c) ** 2])
        self._widest = self._P.diagonal().copy()
        self._nis = 1.0
        self._skipped = False
        self.pieces = 0
        # Of the time by what it says: pieces of motion, pieces at rest, and what a lost reply spoilt, for nobody knows
        # what turned the wheel in it [s].
        self.used_s = self.quiet_s = self.lost_s = 0.0
        self._waiting: Tick | None = None  # whose reading leaps
        self.opposite = OppositeTold()
        self._last: WheelSample | None = None
        self._command: IssuedCommand | None = None
        self._in_force_A: float | None = None
        self._at_s = self._from_rad_s = 0.0  # time of the last sample; speed at the start of the piece
        self._charge = self._turned = self._dry = self._T = 0.0
        self._fastest, self._slowest, self._known = 0.0, math.inf, True

    @property
    def gain(self) -> tuple[float, float]:
        """The gain kappa and its standard deviation [rad/s^2/A]."""
        return float(self._x[_GAIN]), math.sqrt(float(self._P[_GAIN, _GAIN]) * max(self._nis, 1.0))

    @property
    def is_known(self) -> bool:
        """Whether enough has moved to say anything."""
        return self.pieces >= _LEAST_PIECES

    @property
    def is_wrong(self) -> bool:
        """Whether the current turns the wheel the other way than the reading says."""
        gain, _ = self.gain
        enough = self.is_known and gain < -_SIGN_SHARE * self._expected
        return enough and self._end_of_gain(1.0) < 0.0

    @property
    def is_right(self) -> bool:
        """Whether the current turns the wheel the way that the reading says, about as strongly as expected."""
        gain, std = self.gain
        within = gain + _SIZE_SIGMAS * std < _SIZE_FACTOR * self._expected
        within = within and gain - _SIZE_SIGMAS * std > self._expected / _SIZE_FACTOR
        return self.is_known and within and self._end_of_gain(-1.0) > 0.0

    @property
    def is_settled(self) -> bool:
        """Whether more of the same motion would show nothing new: right, wrong, or of another size than expected."""
        factor = self.odd_factor
        odd = factor is not None and (factor < 1.0 or self._end_of_gain(-1.0) > 0.0)
        return odd or self.is_right or self.is_wrong

    @property
    def odd_factor(self) -> float | None:
        """By which factor the size of the gain is off what was expected; None where it is not, or is not known."""
        gain, std = self.gain
        if not self.is_known or self._expected == 0.0:
            return None
        size = abs(gain)
        large = size - _SIZE_SIGMAS * std > _SIZE_FACTOR * self._expected
        small = size + _SIZE_SIGMAS * std < self._expected / _SIZE_FACTOR
        is_sure = small or gain > 0.0 or self.is_wrong  # wild readings make a large gain of either sign
        return size / self._expected if (large or small) and is_sure else None

    def _end_of_gain(self, side: float) -> float:
        """The largest (side 1) or smallest (-1) motor gain that the readings leave [rad/s^2/A].

        By so many sigmas, and friction not negative.
        """
        widened = max(self._nis, 1.0)
        places = ((_GAIN, _GAIN), (_GAIN, _COULOMB), (_COULOMB, _COULOMB))
        variance, both, coulomb = (widened * float(self._P[place]) for place in places)
        gain, c = side * float(self._x[_GAIN]), float(self._x[_COULOMB])
        freely = gain + _SIGN_SIGMAS * math.sqrt(variance)
        if coulomb <= 0.0:
            return side * freely
        slope = side * both / coulomb
        reach = _SIGN_SIGMAS * math.sqrt(coulomb)
        ends = (max(-reach, -max(c, 0.0)) * slope, reach * slope)
        rest = math.sqrt(max(variance - side * both * slope, 0.0))
        return side * min(freely, gain + max(ends) + _SIGN_SIGMAS * rest)

    def add(self, tick: Tick) -> None:
        """Take one turn of the loop."""
        self.opposite.add(tick.command)
        waiting, self._waiting = self._waiting, None
        if waiting is not None:
            self._add(self._between(waiting.sample, tick.sample), waiting.command)
        if self._leaps(tick.sample):
            self._waiting = tick
        else:
            self._add(tick.sample, tick.command)

    def _leaps(self, sample: WheelSample) -> bool:
        """Whether a reading is farther from the one before than a wheel goes, however wrong a scale may be."""
        last, read = self._last, sample.speed_rad_s
        if last is None or last.speed_rad_s is None or read is None or last.segment != sample.segment:
            return False
        strongest_A = max(abs(self._in_force_A or 0.0), 0.0 if self._command is None else abs(self._command.current_A))
        most = _NO_WHEEL * (self._expected * strongest_A + self._coulomb) * (sample.time_s - last.time_s)
        return abs(read - last.speed_rad_s) > self._at_rest + most

    def _between(self, sample: WheelSample, ahead: WheelSample) -> WheelSample:
        """A sample with the median of its reading and those beside it; without one where none comes behind it."""
        last, read = self._last, sample.speed_rad_s
        if last is None or last.speed_rad_s is None or read is None or ahead.segment != sample.segment:
            return sample
        if ahead.speed_rad_s is None:
            return replace(sample, speed_rad_s=None)
        return replace(sample, speed_rad_s=sorted((last.speed_rad_s, read, ahead.speed_rad_s))[1])

    def _add(self, sample: WheelSample, command: IssuedCommand | None) -> None:
        """Take a reading and the command that followed it."""
        last = self._last
        following, self._command = self._command, command
        if sample.speed_rad_s is None:  # the piece continues over it: the currents are known nevertheless
            if last is not None and following is not None:
                self._current_over(sample.time_s - self._at_s, following)
                self._at_s = sample.time_s
            return
        same = last is not None and sample.segment == last.segment
        dt = sample.time_s - self._at_s
        self._last, self._at_s = sample, sample.time_s
        if not same or last is None or not 0.0 < sample.time_s - last.time_s < LONGEST_STEP_S or following is None:
            self._in_force_A = None
            if same and last is not None:
                self.lost_s += self._T + max(sample.time_s - last.time_s, 0.0)
            self._drop()
            self._from_rad_s = sample.speed_rad_s
            if same and following is not None:
                self._in_force_A = following.current_A
            return
        self._current_over(dt, following)
        whole = sample.time_s - last.time_s
        assert last.speed_rad_s is not None
        speed = 0.5 * (last.speed_rad_s + sample.speed_rad_s)
        self._fastest = max(self._fastest, abs(sample.speed_rad_s))
        self._slowest = min(self._slowest, abs(sample.speed_rad_s), abs(speed))
        self._T += whole
        self._turned += speed * whole
        self._dry += math.copysign(whole, speed)
        if self._T >= PIECE_S - 1.0e-6:
            if not self._known:
                self.lost_s += self._T
            elif self._fastest > self._at_rest:
                self.used_s += self._T
                self._take(sample.speed_rad_s - self._from_rad_s)
            else:
                self.quiet_s += self._T
            self._drop()
            self._from_rad_s = sample.speed_rad_s

    def _current_over(self, dt: float, following: IssuedCommand) -> None:
        """Add the charge of an interval; a command that was not confirmed spoils the piece."""
        before = following.current_A if self._in_force_A is None else self._in_force_A
        late = min(max(following.delay_s, 0.0), max(dt, 0.0))
        self._charge += before * late + following.current_A * (dt - late)
        self._known = self._known and following.acknowledged
        self._in_force_A = following.current_A

    def _drop(self) -> None:
        self._charge = self._turned = self._dry = self._T = 0.0
        self._fastest, self._slowest = 0.0, math.inf
        self._known = True

    def _take(self, change_rad_s: float) -> None:
        """One piece into the regression (eq. 1)."""
        h: Float64Array = np.array([self._charge, -self._turned, -self._dry, self._T])
        c = self._coulomb
        variance = 2.0 * self._step**2 + (_ERROR_SHARE * c * self._T) ** 2
        if self._slowest < self._slow:
            variance += (0.5 * c * self._T) ** 2
        self._P[_OUTSIDE, _OUTSIDE] += (_WANDER_SHARE * c) ** 2 * self._T
        ph = self._P @ h
        spread = float(h @ ph) + variance
        residual = change_rad_s - float(h @ self._x)
        if self.is_known and not self._skipped and residual * residual > _LEAPS**2 * spread * max(self._nis, 1.0):
            self._skipped = True  # a hand, or one wild reading at an end of the piece: no current did that
            return
        self._skipped = False
        gain = ph / spread
        self._x = self._x + gain * residual
        self._P = self._P - np.outer(gain, ph)
        self._P = 0.5 * (self._P + self._P.T)
        self._forget()
        self.pieces += 1
        share = 1.0 / min(float(self.pieces), _INNOVATIONS_KEPT)
        self._nis += share * (residual * residual / spread - self._nis)

    def _forget(self) -> None:
        """Older pieces count less: P grows by exp(T / 30 s), in no direction beyond what it began with."""
        self._P *= math.exp(self._T / _FORGETS_S)
        beyond = np.sqrt(np.minimum(1.0, self._widest / self._P.diagonal()))
        self._P *= np.outer(beyond, beyond)


class OppositeTold:
    """Counts commands that telemetry reported with the other sign; one that it bears out begins anew."""

    def __init__(self) -> None:
        self._running = 0

    def add(self, issued: IssuedCommand | None) -> None:
        """Take what became of a command; a zero has no sign."""
        if issued is not None and issued.reason == OPPOSITE:
            self._running += 1
        elif issued is not None and issued.acknowledged and issued.current_A != 0.0:
            self._running = 0

    @property
    def is_certain(self) -> bool:
        """Whether it has been so for long enough."""
        return self._running >= _FOR_CERTAIN

    @staticmethod
    def text(place: str) -> str:
        """For a person. place: where the scale of what is written stands."""
        return (
            "every current that is commanded is told by telemetry with the opposite sign, so that none counts as "
            "taken: in the wire map the scale of current_command where it is written has the other sign than that "
            f"of the current that is read. Turn the sign of one of the two; what is written stands in {place}"
        )
