"""Whether a zero that was written is in force: read back, measured, and seen in the motion; not acknowledged alone.

Where telemetry tells neither a command nor a current, the motion is all there is: a wheel that turns must slow down.
"""

from __future__ import annotations

import math
from collections import deque

from rw_ekf.records import WheelSample

_LOOKS = 5  # readings that count
_AGAINST = 3  # of them: one wild number contradicts nothing
_COUNT_A = 2.0e-4
_LIMIT_SHARE = 0.02  # of limits.current_A: what an amplifier may be off zero
_GROWS = 6.0  # steps of a reading by which no wheel speeds up without a current, and below which it may stand still
_SURE = 3.0  # standard deviations by which the second half of the readings is slower than the first
COURSE = 30  # readings: 3 s of 1 rpm of noise show .08 rad/s^2, a seventh of [CK13]'s dry friction


class ZeroSight:
    """Takes the readings that follow a zero."""

    def __init__(self, limit_A: float, speed_step_rad_s: float) -> None:
        """limit_A: limits.current_A. speed_step_rad_s: noise or resolution of a reading, whichever is larger."""
        self._tolerance_A = _LIMIT_SHARE * limit_A + _COUNT_A
        self._step = speed_step_rad_s
        self._growth = _GROWS * speed_step_rad_s
        self.begin()

    def begin(self) -> None:
        """A zero is written anew, or by another way."""
        self.readings = 0
        self._told: deque[float] = deque(maxlen=_LOOKS)
        self._measured: deque[float] = deque(maxlen=_LOOKS)
        self._speeds: deque[float] = deque(maxlen=_AGAINST)
        self._course: deque[float] = deque(maxlen=COURSE)
        self._least: float | None = None
        self._grew = 0.0

    def add(self, sample: WheelSample) -> None:
        """Take a reading."""
        self.readings += 1
        if sample.current_command_A is not None:
            self._told.append(sample.current_command_A)
        if sample.current_A is not None:
            self._measured.append(sample.current_A)
        if sample.speed_rad_s is not None:
            self._speeds.append(abs(sample.speed_rad_s))
            self._course.append(self._speeds[-1])
            if len(self._speeds) == _AGAINST:
                middle = sorted(self._speeds)[_AGAINST // 2]
                self._least = middle if self._least is None else min(self._least, middle)
                self._grew = middle - self._least

    @property
    def is_open(self) -> bool:
        """Whether the motion alone could tell a zero, the wheel turns, and it has not slowed down yet."""
        half, course = len(self._course) // 2, list(self._course)
        if self._told or self._measured or half == 0 or self._step == 0.0:
            return False
        slowed = (sum(course[:half]) - sum(course[-half:])) / half
        return sum(course) > len(course) * self._growth and slowed < _SURE * self._step * math.sqrt(2.0 / half)

    @property
    def goes_on(self) -> str | None:
        """That it went on as fast for all of COURSE, in words; None where it did not, or is not known to."""
        if len(self._course) < COURSE or not self.is_open:
            return None
        return "telemetry tells no current, and the wheel goes on turning as fast"

    @property
    def against(self) -> str | None:
        """What speaks against it, in words; None where nothing does."""
        told = [value for value in self._told if abs(value) > _COUNT_A]
        if len(told) >= _AGAINST:
            return f"telemetry says that {told[-1]:.4g} A is commanded"
        measured = [value for value in self._measured if abs(value) > self._tolerance_A]
        if len(measured) >= _AGAINST:
            return f"{measured[-1]:.4g} A is measured"
        return "the wheel goes on speeding up" if self._grew > self._growth > 0.0 else None
