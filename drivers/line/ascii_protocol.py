"""Wheels that speak lines of text, as an Arduino does (docs/wire-protocol.md#lines-of-text)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Self

from rw_ekf.checking.findings import Where
from rw_ekf.drivers.line.ascii_map import AsciiMap
from rw_ekf.drivers.line.register_protocol import AddressedRegisterProtocol, of_content
from rw_ekf.errors import ConfigError

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.register_server import RegisterServer


class AsciiProtocol(AddressedRegisterProtocol):
    """A WheelProtocol over such a map; its lines bear an address where the map gives one."""

    undescribed = "lines of text have no fields of a fixed size, so its requests and replies are what there is to give"

    wire_map: AsciiMap

    @property
    def electronics(self) -> type[RegisterServer]:
        """What answers in a simulated wheel."""
        from rw_ekf.drivers.sim.ascii_server import AsciiServer

        return AsciiServer

    def at(self, address: int) -> Self:
        """As of any, of a map whose lines have a place for it."""
        if self.address is None:
            raise ConfigError(
                f"is {address}, but the lines of the wire map have no place {{address:d}}: write it into each request "
                "and reply, and give framing.address, or drop it"
            )
        return super().at(address)


def protocol_of(data: Mapping[str, object], where: Where) -> AsciiProtocol:
    """Make the protocol of a map's content. Raises ConfigError with every finding."""
    return of_content(AsciiProtocol, AsciiMap, data, where)
