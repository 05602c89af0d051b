"""Thresholds from the false alarms that are accepted: half of them for each watch (docs/watch.md eq. 5, 13)."""

from __future__ import annotations

import math

_SECONDS = 3.6e6  # of 1000 h
# How many independent tests a tick of the bank amounts to, and a block of the residual: measured over healthy simulated
# wheels (docs/watch.md), rounded up.
_TESTS_PER_TICK = 0.5
_TESTS_PER_BLOCK = 12.0


def onset_threshold(false_alarms_per_1000_h: float, period_s: float) -> float:
    """Standard deviations at which the onset bank calls a spike [-]: one-sided, half of the false alarms."""
    return _gaussian_tail(0.5 * false_alarms_per_1000_h / (_TESTS_PER_TICK * _SECONDS / period_s))


def dependence_threshold(false_alarms_per_1000_h: float, block_s: float) -> float:
    """Standard deviations at which a dependence of the residual raises the alarm [-]: half of the false alarms."""
    return _gaussian_tail(0.5 * false_alarms_per_1000_h / (_TESTS_PER_BLOCK * _SECONDS / block_s))


def _gaussian_tail(probability: float) -> float:
    """The h with exp(-h^2/2) = probability; at least 3."""
    return math.sqrt(max(-2.0 * math.log(probability), 9.0))
