"""A controller that asks the daemon for torques over its socket, on the daemon's own virtual clock."""

from __future__ import annotations

import contextlib
import json
import math
import os
import socket
from collections.abc import Callable
from typing import Any, Self

from rw_ekf.clock import VirtualClock

Answer = dict[str, Any]


class TorqueClient:
    """Connects as soon as the daemon listens, and asks every period_s; keeps every answer."""

    def __init__(self, path: str, torque_Nm: Callable[[float], float], period_s: float = 0.1) -> None:
        """torque_Nm: what is asked for, by the daemon's time [s]; NaN: nothing is."""
        self._path = path
        self._torque_Nm = torque_Nm
        self._period_s = period_s
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._connected = False
        self._rest = b""
        self.answers: list[Answer] = []

    def begin(self, clock: VirtualClock) -> None:
        """Put everything that it does on the clock."""

        def act() -> None:
            self._act(clock.monotonic())
            clock.at(clock.monotonic() + self._period_s, act)

        clock.at(0.05, act)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """Take what has come last, and close."""
        if self._connected:
            self._hear()
        self._socket.close()

    def _act(self, now_s: float) -> None:
        if not self._connected:
            if not os.path.exists(self._path):
                return
            self._socket.connect(self._path)
            self._socket.setblocking(False)
            self._connected = True
        torque_Nm = self._torque_Nm(now_s)
        if not math.isnan(torque_Nm):
            self._socket.send(json.dumps({"torque_Nm": torque_Nm}).encode() + b"\n")
        self._hear()

    def _hear(self) -> None:
        with contextlib.suppress(BlockingIOError):
            while chunk := self._socket.recv(65536):
                self._rest += chunk
        *lines, self._rest = self._rest.split(b"\n")
        self.answers += [json.loads(line) for line in lines]
