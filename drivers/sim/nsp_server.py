"""The electronics of a wheel that speaks NSP: those of any register, behind a boot loader."""

from __future__ import annotations

from typing import Any

from rw_ekf.drivers.line.framing import Frame
from rw_ekf.drivers.line.nsp import FIRST_READ, INIT_ID, OK, PING_ID, REFUSED
from rw_ekf.drivers.line.nsp_protocol import NspMap
from rw_ekf.drivers.line.wire_layout import Register
from rw_ekf.drivers.sim.register_server import RegisterServer


class NspServer(RegisterServer):
    """It powers up, and comes out of every reset, in a boot loader that knows PING and INIT alone."""

    wire_map: NspMap

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.started = False

    def restart(self) -> None:
        """Back in the boot loader."""
        super().restart()
        self.started = False

    def _answer(self, frame: Frame, register: Register | None) -> bytes | None:
        if frame.id == PING_ID:
            where = "application" if self.started else "boot loader"
            return f"rw-ekf simulated wheel {self._serial_number}, {where}".encode()
        if frame.id == INIT_ID:
            if frame.data != self.wire_map.init_data:
                return REFUSED
            super().restart()  # a program that runs begins anew: nobody may start it without need
            self.started = True
            return OK
        if not self.started:
            return b"" if frame.id >= FIRST_READ else REFUSED
        if frame.id >= FIRST_READ:
            return super()._answer(frame, register) or b""
        return super()._answer(frame, register)
