"""A record that looks like no wheel may be a wheel's in other units: the factor that would make it one."""

from __future__ import annotations

import math

from rw_ekf.model.state import CK13_STATISTICAL, FrictionParameters

# What a column may hold in place of rad/s, or of rpm that were turned into rad/s: (factor on the true value, question).
_SPEED_FACTORS = (
    (1.0, ""),
    (30.0 / math.pi, "is the speed in rpm, not in rad/s?"),
    (math.pi / 30.0, "is the speed in rad/s, not in rpm?"),
    (180.0 / math.pi, "is the speed in degrees per second?"),
    (0.5 / math.pi, "is the speed in turns per second?"),
    (6.0, "is the speed in degrees per second, not in rpm?"),
    (1.0e3, "is the speed in thousandths (mrad/s)?"),
    (1.0e-3, "is the speed in thousands?"),
)
_CURRENT_FACTORS = (
    (1.0, ""),
    (1.0e3, "is the current in mA?"),
    (1.0e-3, "is the current scaled by 1/1000 once too often?"),
    (1.0e6, "is the current in microamperes?"),
    (10.0, "is the current in steps of 0.1 A?"),
    (1.0e4, "is the current in steps of 0.1 mA?"),
)
_WITHIN = math.log(2.0)  # wheels of one class differ by so much


def question_of_units(found: FrictionParameters, *, driven: bool = True) -> str | None:
    """The likeliest mistake in units, as a question; None where no usual factor makes a wheel of these parameters.

    With readings v times the true speed and currents a times the true current, k comes out v/a times and c v times
    what it is. driven: the record has a current, so that k means something.
    """
    k, _, c, _ = CK13_STATISTICAL
    if not (found.motor_gain > 0.0 and found.coulomb > 0.0):
        return None
    best: tuple[float, str] | None = None
    for speed, about_speed in _SPEED_FACTORS:
        for current, about_current in _CURRENT_FACTORS if driven else _CURRENT_FACTORS[:1]:
            if not (about_speed or about_current):
                continue
            off_c = abs(math.log(found.coulomb / (speed * c)))
            off_k = abs(math.log(found.motor_gain * current / (speed * k))) if driven else 0.0
            if max(off_c, off_k) > _WITHIN:
                continue
            size = off_c + off_k + (0.5 if about_speed and about_current else 0.0)
            if best is None or size < best[0]:
                best = size, " and ".join(text.rstrip("?") for text in (about_speed, about_current) if text) + "?"
    return None if best is None else best[1]


def times(ratio: float) -> str:
    """`1/1000 of`, `2.4 times`: a ratio above zero as people say it, to two digits."""
    size = max(ratio, 1.0 / ratio)
    text = f"{size:.2g}" if size < 100.0 else f"{round(size, 1 - math.floor(math.log10(size))):.0f}"
    return f"{text} times" if ratio >= 1.0 else f"1/{text} of"
