"""Where a wheel's rate crosses zero or touches it: every place of the window, however close two may be."""

from __future__ import annotations

from dataclasses import dataclass

from rw_ekf.flyby.geometry import Flyby
from rw_ekf.flyby.wheel_rates import WheelRate

_NOTHING = 1.0e-9  # of the rate's scale: no flyby is known to a billionth


@dataclass(frozen=True)
class Crossing:
    """One change of sign."""

    time_s: float
    rate_rad_s2: float  # of change


@dataclass(frozen=True)
class WheelCourse:
    """What one wheel does in the window."""

    start_rad_s: float
    end_rad_s: float
    crossings: tuple[Crossing, ...]
    touches_s: tuple[float, ...]  # zero without a change of sign, the two ends of the window included
    slowest_rad_s: float  # least size of the rate; zero where it crosses or touches
    slowest_s: float

    @property
    def ends_reversed(self) -> bool:
        """The criterion of [L17] (C1, C2, C4 < 0 or > 0): the rate at the end has the other sign, so it crosses.

        Where it is False the number of crossings is even: none, or two.
        """
        return self.start_rad_s * self.end_rad_s < 0.0


def course_of(flyby: Flyby, rate: WheelRate) -> WheelCourse:
    """Follow one wheel through the window.

    Between two neighbouring stationary points the rate is monotonic, so one change of sign there is one crossing.
    """
    from scipy.optimize import brentq

    start, end = flyby.start_rad, flyby.end_rad
    angles = [start, *rate.stationary_rad(start, end), end]
    signs = [_sign(rate(angle), rate.scale) for angle in angles]
    crossings: list[float] = []
    touches: list[float] = []
    last = 0  # the last sign that was not zero
    zeros: list[float] = []  # stationary points at zero since then
    before = start
    for angle, sign in zip(angles, signs, strict=True):
        if sign == 0:
            zeros.append(angle)
            continue
        if last * sign < 0:
            crossings.append(zeros[0] if zeros else float(brentq(rate, before, angle, xtol=1e-14)))
        elif zeros:
            touches.append(zeros[0])
        last, zeros, before = sign, [], angle
    if zeros:
        touches += zeros if last == 0 else zeros[:1]  # at zero all the way, or up to the end
    slowest = min((abs(rate(angle)), angle) for angle in [*angles, *crossings, *touches])
    return WheelCourse(
        rate(start),
        rate(end),
        tuple(Crossing(flyby.time_s(angle), rate.slope(angle) * flyby.rate_rad_s(angle)) for angle in crossings),
        tuple(flyby.time_s(angle) for angle in touches),
        0.0 if crossings or touches else slowest[0],
        flyby.time_s(slowest[1]),
    )


def _sign(value: float, scale: float) -> int:
    return 0 if abs(value) <= _NOTHING * scale else 1 if value > 0.0 else -1
