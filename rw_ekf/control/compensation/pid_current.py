"""No compensation: the current of the torque that is requested, as in the current mode of [CK13] 4.1."""

from __future__ import annotations

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.records import Tick


class PidCurrent:
    """I = a / k with the motor gain of the data sheet."""

    def __init__(self, motor_gain: float) -> None:
        """motor_gain: acceleration per ampere [rad/s^2/A]."""
        self._motor_gain = motor_gain

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2], friction forgotten."""
        return request_rad_s2 / self._motor_gain
