"""A record that looks like no wheel may be a wheel's in other units: the factors that would make it one."""

from __future__ import annotations

import math
from typing import NamedTuple

from rw_ekf.model.state import CK13_STATISTICAL, FrictionParameters

_PER_RPM = math.pi / 30.0


class Slip(NamedTuple):
    """A usual mistake: what the log has in place of the true value, times so much, and the question about it."""

    factor: float
    question: str


# Of a speed that the map calls rad/s, and of one that it calls rpm: degrees and turns are other factors there.
SPEED_SLIPS = {
    "speed_rad_s": (
        Slip(1.0 / _PER_RPM, "is the speed in rpm, not in rad/s?"),
        Slip(180.0 / math.pi, "is the speed in degrees per second?"),
        Slip(0.5 / math.pi, "is the speed in turns per second?"),
        Slip(1.0e3, "is the speed in thousandths (mrad/s)?"),
        Slip(1.0e-3, "is the speed in thousands?"),
    ),
    "speed_rpm": (
        Slip(_PER_RPM, "is the speed in rad/s, not in rpm?"),
        Slip(6.0, "is the speed in degrees per second, not in rpm?"),
        Slip(1.0 / 60.0, "is the speed in turns per second, not in rpm?"),
        Slip(1.0e3, "is the speed in thousandths of an rpm?"),
        Slip(1.0e-3, "is the speed in thousands of rpm?"),
    ),
}
CURRENT_SLIPS = (
    Slip(1.0e3, "is the current in mA?"),
    Slip(1.0e-3, "is the current scaled by 1/1000 once too often?"),
    Slip(1.0e6, "is the current in microamperes?"),
    Slip(10.0, "is the current in steps of 0.1 A?"),
    Slip(1.0e4, "is the current in steps of 0.1 mA?"),
)
TIME_SLIPS = (
    Slip(1.0e3, "is the time in milliseconds?"),
    Slip(1.0e6, "is the time in microseconds?"),
    Slip(1.0e9, "is the time in nanoseconds?"),
    Slip(1.0 / 60.0, "is the time in minutes?"),
)
RIGHT = Slip(1.0, "")
_WITHIN = math.log(2.0)  # wheels of one class differ by so much in gain and Coulomb friction,
_VISCOUS_WITHIN = math.log(6.0)  # and in viscous friction, which depends on the lubricant's temperature
_TWO_AT_ONCE = 0.5
_BY_VISCOUS = 0.1  # what viscous friction counts beside the other two: short records hardly show it


class Slips(NamedTuple):
    """Which mistake was made in speed, current and time; `RIGHT` where none was."""

    speed: Slip = RIGHT
    current: Slip = RIGHT
    time: Slip = RIGHT

    @property
    def question(self) -> str:
        """All of them as one question."""
        return " and ".join(slip.question.rstrip("?") for slip in self if slip.question) + "?"


def question_of_units(
    found: FrictionParameters, *, driven: bool = True, speed_name: str = "speed_rad_s", viscous_std: float = 0.0
) -> Slips | None:
    """The likeliest mistake in units; None where no usual factor makes a wheel of these parameters.

    With readings v times the true speed, currents a times the true current and times t times the true time, k comes out
    v / (a t) times, c v / t times and b 1 / t times what it is. driven: the record has a current, so that k means
    something. speed_name: what the map calls the speed. viscous_std: b may be anything within three of it.
    """
    k, b, c, _ = CK13_STATISTICAL
    if not (found.motor_gain > 0.0 and found.coulomb > 0.0):
        return None
    currents = (RIGHT, *CURRENT_SLIPS) if driven else (RIGHT,)
    tried = [Slips(v, a) for v in (RIGHT, *SPEED_SLIPS[speed_name]) for a in currents][1:]
    tried += [Slips(time=slip) for slip in TIME_SLIPS]
    best: tuple[float, Slips] | None = None
    for slips in tried:
        v, a, t = (slip.factor for slip in slips)
        off_c = abs(math.log(found.coulomb * t / (v * c)))
        off_k = abs(math.log(found.motor_gain * a * t / (v * k))) if driven else 0.0
        high, low = (max(found.viscous + s * viscous_std, 1e-12) * t / b for s in (3.0, -3.0))
        off_b = max(0.0, -math.log(high), math.log(low))
        if max(off_c, off_k) > _WITHIN or off_b > _VISCOUS_WITHIN:
            continue
        near_b = abs(math.log(max(found.viscous, 1e-12) * t / b))
        size = off_c + off_k + off_b + _BY_VISCOUS * near_b + (_TWO_AT_ONCE if v != 1.0 and a != 1.0 else 0.0)
        if best is None or size < best[0]:
            best = size, slips
    return None if best is None else best[1]


def times(ratio: float) -> str:
    """`1/1000 of`, `2.4 times`: a ratio above zero as people say it, to two digits."""
    size = max(ratio, 1.0 / ratio)
    text = f"{size:.2g}" if size < 100.0 else f"{round(size, 1 - math.floor(math.log10(size))):.0f}"
    return f"{text} times" if ratio >= 1.0 else f"1/{text} of"
