"""The offset of Pistiner's patent, as [S91] describes it: twice the Coulomb torque, noted shortly before the reversal.

An integrating controller holds the friction of the side that the wheel comes from; what it requests at 5 to 10 rpm,
less what is known (the disturbance that the wheel takes up, the viscous friction), is T_c. At the reversal friction
changes by -2 T_c, and an offset of that is summed with the request for as long as the wheel is on the other side.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.tick_intervals import Timeline
from rw_ekf.records import Tick
from rw_ekf.units import rad_s_from_rpm

TUNABLE = {"noted_rpm": (5.0, 10.0), "applied_rpm": (0.05, 5.0)}
_WINDOW_S = 10.0
_AWAY = 1.5  # times the noted speed, from where on the wheel has a side again


class OffsetSpeeds(NamedTuple):
    """Where the request is noted, and where the offset is applied: all but at the reversal, as tuned."""

    noted_rpm: float = 5.5
    applied_rpm: float = 0.05


class PistinerOffset:
    """I = (a + offset) / k. It uses the filter's speed, and of a model the viscous friction of the data sheet only."""

    def __init__(
        self,
        motor_gain: float,
        viscous: float,
        speeds: OffsetSpeeds,
        known_rad_s2: float | None = None,
    ) -> None:
        """Gain [rad/s^2/A] and viscous friction [1/s] of the data sheet.

        known_rad_s2: the wheel's acceleration that the disturbances call for; None: it is measured over the last
        ten seconds, since what the wheel gains without friction is what they give it.
        """
        self._motor_gain = motor_gain
        self._viscous = viscous
        self._noted_rad_s = rad_s_from_rpm(speeds.noted_rpm)
        self._applied_rad_s = min(rad_s_from_rpm(speeds.applied_rpm), self._noted_rad_s)
        self._known_rad_s2 = known_rad_s2
        self._timeline = Timeline()
        self._past: deque[tuple[float, float]] = deque()  # time, speed
        self._side = 0.0  # that the wheel comes from: +1 or -1; 0: not known
        self._coulomb_rad_s2: float | None = None  # as noted on the way down, signed as the side
        self._before_rad_s2: float | None = None  # the offset before this reversal, once it is applied
        self.offset_rad_s2 = 0.0

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2]; the offset stays where a gap leaves the wheel's side open."""
        if self._timeline.step(tick) is None:
            self._past.clear()
            self._side, self._coulomb_rad_s2, self._before_rad_s2 = 0.0, None, None
        speed = known.speed_rad_s
        self._past.append((tick.sample.time_s, speed))
        while self._past[-1][0] - self._past[0][0] > _WINDOW_S:
            self._past.popleft()
        if abs(speed) > _AWAY * self._noted_rad_s:
            self._on_a_side(math.copysign(1.0, speed))
        elif self._side != 0.0:
            self._near_zero(self._side * speed, request_rad_s2)
        return self._timeline.wanted((request_rad_s2 + self.offset_rad_s2) / self._motor_gain)

    def _on_a_side(self, side: float) -> None:
        """Note the side; a wheel that was turned back before it got through takes its offset with it."""
        if self._before_rad_s2 is not None and side == self._side:
            self.offset_rad_s2 = self._before_rad_s2
        self._side, self._coulomb_rad_s2, self._before_rad_s2 = side, None, None

    def _near_zero(self, outward_rad_s: float, request_rad_s2: float) -> None:
        """On the way down note the Coulomb friction, and apply it, once each. outward: the speed, > 0 where it was."""
        acceleration = self._acceleration_rad_s2()
        if self._coulomb_rad_s2 is None and outward_rad_s <= self._noted_rad_s and acceleration is not None:
            held = request_rad_s2 + self.offset_rad_s2 - acceleration
            self._coulomb_rad_s2 = held - self._viscous * self._side * outward_rad_s
        if self._coulomb_rad_s2 is not None and self._before_rad_s2 is None and outward_rad_s <= self._applied_rad_s:
            self._before_rad_s2 = self.offset_rad_s2
            if self._coulomb_rad_s2 * self._side > 0.0:  # else it was no friction that the request held
                self.offset_rad_s2 -= 2.0 * self._coulomb_rad_s2

    def _acceleration_rad_s2(self) -> float | None:
        """What is known; where nothing is, the speed's mean slope over the window, None before that is half full."""
        if self._known_rad_s2 is not None:
            return self._known_rad_s2
        (first_s, first), (last_s, last) = self._past[0], self._past[-1]
        if last_s - first_s < 0.5 * _WINDOW_S:
            return None
        return (last - first) / (last_s - first_s)
