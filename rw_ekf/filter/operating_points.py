"""Where a wheel has been: readings sorted into buckets by speed and by drive, and what such a motion can show at all.

At one speed and one current the readings determine k I - b omega - c and nothing else, however small the filter's
sigmas have become with the help of its prior. Two speeds separate b from c, two drives (or a coast) k from both, and
only a stop or creep shows break-away friction. A bucket counts once it holds twenty used readings.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.course.course import Course
from rw_ekf.model.friction import CREEP_STRIBECK_SPEEDS
from rw_ekf.model.state import FrictionParameters
from rw_ekf.records import ParameterFlags

_ENOUGH = 20  # used readings in a bucket
_APART = 2  # buckets: neighbours may hold two sides of one edge
_PER_OCTAVE = 4.0
_COASTS = 0.25  # of the current that overcomes Coulomb friction: as good as none
_PAUSE = 3  # readings in creep that make a stop of it
_NO_CURRENT_A = 1.0e-6


@dataclass
class OperatingPoints:
    """Counts of used readings; nothing grows with the length of a run.

    Buckets are a quarter of an octave wide: speeds from three Stribeck speeds on; currents from a quarter of the one
    that overcomes Coulomb friction, as the start has it, above zero where it drives and below where it brakes.
    """

    creep_rad_s: float
    unit_A: float
    speeds: Counter[int] = field(default_factory=Counter)
    drives: Counter[int] = field(default_factory=Counter)
    creeping: int = 0  # used readings below three Stribeck speeds
    starts: int = 0  # out of creep, after a stop or the other way round than into it
    _way: int = 0  # of the last reading beyond creep
    _pause: int = 0  # readings in creep since
    _shown: ParameterFlags | None = None  # where no bucket has filled since the last request

    @classmethod
    def of_wheel(cls, start: FrictionParameters, stribeck_speed_rad_s: float) -> OperatingPoints:
        """Empty buckets for a wheel that is believed to be like `start`."""
        unit = abs(start.coulomb) / max(abs(start.motor_gain), 1.0e-12)
        return cls(CREEP_STRIBECK_SPEEDS * stribeck_speed_rad_s, max(unit, _NO_CURRENT_A))

    def add(self, speed_rad_s: float, current_A: float) -> None:
        """Count a used reading under the current that was in force."""
        if abs(speed_rad_s) < self.creep_rad_s:
            self.creeping += 1
            self._pause += 1
            if self.creeping == _ENOUGH:
                self._shown = None
            return
        way = 1 if speed_rad_s > 0.0 else -1
        if self._way == -way or self._pause >= _PAUSE:
            self.starts += 1
            self._shown = None
        self._way, self._pause = way, 0
        octave = int(_PER_OCTAVE * math.log2(abs(speed_rad_s) / self.creep_rad_s))
        strength = int(_PER_OCTAVE * math.log2(max(abs(current_A) / self.unit_A, _COASTS) / _COASTS))
        drive = strength if way * current_A > 0.0 else -strength
        self.speeds[octave] += 1
        self.drives[drive] += 1
        if self.speeds[octave] == _ENOUGH or self.drives[drive] == _ENOUGH:
            self._shown = None

    def add_all(self, speed_rad_s: Float64Array, current_A: Float64Array) -> None:
        """Count used readings, (n,) each, in order of time; none where all has been shown already."""
        if all(self.shown):
            return
        slides: BoolArray = np.abs(speed_rad_s) >= self.creep_rad_s
        self.creeping += int(np.count_nonzero(~slides))
        self._shown = None
        at = np.flatnonzero(slides)
        if at.size == 0:
            self._pause += speed_rad_s.size
            return
        ways = np.where(speed_rad_s[at] > 0.0, 1, -1)
        before = np.concatenate([[self._way], ways[:-1]])
        pauses = np.diff(at, prepend=-1) - 1
        pauses[0] += self._pause
        self.starts += int(np.count_nonzero(((ways != before) & (before != 0)) | (pauses >= _PAUSE)))
        self._way, self._pause = int(ways[-1]), int(speed_rad_s.size - 1 - at[-1])
        octaves = (_PER_OCTAVE * np.log2(np.abs(speed_rad_s[at]) / self.creep_rad_s)).astype(np.int64)
        strengths = np.maximum(np.abs(current_A[at]) / self.unit_A, _COASTS) / _COASTS
        strengths = (_PER_OCTAVE * np.log2(strengths)).astype(np.int64)
        for counter, values in (
            (self.speeds, octaves),
            (self.drives, np.where(ways * current_A[at] > 0.0, strengths, -strengths)),
        ):
            least = int(values.min())
            counts = np.bincount(values - least)  # some hundred buckets at most: no need to sort
            found = np.flatnonzero(counts)
            counter.update(dict(zip((found + least).tolist(), counts[found].tolist(), strict=True)))

    @classmethod
    def of_course(
        cls, course: Course, start: FrictionParameters, stribeck_speed_rad_s: float, used: BoolArray
    ) -> OperatingPoints:
        """Those of a log's used readings (n,)."""
        found = cls.of_wheel(start, stribeck_speed_rad_s)
        found.add_course(course, used)
        return found

    def add_course(self, course: Course, used: BoolArray) -> None:
        """Count the used readings (n,) of a log, or of a part of one."""
        currents = course.pieces.current_A
        if currents.size:
            held = np.minimum(np.maximum(course.piece_start - 1, course.first_piece), currents.size - 1)
            self.add_all(course.speed_rad_s[used], currents[held[used]])

    def clear(self) -> None:
        """Begin anew: what was seen was of another wheel."""
        self.speeds.clear()
        self.drives.clear()
        self.creeping = self.starts = self._way = self._pause = 0
        self._shown = None

    @property
    def shown(self) -> ParameterFlags:
        """Which parameters such a motion can show."""
        if self._shown is None:
            speeds, drives = _filled(self.speeds), _filled(self.drives)
            two_speeds = bool(speeds) and max(speeds) - min(speeds) >= _APART
            two_drives = bool(drives) and max(drives) - min(drives) >= _APART
            self._shown = ParameterFlags(
                motor_gain=two_drives,
                viscous=two_speeds,
                coulomb=two_speeds and (two_drives or 0 in drives),
                static=self.starts > 0 or (self.creeping >= _ENOUGH and bool(speeds)),
            )
        return self._shown


def _filled(counts: Counter[int]) -> list[int]:
    return [bucket for bucket, count in counts.items() if count >= _ENOUGH]
