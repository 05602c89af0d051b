"""The integrated equation of motion held against a log, as it is read and as it might be read in another way."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.course.course import Course
from rw_ekf.identify.record_scale import WindowSums
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.units import RAD_S_PER_RPM

# Of the square sum of the changes, what the equation leaves. Simulated healthy machines of six sizes leave up to .05,
# measured ones .01 to .07 (a motor that settles within rows .30, a pendulum .98: no other reading is better),
# misread ones .2 to 1 as they stand (exchanged columns from .09, gain below zero) and below .06 when read rightly. With
# each number of this block 30 % more or less, no healthy log is accused; 1.17 for _TOWARD, a share, misses.
LEFT_OVER, EXPLAINED, BETTER = 0.15, 0.1, 4.0
GAIN_COUNTS = 4.0  # times as much is left without the current: then its gain has a sign
_TOWARD = 0.9  # of the windows in which speed and set-point differ; of a current it is about half
_LOOP = 0.02  # by which the gain of a loop may differ from its rate: a standing set-point is reached
_LOOP_FRICTION = 0.1  # of the drive at top speed: a speed loop's integral hides the friction


@dataclass(frozen=True)
class Reading:
    """Equation 7 solved: gain, viscous and Coulomb friction, what is left of the changes, and left without a gain."""

    gain: float
    viscous: float
    coulomb: float
    left: float
    without_gain: float
    viscous_std: float

    @classmethod
    def of(cls, change: Float64Array, integrals: Float64Array) -> Reading:
        """Solve for the columns that are not zero throughout."""
        sizes = np.linalg.norm(integrals, axis=0)
        used = sizes > 0.0
        total = float(change @ change) or 1.0
        solution, covariance = np.zeros(3), np.zeros((3, 3))
        A = integrals[:, used] / sizes[used]
        solution[used] = np.linalg.lstsq(A, change, rcond=1e-9)[0] / sizes[used]
        residual = change - integrals @ solution
        without = change - integrals[:, 1:] @ np.linalg.lstsq(integrals[:, 1:], change, rcond=1e-9)[0]
        # A window overlaps three others.
        covariance[np.ix_(used, used)] = 4.0 * float(np.mean(residual**2)) * np.linalg.pinv(A.T @ A)
        viscous_std = math.sqrt(max(float(covariance[1, 1]), 0.0)) / (float(sizes[1]) or 1.0)
        left = max(float(residual @ residual), 1e-12 * total)
        gain, viscous, coulomb = (float(v) for v in solution)
        return cls(gain, viscous, coulomb, left / total, float(without @ without) / left, viscous_std)

    def friction(self, top_speed: float) -> float:
        """At half the top speed, per unit inertia: below zero for no machine."""
        return 0.5 * self.viscous * top_speed + self.coulomb

    def is_machine(self, top_speed: float) -> bool:
        """Whether the equation holds, with the signs of a machine."""
        return self.left < EXPLAINED and self.gain > 0.0 and self.friction(top_speed) > 0.0


def exchanged(log: WheelLog) -> Course:
    """The log with its speed in the place of its current, and the other way round."""
    speed = np.where(np.isfinite(log.speed_rad_s), log.speed_rad_s, 0.0)
    return Course.of(log.time_s, np.array(log.current_A), speed, None, log.segment)


def between_steps(log: WheelLog, sums: WindowSums) -> WindowSums:
    """The windows in which the drive does not step, where most do not: its direction may change with a step."""
    steps = np.cumsum(np.abs(np.diff(log.current_A, prepend=log.current_A[:1])) > 0.05 * np.ptp(log.current_A))
    whole = steps[sums.begin] == steps[sums.end]
    if float(np.mean(whole)) < 0.3:
        return sums
    return replace(sums, change=sums.change[whole], integrals=sums.integrals[whole])


def between_rests(course: Course, top: float, noise: float) -> Int64Array:
    """Number of the stretch that each sample (n,) is in, from 1, a new one after each passage through rest; 0: slow."""
    slow = np.abs(np.nan_to_num(course.speed_rad_s)) < max(0.04 * top, 5.0 * noise)
    number = np.cumsum(np.diff(slow, prepend=True) & ~slow)
    return np.where(slow, 0, number).astype(np.int64)


def signed_by(groups: Int64Array, sums: WindowSums) -> Reading:
    """Solve with a sign of the current for each group of windows (m,), found by turns with the parameters.

    Begun with the sign of what the speed does, and with its own: a machine that settles at once hardly accelerates.
    """
    change, A = sums.change, sums.integrals
    _, group = np.unique(groups, return_inverse=True)
    found = []
    for start in (A[:, 0] * change, -A[:, 0] * A[:, 1]):
        sign = np.where(np.bincount(group, start) < 0.0, -1.0, 1.0)
        for _ in range(20):
            read = Reading.of(change, A * np.column_stack((sign[group], np.ones((change.size, 2)))))
            rest = change - read.viscous * A[:, 1] - read.coulomb * A[:, 2]
            better = np.where(np.bincount(group, rest * A[:, 0] * read.gain) < 0.0, -1.0, 1.0)
            if np.array_equal(better, sign):
                break
            sign = better
        found.append(read)
    return min(found, key=lambda read: read.left)


def is_set_point(sums: WindowSums, read: Reading) -> bool:
    """Whether the speed goes where the "current" says, in one of a speed's units, whenever it is not there.

    Either as a loop of first order does, whose gain is its rate, or in whatever way: always toward it.
    """
    for unit in (1.0, RAD_S_PER_RPM, 1.0 / RAD_S_PER_RPM):
        if read.is_machine(sums.top_speed):
            small = abs(read.coulomb) < _LOOP_FRICTION * read.viscous * sums.top_speed
            sure = read.viscous > 10.0 * read.viscous_std
            if small and sure and abs(read.gain / (unit * read.viscous) - 1.0) < _LOOP:
                return True
            continue
        wanted, speed = unit * sums.integrals[:, 0] / sums.seconds, -sums.integrals[:, 1] / sums.seconds
        if not 0.5 < float(np.quantile(np.abs(wanted), 0.95)) / sums.top_speed < 2.0:
            continue
        away = np.abs(wanted - speed) > 0.1 * sums.top_speed
        toward = (wanted - speed)[away] * sums.change[away] > 0.0
        up = float(np.mean(sums.change[away] > 0.0)) if away.any() else 0.0
        if int(away.sum()) > 20 and 0.1 < up < 0.9 and float(np.mean(toward)) > _TOWARD:
            return True
    return False
