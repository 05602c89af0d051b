"""What readings are worth while the wheel stands: noise, resolution, how long a reply takes, how its clock goes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.commissioning.dialogue import RefusedError
from rw_ekf.commissioning.guarded_wheel import Bench, Move, Row, zero
from rw_ekf.units import rad_s_from_rpm, rpm_from_rad_s

_REST_S = 180.0  # that a wheel may take to come to rest by itself
_READINGS_S = 20.0
_POLLS = 60
_LOOKED_AT = 20  # readings that decide whether it stands
_LEAST_RAD_S = rad_s_from_rpm(0.2)  # a mean reading below it is rest, whatever the noise
_LATTICE_SHARE = 0.02  # of a step, by which readings may lie off it
_FAST_CLOCK = 1.5  # times the computer's: no clock goes so wrong by itself
_LEAST_VALUES = 3  # that show a lattice


class Still(NamedTuple):
    """Readings of a wheel at rest."""

    noise_rad_s: float  # standard deviation, at least what rounding alone makes
    lattice_rad_s: float | None  # step that all readings are multiples of; None: none is seen
    mean_rad_s: float
    read_ms: float  # a whole sample, from the first request to the last reply, median
    read_ms_max: float
    reply_ms: float  # of one reply, beyond its bytes' own time on the line
    clock_ppm: float  # by which the wheel's clock is fast against the computer's
    clock_jitter_ms: float

    @property
    def rest_rad_s(self) -> float:
        """A reading above it is motion."""
        return max(6.0 * self.noise_rad_s, 4.0 * (self.lattice_rad_s or 0.0), _LEAST_RAD_S)

    def text(self) -> str:
        """For a person."""
        step = "none seen" if self.lattice_rad_s is None else f"{rpm_from_rad_s(self.lattice_rad_s):.3g} rpm"
        return (
            f"noise {rpm_from_rad_s(self.noise_rad_s):.3g} rpm, step {step}, a sample in {self.read_ms:.3g} ms (at "
            f"most {self.read_ms_max:.3g}; a reply in {self.reply_ms:.2g} beyond its bytes), clock "
            f"{self.clock_ppm:+.3g} ppm, jitter {self.clock_jitter_ms:.2g} ms"
        )


def measure_still(bench: Bench, step_rad_s: float) -> Still:
    """Wait for rest, then read. step_rad_s: resolution by the wire map. Raises RefusedError where it does not rest."""
    waited = bench.run(_until_rest(), _REST_S)
    reported = [row.speed_rad_s for row in waited if row.speed_rad_s is not None]
    if not _rests(reported[-_LOOKED_AT:]):
        last = reported[-1] if reported else math.nan
        raise RefusedError(
            f"the speed still reads {rpm_from_rad_s(last):.4g} rpm after {_REST_S:g} s of zero current: let the wheel "
            "come to rest, or mend the offset of speed in the wire map, then start again"
        )
    rows = bench.run(zero(), _READINGS_S)
    replies_s = _polled(bench)
    speeds = np.array([row.speed_rad_s for row in rows if row.speed_rad_s is not None])
    if speeds.size < _LOOKED_AT or len(replies_s) < _POLLS // 2:
        raise RefusedError(f"{_too_little(rows, speeds.size, len(replies_s))} before anything moves")
    lattice = lattice_of(speeds)
    rounding = max(step_rad_s, lattice or 0.0) / math.sqrt(12.0)
    ppm, jitter_ms = _clock(rows)
    return Still(
        max(float(np.std(speeds)), rounding, 1.0e-6),
        lattice if lattice is not None else (step_rad_s or None),
        float(speeds.mean()),
        1e3 * float(np.median(replies_s)),
        1e3 * float(np.max(replies_s)),
        bench.live.link.reply_ms or 0.0,
        ppm,
        jitter_ms,
    )


def _too_little(rows: Sequence[Row], speeds: int, replies: int) -> str:
    """Why there are too few readings, and what to look at."""
    here_s, there_s = (rows[-1].host_s - rows[0].host_s, rows[-1].time_s - rows[0].time_s) if rows else (0.0, 0.0)
    if there_s > _FAST_CLOCK * here_s > 0.0:
        return (
            f"the wheel's clock went on by {there_s:.3g} s in {here_s:.3g} s of this computer's, "
            f"{there_s / here_s:.3g} times as fast, so that only {len(rows)} readings came in its {_READINGS_S:g} s: "
            "mend the unit of uptime in the wire map, or serve a simulated wheel with --speed-factor 1,"
        )
    if replies < _POLLS // 2 and speeds >= _LOOKED_AT:
        return f"only {replies} of {_POLLS} requests one after another were answered: look at the line"
    if speeds < len(rows):
        return f"only {speeds} of {len(rows)} readings had a speed: look at the line and at the speed in the wire map"
    return f"only {len(rows)} readings came in {_READINGS_S:g} s, {_LOOKED_AT} are wanted: look at the line"


def lattice_of(values: Float64Array) -> float | None:
    """The step of which all differences are multiples; None where too few values differ, or they lie anyhow."""
    different = np.unique(values)
    if different.size < _LEAST_VALUES:
        return None
    gaps = np.diff(different)
    step = float(gaps.min())
    if step <= 1.0e-9 * float(np.abs(different).max()):
        return None
    multiples = (different - different[0]) / step
    return step if float(np.abs(multiples - np.round(multiples)).max()) < _LATTICE_SHARE else None


def _until_rest() -> Move:
    recent: list[float] = []
    while not _rests(recent[-_LOOKED_AT:]):
        sample = yield 0.0
        if sample.speed_rad_s is not None:
            recent.append(sample.speed_rad_s)
    yield 0.0


def _rests(speeds: Sequence[float]) -> bool:
    """Whether the mean is that of noise around zero."""
    if len(speeds) < _LOOKED_AT:
        return False
    values = np.array(speeds)
    return bool(abs(values.mean()) < max(5.0 * values.std() / math.sqrt(values.size), _LEAST_RAD_S))


def _polled(bench: Bench) -> list[float]:
    """How long replies take, one request after another; nothing is written."""
    took = []
    for _ in range(_POLLS):
        began_s = bench.clock.monotonic()
        if bench.live.driver.read(0.2) is not None:
            took.append(bench.clock.monotonic() - began_s)
    return took


def _clock(rows: Sequence[Row]) -> tuple[float, float]:
    """By how many ppm the samples' time is fast, and how far it strays from a straight line [ms]."""
    host = np.array([row.host_s for row in rows])
    wheel = np.array([row.time_s for row in rows])
    host -= host[0]
    slope, offset = np.polyfit(host, wheel, 1)
    stray = wheel - (slope * host + offset)
    return 1e6 * (float(slope) - 1.0), 1e3 * float(np.std(stray))
