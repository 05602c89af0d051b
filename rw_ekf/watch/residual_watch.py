"""Is the residual still noise? Tests over sliding windows of blocks of ten seconds, a short window and a long one.

The innovations are those of an estimator that adapts: what it can absorb it will. What is left is regressed on the
filter's response to the torques of `dependences`; correlation in time and size are tested beside. One event, a late
break-away say, is not structure: what is found must be there without its two largest blocks too.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rw_ekf.watch.alarms import RESIDUAL, Alarm
from rw_ekf.watch.dependences import TORQUES, Responses
from rw_ekf.watch.observation import Observation
from rw_ekf.watch.residual_window import (
    LAGS,
    BlockSums,
    block_sums,
    chi_square_limit,
    deviation_of,
    deviation_of_name,
    largest_dependence,
    spread,
    total,
    whiteness,
    without_largest,
)

BLOCK_S = 10.0
_MOST_ROWS = 128  # of one piece of a block
_SHORT_BLOCKS = 6
_SLOW_BLOCKS = 18  # temperature and time are no explanation within three minutes
_FEWEST = 100  # samples of a window that is judged
_FEWEST_FOR_SIZE = 300
_NOISE_TOLERANCE = math.log(1.25)  # a spread wrong by more is worth an alarm
_AGAIN = 0.7  # share of a threshold below which the residual is noise again
_CLEARLY = 1.2  # another name needs so much more deviation than the one given has now ...
_RENAMED_AFTER = 6  # ... for so many blocks running
NOISE_LEVEL = "noise level"
IN_TIME = "none, it is correlated in time"


class Verdict(NamedTuple):
    """What a window says: `excess` above 1 is not noise."""

    excess: float
    dependence: str
    torque: str | None
    deviation: float
    whiteness: float
    noise_ratio: float
    since_s: float


class ResidualWatch:
    """Raises and ends the alarm "residual is not noise". Memory does not grow."""

    def __init__(self, stribeck_speed_rad_s: float, window_s: float, threshold: float) -> None:
        """window_s: of the long window; threshold: of a dependence, in standard deviations [-]."""
        self._stribeck_speed_rad_s = stribeck_speed_rad_s
        self._threshold = threshold
        self._white_limit = chi_square_limit(threshold)
        self._blocks: deque[BlockSums] = deque(maxlen=max(round(window_s / BLOCK_S), _SHORT_BLOCKS))
        self.active: Alarm | None = None
        self.context: str | None = None  # what went before and may explain an alarm
        self.forget()

    def forget(self) -> None:
        """Begin anew: what was before says nothing about what follows. An active alarm stays until it is disproved."""
        self._blocks.clear()
        self._responses = Responses(self._stribeck_speed_rad_s)
        self._before = np.full(LAGS, math.nan)
        self._rows: list[Observation] = []
        self._pieces: list[BlockSums] = []
        self._block_s = 0.0
        self._other_name = 0  # blocks running in which another dependence than the alarm's was clearly larger
        self._blocks_since_named = self._name_lasts = 0
        self._begun_s = -math.inf  # of the active alarm, in the time of these blocks

    def add(self, e: Observation) -> list[Alarm]:
        """Take one sample; return the alarm that began, changed its name or ended with it."""
        self._rows.append(e)
        self._block_s += min(e.dt_s, BLOCK_S)
        full = self._block_s >= BLOCK_S - 0.5 * e.dt_s
        if full or len(self._rows) >= _MOST_ROWS:
            self._sum_up()
        if not full:
            return []
        self._blocks.append(total(self._pieces))
        self._pieces = []
        self._block_s = 0.0
        return self._judge(e.time_s)

    def _sum_up(self) -> None:
        responses, normalised = self._responses.of_block(self._rows)
        sums, self._before = block_sums(self._rows[0].time_s, responses, normalised, self._before)
        self._pieces.append(sums)
        self._rows = []

    def _judge(self, time_s: float) -> list[Alarm]:
        blocks = list(self._blocks)
        if self.active is not None:  # what was before the change would blur what it is
            blocks = [b for b in blocks if b.begin_s >= self._begun_s] or blocks[-1:]
        windows = [blocks[-_SHORT_BLOCKS:]]
        if len(blocks) > _SHORT_BLOCKS:
            windows.append(blocks)
        verdicts = [self._verdict(window) for window in windows]
        worst = max(range(len(windows)), key=lambda i: verdicts[i].excess)
        if self.active is None:
            if verdicts[worst].excess <= 1.0:
                return []
            return [self._name(verdicts[worst], verdicts[worst].since_s)]
        self._blocks_since_named += 1
        if verdicts[worst].excess < _AGAIN and len(blocks) >= _SHORT_BLOCKS:
            ended = Alarm(RESIDUAL, self.active.since_s, self.active.details, time_s)
            self.active = None
            return [ended]
        return self._renamed(verdicts[worst], windows[worst])

    def _renamed(self, verdict: Verdict, window: Sequence[BlockSums]) -> list[Alarm]:
        """Say the alarm again where another dependence has for some time been clearly larger than the one named."""
        assert self.active is not None
        name = str(self.active.details["largest_dependence"])
        clearly = (
            verdict.excess > 1.0
            and verdict.dependence != name
            and verdict.deviation > _CLEARLY * deviation_of_name(total(window), name)
        )
        self._other_name = self._other_name + 1 if clearly else 0
        if self._other_name < _RENAMED_AFTER or self._blocks_since_named < self._name_lasts:
            return []
        self._name_lasts = self._blocks.maxlen or 0
        return [self._name(verdict, self.active.since_s)]

    def _name(self, verdict: Verdict, since_s: float) -> Alarm:
        self._other_name = self._blocks_since_named = 0
        if self.active is None:
            self._begun_s = since_s
            self._name_lasts = _SHORT_BLOCKS  # the first name, of a short record, may soon be bettered; later ones hold
        self.active = Alarm(
            RESIDUAL,
            since_s,
            {
                "largest_dependence": verdict.dependence,
                "torque": verdict.torque,
                "deviation": round(verdict.deviation, 2),
                "whiteness": round(verdict.whiteness, 1),
                "noise_ratio": round(verdict.noise_ratio, 3),
                "after": self.context,
            },
        )
        return self.active

    def _verdict(self, blocks: Sequence[BlockSums]) -> Verdict:
        window = total(blocks)
        if window.samples < _FEWEST:
            return Verdict(0.0, IN_TIME, None, 0.0, 0.0, 1.0, window.begin_s)
        finding = largest_dependence(window, slow_too=len(blocks) >= _SLOW_BLOCKS)
        white, ratio = whiteness(window), spread(window)
        name: str = TORQUES[finding.column].name
        torque: str | None = TORQUES[finding.column].torque
        way = math.copysign(1.0, window.score[finding.column])
        weight = [way * float(b.score[finding.column]) for b in blocks]
        dependent = finding.deviation / self._threshold
        correlated = white / self._white_limit
        off = 0.0
        if max(dependent, correlated) <= 1.0 and window.samples >= _FEWEST_FOR_SIZE:
            off = abs(math.log(ratio)) / _NOISE_TOLERANCE
        if dependent > 1.0:
            rest = without_largest(blocks, weight)
            left = 0.0 if rest is None else deviation_of(rest, finding) / (_AGAIN * self._threshold)
            dependent = min(dependent, left)
        if correlated > 1.0:
            rest = without_largest(blocks, [float(b.lagged @ window.lagged) for b in blocks])
            left = 0.0 if rest is None else whiteness(rest) / (_AGAIN * self._white_limit)
            correlated = min(correlated, left)
        excess = max(dependent, correlated, off)
        if excess > 1.0 >= dependent:
            name, torque = (IN_TIME, None) if correlated > 1.0 else (NOISE_LEVEL, None)
        since_s = _since(blocks, weight) if excess > 1.0 else window.begin_s
        return Verdict(excess, name, torque, finding.deviation, white, ratio, since_s)


def _since(blocks: Sequence[BlockSums], weight: Sequence[float]) -> float:
    """Begin of the last blocks of which the sum of weights, over the root of their number, is largest."""
    best, begin_s, gathered = 0.0, blocks[-1].begin_s, 0.0
    for count, (block, value) in enumerate(zip(reversed(blocks), reversed(weight), strict=True), start=1):
        gathered += value
        if gathered > 0.0 and gathered * gathered / count > best:
            best, begin_s = gathered * gathered / count, block.begin_s
    return begin_s
