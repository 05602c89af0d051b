"""The true speed against the reading: what no line can tell by itself, and who does.

Every number on the line goes with the scale of speed: twice the speed is twice the gain and twice the friction, of a
wheel that might exist. So a person holds a tachometer against the wheel while it turns steadily, or says beforehand
what true speed is per reading; else nothing faster than a tenth of the limit is done, and no model is written. Where
nobody can be asked it is refused before anything moves.
"""

from __future__ import annotations

import math

NAMED = {  # mistakes that are usual, true over read
    1.0: "the wire map's scale is right",
    2.0 * math.pi / 60.0: "the wheel tells rpm where the wire map says rad/s",
    60.0 / (2.0 * math.pi): "the wheel tells rad/s where the wire map says rpm",
    0.5: "the wire map's scale is twice what it should be",
    2.0: "the wire map's scale is half of what it should be",
    0.1: "the wire map's scale is ten times what it should be",
    10.0: "the wire map's scale is a tenth of what it should be",
    2.0 * math.pi: "the wheel tells turns per second where the wire map says rad/s",
    60.0: "the wheel tells turns per second where the wire map says rpm",
}
_WITHIN = 0.04  # of a named ratio: a tachometer held by hand, a reading with noise
_LARGEST = 1.0e4

UNKNOWN = (
    "the scale of the speed cannot be known from the line alone: every reading would fit a wheel of another gain. Say "
    "what true speed is per reading (--speed-ratio 1 where the wire map is known to be right), or start on a terminal "
    "and hold a tachometer against the wheel when asked. Nothing faster than a tenth of the speed limit was done"
)


def is_named(ratio: float) -> bool:
    """Whether a usual mistake, or none, explains it."""
    return min(abs(math.log(ratio / known)) for known in NAMED) < _WITHIN


def agreed(first: float, second: float) -> float | None:
    """The mean of two ratios measured at two speeds; None where they contradict each other."""
    return math.sqrt(first * second) if abs(math.log(first / second)) < _WITHIN else None


def named_ratio(ratio: float) -> tuple[float, str]:
    """The ratio that is meant by a measured one (true over read), and a sentence. Raises ValueError for no ratio."""
    if not math.isfinite(ratio) or not 1.0 / _LARGEST < ratio < _LARGEST:
        raise ValueError(f"a ratio of {ratio:g} is none")
    near = min(NAMED, key=lambda known: abs(math.log(ratio / known)))
    if is_named(ratio):
        return near, NAMED[near]
    return ratio, f"the true speed is {ratio:.4g} times the reading, which is no usual mistake of units"
