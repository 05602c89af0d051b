"""Ports of pyserial with something wrong about them: they fail at a call, or bring junk."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rw_ekf.drivers.line.serial_port import PortSettings, open_serial_port

CALLS = ("read", "write", "in_waiting", "reset_input_buffer", "reset_output_buffer", "close")


class Failing:
    """A port that raises at its k-th call; behind that every call is the port's own."""

    def __init__(self, port: Any, at_call: int, error: BaseException) -> None:
        self._port = port
        self._left = at_call
        self._error = error
        self.raised = False

    def __getattr__(self, name: str) -> Any:
        if name in CALLS:
            self._left -= 1
            if self._left == 0:
                self.raised = True
                raise self._error
        return getattr(self._port, name)


class Babbling:
    """A port on which so many bytes of junk come before anything else."""

    def __init__(self, port: Any, junk: bytes) -> None:
        self._port = port
        self.junk = junk

    @property
    def in_waiting(self) -> int:
        return len(self.junk) or int(self._port.in_waiting)

    def read(self, size: int = 1) -> bytes:
        if not self.junk:
            return bytes(self._port.read(size))
        came, self.junk = self.junk[:size], self.junk[size:]
        return came

    def __getattr__(self, name: str) -> Any:
        return getattr(self._port, name)


def opening(wrap: Callable[[Any], Any]) -> Callable[[PortSettings, float], Any]:
    """What opens a port and wraps it."""
    return lambda settings, write_timeout_s: wrap(open_serial_port(settings, write_timeout_s))
