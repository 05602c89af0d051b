"""A named cause's own curve: its law, and what was measured, against what the cause is a function of.

Points are what is measured once all else in the model is taken off: the law, and the residual that the model with it
leaves. An effect with a memory has no such law: points are then the residual of the model without it, against the
speed, or against the torque that the effect turned out to be.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.report.binning import binned_means
from rw_ekf.diagnosis.report.curves import Curve
from rw_ekf.diagnosis.report.drawn_time import timeline
from rw_ekf.diagnosis.report.law_curves import law_curves
from rw_ekf.diagnosis.report.quantities import Quantity, correlation_of, quantities_of
from rw_ekf.diagnosis.report.words import Units, plain_name
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.effects.periodic import PeriodicEffect
from rw_ekf.model.effect import REFERENCE_DEGC, Effect, Term
from rw_ekf.model.effect_kinds import LawEffect, StaticEffect
from rw_ekf.model.moment import Moment
from rw_ekf.numbers import number_text

if TYPE_CHECKING:
    from rw_ekf.diagnosis.outcome import ModelTrace, Outcome
    from rw_ekf.wheel.model_file import WheelModel

_LAW_POINTS = 400
_LAW_BINS, _OF_SINGLE = 60, 0.125  # of a law that has none of its own: no mean is needed, it has no noise
_MOST_PERIODS = 4  # in the width of a picture; more are laid over each other
_SHORT_S = 1.0e-6  # a piece in which nothing moves


@dataclass(frozen=True)
class _Place:
    """Where the wheel usually is, for all that a law is not drawn against."""

    speed_rad_s: float
    current_A: float
    temperature_degC: float = REFERENCE_DEGC
    angle_rad: float = 0.0
    time_s: float = 0.0


@dataclass(eq=False, frozen=True)
class _Cause:
    """A named effect with what it is drawn from."""

    effect: type[Effect]
    terms: tuple[Term, ...]
    quantity: Quantity
    usual: _Place
    correlation: float


def cause_curves(diagnosis: Outcome, units: Units) -> list[Curve]:
    """A curve for each effect that was named and added; none for what is a function of nothing.

    Empty where there is no model before and after.
    """
    before, after, model, log = diagnosis.before, diagnosis.after, diagnosis.model, diagnosis.log
    if before is None or after is None or len(log) == 0:
        return []
    quantities = {"current" if q.title == units.drive else q.title: q for q in quantities_of(diagnosis, units)}
    usual = _Place(_root_mean_square(log.speed_rad_s), _root_mean_square(log.current_A))
    correlation, curves = correlation_of(diagnosis), []
    for name in (diagnosis.document().get("verdict") or {}).get("effects") or ():
        effect = CATALOGUE.get(name)
        quantity = None if effect is None else quantities.get(effect.shown_against)
        if effect is None or quantity is None or issubclass(effect, LawEffect):
            continue
        own = () if model is None else tuple(model.effects.of(name))
        cause = _Cause(effect, own, _folded(quantity, own, diagnosis), usual, correlation)
        if model is not None and own and issubclass(effect, StaticEffect):
            curves.append(_lawful(cause, after, model, diagnosis, units))
        else:
            curves.append(_remembered(cause, before, after, diagnosis, units))
    return [*(curve for curve in curves if curve is not None), *law_curves(diagnosis, units)]


def _lawful(cause: _Cause, after: ModelTrace, model: WheelModel, diagnosis: Outcome, units: Units) -> Curve | None:
    """The law, and the measured points about it."""
    quantity = cause.quantity
    lever, sign, words = _lever(cause, diagnosis, units)
    at = np.linspace(quantity.low, quantity.high, _LAW_POINTS)
    torques = [_acceleration(cause.terms, model, place) for place in _places(cause, at, diagnosis, units)]
    law = sign * np.array(torques) / units.residual_scale
    left = after.residual_acceleration_rad_s2 / units.residual_scale
    points = quantity.means(left + lever * np.interp(quantity.x, at, law), cause.correlation, lever)
    if not points.count.size:
        return None
    return Curve(
        plain_name(cause.effect.id), quantity.label, f"{words} [{units.residual}]", points.x, points.mean,
        2.0 * points.standard_error, at, law,
    )  # fmt: skip


def _remembered(cause: _Cause, before: ModelTrace, after: ModelTrace, diagnosis: Outcome, units: Units) -> Curve | None:
    """The residual without the effect, and by how much the model with it differs."""
    measured = before.residual_acceleration_rad_s2 / units.residual_scale
    law = measured - after.residual_acceleration_rad_s2 / units.residual_scale
    name, quantity = plain_name(cause.effect.id), cause.quantity
    if quantity.along_motion:
        lever, _, words = _lever(cause, diagnosis, units)
        edges = np.linspace(quantity.low, quantity.high, _LAW_BINS + 1)
        line = binned_means(quantity.x, law, quantity.mask, edges, _OF_SINGLE, lever)
        x, x_label, y_label = quantity, quantity.label, f"{words} [{units.residual}]"
        law_x, law_y = line.x, line.mean
    else:
        known = law[np.isfinite(law) & (law != 0.0)]
        law_x = law_y = np.percentile(known, (0.5, 99.5)) if known.size else np.zeros(2)
        lever, x_label = np.ones(law.size), f"torque by which the model changed [{units.residual}]"
        y_label = f"torque beyond the model before [{units.residual}]"
        x = replace(quantity, x=law, low=float(law_x[0]), high=float(law_x[1]))
    if not x.high > x.low:
        return None
    points = x.means(measured, cause.correlation, lever)
    if not points.count.size:
        return None
    return Curve(name, x_label, y_label, points.x, points.mean, 2.0 * points.standard_error, law_x, law_y)


def _acceleration(terms: tuple[Term, ...], model: WheelModel, place: _Place) -> float:
    """What the terms of a static effect add to the acceleration [rad/s^2] at one place."""
    total, speed, known = 0.0, place.speed_rad_s, model.parameters
    at = Moment(speed, place.current_A, place.temperature_degC, place.angle_rad, place.time_s, _SHORT_S)
    for term in terms:
        effect: Any = term.effect
        for number, value in enumerate(term.values):
            current, external, viscous, viscous_factor, dry_factor, dry = effect.contribution(
                value, effect.component_shape(term.shape, number), at
            )
            total += known.motor_gain * current + external - (known.viscous * viscous_factor + viscous) * speed
            total -= float(np.sign(speed)) * (known.coulomb * dry_factor + dry)
    return total


def _places(cause: _Cause, at: Float64Array, diagnosis: Outcome, units: Units) -> list[_Place]:
    """The usual place, moved along the quantity that the effect is drawn against."""
    time = timeline(diagnosis.log.time_s)
    name, scale, zero = {
        "time": ("time_s", time.unit_s, time.start_s),
        "temperature": ("temperature_degC", 1.0, 0.0),
        "angle": ("angle_rad", np.radians(1.0), 0.0),
        units.drive: ("current_A", units.current_scale, 0.0),
    }.get(cause.quantity.title, ("speed_rad_s", units.speed_scale, 0.0))
    return [replace(cause.usual, **{name: float(zero + scale * x)}) for x in at]


def _folded(quantity: Quantity, terms: tuple[Term, ...], diagnosis: Outcome) -> Quantity:
    """Periods of a periodic effect laid over each other, where they are too many to be seen side by side."""
    if len(terms) != 1 or not issubclass(terms[0].effect, PeriodicEffect):
        return quantity
    rate = terms[0].shape[0]  # periods in a turn, or in a second
    period = 1.0 / rate / timeline(diagnosis.log.time_s).unit_s if quantity.in_time else 360.0 / rate
    if (quantity.high - quantity.low) / period <= _MOST_PERIODS:
        return quantity
    within = "time within a period" if quantity.in_time else f"angle within one of {rate:g} periods of a turn"
    label = f"{within} [{quantity.label.rpartition('[')[2]}"
    return replace(quantity, label=label, x=np.mod(quantity.x, period), low=0.0, high=period, finest=True)


def _lever(cause: _Cause, diagnosis: Outcome, units: Units) -> tuple[Float64Array, float, str]:
    """(n,) what a curve of one is in the residual of a sample, its sign at the usual place, and words for the curve."""
    speed, current, usual = diagnosis.log.speed_rad_s, diagnosis.log.current_A, cause.usual
    if cause.effect.acts_as == "drag":
        return -np.sign(speed), -1.0, "additional drag"
    if cause.effect.acts_as == "viscous drag":
        where = f"{number_text(usual.speed_rad_s / units.speed_scale, 2)} {units.speed}"
        return -speed / usual.speed_rad_s, -1.0, f"additional drag at {where}"
    if cause.effect.acts_as == "motor torque":
        where = f"{number_text(usual.current_A / units.current_scale, 2)} {units.current}"
        return current / usual.current_A, 1.0, f"additional torque at {where}"
    if cause.effect.angular and cause.terms and np.isfinite(diagnosis.log.rate_hz):
        # Of a wave that passes within a sample its mean is left.
        turned = max(term.shape[0] for term in cause.terms) * speed / diagnosis.log.rate_hz
        return np.sinc(turned / (2.0 * np.pi)), 1.0, "additional torque"
    return np.ones(speed.size), 1.0, "additional torque"


def _root_mean_square(values: Float64Array) -> float:
    """Of what is known; 1 where that is nothing."""
    known = values[np.isfinite(values)]
    return (float(np.sqrt(np.mean(known**2))) if known.size else 0.0) or 1.0
