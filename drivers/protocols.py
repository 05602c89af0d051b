"""Wire protocols: the `family` of a file in config/ names what speaks it, an entry point of rw_ekf.protocols.

That is a function `protocol_of(data, where)`, which checks the file's content and returns what opens such a wheel.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rw_ekf.checking.wording import shown
from rw_ekf.driver import WheelProtocol
from rw_ekf.errors import ConfigError
from rw_ekf.plugins import loaded, registered

FAMILIES = {
    "registers": "rw_ekf.drivers.line.register_protocol:protocol_of",
    "ascii": "rw_ekf.drivers.line.ascii_protocol:protocol_of",
    "nsp": "rw_ekf.drivers.line.nsp_protocol:protocol_of",
    "vesc": "rw_ekf.drivers.line.vesc_protocol:protocol_of",
    "can": "rw_ekf.drivers.can.can_protocol:protocol_of",
}
USUAL_FAMILY = "registers"

Where = Callable[[tuple[str | int, ...]], str]


def protocol_of(data: object, where: Where) -> WheelProtocol:
    """Return the protocol that a file's content describes. Raises ConfigError with every finding.

    where: turns a path like ("registers", 3, "id") into "file:line:column".
    """
    family = data.get("family", USUAL_FAMILY) if isinstance(data, Mapping) else USUAL_FAMILY
    families = registered("rw_ekf.protocols", FAMILIES)
    if not isinstance(family, str) or family not in families:
        known = ", ".join(sorted(families))
        raise ConfigError(f"{where(('family',))}: family must be one of {known}; found {shown(family)}")
    made: WheelProtocol = loaded(families[family])(data, where)
    return made
