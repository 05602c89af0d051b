"""What is left, as curves: how much more drag at which speed, what torque at which angle (docs/likelihood.md).

A curve is a regression on the map's own functions, of the kind of slope (a drag, a torque) that explains most. What the
model's own parameters can follow, a constant drag or one that is proportional to speed, is in no curve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.checks.residual_map import Cover, Kind, covers_of, p_value_of
from rw_ekf.diagnosis.hypotheses.joint_regressors import GroupFit, fit_group
from rw_ekf.diagnosis.hypotheses.noise_ratios import Profiled
from rw_ekf.diagnosis.hypotheses.random_walk import followed_finely
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.thresholds import INFLATION
from rw_ekf.numbers import number_text, plus_minus
from rw_ekf.units import RAD_S_PER_RPM

_MOST = 3  # dependences that are drawn: of one cause, most of them bend
_CLEAR_SIGMAS = 5.0  # of a curve that is described by its rise
_WORDS: dict[Kind, str] = {
    "drag": "drag",
    "torque": "a torque, whichever way the wheel turns,",
    "torque along the current": "the torque along the current",
    "motor gain": "the motor gain",
}
_LEAST_SIGMAS = 2.0  # of a peak that a sentence is made of
_UNSUPPORTED = 8.0  # times the usual sigma: where a record hardly was, nothing is reported
_RECORDS = {
    "speed": (
        "a log that stays at several speeds there for a minute each and goes through all others slowly, both ways "
        "round: `rw-ekf excite steps` with `command.amplitude_A` so chosen, or `rw-ekf excite S1`; log the temperature "
        "beside it"
    ),
    "low speed": (
        "a log with many slow reversals: `rw-ekf excite S1` (sine), or `rw-ekf excite sine` with a small "
        "`command.amplitude_A`; log the angle (`angle_rad`) beside it"
    ),
    "current": (
        "a log with other currents at the same speeds: `rw-ekf excite P2` (random steps) and coast-downs "
        "(`rw-ekf excite identification`); log the current that flows (`current_A`), not the command alone"
    ),
    "time": (
        "a second log of the same profile, to see whether it comes again at the same time: "
        "`rw-ekf excite identification`, then `rw-ekf diagnose LOG LOG`; log the temperature (`temperature_degC`) and "
        "whatever else changes, as the supply's voltage"
    ),
    "temperature": (
        "a log that begins cold and one that begins warm, or one in which the temperature falls again: "
        "`rw-ekf excite identification` for both, then `rw-ekf diagnose LOG LOG`; log the bearing's temperature"
    ),
    "angle": (
        "a log with the angle (`angle_rad`) from a sensor, at slow and at fast speeds: `rw-ekf excite identification`, "
        "as many rows a second as the wheel gives"
    ),
}  # which record would show more


@dataclass(frozen=True)
class Axis:
    """How a quantity is reported."""

    unit: str
    scale: float  # SI of one such unit


@dataclass(eq=False, frozen=True)
class Curve:
    """A curve as it is reported, (k,) arrays; times since the log's start."""

    at: Float64Array
    value: Float64Array
    std: Float64Array
    std_of_rise: float  # of its last value less its first


def shapes_of(found: Found, inertia_kg_m2: float | None, *, in_rpm: bool) -> list[dict[str, Any]]:
    """`shapes` of the document: a curve for each dependence that is left, the most significant first."""
    left = found.left[:_MOST]
    if not left:
        return []
    covers = covers_of(found.fit, found.prepared.facts)
    profiled = Profiled(found.fit, followed_finely(found.fit))
    began_s = float(found.prepared.course.time_s[0])
    return [
        entry
        for item in left
        if (entry := _entry(item.name, *_strongest(profiled, covers[item.name]), inertia_kg_m2, began_s, in_rpm=in_rpm))
    ]


def _strongest(profiled: Profiled, covers: list[Cover]) -> tuple[Cover, GroupFit]:
    fits = [fit_group(profiled, cover.regressors) for cover in covers]
    best = min(range(len(covers)), key=lambda i: (p_value_of(fits[i].statistic, fits[i].freedom), -fits[i].statistic))
    return covers[best], fits[best]


def _entry(
    name: str, cover: Cover, fit: GroupFit, inertia_kg_m2: float | None, began_s: float, *, in_rpm: bool
) -> dict[str, Any] | None:
    functions = cover.functions @ cover.unfollowed()
    value = functions @ fit.coefficients
    covariance = INFLATION * functions @ fit.covariance @ functions.T
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if not np.any(std > 0.0):
        return None
    supported = (std > 0.0) & (std < _UNSUPPORTED * np.median(std[std > 0.0]))
    axis, unit, scale = _axis(name, in_rpm=in_rpm), *_unit(cover.kind, inertia_kg_m2)
    at, value, std = cover.at[supported] / axis.scale, value[supported] / scale, std[supported] / scale
    rise = covariance[np.ix_(supported, supported)][np.ix_([0, -1], [0, -1])]
    curve = Curve(at - (began_s if name == "time" else 0.0), value, std,
                  math.sqrt(max(float(rise[0, 0] + rise[1, 1] - 2.0 * rise[0, 1]), 0.0)) / scale)  # fmt: skip
    return {
        "dependence": name,
        "kind": cover.kind,
        "at_unit": axis.unit,
        "unit": unit,
        "at": [float(v) for v in at],
        "value": [float(v) for v in value],
        "std": [float(v) for v in std],
        "sentence": _sentence(name, cover.kind, curve, axis, unit),
        "record": _RECORDS[name],
    }


def _axis(name: str, *, in_rpm: bool) -> Axis:
    if name in {"speed", "low speed"}:
        return Axis("rpm", RAD_S_PER_RPM) if in_rpm else Axis("rad/s (or m/s)", 1.0)
    if name == "current":
        return Axis("mA", 1.0e-3) if in_rpm else Axis("A (or N)", 1.0)
    return {"time": Axis("s", 1.0), "temperature": Axis("degC", 1.0), "angle": Axis("deg", math.radians(1.0))}[name]


def _unit(kind: Kind, inertia_kg_m2: float | None) -> tuple[str, float]:
    """Unit of a curve, and how much SI (per unit inertia) one of it is."""
    per = "/A" if kind == "motor gain" else ""
    return (f"rad/s^2{per}", 1.0) if inertia_kg_m2 is None else (f"mNm{per}", 1.0e-3 / inertia_kg_m2)


def _sentence(name: str, kind: Kind, curve: Curve, axis: Axis, unit: str) -> str:
    """The curve in words: how much it rises or falls where it does nothing else, otherwise its largest peak."""
    since = " after the log's start" if name == "time" else ""
    fine = 0.02 * float(np.ptp(curve.at))
    value, std = curve.value, curve.std
    rise = float(value[-1] - value[0])
    if value.size > 2 and abs(rise) > _CLEAR_SIGMAS * curve.std_of_rise and np.all(np.diff(value) * rise > 0.0):
        span = _range_text(float(curve.at[0]), float(curve.at[-1]), fine)
        grows = "rises" if rise > 0.0 else "falls"
        size = plus_minus(abs(rise), curve.std_of_rise)
        return f"{_WORDS[kind]} {grows} by about {size} {unit} from {span} {axis.unit}{since}"
    peak = int(np.argmax(np.abs(value) - _LEAST_SIGMAS * std))
    if abs(value[peak]) < _LEAST_SIGMAS * std[peak]:
        return f"no place of the {name} stands out"
    size = f"about {plus_minus(abs(float(value[peak])), float(std[peak]))} {unit}"
    where = f"around {_range_text(*_extent(curve.at, value, peak), fine)} {axis.unit}{since}"
    more = bool(value[peak] > 0.0)
    return {
        "drag": f"{size} {'more' if more else 'less'} drag {where}",
        "torque": f"a {'positive' if more else 'negative'} torque of {size} {where}, whichever way the wheel turns",
        "torque along the current": f"{size} {'more' if more else 'less'} torque along the current {where}",
        "motor gain": f"a motor gain that is {size} {'larger' if more else 'smaller'} {where}",
    }[kind]


def _extent(at: Float64Array, value: Float64Array, peak: int) -> tuple[float, float]:
    """Where a curve of straight pieces is above half of its peak, on both sides of it."""
    share = value / value[peak]
    ends = []
    for way in (-1, 1):
        i = peak
        while 0 <= i + way < at.size and share[i + way] > 0.5:
            i += way
        if 0 <= i + way < at.size:
            part = (share[i] - 0.5) / (share[i] - share[i + way])
            ends.append(float(at[i] + part * (at[i + way] - at[i])))
        else:
            ends.append(float(at[i]))
    return ends[0], ends[1]


def _range_text(low: float, high: float, fine: float) -> str:
    """`40 to 60`, to digits that a curve of a few knots has."""
    step = 10.0 ** math.floor(math.log10(fine)) if fine > 0.0 else 1.0
    ends = [number_text(round(value / step) * step, 3) if step < 1.0 else f"{round(value / step) * step:.0f}"
            for value in (low, high)]  # fmt: skip
    return " to ".join(dict.fromkeys(ends))
