"""Where a law without a formula may be: every quantity that a record moves, with every way in which a law may act."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.beyond_law_range import beyond
from rw_ekf.diagnosis.hypotheses.confounding import may_confound
from rw_ekf.diagnosis.thresholds import CHOSEN_LOG, INDISTINGUISHABLE, UNNAMED_LOG_ODDS
from rw_ekf.effects.catalogue import TORQUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.structure import slopes_by_torque, where_begun
from rw_ekf.model.effect import RecordFacts, Term
from rw_ekf.model.law import TURN, ActsAs, Law, Quantity

LAW_LOG_ODDS = UNNAMED_LOG_ODDS - CHOSEN_LOG  # of a law that no catalogue has, and of all that was chosen of it
BOTH_SIDES = ("speed", "current_along_motion")  # of zero, where the law may bend at once, or jump
_LEAST_RANGE = {"temperature": 1.0}  # K
_LEAST_VALUES = 8  # that a quantity has to have
_OTHER_WAY = 1.0e-3  # of what a torque moves, against the motion: less is a wheel that turns one way


@dataclass(eq=False, frozen=True)
class Ground:
    """One quantity that a law may be a function of, and one way it may act."""

    quantity: Quantity
    acts_as: ActsAs
    at: Float64Array  # (n,) the quantity where each interval began
    slope: Float64Array  # (n,) of each prediction by 1 of the law there
    followed: tuple[int, ...] = (0,)  # powers of the quantity that the model follows without a law
    turned: Float64Array | None = None  # (n,) rad within each interval, of a law of the angle
    column: str = ""
    slot: int = 0

    def law(self, low: float, high: float, functions: Float64Array, stds: Float64Array) -> Law:
        """Functions (m, knots) from low to high as a law, with deviations (m,) of their coefficients beforehand."""
        return Law(
            self.quantity, self.acts_as, low, high,
            tuple(tuple(float(value) for value in row) for row in functions), tuple(float(std) for std in stds),
            self.column, self.slot,
        )  # fmt: skip

    @property
    def range(self) -> tuple[float, float]:
        """From the least value to the greatest; of an angle one turn."""
        if self.turned is not None:
            return 0.0, TURN
        most = float(np.max(np.abs(self.at)))
        if self.quantity in {"speed_size", "current_size"}:
            return 0.0, most
        return (-most, most) if self.quantity in BOTH_SIDES else (float(self.at.min()), float(self.at.max()))


@dataclass(eq=False, frozen=True)
class Nameless:
    """The likeliest law of one ground."""

    ground: Ground
    log_factor: float  # by how much the record is likelier with it
    term: Term

    @property
    def passes(self) -> bool:
        """Whether it belongs to the clock of its record."""
        return self.ground.quantity == "time"

    @property
    def is_impulse(self) -> bool:
        """Whether it is over at once, and its time known already."""
        return self.passes and self.term.law is not None and self.term.law.spread != ()

    @property
    def times_s(self) -> tuple[float, float]:
        """From when to when, of a law of the time."""
        assert self.term.law is not None
        return self.term.law.first, self.term.law.last

    @property
    def weight(self) -> float:
        """Log of how much likelier it is than no law, what it is beforehand included."""
        return self.log_factor + LAW_LOG_ODDS - (INDISTINGUISHABLE if self.passes else 0.0)


def grounds(fit: Fit, facts: RecordFacts, columns: Sequence[str]) -> Iterator[Ground]:
    """Every quantity that the record moves, with every way in which a law of it may act."""
    drive, dry = slopes_by_torque(fit)
    record = fit.linearised.record
    course, follows = record.course, record.follows
    drive, dry = np.where(follows, drive, 0.0), np.where(follows, dry, 0.0)

    speed, current = where_begun(fit.trajectory.speed), course.mean_current_A
    along = current * np.sign(speed)
    viscous = drive * speed
    gain = drive * current * fit.model.parameters.motor_gain
    loss = drive * np.sign(current) * fit.model.parameters.motor_gain
    known = [term.law for term in fit.model.terms if term.law is not None and not term.law.prior_std]
    edge = np.any([np.zeros(course.samples, dtype=bool), *(beyond(law, course) for law in known)], axis=0)
    # Without its mean a law makes up for that where the record never was: it is taken off only where it is another's.
    steady = (0,) if fit.model.of(TORQUE.id) else ()
    both_ways = not _turns_one_way(drive, dry)  # else a torque is a drag, and the speed is its size
    yield Ground("speed_size", "drag", np.abs(speed), dry, (0, 1))
    if both_ways:
        yield Ground("speed_size", "torque", np.abs(speed), drive, steady)
        yield Ground("speed", "drag", speed, dry, (0, 1))
    if facts.top_current_A > 0.0:
        yield Ground("speed_size", "motor_gain", np.abs(speed), gain)
        if both_ways:
            yield Ground("speed", "motor_gain", speed, gain)
        yield Ground("current_along_motion", "drag", along, dry, (1,))
        yield Ground("current_size", "motor_gain", np.abs(current), gain)
        yield Ground("current_size", "torque", np.abs(current), drive, steady)
    if "angle_rad" in facts.channels:
        turned = np.diff(course.angle_rad, prepend=course.angle_rad[:1])
        yield Ground("angle", "torque", where_begun(course.angle_rad), drive, (), turned)
        yield Ground("angle", "drag", where_begun(course.angle_rad), dry, (0,), turned)
    passing: list[tuple[Quantity, Float64Array, str, int]] = [("time", where_begun(course.time_s), "", 0)]
    # Where temperature goes with time a law of it says no more than a drift, which the catalogue has.
    if "temperature_degC" in facts.channels and not may_confound(fit, "time", "temperature"):
        passing.append(("temperature", where_begun(course.temperature_degC), "", 0))
    for slot, name in enumerate(columns):
        values = course.columns[:, slot] if course.columns.size else np.zeros(0)
        if values.size and np.isfinite(values).all():
            passing.append(("column", where_begun(values), name, slot))
    for quantity, values, name, slot in passing:
        if np.ptp(values) <= _LEAST_RANGE.get(quantity, 0.0) or np.unique(values[:5000]).size < _LEAST_VALUES:
            continue
        # What a law of the model is off by beyond its range begins and ends at a time, too.
        seen = np.where(edge, 0.0, 1.0) if quantity == "time" else 1.0
        yield Ground(quantity, "drag", values, dry * seen, column=name, slot=slot)
        yield Ground(quantity, "viscous_drag", values, viscous * seen, column=name, slot=slot)
        yield Ground(quantity, "windage", values, viscous * np.abs(speed) * seen, column=name, slot=slot)
        if both_ways:
            yield Ground(quantity, "torque", values, drive * seen, steady, column=name, slot=slot)
        if facts.top_current_A > 0.0:
            yield Ground(quantity, "motor_gain", values, gain * seen, column=name, slot=slot)
            if quantity == "time":
                yield Ground(quantity, "current_loss", values, loss * seen, column=name, slot=slot)


def _turns_one_way(drive: Float64Array, dry: Float64Array) -> bool:
    """Whether a torque does what dry friction does, or the opposite, by their slopes (n,) of each prediction."""
    moved = drive * drive
    along = float(np.sum(moved[drive * dry < 0.0]))
    return min(along, float(np.sum(moved)) - along) < _OTHER_WAY * float(np.sum(moved))
