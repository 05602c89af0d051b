"""Wheels on a CAN bus (`family: can`), as a map of messages describes them (docs/wire-protocol.md#can)."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import TYPE_CHECKING

from rw_ekf.checking.findings import Where, checked
from rw_ekf.driver import WireLimits
from rw_ekf.drivers.can.can_database import database_of, folder_of
from rw_ekf.drivers.can.can_file import CanFile
from rw_ekf.drivers.can.can_map import CanMap, can_map
from rw_ekf.drivers.line.register_protocol import RegisterProtocol

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.register_server import RegisterServer


class CanProtocol(RegisterProtocol):
    """A WheelProtocol over such a map."""

    undescribed = (
        "a CAN map's messages are those of its DBC, or of `messages` in it: give that to the ground system as it is"
    )

    wire_map: CanMap

    @property
    def limits(self) -> WireLimits:
        """What the messages can carry, and how often they come."""
        file = self.wire_map.layout.file
        watchdog = file.command.watchdog_ms
        return super().limits._replace(
            telemetry_s=1e-3 * file.cycle.period_ms, command_within_s=None if watchdog is None else 1e-3 * watchdog
        )

    @property
    def electronics(self) -> type[RegisterServer]:
        """What answers in a simulated wheel."""
        from rw_ekf.drivers.sim.can_server import CanServer

        return CanServer


def protocol_of(data: Mapping[str, object], where: Where) -> CanProtocol:
    """Make the protocol of a map's content. Raises ConfigError with every finding."""
    content = {key: value for key, value in data.items() if key != "family"}
    file = checked(CanFile, content, "a map of CAN messages", where)
    made = can_map(file, database_of(file, where), where)
    said = json.dumps(content, sort_keys=True).encode()
    if file.dbc is not None:
        said += (folder_of(where) / file.dbc).read_bytes()
    return CanProtocol(made, _scale_places(file, where), hashlib.sha256(said).hexdigest())


def _scale_places(file: CanFile, where: Where) -> dict[str, str]:
    """Where the scales of speed and current stand: file:line and signal, or the DBC."""
    places = {}
    for word, text in (("speed", file.telemetry["speed"].signal), ("current", file.command.signal)):
        message, name = text.split(".")
        place = str(folder_of(where) / str(file.dbc))
        for i, one in enumerate(file.messages):
            for k, signal in enumerate(one.signals):
                if (one.name, signal.name) == (message, name):
                    place = where(("messages", i, "signals", k, "scale")).rsplit(":", 1)[0]
        places[word] = f"{place} (scale of {name} in message {message})"
    return places
