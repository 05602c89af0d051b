"""Which initial rates keep every wheel from reversing near closest approach, along a line of such rates."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rw_ekf.flyby.geometry import Flyby
from rw_ekf.flyby.wheel_rates import WheelRate, derivative, root_angles, wheel_rates
from rw_ekf.units import RAD_S_PER_RPM

_NOTHING = 1.0e-9  # of a rate's scale

Interval = tuple[float, float]


@dataclass(frozen=True)
class Family:
    """Rates that depend on one number v: of each wheel base + v direction, at every angle."""

    name: str  # what v is
    unit: str
    present: float  # the v of the rates that were requested
    base: tuple[WheelRate, ...]
    direction: tuple[WheelRate, ...]


def scaled_family(flyby: Flyby, rates_rad_s: Sequence[float]) -> Family:
    """The initial rates, all times v."""
    base = wheel_rates(flyby, [0.0] * len(rates_rad_s))
    whole = wheel_rates(flyby, rates_rad_s)
    return Family("all rates times", "", 1.0, base, tuple(map(_minus, whole, base)))


def null_family(flyby: Flyby, rates_rad_s: Sequence[float]) -> Family | None:
    """Four wheels: the initial rates and v times their null-space vector, its largest component 1 rpm; else None."""
    if len(flyby.wheels) != 4:
        return None
    _, _, rows = np.linalg.svd(flyby.wheels.axes)
    vector = rows[3] / flyby.wheels.inertia_kg_m2  # momenta to rates
    vector *= RAD_S_PER_RPM / vector[np.argmax(np.abs(vector))]
    shown = ", ".join(f"{value / RAD_S_PER_RPM:.3g}" for value in vector)
    direction = tuple(WheelRate(float(value), 0.0, 0.0, 0.0) for value in vector)
    return Family(f"added along the null space ({shown}):", " rpm", 0.0, wheel_rates(flyby, rates_rad_s), direction)


def allowed_values(flyby: Flyby, family: Family, within_s: float) -> list[Interval]:
    """Open intervals of v for which no wheel is at zero within so many seconds of closest approach, ascending.

    A wheel is at zero where v = -base/direction; over the time to be kept free that ratio covers intervals, found
    exactly from where it is stationary and where it has poles. What none of the wheels covers is allowed.
    """
    closest = flyby.closest_approach_s
    first = max(flyby.start_rad, flyby.angle_rad(closest - within_s))
    last = min(flyby.end_rad, flyby.angle_rad(closest + within_s))
    if first >= last:  # the window does not come so near
        return [(-math.inf, math.inf)]
    forbidden = [
        interval
        for base, direction in zip(family.base, family.direction, strict=True)
        for interval in _forbidden(base, direction, first, last)
    ]
    allowed: list[Interval] = []
    reached = -math.inf
    for low, high in sorted(forbidden):
        if low > reached:
            allowed.append((reached, low))
        reached = max(reached, high)
    return [*allowed, (reached, math.inf)] if reached < math.inf else allowed


def _forbidden(base: WheelRate, direction: WheelRate, first: float, last: float) -> list[Interval]:
    """Values of v for which one wheel is at zero somewhere between two angles."""
    everything = [(-math.inf, math.inf)]
    f, g = base.fourier, direction.fourier
    turns = np.convolve(derivative(f), g) - np.convolve(f, derivative(g))  # zero where the ratio is stationary
    inner = [*root_angles(f, first, last), *root_angles(g, first, last), *root_angles(turns, first, last)]
    angles = [first, *sorted(inner), last]
    tiny_base, tiny = _NOTHING * (base.scale + direction.scale * RAD_S_PER_RPM), _NOTHING * direction.scale
    if direction.scale <= _NOTHING * base.scale:  # nothing that v does reaches this wheel
        signs = {math.copysign(1.0, base(angle)) for angle in angles if abs(base(angle)) > tiny_base}
        reaches_zero = len(signs) != 1 or any(abs(base(angle)) <= tiny_base for angle in angles)
        return everything if reaches_zero else []
    if any(abs(base(angle)) <= tiny_base and abs(direction(angle)) <= tiny for angle in angles):
        return everything  # at zero there whatever v is
    found: list[Interval] = []
    for left, right in itertools.pairwise(angles):
        between = direction(0.5 * (left + right))
        ends = [
            math.copysign(math.inf, -base(angle) * between)
            if abs(direction(angle)) <= tiny
            else -base(angle) / direction(angle)
            for angle in (left, right)
        ]
        found.append((min(ends), max(ends)))
    return found


def _minus(one: WheelRate, other: WheelRate) -> WheelRate:
    return WheelRate(one.mean - other.mean, one.cosine - other.cosine, one.sine - other.sine, one.second - other.second)
