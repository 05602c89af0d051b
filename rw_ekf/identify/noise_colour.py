"""Whether the noise of one reading carries over into the next: the mark of a filter in the sensor or in the logger.

Everything else takes the readings' noises for independent. Where they are not, a wheel seems to give way and to spring
back, as on a bristle, and every sigma is too small by the root of the readings that say the same. Differences of
readings,

    S(w) = q dt + R |1 - exp(-i w)|^2 C(w),                                    w: radians a reading,

have the torque noise as their floor and the reading noise above it; C is 1 where readings are independent,
(1 - a^2) / |1 - a exp(-i w)|^2 behind a low-pass of first order and |sum of exp(-i w k), k < N|^2 / N behind a mean of
the last N readings. Which of them the spectrum has is tested on stretches in which the wheel keeps its direction, less
what the current does, by their median: a step that a model lacks is in few of them. A filter that is found must show as
well in what does not follow the command's past: a machine that settles within a few rows and a command that acts late
leave differences of much the same spectrum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.course.course import Course
from rw_ekf.course.grid import grid_of
from rw_ekf.identify.command_past import answer_taken_off
from rw_ekf.identify.record_scale import noise_beside_motion, rough_parameters

_SAMPLES = 40_000
_BLOCK = 128  # readings of a stretch
_LOWEST = 3  # of its frequencies: below, what a wheel does and the model does not know
_FEWEST_BLOCKS, _MOST_BLOCKS = 8, 200
_COARSE = 2.0  # noises: rounding to a grid is noise of 0.29 of it
_MOVING = 8.0  # speed noises: slower, friction changes with the speed
_STRIDES = (1, 4, 16, 64)  # readings a step: a slow filter shows in every so many
_NEIGHBOURS = 1.5  # frequencies that count as one, of Hann's window
_CLEARLY = 12.0  # by which chi-square falls; independent readings reach 9
_LITTLE = 0.1  # of the noise behind a slow filter is between neighbouring readings
_INDEPENDENT = 0.1  # correlation of two noises that is none
_LOW_PASS = np.arange(0.15, 0.96, 0.05)  # a
_MEANS = range(2, 9)  # N
_TURNS, _STEP, _DAMPING = 25, 2.0, 1.0e-3
_TOP = 12  # highest frequencies
_LEAKS = 1.0e-4  # of a power, into the frequencies beside it


@dataclass(frozen=True)
class NoiseColour:
    """The filter whose noise the readings have."""

    seconds: float  # its time constant, or what the mean is over
    running_mean: bool
    stride: int  # readings so far apart are independent

    def walking(self, first_row: int, rows: int) -> BoolArray:
        """One row in `stride` (rows,), and after as many a row later: never in step with a command that has a clock."""
        place = (first_row + np.arange(rows)) % (self.stride * self.stride + 1)
        kept: BoolArray = (place % self.stride == 0) & (place < self.stride * self.stride)
        return kept

    @property
    def sentence(self) -> str:
        """What was seen and what was done about it."""
        passed = "a mean over" if self.running_mean else "a low-pass of"
        return (
            f"the readings' noise goes on from one reading to the next, as behind {passed} {self.seconds:.2g} s in the "
            f"sensor or the logger: one reading in {self.stride} says something new and was looked at. A lag, a delay "
            "or an average that is found is then that filter's, not the actuator's"
        )


def independent_readings(course: Course) -> tuple[Course, NoiseColour | None]:
    """The course with so many readings left out that the noises of those left are independent; None: all are."""
    speed_noise = noise_beside_motion(course)
    if speed_noise is None or _is_rounding(course.speed_rad_s, speed_noise):
        return course, None
    colour = noise_colour(course, speed_noise)
    if colour is None:
        return course, None
    return course.only(colour.walking(0, course.samples)), colour


def _is_rounding(speed_rad_s: Float64Array, speed_noise_rad_s: float) -> bool:
    """Whether most of the noise is that of a grid: a slow wheel stays in its cell, and no filter is behind that."""
    grid = grid_of(speed_rad_s)
    return grid is not None and grid > _COARSE * speed_noise_rad_s


def noise_colour(course: Course, speed_noise_rad_s: float) -> NoiseColour | None:
    """The filter that the readings' noise shows; None where they are independent, or where that is unknown."""
    part = course.window(0, min(course.samples, _SAMPLES))
    rough, independent = rough_parameters(part, speed_noise_rad_s), math.inf
    if rough is None:
        return None
    for stride in _STRIDES:
        spectra = _spectra(part, rough.motor_gain, speed_noise_rad_s, stride)
        if spectra.shape[0] < _FEWEST_BLOCKS:
            break
        found, variance = _explained(spectra, stride, course.period_s)
        if found is not None:
            alone = _spectra(part, rough.motor_gain, speed_noise_rad_s, stride, answer_off=True)
            if alone.shape[0] >= _FEWEST_BLOCKS:
                found, variance = _explained(alone, stride, course.period_s)
            if found is None:
                return None
            # Behind a slow filter neighbouring readings are all but the same: what is between them is no noise of its.
            return found if stride == 1 or independent < _LITTLE * variance else None
        independent = min(independent, variance)
    return None


def _spectra(
    course: Course, motor_gain: float, speed_noise_rad_s: float, stride: int, *, answer_off: bool = False
) -> Float64Array:
    """Power of the differences of every `stride`-th reading, (stretches, _BLOCK / 2 + 1).

    answer_off: of what does not follow the command's past; no stretch where that cannot be determined.
    """
    speed, usual_s = course.speed_rad_s[::stride], stride * course.period_s
    step_s = np.diff(course.time_s[::stride], prepend=np.nan)
    follows = (np.abs(step_s - usual_s) < 0.5 * usual_s) & (np.diff(course.segment[::stride], prepend=-1) == 0)
    moving = np.where(np.abs(speed) > _MOVING * speed_noise_rad_s, np.sign(speed), 0.0)
    charge = np.cumsum(course.mean_current_A * np.diff(course.time_s, prepend=course.time_s[:1]))
    coasting = np.diff(speed - motor_gain * charge[::stride], prepend=np.nan)
    steady = follows & (moving * np.roll(moving, 1) > 0.0)
    if answer_off:
        apart = np.full(course.samples, np.nan)
        apart[::stride] = np.where(steady, coasting, np.nan)
        taken = answer_taken_off(course, apart)
        if taken is None:
            return np.zeros((0, _BLOCK // 2 + 1))
        coasting, steady = taken[::stride], steady & np.isfinite(taken[::stride])
    ramp, taper = np.arange(_BLOCK) - 0.5 * _BLOCK, np.hanning(_BLOCK + 2)[1:-1]
    found: list[Float64Array] = []
    for first in _starts(steady):
        here = slice(first, first + _BLOCK)
        basis, _ = np.linalg.qr(np.column_stack((step_s[here], step_s[here] * ramp)))
        left = coasting[here] - basis @ (basis.T @ coasting[here])
        found.append(np.abs(np.fft.rfft(left * taper)) ** 2 / float(taper @ taper))
    return np.array(found).reshape(-1, _BLOCK // 2 + 1)


def _starts(good: BoolArray) -> list[int]:
    """Where whole stretches of good differences begin, none over another; at most so many."""
    edges = np.append(np.flatnonzero(~good), good.size)
    starts = [first for begin, end in pairwise(edges) for first in range(int(begin) + 1, int(end) - _BLOCK + 1, _BLOCK)]
    return starts[:: max(1, -(-len(starts) // _MOST_BLOCKS))]


def _explained(spectra: Float64Array, stride: int, period_s: float) -> tuple[NoiseColour | None, float]:
    """The filter that explains the spectra clearly better than independent readings do, if any, and the noise's R."""
    middle = math.log(2.0)  # of the exponential distribution that a power has
    power = np.median(spectra[:, _LOWEST:-1], axis=0) / middle
    if not np.all(power > 0.0):
        return None, math.inf
    at = 2.0 * math.pi * np.arange(_LOWEST, _BLOCK // 2) / _BLOCK
    variance = _NEIGHBOURS / (spectra.shape[0] * middle**2)
    wave = np.exp(-1j * at)
    low_pass = [(1.0 - a * a) / np.abs(1.0 - a * wave) ** 2 for a in _LOW_PASS]
    means = [np.abs(np.sum(wave ** np.arange(n)[:, None], axis=0)) ** 2 / n for n in _MEANS]
    colours = np.array([np.ones(at.size), *low_pass, *means])
    misfit, R = _fitted(np.log(power), np.abs(1.0 - wave) ** 2 * colours)
    chi_square = misfit / variance
    best = int(np.argmin(chi_square))
    if chi_square[0] - chi_square[best] < _CLEARLY:
        return None, float(R[0])
    if best > len(low_pass):
        readings = apart = float(_MEANS[best - 1 - len(low_pass)])
    else:
        a = float(_LOW_PASS[best - 1])
        readings, apart = -1.0 / math.log(a), math.log(_INDEPENDENT) / math.log(a)
    found = NoiseColour(
        seconds=stride * readings * period_s,
        running_mean=best > len(low_pass),
        stride=stride * math.ceil(apart),
    )
    return found, float(R[best])


def _fitted(logs: Float64Array, shapes: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Sums of squares of logs (m,) less those of R shapes (k, m) + q at the best R and q of each, and R: (k,) twice."""
    shapes = np.log(np.maximum(shapes, _LEAKS))
    R = np.median(logs[-_TOP:] - shapes[0, -_TOP:]) * np.ones(shapes.shape[0])
    q = np.full(shapes.shape[0], logs[: _TOP // 2].min())
    for _ in range(_TURNS):
        model = np.logaddexp(R[:, None] + shapes, q[:, None])
        left = logs - model
        u = np.exp(R[:, None] + shapes - model)  # share of the reading noise
        v = 1.0 - u
        uu, uv, vv = (u * u).sum(1) + _DAMPING, (u * v).sum(1), (v * v).sum(1) + _DAMPING
        by_R, by_q = (u * left).sum(1), (v * left).sum(1)
        det = uu * vv - uv * uv
        R = R + np.clip((vv * by_R - uv * by_q) / det, -_STEP, _STEP)
        q = q + np.clip((uu * by_q - uv * by_R) / det, -_STEP, _STEP)
    left = logs - np.logaddexp(R[:, None] + shapes, q[:, None])
    return (left * left).sum(1), np.exp(R)
