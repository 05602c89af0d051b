"""Wheels on a VESC (`family: vesc`), by its binary packets on a UART or USB (docs/wire-protocol.md#vesc)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from rw_ekf.checking.findings import Where
from rw_ekf.driver import WireLimits
from rw_ekf.drivers.line.register_protocol import RegisterProtocol, of_content
from rw_ekf.drivers.line.vesc_map import VescMap

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.register_server import RegisterServer


class VescProtocol(RegisterProtocol):
    """A WheelProtocol over such a map."""

    undescribed = (
        "what a reply of a VESC holds is chosen by the mask of its request, and its packets are those of its "
        "firmware: give the ground system the map as it is"
    )

    wire_map: VescMap

    @property
    def limits(self) -> WireLimits:
        """What the packets can carry, and how soon a current must be repeated."""
        watchdog_ms = self.wire_map.command.watchdog_ms
        return super().limits._replace(command_within_s=None if watchdog_ms is None else 1e-3 * watchdog_ms)

    @property
    def electronics(self) -> type[RegisterServer]:
        """What answers in a simulated wheel."""
        from rw_ekf.drivers.sim.vesc_server import VescServer

        return VescServer


def protocol_of(data: Mapping[str, object], where: Where) -> VescProtocol:
    """Make the protocol of a map's content. Raises ConfigError with every finding."""
    return of_content(VescProtocol, VescMap, data, where)
