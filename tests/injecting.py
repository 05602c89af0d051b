"""Faults put into a simulated wheel while a test goes on."""

from __future__ import annotations

from rw_ekf.drivers.sim.fault_text import parse_faults
from rw_ekf.drivers.sim.register_server import RegisterServer


def put_faults(server: RegisterServer, text: str = "") -> None:
    """The wheel has these faults and no others, as `rw-ekf simulate --fault` takes them; without a text it has none."""
    server.faults.put(*parse_faults([text] if text else []))
