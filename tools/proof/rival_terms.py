"""What a rival's model is made of: terms linear in their coefficients, as columns of a regression and as a run.

Three kinds: what acts whatever the speed (drive, angle, temperature, time), what is multiplied by the speed (drive
times speed), and laws of the speed alone, which are friction and may jump at zero.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline

from rw_ekf.arrays import Float64Array, Int64Array, by_identity
from rw_ekf.logs.wheel_log import WheelLog
from tools.proof.rival_run import GRID, Driven, Friction

HARMONICS = 12  # of the angle, where it is logged
_NEAR = 1.0e-4  # of the range of speeds: what a spline's slope at its ends is taken over


@by_identity
class Rows(NamedTuple):
    """A log as rivals take it, (n,) each, SI."""

    time_s: Float64Array  # only its differences within a segment count
    speed_rad_s: Float64Array  # NaN: missing
    drive: Float64Array  # in force from time_s + delay_s on
    delay_s: Float64Array
    segment: Int64Array
    angle_rad: Float64Array | None
    temperature_degC: Float64Array | None

    @classmethod
    def of_log(cls, log: WheelLog) -> Rows:
        """The same rows; gaps of angle and temperature are bridged."""
        angle, temperature = (log.channels.get(name) for name in ("angle_rad", "temperature_degC"))
        return cls(
            log.time_s, log.speed_rad_s, log.current_A, log.command_delay_s, log.segment,
            _bridged(angle), _bridged(temperature),
        )  # fmt: skip

    def step_s(self) -> Float64Array:
        """Time to the next row, 0 where none follows in the segment, (n,)."""
        step = np.diff(self.time_s, append=self.time_s[-1:])
        step[np.diff(self.segment, append=self.segment[-1:]) != 0] = 0.0
        return np.maximum(step, 0.0)

    def drive_late_by(self, rows: int) -> Float64Array:
        """The drive (n,) that comes into force so many rows later than the log says; the first one held before."""
        at = np.arange(self.drive.size)
        return self.drive[np.maximum(at - rows, np.searchsorted(self.segment, self.segment))]


Acting = Callable[[Rows, Float64Array], Float64Array]


@dataclass(eq=False, frozen=True)
class Terms:
    """Terms in the order of their coefficients: acting, multiplied by the speed, laws of the speed."""

    names: tuple[str, ...]
    acting: tuple[Acting, ...]
    sloping: tuple[Acting, ...]
    of_speed: Callable[[Float64Array], Float64Array]  # speeds (m,) -> (m, those left over)
    tables: dict[float, tuple[Float64Array, Float64Array]] = field(default_factory=dict)  # by the top speed

    def columns(self, rows: Rows, smooth_rad_s: Float64Array, late_rows: int) -> Float64Array:
        """Each term's mean over the interval that begins at each row, (n, terms); of the speed's by trapezoids."""
        early_share = np.minimum(rows.delay_s / np.maximum(rows.step_s(), 1.0e-12), 1.0)[:, None]
        late, early = rows.drive_late_by(late_rows), rows.drive_late_by(late_rows + 1)
        parts = []
        following = np.append(smooth_rad_s[1:], smooth_rad_s[-1:])
        for terms, factor in ((self.acting, np.ones(1)), (self.sloping, 0.5 * (smooth_rad_s + following))):
            if terms:
                now, before = (np.column_stack([term(rows, drive) for term in terms]) for drive in (late, early))
                parts.append((now + early_share * (before - now)) * factor[:, None])
        return np.column_stack([*parts, 0.5 * (self.of_speed(smooth_rad_s) + self.of_speed(following))])

    def driven(self, rows: Rows, coefficients: Float64Array, late_rows: int) -> Driven:
        """What acts between the rows."""
        late, early = rows.drive_late_by(late_rows), rows.drive_late_by(late_rows + 1)
        count = len(self.acting)

        def total(terms: Sequence[Acting], values: Float64Array, drive: Float64Array) -> Float64Array:
            out = np.zeros(drive.size)
            for term, value in zip(terms, values, strict=False):
                if value != 0.0:
                    out += value * term(rows, drive)
            return out

        step = rows.step_s()
        act, slope = coefficients[:count], coefficients[count:]
        return Driven(
            step, np.minimum(rows.delay_s, step),
            total(self.acting, act, early), total(self.acting, act, late),
            total(self.sloping, slope, early), total(self.sloping, slope, late),
        )  # fmt: skip

    def friction(self, coefficients: Float64Array, top_rad_s: float) -> Friction:
        """The laws of the speed as a friction for each direction."""
        values = coefficients[len(self.acting) + len(self.sloping) :]
        if top_rad_s not in self.tables:
            size = np.linspace(0.0, top_rad_s, GRID)
            size[0] = 1.0e-9 * top_rad_s  # what holds at rest is what slows the slowest motion
            self.tables[top_rad_s] = -self.of_speed(size), self.of_speed(-size)
        forward, backward = self.tables[top_rad_s]
        return Friction(top_rad_s, forward @ values, backward @ values)


def _drive(rows: Rows, drive: Float64Array) -> Float64Array:
    return drive


def plain_terms(slow_rad_s: float) -> Terms:
    """The four-parameter model: gain, viscous, Coulomb and break-away friction with a given Stribeck speed."""

    def of_speed(speed: Float64Array) -> Float64Array:
        sign = np.sign(speed)
        return np.column_stack((speed, sign, sign * np.exp(-((speed / slow_rad_s) ** 2))))

    return Terms(("I", "omega", "sgn", "break-away"), (_drive,), (), of_speed)


def spline_terms(speed_rad_s: Float64Array, knots: int) -> Terms:
    """Gain, a dry friction, and a cubic spline over the signed speed, with inner knots at quantiles of speeds (n,).

    Beyond those speeds it goes on as straight lines.
    """
    low, high = float(np.min(speed_rad_s)), float(np.max(speed_rad_s))
    inner = np.unique(np.quantile(speed_rad_s, np.linspace(0.0, 1.0, knots + 2)[1:-1]))
    inner = inner[(inner > low) & (inner < high)]
    at = np.concatenate((4 * [low], inner, 4 * [high]))

    ends = BSpline.design_matrix(np.array([low, low + _NEAR * (high - low), high - _NEAR * (high - low), high]), at, 3)
    values = ends.toarray()
    slopes = np.array([values[1] - values[0], values[3] - values[2]]) / (_NEAR * (high - low))

    def of_speed(speed: Float64Array) -> Float64Array:
        inside = np.clip(speed, low, high)
        basis = BSpline.design_matrix(inside, at, 3).toarray()
        basis += (speed - inside)[:, None] * slopes[(speed > high).astype(int)]
        return np.column_stack((np.sign(speed), basis))

    names = ("I", "sgn", *(f"B{i}" for i in range(at.size - 4)))
    return Terms(names, (_drive,), (), of_speed)


def library(rows: Rows, top_rad_s: float, *, soft: bool) -> Terms:
    """The candidates of a sparse regression; soft: with a friction that sets in gradually beside the one that jumps.

    Both at once mean little where the record hardly is near rest: what they cancel there holds a wheel for good.
    """
    acting: dict[str, Acting] = {"I": _drive, "1": lambda r, d: np.ones(d.size), "I|I|": lambda r, d: d * np.abs(d)}
    middle_s = 0.5 * (rows.time_s[0] + rows.time_s[-1])
    acting["t"] = lambda r, d: r.time_s - middle_s
    if rows.temperature_degC is not None and np.ptp(rows.temperature_degC) > 0.0:
        usual = float(np.mean(rows.temperature_degC))
        acting["T"] = lambda r, d: np.zeros(d.size) if r.temperature_degC is None else r.temperature_degC - usual
    if rows.angle_rad is not None:
        for order in range(1, HARMONICS + 1):
            acting[f"sin {order} angle"] = _harmonic(order, np.sin)
            acting[f"cos {order} angle"] = _harmonic(order, np.cos)

    def of_speed(speed: Float64Array) -> Float64Array:
        ratio = speed / top_rad_s
        laws = [ratio, ratio * np.abs(ratio), ratio**3, np.sign(speed)]
        return np.column_stack([*laws, np.tanh(20.0 * ratio)] if soft else laws)

    laws = ("omega", "omega|omega|", "omega^3", "sgn", *(("tanh",) if soft else ()))
    sloping: dict[str, Acting] = {"I omega": _drive, "|I| omega": lambda r, d: np.abs(d)}
    return Terms((*acting, *sloping, *laws), tuple(acting.values()), tuple(sloping.values()), of_speed)


def _harmonic(order: int, wave: Callable[[Float64Array], Float64Array]) -> Acting:
    return lambda r, d: np.zeros(d.size) if r.angle_rad is None else wave(order * r.angle_rad)


def _bridged(values: Float64Array | None) -> Float64Array | None:
    if values is None:
        return None
    known = np.flatnonzero(np.isfinite(values))
    if known.size == 0:
        return None
    return np.asarray(np.interp(np.arange(values.size), known, values[known]))
