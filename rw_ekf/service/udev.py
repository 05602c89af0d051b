"""The udev rule of one USB adapter: kept from programs that take it for a modem or a Braille display, and quick."""

from __future__ import annotations

import re
from pathlib import Path

_BY_ID = re.compile(r"usb-(?P<serial>[A-Za-z0-9#+\-.:=@_/]+)-if[0-9a-f]{2}(-port\d+)?")


def by_id_name(names: list[str]) -> str | None:
    """The stable name of a USB adapter among the names of a port, e.g. "usb-FTDI_FT232R_A50285BI-if00-port0"."""
    for name in names:
        path = Path(name)
        if path.parent.name == "by-id" and _BY_ID.fullmatch(path.name):
            return path.name
    return None


def rule_text(by_id: str) -> str:
    """Text of the rule for the adapter of that name. Its file must come last: 99-....rules.

    ID_SERIAL is what udev has made the name of; both the adapter and its port have it.
    """
    match = _BY_ID.fullmatch(by_id)
    if match is None:
        raise ValueError(f"{by_id!r} is no name of a USB adapter")
    serial = match["serial"]
    return f"""# rw-ekf: the adapter {by_id}
ACTION=="remove", GOTO="rw_ekf_end"
ENV{{ID_SERIAL}}!="{serial}", GOTO="rw_ekf_end"
# ModemManager would write AT commands to the wheel.
SUBSYSTEM=="usb", ENV{{DEVTYPE}}=="usb_device", ENV{{ID_MM_DEVICE_IGNORE}}="1"
SUBSYSTEM=="tty", ENV{{ID_MM_DEVICE_IGNORE}}="1", ENV{{ID_MM_PORT_IGNORE}}="1"
# brltty takes common adapters for Braille displays, and their port away.
SUBSYSTEM=="usb", ENV{{DEVTYPE}}=="usb_device", ENV{{BRLTTY_BRAILLE_DRIVER}}="", ENV{{SYSTEMD_WANTS}}=""
# FTDI chips hold a reply back for 16 ms unless told otherwise.
SUBSYSTEM=="tty", DRIVERS=="ftdi_sio", ATTR{{device/latency_timer}}="1"
LABEL="rw_ekf_end"
"""
