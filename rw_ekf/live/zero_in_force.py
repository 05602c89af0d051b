"""Whether a zero that was written is in force: read back, measured, and seen in the motion; not acknowledged alone.

Where telemetry reports neither a command nor a current, the motion is all there is: a wheel that turns must slow down,
and, where its friction is known, as its friction slows it,

    a_left = R(v) - d,    sd^2 = sd(R)^2 + sd(d)^2                                                              (1)

with the deceleration d of the readings and what was believed of the friction before the zero. Beyond three sd of it
something else turns or brakes the wheel. Within, it is zero as far as it matters where a_left + 2 sd is less than what
breaks the wheel loose: what may be left lets it come to rest. Else the motion does not decide.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from rw_ekf.numbers import plus_minus
from rw_ekf.records import WheelSample

_LOOKS = 5  # readings that count
_AGAINST = 3  # of them: one wild number contradicts nothing
_COUNT_A = 2.0e-4
_LIMIT_SHARE = 0.02  # of limits.current_A: what an amplifier may be off zero
_GROWS = 6.0  # steps of a reading by which no wheel speeds up without a current, and below which it may stand still
_SURE = 3.0  # standard deviations by which the second half of the readings is slower than the first; of eq. 1
_MAY = 2.0  # standard deviations that what is left may be larger
COURSE = 30  # readings: 3 s of 1 rpm of noise show .08 rad/s^2, a seventh of [CK13]'s dry friction


Slowing = Callable[[float], tuple[float, float] | None]


class _Left(NamedTuple):
    """What else than its friction acts on a wheel that turns (eq. 1) [rad/s^2]."""

    slows: float  # d
    slows_std: float
    friction: float | None = None  # R, and its sd; None: not known
    friction_std: float = 0.0
    breakaway: float = 0.0  # at least

    @property
    def left(self) -> float:
        return 0.0 if self.friction is None else self.friction - self.slows

    @property
    def std(self) -> float:
        return math.hypot(self.slows_std, self.friction_std)

    @property
    def is_reported(self) -> bool:
        """Whether what may be left lets the wheel come to rest."""
        return self.friction is not None and abs(self.left) + _MAY * self.std < self.breakaway

    @property
    def against(self) -> str | None:
        """What speaks against a current of zero."""
        if self.friction is None or abs(self.left) <= _SURE * self.std:
            return None
        by = plus_minus(self.friction, self.friction_std)
        return (
            f"telemetry tells no current, and the wheel slows down by {self.slows:.3g} rad/s^2 where its friction "
            f"alone slows it by {by}"
        )


class ZeroSight:
    """Takes the readings that follow a zero."""

    def __init__(self, limit_A: float, speed_step_rad_s: float, slowing: Slowing) -> None:
        """limit_A: limits.current_A. speed_step_rad_s: noise or resolution of a reading, whichever is larger.

        slowing: the friction at a speed as it was believed before the zero, with its sigma [rad/s^2]; None: not known.
        """
        self._tolerance_A = _LIMIT_SHARE * limit_A + _COUNT_A
        self._step = speed_step_rad_s
        self._growth = _GROWS * speed_step_rad_s
        self._slowing = slowing
        self.begin()

    def begin(self) -> None:
        """A zero is written anew, or by another way."""
        self.readings = 0
        self._reported: deque[float] = deque(maxlen=_LOOKS)
        self._measured: deque[float] = deque(maxlen=_LOOKS)
        self._speeds: deque[float] = deque(maxlen=_AGAINST)
        self._course: deque[tuple[float, float]] = deque(maxlen=COURSE)  # time and speed
        self._segment: int | None = None
        self._least: float | None = None
        self._grew = 0.0

    def add(self, sample: WheelSample) -> None:
        """Take a reading."""
        self.readings += 1
        if sample.current_command_A is not None:
            self._reported.append(sample.current_command_A)
        if sample.current_A is not None:
            self._measured.append(sample.current_A)
        if sample.speed_rad_s is not None:
            self._speeds.append(abs(sample.speed_rad_s))
            if sample.segment != self._segment:  # its time may start anew
                self._segment = sample.segment
                self._course.clear()
            self._course.append((sample.time_s, self._speeds[-1]))
            if len(self._speeds) == _AGAINST:
                middle = sorted(self._speeds)[_AGAINST // 2]
                self._least = middle if self._least is None else min(self._least, middle)
                self._grew = middle - self._least

    @property
    def is_open(self) -> bool:
        """Whether the motion alone could show a zero, the wheel turns, and does not show it yet."""
        left = self._left()
        if left is None or left.is_reported:
            return False
        full = len(self._course) == COURSE  # that its friction is not known well enough is known then
        return left.slows < _SURE * left.slows_std or (left.friction is not None and not full)

    @property
    def is_unreported(self) -> bool:
        """Whether telemetry reports neither a command nor a current."""
        return not self._reported and not self._measured

    @property
    def rests(self) -> bool:
        """Whether it may be at rest, or by its motion comes to rest, whatever may be left on (eq. 1)."""
        left = self._left()
        return left is None or left.is_reported

    @property
    def goes_on(self) -> str | None:
        """That it continued as fast for all of COURSE, or not as its friction has it, in words; None: not known to."""
        left = self._left()
        if left is None:
            return None
        if len(self._course) == COURSE and self.is_open:
            return "telemetry tells no current, and the wheel goes on turning as fast"
        return left.against

    def _left(self) -> _Left | None:
        """Eq. 1; None where telemetry reports a current, or the wheel may be at rest, or too little is known yet."""
        half, course = len(self._course) // 2, list(self._course)
        turns = len(self._speeds) == _AGAINST and min(self._speeds) > self._growth
        if not self.is_unreported or half == 0 or self._step == 0.0 or not turns:
            return None
        (early_s, fast), (late_s, slow) = (_mean(part) for part in (course[:half], course[-half:]))
        if not late_s > early_s:
            return None
        slows = (fast - slow) / (late_s - early_s)
        off = (speed - slow + slows * (time_s - late_s) for time_s, speed in course)
        noise = max(self._step, math.sqrt(sum(one * one for one in off) / len(course)))
        slows_std = noise * math.sqrt(2.0 / half) / (late_s - early_s)
        friction, rest = self._slowing(0.5 * (fast + slow)), self._slowing(0.0)
        if friction is None or rest is None or rest[0] < _MAY * (rest[1] + friction[1]):  # no motion could show it
            return _Left(slows, slows_std)
        return _Left(slows, slows_std, *friction, rest[0] - _MAY * rest[1])

    @property
    def against(self) -> str | None:
        """What speaks against it, in words; None where nothing does."""
        reported = [value for value in self._reported if abs(value) > _COUNT_A]
        if len(reported) >= _AGAINST:
            return f"telemetry says that {reported[-1]:.4g} A is commanded"
        measured = [value for value in self._measured if abs(value) > self._tolerance_A]
        if len(measured) >= _AGAINST:
            return f"{measured[-1]:.4g} A is measured"
        return "the wheel goes on speeding up" if self._grew > self._growth > 0.0 else None


def _mean(course: list[tuple[float, float]]) -> tuple[float, float]:
    return sum(time_s for time_s, _ in course) / len(course), sum(speed for _, speed in course) / len(course)
