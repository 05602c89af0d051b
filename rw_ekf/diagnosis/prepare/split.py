"""Which part of a record is fitted and which is held out (docs/likelihood.md)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array
from rw_ekf.checking.choices import SplitKind

_LEAST_BLOCK_S = 40.0
_SHORT_RECORD_S = 160.0
_REVERSALS_A_BLOCK = 2.0
_LEAST_BLOCKS = 4
_SPREAD_OVER = 8  # blocks at least, where there are so many: of a long block its beginning
_MOSTLY_AT_REST = 0.5  # of a record: the time between reversals is then that of what turns
_MOST_SAMPLES = 25_000  # of each part: what a diagnosis can look at within its budget


@dataclass(eq=False, frozen=True)
class Split:
    """Stretches of time in turn: `block` numbers them; each is searched, held out, or not looked at."""

    kind: SplitKind
    fit: BoolArray  # (n,)
    heldout: BoolArray  # (n,)
    block: Int64Array  # (n,)
    time_s: Float64Array  # (n,) of the log

    @property
    def looked_at(self) -> BoolArray:
        """Samples that the diagnosis looks at, (n,)."""
        return self.fit | self.heldout

    def at(self, kept: BoolArray) -> Split:
        """The same over some samples (n,) alone."""
        return Split(self.kind, self.fit[kept], self.heldout[kept], self.block[kept], self.time_s[kept])

    def exchanged(self) -> Split:
        """The same with the parts' roles exchanged."""
        return Split(self.kind, self.heldout, self.fit, self.block, self.time_s)

    def document(self) -> dict[str, Any]:
        """The `split` object of the diagnosis document, in the log's own time."""
        return {"kind": self.kind, "fit_s": self._spans(self.fit), "heldout_s": self._spans(self.heldout)}

    def _spans(self, mask: BoolArray) -> list[list[float]]:
        spans = []
        for block in np.unique(self.block[mask]):
            inside = self.time_s[mask & (self.block == block)]
            spans.append([float(inside[0]), float(inside[-1])])
        return spans


def running_time(time_s: Float64Array, segment: Int64Array) -> Float64Array:
    """Time since the start with the jumps between segments taken out [s], (n,)."""
    step = np.diff(time_s, prepend=time_s[:1])
    step[np.diff(segment, prepend=segment[:1]) != 0] = 0.0
    return np.cumsum(np.maximum(step, 0.0))


def split_record(
    time_s: Float64Array,
    segment: Int64Array,
    speed_rad_s: Float64Array,
    kind: SplitKind,
    noise_rad_s: float,
    log_of: Int64Array | None = None,
) -> Split:
    """Cut a record: every other block held out, or its second half.

    Blocks are 40 s at least and long enough for two reversals; a record under 160 s is cut into four. Of several logs
    (log_of: (n,), which one a sample is of) that are shorter than a block every other one is held out, whole. Of a
    record beyond 50,000 samples only so many blocks are looked at, in pairs evenly spread over those in which the wheel
    turns; `looked_at` states which.
    """
    elapsed = running_time(time_s, segment)
    duration = float(elapsed[-1]) if elapsed.size else 0.0
    rests = ~(np.abs(speed_rad_s) > 5.0 * noise_rad_s)
    if kind == "halves":
        count = 2
    elif duration < _SHORT_RECORD_S:
        count = _LEAST_BLOCKS
    else:
        turns, turning_s = reversals(speed_rad_s, noise_rad_s), duration
        if rests.mean() > _MOSTLY_AT_REST:
            turning_s *= 1.0 - float(rests.mean())
        length = max(_LEAST_BLOCK_S, _REVERSALS_A_BLOCK * turning_s / turns if turns else 0.0)
        count = max(_LEAST_BLOCKS, int(duration / length))
    block = _blocks(elapsed, duration, count)
    if kind == "blocks" and _are_short(log_of, duration):
        assert log_of is not None
        if _both_ways_alike(log_of % 2 == 0, speed_rad_s, noise_rad_s):
            return Split(kind, log_of % 2 == 0, log_of % 2 == 1, log_of, time_s)
    while (
        kind == "blocks"
        and duration / (2 * count) >= _LEAST_BLOCK_S
        and not _both_ways_alike(block % 2 == 0, speed_rad_s, noise_rad_s)
    ):
        count *= 2  # coast-downs by turns: whole ones in alternate blocks would all go one way
        block = _blocks(elapsed, duration, count)
    fit = block % 2 == 0
    heldout = ~fit
    if elapsed.size > 2 * _MOST_SAMPLES:
        heldout = heldout.copy()
        if kind == "halves":  # the beginning of each half: what comes later is not looked at
            fit &= np.cumsum(fit) <= _MOST_SAMPLES
            heldout &= np.cumsum(heldout) <= _MOST_SAMPLES
        else:
            keep = max(round(_MOST_SAMPLES / elapsed.size * count), min(count // 2, _SPREAD_OVER))
            pairs = np.unique(block[~rests] // 2 * 2)  # a wheel that rests for hours says nothing of its friction
            pairs = pairs[pairs <= count - 2] if pairs.size else np.arange(0, count - 1, 2)
            chosen = pairs[np.unique(np.linspace(0, pairs.size - 1, min(keep, pairs.size)).astype(int))]
            place = np.arange(block.size) - np.searchsorted(block, block)  # within its block
            short = place < _MOST_SAMPLES // chosen.size
            fit, heldout = np.isin(block, chosen) & short, np.isin(block, chosen + 1) & short
    return Split(kind, fit, heldout, block, time_s)


def _are_short(log_of: Int64Array | None, duration: float) -> bool:
    """Whether a record consists of several logs that have no room for a block, and can all be looked at."""
    if log_of is None or not 0 < log_of.size <= 2 * _MOST_SAMPLES:
        return False
    return bool(log_of[-1] > 0) and duration < _LEAST_BLOCK_S * float(log_of[-1] + 1)


def _blocks(elapsed: Float64Array, duration: float, count: int) -> Int64Array:
    edges = np.linspace(0.0, duration, count + 1)
    return np.clip(np.searchsorted(edges, elapsed, side="right") - 1, 0, count - 1).astype(np.int64)


def _both_ways_alike(fit: BoolArray, speed_rad_s: Float64Array, noise_rad_s: float) -> bool:
    """Whether each direction in which the record turns is in both parts."""
    for turning in (speed_rad_s > 5.0 * noise_rad_s, speed_rad_s < -5.0 * noise_rad_s):
        if turning.any() and not ((turning & fit).any() and (turning & ~fit).any()):
            return False
    return True


def reversals(speed_rad_s: Float64Array, noise_rad_s: float) -> int:
    """How often the speed changes its sign, touches within five sigma of the noise not counted."""
    sign = np.sign(np.where(np.abs(speed_rad_s) > 5.0 * noise_rad_s, speed_rad_s, 0.0))
    sign = sign[np.isfinite(sign) & (sign != 0.0)]
    return int(np.count_nonzero(np.diff(sign)))
