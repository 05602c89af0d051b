"""A wheel behind a terminal server, raw or RFC 2217, that is restarted: as a port that is unplugged.

The servers are bridges of the tests' own to the simulated wheel's pty; ser2net itself is used where it is installed.
"""

from __future__ import annotations

import contextlib
import os
import select
import shutil
import socket
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
import serial
from serial.rfc2217 import PortManager

from rw_ekf.clock import SystemClock
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.errors import DriverError
from tests.faults.rig import EACH_FAMILY
from tests.live.bench import Bench, wait_for
from tests.serial_wheels import open_serial_wheel

CLOCK = SystemClock()
URLS = {"raw": "socket://127.0.0.1:{}", "rfc2217": "rfc2217://127.0.0.1:{}?ign_set_control"}

pytestmark = [
    EACH_FAMILY,
    pytest.mark.usefixtures("family"),
    pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning"),  # pyserial 3.5 calls them
]


class Bridge:
    """A terminal server on one TCP port: bytes between its client and a tty, until it is stopped."""

    def __init__(self, tty: str, port: int, telnet: bool) -> None:
        self._listener = socket.create_server(("127.0.0.1", port))
        self.port = int(self._listener.getsockname()[1])
        self._tty = os.open(tty, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self._telnet = telnet
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def stop(self) -> None:
        """End as a server does that is killed: its connection breaks, its port is free."""
        self._over.set()
        self._thread.join()
        self._listener.close()
        os.close(self._tty)

    def _serve(self) -> None:
        self._listener.settimeout(0.05)
        while not self._over.is_set():
            with contextlib.suppress(OSError):
                connection, _ = self._listener.accept()
                connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # else a reply behind an echo waits
                with connection, serial.serial_for_url("loop://") as settings:
                    self._pass(connection, settings)

    def _pass(self, connection: socket.socket, settings: Any) -> None:
        manager: Any = cast(Any, PortManager)(settings, SimpleNamespace(write=connection.sendall))
        while not self._over.is_set():
            watched: list[Any] = [connection, self._tty]
            ready, _, _ = select.select(watched, [], [], 0.05)
            if connection in ready:
                received = connection.recv(1024)
                if not received:
                    return
                os.write(self._tty, b"".join(manager.filter(received)) if self._telnet else received)
            if self._tty in ready:
                sent = os.read(self._tty, 1024)
                connection.sendall(b"".join(manager.escape(sent)) if self._telnet else sent)


@pytest.mark.parametrize("kind", URLS)
def test_a_terminal_server_that_restarts_is_as_a_port_unplugged(bench: Bench, wire_map: WireMap, kind: str) -> None:
    """Row 30: three times: a DriverError that names the port, then nothing, then the wheel and its counters."""
    bridge = Bridge(bench.port, 0, kind == "rfc2217")
    port = bridge.port
    url = URLS[kind].format(port)
    wheel = open_serial_wheel(url, wire_map, CLOCK, 0.3)
    for turn in range(3):
        assert wheel.read(1.0) is not None
        assert wheel.command_current(0.1).acknowledged
        bridge.stop()
        stated = _lost(wheel)
        assert url in stated
        with pytest.raises(DriverError, match="could not be opened"):
            open_serial_wheel(url, wire_map, CLOCK, 0.3, previous=wheel)
        bridge = Bridge(bench.port, port, kind == "rfc2217")
        wheel = open_serial_wheel(url, wire_map, CLOCK, 0.3, probe=False, previous=wheel)
        assert wheel.command_current(0.0).acknowledged
        assert wheel.link.reconnects == turn + 1
    assert wheel.read(1.0) is not None
    wheel.close()
    bridge.stop()


@contextlib.contextmanager
def _ser2net(directory: Path, tty: str, port: int, kind: str) -> Iterator[None]:
    """The real program on one port."""
    accepter = "telnet(rfc2217)" if kind == "rfc2217" else "tcp"
    where = f"{accepter},tcp,localhost,{port}" if kind == "rfc2217" else f"tcp,localhost,{port}"
    path = directory / "ser2net.yaml"
    path.write_text(
        f"connection: &wheel\n  accepter: {where}\n  connector: serialdev,{tty},38400n81,local\n", encoding="utf-8"
    )
    process = subprocess.Popen([str(shutil.which("ser2net")), "-n", "-u", "-c", str(path)])
    try:
        wait_for(lambda: _listens(port))
        yield
    finally:
        process.kill()
        process.wait()


@pytest.mark.skipif(shutil.which("ser2net") is None, reason="ser2net is not installed; a bridge stands in for it")
@pytest.mark.parametrize("kind", URLS)
def test_ser2net_that_restarts_is_as_a_port_unplugged(
    bench: Bench, wire_map: WireMap, kind: str, tmp_path: Path
) -> None:
    """Row 30: the real one, killed and started again."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = int(free.getsockname()[1])
    url = URLS[kind].format(port)
    with _ser2net(tmp_path, bench.port, port, kind):
        wheel = open_serial_wheel(url, wire_map, CLOCK, 0.5)
        assert wheel.read(1.0) is not None
    assert url in _lost(wheel)
    with _ser2net(tmp_path, bench.port, port, kind):
        wheel = open_serial_wheel(url, wire_map, CLOCK, 0.5, probe=False, previous=wheel)
        assert wheel.command_current(0.0).acknowledged
        assert wheel.read(1.0) is not None
        wheel.close()


def _lost(wheel: SerialWheel) -> str:
    """What is said when the line fails."""
    stated: list[str] = []

    def failed() -> bool:
        try:
            wheel.read(0.3)
        except DriverError as error:
            stated.append(str(error))
        return bool(stated)

    wait_for(failed)
    return stated[0]


def _listens(port: int) -> bool:
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), 0.2):
        return True
    return False
