"""Wheels that speak lines of text, as an Arduino does (docs/wire-protocol.md#lines-of-text)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from rw_ekf.checking.findings import Where
from rw_ekf.drivers.line.ascii_map import AsciiMap
from rw_ekf.drivers.line.register_protocol import RegisterProtocol, of_content

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.register_server import RegisterServer


class AsciiProtocol(RegisterProtocol):
    """A WheelProtocol over such a map."""

    undescribed = "lines of text have no fields of a fixed size, so its requests and replies are what there is to give"

    wire_map: AsciiMap

    @property
    def electronics(self) -> type[RegisterServer]:
        """What answers in a simulated wheel."""
        from rw_ekf.drivers.sim.ascii_server import AsciiServer

        return AsciiServer


def protocol_of(data: Mapping[str, object], where: Where) -> AsciiProtocol:
    """Make the protocol of a map's content. Raises ConfigError with every finding."""
    return of_content(AsciiProtocol, AsciiMap, data, where)
