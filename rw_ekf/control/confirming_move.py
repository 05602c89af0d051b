"""The small move before a profile: whether a wheel turns the way its wire map says, and about as strongly.

Pulses of one current, forward, back, back, forward, so that the wheel ends about as fast as it began, but for what its
friction takes. The watch over the sign (rw_ekf.watch.sign_watch) decides on what the readings show; the move only
requests currents, which pass the guard like any others.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from rw_ekf.model.state import FrictionParameters
from rw_ekf.records import Controller, RunState, Tick, WheelSample
from rw_ekf.watch.sign_watch import SignWatch

_PULSE_S = 1.0
_LONGEST_PULSE_S = 5.0
_LEAST_READINGS = 2.0  # of a pulse
_MOST_PULSES = 12  # of full length
_BREAKS_AWAY = 2.5  # times the current that the believed friction takes
_SHOWS = 12.0  # noises or steps of a reading by which a pulse changes the speed
_STEPS_UP = 4  # from the first current to the limit
_REACH = 6.0  # times the change that the first pulse should make: the wheel is stronger than that, the pulse is over
_GROWS = 4.0  # noises or steps by which a pulse that should brake may make the wheel faster
_SIDES = (1.0, -1.0, -1.0, 1.0)
_EPSILON_S = 1.0e-6


class MoveLimits(NamedTuple):
    """What the move keeps to, besides what the guard holds back in any case."""

    current_A: float
    slew_A_per_s: float
    speed_rad_s: float
    period_s: float  # between readings
    step_rad_s: float  # of a reading (or noise)


class ConfirmingMove:
    """A commander that moves the wheel until the watch has decided, then leaves it to the profile."""

    phase = "confirming the sign"

    def __init__(
        self,
        profile: Controller,
        watch: SignWatch,
        believed: FrictionParameters,
        limits: MoveLimits,
        over: Callable[[ConfirmingMove], None],
    ) -> None:
        """believed: of the wheel; over: called when the move has ended, before the profile begins."""
        self._profile = profile
        self._watch = watch
        self._limits = limits
        self._over = over
        self._gain = max(abs(believed.motor_gain), 1.0e-12)
        least = max(_BREAKS_AWAY * abs(believed.static), _SHOWS * limits.step_rad_s / _PULSE_S) / self._gain
        self.first_A = self.current_A = min(least, limits.current_A)
        self._factor = max(2.0, (limits.current_A / self.first_A) ** (1.0 / _STEPS_UP))
        self.active = True
        self.lasted_s = 0.0
        self._last: WheelSample | None = None
        self._pulses = 0  # begun so far
        self._since_s = self._side = 0.0  # time in the pulse; its direction
        self._from_rad_s: float | None = None  # speed at its beginning
        self._away = False  # it leads away from the speed limit, if the sign is right
        self._spent = False  # it did not
        self._cut = False  # one of this current was over before its time
        self._at_this_current = self._pieces = 0  # pulses; pieces of the watch when their last pair began

    @property
    def longest_s(self) -> float:
        """How long it can last [s]."""
        return _MOST_PULSES * self._pulse_s

    def __call__(self, tick: Tick) -> float:
        """Return the current [A] to request after this tick's sample."""
        if not self.active:
            return self._profile(tick)
        if tick.state is not None and tick.state.state is RunState.SAFE:
            self._begin_anew()  # only zero is written: nothing that is requested could be seen
            return 0.0
        sample = tick.sample
        if self._last is not None:
            same = sample.segment == self._last.segment
            step_s = max(sample.time_s - self._last.time_s, 0.0) if same else self._limits.period_s
            self.lasted_s += step_s
            self._since_s += step_s
        self._last = sample
        if self._pulses == 0 or self._is_over(sample.speed_rad_s):
            if self._is_decided():
                self.active = False
                self._over(self)
                return self._profile(tick)
            self._begin_pulse(sample.speed_rad_s)
        if self._away and self._is_faster(sample.speed_rad_s):
            self._spent = True
        return 0.0 if self._spent else self._side * self.current_A

    def _begin_anew(self) -> None:
        self._last = None
        self._pulses = self._at_this_current = 0
        self._spent = self._cut = False
        self.current_A = self.first_A

    @property
    def _pulse_s(self) -> float:
        """Length of a pulse [s]: long enough for some readings, and for the slew there and back."""
        rises = 2.0 * self.current_A / self._limits.slew_A_per_s
        return min(max(_PULSE_S, _LEAST_READINGS * self._limits.period_s, rises), _LONGEST_PULSE_S)

    def _change(self, current_A: float) -> float:
        """What a pulse of a current should change the speed by, without friction [rad/s]."""
        return self._gain * current_A * self._pulse_s

    def _is_over(self, speed: float | None) -> bool:
        if self._since_s >= self._pulse_s - _EPSILON_S:
            return True
        if speed is None or self._from_rad_s is None:
            return False
        over = abs(speed - self._from_rad_s) > _REACH * self._change(max(self.first_A, 0.5 * self.current_A))
        self._cut = self._cut or over
        return over

    def _is_faster(self, speed: float | None) -> bool:
        began = self._from_rad_s
        return speed is not None and began is not None and abs(speed) > abs(began) + _GROWS * self._limits.step_rad_s

    def _is_decided(self) -> bool:
        """Whether the move ends here: wrong, at its longest, or after a pair of pulses with nothing left to learn."""
        if self._watch.is_wrong or self._watch.opposite.is_certain or self.lasted_s >= self.longest_s - _EPSILON_S:
            return True
        if self._pulses % 2 == 1 or self._pulses == 0:  # the speed is back only after a pair
            return False
        still = self._watch.pieces == self._pieces
        return self._watch.is_settled or (still and self.current_A >= self._limits.current_A)

    def _begin_pulse(self, speed: float | None) -> None:
        if self._pulses % 2 == 0:
            self._choose_current()
        self._since_s, self._from_rad_s, self._spent = 0.0, speed, False
        self._side = _SIDES[self._pulses % len(_SIDES)]
        near = self._limits.speed_rad_s - 2.0 * self._change(self.current_A)
        self._away = speed is not None and abs(speed) > near
        if self._away and speed is not None:  # brake, coast, brake, coast
            self._side = -math.copysign(1.0, speed) if self._pulses % 2 == 0 else 0.0
        self._pulses += 1

    def _choose_current(self) -> None:
        """More where a pair moved nothing, or two pairs decided nothing; not where the wheel is stronger than known."""
        still = self._pulses > 0 and self._watch.pieces == self._pieces
        if not self._cut and (still or self._at_this_current >= len(_SIDES)):
            self.current_A = min(self.current_A * self._factor, self._limits.current_A)
            self._at_this_current = 0
        self._at_this_current += 2
        self._cut = False
        self._pieces = self._watch.pieces
