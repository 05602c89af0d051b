"""Generalised likelihood ratio for "extra dry friction set in at some time", on the innovations of a running filter.

Dry friction A > 0 [rad/s^2] from time t0 on makes the true speed lag behind the predicted one. With gain K_i of the
filter (0 for a reading it did not use) the lag per unit of A before and after each update is (docs/watch.md eq. 2-4)

    m_i = keep_i m+ - direction_i dt_i e,    m+ = (1 - K_i) m_i,    e+ = e - L_i m_i

so that the innovation has mean A m_i. e is what the filter does not yet have of a unit of drag: 1 for the estimator,
whose friction hardly moves within seconds; the tracker of a spike has a state for it (gain L). Beside each onset stands
its rival, a sudden step of the speed itself (a lost command, a late break-away), with the same response and no push.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rw_ekf.watch.observation import Observation

_CLIP = 4.0  # standard deviations that one reading counts for at most: three wild ones raise no alarm
_PER_OCTAVE = 4  # onsets kept per doubling of age
_THIN_EVERY = 6  # samples


@dataclass(slots=True, eq=False)
class _Onset:
    """One hypothesis: its time, its rate of response, and what the innovations say of it and of its rival."""

    tick: int
    time_s: float
    lag: float = 0.0  # m
    missing: float = 1.0  # e
    step: float = 1.0  # response to a step of the speed
    step_missing: float = 0.0
    information: float = 0.0  # sum m^2/S
    score: float = 0.0  # sum m nu/S, nu clipped
    step_information: float = 0.0
    step_score: float = 0.0


@dataclass(frozen=True, slots=True)
class Onset:
    """The best onset: when, how strong the evidence, and how much better it is than a step of the speed."""

    time_s: float
    statistic: float  # standard normal while there is none [-]
    margin: float  # twice the logarithm of the likelihood ratio to the best step of the speed [-]


class OnsetBank:
    """Onsets at ages spaced evenly in their logarithm; memory and time per sample do not grow."""

    def __init__(self, longest_s: float, period_s: float) -> None:
        """longest_s: how old an onset may get; period_s: nominal, of the loop."""
        self._longest = max(round(longest_s / period_s), 4 * _PER_OCTAVE)
        self._onsets: list[_Onset] = []
        self._tick = 0
        self._leaders: tuple[_Onset | None, _Onset | None] = (
            None,
            None,
        )  # the best onset, and the best step of the speed
        self._left = 1.0  # 1 - K of the last sample
        self._drag_gain = 0.0  # L

    def clear(self) -> None:
        """Forget everything."""
        self._onsets.clear()
        self._left = 1.0

    def add(self, e: Observation, drag_gain: float = 0.0) -> Onset | None:
        """Weigh one sample; the best onset so far, if any speaks for more drag.

        drag_gain: L of a filter that has a drag state.
        """
        if e.restart:
            self.clear()
        self._respond(e, drag_gain)
        best = self._weigh(e) if e.direction != 0.0 and not math.isnan(e.innovation_rad_s) else None
        if e.reseeded:  # the filter's speed and the wheel's have met, whatever was before
            for onset in self._onsets:
                onset.lag = onset.step = 0.0
        self._tick += 1
        self._onsets.append(_Onset(self._tick, e.time_s))
        if self._tick % _THIN_EVERY == 0:
            self._thin()
        return best

    def _respond(self, e: Observation, drag_gain: float) -> None:
        keep = e.keep * self._left
        push = -e.direction * e.dt_s
        if self._drag_gain == 0.0:
            for onset in self._onsets:
                onset.lag = keep * onset.lag + push * onset.missing
                onset.step *= keep
        else:
            for onset in self._onsets:
                onset.missing -= self._drag_gain * onset.lag
                onset.step_missing -= self._drag_gain * onset.step
                onset.lag = keep * onset.lag + push * onset.missing
                onset.step = keep * onset.step + push * onset.step_missing
        self._left = 1.0 - e.gain
        self._drag_gain = drag_gain if e.gain > 0.0 else 0.0

    def _weigh(self, e: Observation) -> Onset | None:
        weight = 1.0 / e.variance
        limit = _CLIP * math.sqrt(e.variance)
        reported = weight * min(max(e.innovation_rad_s, -limit), limit)
        best, rival, best_square, rival_square = None, None, 0.0, 0.0
        for onset in self._onsets:
            lag, step = onset.lag, onset.step
            information = onset.information + weight * lag * lag
            score = onset.score + reported * lag
            onset.information, onset.score = information, score
            if score > 0.0 and score * score > best_square * information:
                best, best_square = onset, score * score / information
            information = onset.step_information + weight * step * step
            score = onset.step_score + reported * step
            onset.step_information, onset.step_score = information, score
            if score * score > rival_square * information:
                rival, rival_square = onset, score * score / information
        self._leaders = best, rival
        if best is None:
            return None
        return Onset(best.time_s, math.sqrt(best_square), best_square - rival_square)

    def _thin(self) -> None:
        """Keep the leaders, and onsets at multiples of a power of two that grows with their age."""
        now, leaders = self._tick, self._leaders
        kept = []
        for onset in self._onsets:
            age = now - onset.tick
            octaves = (age // _PER_OCTAVE).bit_length() - 1
            if octaves <= 0 or (age <= self._longest and (onset.tick % (1 << octaves) == 0 or onset in leaders)):
                kept.append(onset)
        self._onsets = kept
