"""The electronics of a wheel that speaks lines of text: those of any register, made ready by the lines of its start."""

from __future__ import annotations

from typing import Any

from rw_ekf.drivers.line.ascii_codec import STARTUP_ID, AsciiCodec
from rw_ekf.drivers.line.ascii_protocol import AsciiMap
from rw_ekf.drivers.line.framing import Frame
from rw_ekf.drivers.line.wire_layout import Register
from rw_ekf.drivers.sim.register_server import REFUSED, RegisterServer, Reply


class AsciiServer(RegisterServer):
    """Until it has heard every line of its start, in order, it takes no current but zero; it says that it restarted."""

    wire_map: AsciiMap
    _codec: AsciiCodec

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.lines_heard = 0
        self._says_restarted = False

    @property
    def is_ready(self) -> bool:
        """Whether it takes a current."""
        return self.lines_heard >= len(self.wire_map.startup)

    def restart(self) -> None:
        """As after a loss of power."""
        super().restart()
        self.lines_heard = 0
        self._says_restarted = self.wire_map.restarted is not None

    def handle(self, received: bytes, time_s: float) -> list[Reply]:
        """As any; the line of a restart comes before the next answer."""
        replies = super().handle(received, time_s)
        if not self._says_restarted or not replies:
            return replies
        self._says_restarted = False
        assert self.wire_map.restarted is not None
        return [Reply(self._codec.stated(self.wire_map.restarted)), *replies]

    def _answer(self, frame: Frame, register: Register | None) -> bytes | None:
        if frame.id >= STARTUP_ID:
            line = frame.id - STARTUP_ID
            self.lines_heard = line + 1 if line in (0, self.lines_heard) else self.lines_heard
            return None
        return super()._answer(frame, register)

    def _write_status(self, frame: Frame, register: Register | None) -> int:
        ready = self.is_ready or register is None or register.name != "current_command"
        return super()._write_status(frame, register) if ready or not any(frame.data) else REFUSED
