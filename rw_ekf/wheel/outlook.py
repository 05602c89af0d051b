"""The wheel a little ahead, as the filter believes it: its own propagation under a current still to be chosen."""

from __future__ import annotations

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.model.flow import flow
from rw_ekf.model.friction import FrictionCurve, Stribeck
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, SPEED, STATE_SIZE, STATIC, VISCOUS
from rw_ekf.wheel.effect_table import EffectTable
from rw_ekf.wheel.interval import Interval, Pieces
from rw_ekf.wheel.pieces import effect_interval
from rw_ekf.wheel.window import lateness


class WheelOutlook:
    """From when a command that is issued now acts: crossing, stick, effects and hidden states as in the filter.

    A delay of the model, or half the window of its readings, comes on top of the
    command's delay. Temperature stays; the angle advances with the speed.
    """

    def __init__(
        self,
        x: Float64Array,
        table: EffectTable,
        stribeck: Stribeck,
        interval: Interval,
        pieces: Pieces,
        speed_rad_s: float | None = None,
    ) -> None:
        """Follow the belief x (n,) to where the command acts.

        interval: from the belief to where the wire has the command, its currents in `pieces`. speed_rad_s: a speed to
        take for known in place of the believed one.
        """
        values = x.tolist()
        if speed_rad_s is not None:
            values[SPEED] = speed_rad_s
        self._plain = table.size == STATE_SIZE
        self.lead_s: float = interval.to_s - interval.from_s
        self._curve = FrictionCurve(values[VISCOUS], values[COULOMB], values[STATIC], stribeck.omega_s, stribeck.law)
        if self._plain:
            for piece in range(interval.start, interval.stop):
                drive = values[MOTOR_GAIN] * pieces.current_A[piece]
                values[SPEED] = flow(values[SPEED], drive, self._curve, pieces.duration_s[piece], False)[0]
        else:
            self._table, self._stribeck = table, stribeck
            self._row, self._end = np.zeros(table.size), np.zeros(table.size)
            delay_s = lateness(values, table)
            to_s = interval.to_s + delay_s
            self.lead_s += delay_s
            before = values[SPEED]
            values = self._followed(values, interval._replace(to_s=to_s), pieces)
            angle = interval.angle_rad + 0.5 * (before + values[SPEED]) * (to_s - interval.from_s)
            self._next = Interval(to_s, to_s, interval.temperature_degC, angle, 0, 0, 1, interval.columns)
            self._given_s = interval.to_s
        self._x = values
        self.begin_rad_s: float = values[SPEED]

    def end_rad_s(self, current_A: float, duration_s: float) -> float:
        """The speed [rad/s] after a current [A] has acted for so long [s]."""
        if self._plain:
            return flow(self.begin_rad_s, self._x[MOTOR_GAIN] * current_A, self._curve, duration_s, False)[0]
        interval = self._next._replace(to_s=self._next.from_s + duration_s)
        return self._followed(self._x, interval, Pieces([self._given_s], [duration_s], [current_A]))[SPEED]

    def _followed(self, values: list[float], interval: Interval, pieces: Pieces) -> list[float]:
        """The state (n,) at the interval's end; the last piece holds until then."""
        if interval.to_s <= interval.from_s:
            return values
        effect_interval(values, self._table, self._stribeck, pieces, interval, False, self._row, self._end)
        followed: list[float] = self._end.tolist()
        return followed
