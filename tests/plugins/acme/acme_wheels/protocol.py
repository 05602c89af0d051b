"""A wheel protocol: the registers of a wire map, on a line that is faster than the map says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rw_ekf.driver import WheelProtocol
from rw_ekf.drivers.line import register_protocol


def protocol_of(data: Mapping[str, Any], where: Any) -> WheelProtocol:
    """A file with `family: acme` is a wire map; its line runs at 115200 baud."""
    content = {**data, "link": {**data["link"], "baud": 115200}}
    made: WheelProtocol = register_protocol.protocol_of(content, where)
    return made
