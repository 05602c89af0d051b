"""A compensation: of the friction the viscous part alone."""

from __future__ import annotations

from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.schemes import SchemeEntry
from rw_ekf.records import Tick


class ViscousOnly:
    """I = (request + b omega) / k."""

    def __init__(self, viscous: float) -> None:
        self._viscous = viscous

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2]."""
        return known.current_for_A(request_rad_s2 + self._viscous * known.speed_rad_s)


ENTRY = SchemeEntry("acme_viscous", "a lab's own", lambda sheet: ViscousOnly(sheet.parameters.viscous))
