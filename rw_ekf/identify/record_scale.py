"""What a record says of itself before any fit: its noise, its scales, and a prior wide enough to start from.

Used where no configuration describes the plant: a foreign machine may be of another size altogether (docs/logs.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array
from rw_ekf.course.course import Course
from rw_ekf.filter.belief import DEFAULT_PRIOR, Belief, prior_around
from rw_ekf.filter.constants import DEFAULT_SPEED_NOISE_RAD_S, FilterConstants, filter_constants
from rw_ekf.identify.command_past import answer_taken_off
from rw_ekf.model.state import CK13_STATISTICAL, FrictionParameters
from rw_ekf.units import RAD_S_PER_RPM

_MAX_ROWS = 200_000
_ANSWER_ROWS = 20_000
STRIBECK_SHARE_OF_TOP_SPEED = 0.02
DEFAULT_STRIBECK_SPEED_RAD_S = 4.0 * RAD_S_PER_RPM
_PRIOR_STD = (0.5, 2.0, 0.75)
GAIN_BAND, COULOMB_BAND = (0.5, 2.0), (0.33, 2.5)  # of [CK13]'s wheel: another of its class lies within
MOST_VISCOUS = 10.0  # likewise: a motor that is fed a voltage brakes itself a thousand times as much
_TELLS_NOTHING = 1.0e3  # condition of current, speed and direction: at constant speed they are one and the same


@dataclass(frozen=True)
class RecordScale:
    """A filter's constants (noises, Stribeck speed), prior, and whether the record looks like the default wheel."""

    constants: FilterConstants
    prior: Belief
    like_default_wheel: bool
    rough: FrictionParameters


def measure(course: Course) -> RecordScale:
    """Read the scales off a record; never raises on poor data, falls back on the default wheel's.

    Rough: where the wheel hardly moves the parameters come out far off, so that a record which does not look like the
    default wheel here may be one nevertheless (`rw_ekf.likelihood.record_noise` decides).
    """
    speed_noise = noise_beside_motion(course)
    rough = rough_parameters(course, speed_noise)
    if rough is None or _like_default(rough, speed_noise):
        return default_scale(speed_noise, course.period_s, rough)
    top = top_speed_of(course)
    sigma = speed_noise or 1.0e-3 * max(top, 1.0e-9)
    return RecordScale(
        filter_constants(
            max(STRIBECK_SHARE_OF_TOP_SPEED * top, sigma),
            speed_noise_rad_s=sigma,
            acceleration_noise=0.1 * sigma,
            scale=rough,
            nominal_period_s=course.period_s,
        ),
        prior_around(rough, _PRIOR_STD),
        False,
        rough,
    )


def top_speed_of(course: Course) -> float:
    """The largest |speed| [rad/s], the hundredth of the readings beyond it left out; some must be finite."""
    return float(np.quantile(np.abs(course.speed_rad_s[np.isfinite(course.speed_rad_s)]), 0.99))


def default_scale(speed_noise: float | None, period_s: float, rough: FrictionParameters | None = None) -> RecordScale:
    """The default wheel's scales, with the readings' own noise [rad/s] where it is known."""
    return RecordScale(
        filter_constants(
            DEFAULT_STRIBECK_SPEED_RAD_S,
            speed_noise_rad_s=speed_noise or DEFAULT_SPEED_NOISE_RAD_S,
            nominal_period_s=period_s,
        ),
        DEFAULT_PRIOR,
        True,
        rough or CK13_STATISTICAL,
    )


def busiest(course: Course, count: int) -> Course:
    """The `count` samples running in which the speed changes most; all where there are fewer."""
    if course.samples <= count:
        return course
    at, _ = most_moved(course.speed_rad_s, count)
    return course.window(at, at + count)


def most_moved(speed_rad_s: Float64Array, count: int) -> tuple[int, float]:
    """Where the `count` samples running begin in which the speed (n,) changes most, and by how much in all [rad/s]."""
    block = max(min(count, speed_rad_s.size) // 20, 1)
    usable = speed_rad_s.size // block * block
    speed = speed_rad_s[:usable].reshape(-1, block)
    read = np.isfinite(speed)
    mean = np.where(read, speed, 0.0).sum(axis=1) / np.maximum(read.sum(axis=1), 1)
    moved = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(mean, prepend=mean[:1])))))
    wide = min(count // block, moved.size - 1)
    way = moved[wide:] - moved[:-wide]
    return int(np.argmax(way)) * block, float(np.max(way))


def noise_beside_motion(course: Course) -> float | None:
    """`speed_noise_of` a course; where that is mostly a motion that is not smooth from row to row, without it.

    A machine that settles within a few rows answers a quick command with third differences of its own. Half: what the
    command's past takes off independent readings is a few in a hundred.
    """
    found = speed_noise_of(course.speed_rad_s, course.segment)
    head = course.window(0, _ANSWER_ROWS)
    third = np.diff(head.speed_rad_s, 3, prepend=(np.nan,) * 3)
    third[1:][np.diff(head.segment) != 0] = np.nan
    taken = None if found is None else answer_taken_off(head, third)
    if found is None or taken is None:
        return found
    apart = 1.4826 * float(np.nanmedian(np.abs(taken))) / math.sqrt(20.0)
    return apart if 0.0 < apart < 0.5 * found else found


def speed_noise_of(speed_rad_s: Float64Array, segment: Int64Array) -> float | None:
    """Standard deviation of one reading from third differences, robust (median); None where nothing varies.

    A third difference of independent readings has variance 20 sigma^2; a smooth motion contributes next to nothing.
    Readings on a lattice may not change for long: then the lattice step d gives d / sqrt(12).
    """
    y = speed_rad_s[:_MAX_ROWS]
    part = segment[:_MAX_ROWS]
    third = _third_differences(y, part)
    if third.size == 0:  # no four rows running have a speed: one in so many has
        y, part = y[np.isfinite(y)], part[np.isfinite(y)]
        third = _third_differences(y, part)
    if third.size == 0:
        return None
    sigma = 1.4826 * float(np.median(np.abs(third))) / np.sqrt(20.0)
    steps = np.abs(np.diff(y))
    steps = steps[np.isfinite(steps) & (steps > 1.0e-9 * np.nanmax(np.abs(y)))]
    if steps.size == 0:
        return None
    if sigma <= 1.0e-9 * float(np.nanmax(np.abs(y))):
        sigma = max(float(np.quantile(steps, 0.1)) / np.sqrt(12.0), float(np.sqrt(np.mean(third**2) / 20.0)) * 0.1)
    return float(sigma)


def _third_differences(y: Float64Array, part: Int64Array) -> Float64Array:
    if y.size < 8:
        return np.zeros(0)
    third = y[3:] - 3.0 * y[2:-1] + 3.0 * y[1:-2] - y[:-3]
    return np.asarray(third[(part[3:] == part[:-3]) & np.isfinite(third)])


def rough_parameters(course: Course, speed_noise: float | None) -> FrictionParameters | None:
    """Regression of speed changes over windows on current, speed and direction integrals; None if it says nothing.

    Integrated over a window the model is linear in k, b, c and needs no differentiated speed; the window is long
    enough for the speed to change by many times its noise.
    """
    sums = window_sums(course, speed_noise)
    if sums is None or not np.any(sums.change):
        return None
    A, change = sums.integrals, sums.change
    if not np.any(A[:, 0]):
        solution = np.concatenate(([CK13_STATISTICAL.motor_gain], np.linalg.lstsq(A[:, 1:], change, rcond=1e-9)[0]))
    else:
        sizes = np.linalg.norm(A, axis=0)
        if not sizes.all() or np.linalg.cond(A / sizes) > _TELLS_NOTHING:
            return None
        solution = np.linalg.lstsq(A, change, rcond=1e-9)[0]
    k, b, c = (float(v) for v in solution)
    if not np.isfinite(solution).all() or k == 0.0:
        return None
    spread = float(np.std(change)) / max(float(np.mean(sums.seconds)), 1e-9)
    c = c if c > 0.0 else 0.1 * spread
    b = b if b > 0.0 else 0.1 * c / sums.top_speed
    return FrictionParameters(k, b, c, 1.03 * c)


@dataclass(frozen=True, eq=False)
class WindowSums:
    """Equation 7 of docs/identification.md over m windows."""

    change: Float64Array  # (m,) of the speed [rad/s]
    integrals: Float64Array  # (m, 3) of current, speed and direction over each, the latter two with a minus
    seconds: Float64Array  # (m,) how long each is
    begin: Int64Array  # (m,) the sample at which each begins, and the one at which it ends
    end: Int64Array
    top_speed: float  # [rad/s]


def window_sums(course: Course, speed_noise: float | None) -> WindowSums | None:
    """The sums of a record's first 200,000 rows; None where there are too few, or nothing turns."""
    course = course.window(0, _MAX_ROWS)
    t, y = course.time_s, course.speed_rad_s
    good = np.isfinite(y)
    if t.size < 20 or not good.any():
        return None
    y = np.interp(np.arange(y.size), np.flatnonzero(good), y[good])
    current = course.mean_current_A[1:]
    dt = np.diff(t)
    top = float(np.quantile(np.abs(y), 0.99))
    if not top > 0.0:
        return None
    lag = _window(y, speed_noise or 1e-3 * top)
    turning = _turning(y, speed_noise or 0.0, 0.02 * top)
    moving = np.where(turning, np.sign(y), 0.0)
    middle = 0.5 * (y[1:] + y[:-1])
    direction = 0.5 * (moving[1:] + moving[:-1])
    # A wheel at rest does not answer to its current: intervals at rest count on neither side.
    same = (course.segment[1 : t.size] == course.segment[: t.size - 1]) & (dt > 0.0) & turning[1:] & turning[:-1]
    sums = [np.concatenate(([0.0], np.cumsum(np.where(same, v * dt, 0.0)))) for v in (current, middle, direction)]
    begin = np.arange(0, t.size - lag, max(1, lag // 4))
    end = begin + lag
    begin, end = (v[course.segment[end] == course.segment[begin]] for v in (begin, end))
    if begin.size < 8:
        return None
    A = np.column_stack([s[end] - s[begin] for s in sums]) * np.array([1.0, -1.0, -1.0])
    return WindowSums(y[end] - y[begin], A, t[end] - t[begin], begin, end, top)


def _turning(y: Float64Array, noise: float, least: float) -> BoolArray:
    """Where the wheel turns beyond doubt, (n,): a running mean of the readings is far from zero in its own noise."""
    wide = 9
    total = np.concatenate(([0.0], np.cumsum(np.pad(y, wide // 2, mode="edge"))))
    mean = (total[wide:] - total[:-wide]) / wide
    return np.asarray(np.abs(mean) > max(least, 5.0 * noise / np.sqrt(wide)))


def _window(y: Float64Array, noise: float) -> int:
    """Samples in a window over which the speed typically changes by 30 times its noise, at most a twentieth of all."""
    lag = 1
    while lag < y.size // 20 and float(np.median(np.abs(y[lag:] - y[:-lag]))) < 30.0 * noise:
        lag *= 2
    return lag


def _like_default(rough: FrictionParameters, speed_noise: float | None) -> bool:
    """Within a factor of about two of [CK13]'s wheel in gain and Coulomb friction, and of its kind in noise."""
    k, b, c, _ = CK13_STATISTICAL
    gain = GAIN_BAND[0] < rough.motor_gain / k < GAIN_BAND[1]
    friction = COULOMB_BAND[0] < rough.coulomb / c < COULOMB_BAND[1] and rough.viscous < MOST_VISCOUS * b
    noise = speed_noise is None or 0.05 * RAD_S_PER_RPM < speed_noise < 30.0 * RAD_S_PER_RPM
    return gain and friction and noise
