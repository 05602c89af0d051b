"""What a controller tells of its bus by error frames, as SocketCAN's linux/can/error.h has them."""

from __future__ import annotations

from rw_ekf.drivers.can.can_frames import CanFrame
from rw_ekf.errors import DriverError
from rw_ekf.records import LinkCounters

CONTROLLER, BUS_OFF, RESTARTED = 0x004, 0x040, 0x100  # classes: bits of the identifier
_STATE_BYTE = 1  # of the data, where the class is CONTROLLER
OVERFLOW, WARNING, PASSIVE, ACTIVE = 0x03, 0x0C, 0x30, 0x40
IS_ACTIVE, IS_WARNING, IS_PASSIVE, IS_OFF = "active", "warning", "passive", "off"


class BusWatch:
    """Follows the controller's state, and counts."""

    def __init__(self, port: str, counters: LinkCounters) -> None:
        self._port = port
        self._counters = counters

    def heard(self) -> None:
        """A good frame came: a controller that is off hears none."""
        if self._counters.bus in (None, IS_OFF):
            self._counters.bus = IS_ACTIVE

    def note(self, frame: CanFrame) -> tuple[str, str] | None:
        """Take an error frame: an event and its sentence where the state is new. Raises DriverError for bus-off."""
        self._counters.bus_errors += 1
        was = self._counters.bus
        if frame.id & BUS_OFF:
            self._counters.bus = IS_OFF
            raise DriverError(
                f"{self._port} failed: the controller is bus-off, it counted too many errors. Check bit rate, "
                "termination and wiring; it comes back by restart-ms (ip link set ... type can restart-ms 100)"
            )
        said = frame.data[_STATE_BYTE] if frame.id & CONTROLLER and len(frame.data) > _STATE_BYTE else 0
        if said & PASSIVE:
            self._counters.bus = IS_PASSIVE
        elif said & WARNING:
            self._counters.bus = IS_WARNING
        elif said & ACTIVE or frame.id & RESTARTED:
            self._counters.bus = IS_ACTIVE
        if self._counters.bus == was or self._counters.bus != IS_PASSIVE:
            return None
        return (
            "bus_error_passive",
            "the CAN controller became error-passive: many frames are damaged, or nobody acknowledges them. Check "
            "termination, bit rate and the wheel's power",
        )
