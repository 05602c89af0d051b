"""The electronics of a VESC: currents as means since the last request, a count of what has turned, a time-out."""

from __future__ import annotations

from typing import Any

from rw_ekf.drivers.line.vesc_protocol import VescMap
from rw_ekf.drivers.line.wire_layout import Register
from rw_ekf.drivers.sim.register_server import RegisterServer


class VescServer(RegisterServer):
    """It acknowledges no write, and lets go of a current that is not repeated in time."""

    wire_map: VescMap
    hottest_degC = 100.0  # where it stops with a fault, by its default settings

    def __init__(self, *args: Any, first_uptime_s: float = 0.0, **options: Any) -> None:
        super().__init__(*args, first_uptime_s=first_uptime_s, **options)
        watchdog_ms = self.wire_map.command.watchdog_ms
        self.watchdog_s = None if watchdog_ms is None else 1e-3 * watchdog_ms
        self._turned_rad = abs(self.plant.speed_rad_s) * first_uptime_s
        self._charge_A_s, self._reported_s, self._counted_s = 0.0, self.plant.time_s, self.plant.time_s

    def advance_to(self, time_s: float) -> None:
        """Let the wheel run, and count."""
        before_rad = self.plant.state.angle_rad
        super().advance_to(time_s)
        self._count()
        self._turned_rad += abs(self.plant.state.angle_rad - before_rad)

    def _drive(self, current_A: float) -> None:
        self._count()
        super()._drive(current_A)

    def _count(self) -> None:
        """Count the charge that has flowed since this was done last."""
        self._charge_A_s += self.plant.flowing_A * (self.plant.time_s - self._counted_s)
        self._counted_s = self.plant.time_s

    def restart(self) -> None:
        """Its counts begin anew."""
        super().restart()
        self._turned_rad = 0.0

    def _telemetry(self, register: Register) -> dict[str, float]:
        values = super()._telemetry(register) | {"turned": self._turned_rad}
        passed_s = self.plant.time_s - self._reported_s
        if register.field("current"):
            values["current"] = self._charge_A_s / passed_s if passed_s > 0.0 else self.plant.flowing_A
            self._charge_A_s, self._reported_s = 0.0, self.plant.time_s
        return values
