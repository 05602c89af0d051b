"""A law without a formula as a picture: its curve with its band, among what was measured, against its own quantity."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.report.curves import Curve
from rw_ekf.diagnosis.report.drawn_time import timeline
from rw_ekf.diagnosis.report.quantities import Quantity, correlation_of
from rw_ekf.diagnosis.report.words import Units
from rw_ekf.effects.catalogue import SPELL
from rw_ekf.effects.learned_law import QUANTITY_WORDS, WORDS
from rw_ekf.effects.spell import is_impulse
from rw_ekf.model.law import OF_SPEED

if TYPE_CHECKING:
    from rw_ekf.diagnosis.outcome import Outcome
    from rw_ekf.model.effect import Term
    from rw_ekf.model.law import Law

_POINTS = 300


def law_curves(diagnosis: Outcome, units: Units) -> list[Curve]:
    """A curve for each law of the model that the record called for; none where nothing was added."""
    model, after = diagnosis.model, diagnosis.after
    if model is None or after is None:
        return []
    named = (diagnosis.document().get("verdict") or {}).get("effects") or ()
    terms = [term for term in model.effects.terms if term.law is not None and not term.given and term.id in named]
    knocks = [term for term in terms if _is_knock(term, diagnosis)]
    curves = [_curve(t, t.law, diagnosis, units) for t in terms if t.law is not None and t not in knocks]
    return [curve for curve in [*curves, _jumps(knocks, diagnosis, units)] if curve is not None]


def _is_knock(term: Term, diagnosis: Outcome) -> bool:
    steps = np.diff(diagnosis.log.time_s)
    return term.effect is SPELL and term.law is not None and is_impulse(term.law, float(np.median(steps)))


def _jumps(knocks: list[Term], diagnosis: Outcome, units: Units) -> Curve | None:
    """All impulses together: by how much each changed the speed, and when."""
    knocks = sorted(knocks, key=lambda term: term.law.first if term.law is not None else 0.0)
    laws = [term.law for term in knocks if term.law is not None]
    if not laws:
        return None
    label, scale, zero = _axis(laws[0], diagnosis, units)
    time_s = np.array([0.5 * (law.first + law.last) for law in laws])
    per_size = np.array([law.last - law.first for law in laws]) / units.speed_scale
    sizes = np.array([term.values[0] for term in knocks]) * per_size
    stds = np.array([term.stds[0] for term in knocks]) * per_size
    ends = np.array([diagnosis.log.time_s[0], diagnosis.log.time_s[-1]])
    at = np.concatenate((ends[:1], np.repeat(time_s, 3), ends[1:]))
    stems = np.concatenate(([0.0], np.column_stack((0.0 * sizes, -sizes, 0.0 * sizes)).ravel(), [0.0]))
    return Curve(
        "Speed, at once", label, f"change of the speed [{units.speed}]", (time_s - zero) / scale, -sizes, 2.0 * stds,
        (at - zero) / scale, stems,
    )  # fmt: skip


def _curve(term: Term, law: Law, diagnosis: Outcome, units: Units) -> Curve | None:
    assert diagnosis.after is not None
    at = _along(law, diagnosis)
    if at is None:
        return None
    label, scale, zero = _axis(law, diagnosis, units)
    y_label, y_scale = _measure(law, units)
    values = law.values(term.values)
    known = np.isfinite(at)
    low, high = float(np.min(at[known])), float(np.max(at[known]))
    quantity = Quantity(law.name, label, (at - zero) / scale, known, (low - zero) / scale, (high - zero) / scale)
    lever = _lever(law, diagnosis)
    measured = diagnosis.after.residual_acceleration_rad_s2 + lever * np.interp(at, law.knots, values)
    points = quantity.means(measured, correlation_of(diagnosis), lever)
    if not quantity.high > quantity.low or not points.count.size:
        return None
    places = np.linspace(low, high, _POINTS)
    spread = np.interp(places, law.knots, law.spread) if len(law.spread) == law.knots.size else None
    return Curve(
        f"{WORDS[law.acts_as].partition(',')[0]} over {QUANTITY_WORDS.get(law.quantity, law.column).partition(',')[0]}",
        label, y_label, points.x, points.mean / y_scale, 2.0 * points.standard_error / y_scale,
        (places - zero) / scale, np.interp(places, law.knots, values) / y_scale,
        None if spread is None else 2.0 * spread / y_scale,
    )  # fmt: skip


def _along(law: Law, diagnosis: Outcome) -> Float64Array | None:
    """The law's quantity at each sample, (n,); None where the log has none."""
    log = diagnosis.log
    speed, current = log.speed_rad_s, log.current_A
    if law.quantity == "angle":
        return None if diagnosis.angle_rad is None else np.mod(diagnosis.angle_rad, 2.0 * np.pi)
    if law.quantity == "temperature":
        return diagnosis.temperature_degC
    if law.quantity == "column":
        return log.numbers(law.column)
    return {
        "speed": speed,
        "speed_size": np.abs(speed),
        "current_along_motion": current * np.sign(speed),
        "current_size": np.abs(current),
    }.get(law.quantity, np.asarray(log.time_s, dtype=np.float64))


def _lever(law: Law, diagnosis: Outcome) -> Float64Array:
    """Acceleration by 1 of the law at each sample, (n,)."""
    assert diagnosis.model is not None
    speed, current = diagnosis.log.speed_rad_s, diagnosis.log.current_A
    gain = diagnosis.model.parameters.motor_gain
    return {
        "drag": -np.sign(speed),
        "torque": -np.ones(speed.size),
        "viscous_drag": -speed,
        "windage": -speed * np.abs(speed),
        "motor_gain": gain * current,
        "current_loss": -gain * np.sign(current),
    }[law.acts_as]


def _axis(law: Law, diagnosis: Outcome, units: Units) -> tuple[str, float, float]:
    """Label of the quantity, SI of one unit of it, and where its zero is."""
    if law.quantity == "time":
        time = timeline(np.asarray(diagnosis.log.time_s, dtype=np.float64))
        return time.label, time.unit_s, time.start_s
    if law.quantity in OF_SPEED:
        return f"{'|speed|' if law.quantity == 'speed_size' else 'speed'} [{units.speed}]", units.speed_scale, 0.0
    if law.quantity in {"current_size", "current_along_motion"}:
        words = "|current|" if law.quantity == "current_size" else "current along the motion"
        return f"{words} [{units.current}]", units.current_scale, 0.0
    if law.quantity == "angle":
        return "angle within a turn [deg]", float(np.radians(1.0)), 0.0
    return (law.column or "temperature [°C]"), 1.0, 0.0


def _measure(law: Law, units: Units) -> tuple[str, float]:
    """Label of the law's own size, and SI of one unit of it."""
    if law.acts_as in {"drag", "torque"}:
        return f"additional {law.acts_as} [{units.residual}]", units.residual_scale
    if law.acts_as == "motor_gain":
        return "change of the motor gain [%]", 0.01
    return f"additional {law.acts_as.replace('_', ' ')} [{law.own_unit}]", 1.0
