"""What systemd hears of a run, through a socket that is its own in these tests."""

from __future__ import annotations

import os
import secrets
import signal
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from rw_ekf.clock import VirtualClock
from rw_ekf.live.oversight import SystemdWatchdog, systemd_of
from rw_ekf.records import RunState, StateNow
from tests.faults.supervised import kill, running
from tests.live.bench import Bench, rw_ekf

CONNECTING = StateNow(RunState.CONNECTING, "2000-01-01T00:00:00Z", "the line has been opened")
HANG = """
from rw_ekf.sinks.all_sinks import StatisticsSink
import os, time
good = StatisticsSink.write
def held(self, tick):
    good(self, tick)
    while os.path.exists({flag!r}):
        time.sleep(0.01)
StatisticsSink.write = held
"""


class Listener:
    """systemd's end of the socket."""

    def __init__(self, address: str) -> None:
        self.address = address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind("\0" + address[1:] if address.startswith("@") else address)
        self._socket.setblocking(False)
        self.words: list[str] = []

    def heard(self) -> list[str]:
        """Every word so far, in order."""
        while True:
            try:
                self.words += self._socket.recv(65536).decode().splitlines()
            except BlockingIOError:
                return self.words

    def pings(self) -> int:
        """How often it was told that the run is alive."""
        return self.heard().count("WATCHDOG=1")

    def close(self) -> None:
        """No more."""
        self._socket.close()


@contextmanager
def listening(address: str) -> Iterator[Listener]:
    """A socket at a path, or an abstract one."""
    listener = Listener(address)
    try:
        yield listener
    finally:
        listener.close()


def test_a_hang_of_the_loop_is_silence_to_systemd(bench: Bench) -> None:
    """Row 29: pings come with completed turns; a sink that blocks stops them; when it is free again they go on."""
    flag = bench.directory / "held"
    with listening(f"@rw-ekf-{secrets.token_hex(8)}") as systemd:
        environment = os.environ | {"NOTIFY_SOCKET": systemd.address, "WATCHDOG_USEC": "400000"}
        with running(bench, sabotage=HANG.format(flag=str(flag)), env=environment) as run:
            run.wait(lambda: systemd.pings() >= 3)
            assert systemd.heard()[0] == "READY=1"
            run.wait(lambda: any(word.startswith("STATUS=TRACKING") for word in systemd.heard()))
            flag.touch()
            requests = len(bench.recorder.requests)
            run.wait(lambda: _still(bench, requests))
            held = systemd.pings()
            time.sleep(1.0)  # two and a half times the watchdog's patience
            assert systemd.pings() == held
            flag.unlink()
            run.wait(lambda: systemd.pings() >= held + 3)
            assert "STOPPING=1" not in systemd.heard()
            kill(run.pid, signal.SIGTERM)
            assert run.ended() == 0
            assert "STOPPING=1" in systemd.heard()
    assert bench.registers.command_A == 0.0


def _still(bench: Bench, requests: int) -> bool:
    """Whether nothing has been asked of the wheel for a while."""
    return time.monotonic() - bench.recorder.requests[-1][0] > 0.5 and len(bench.recorder.requests) >= requests


def test_a_killed_daemon_is_followed_by_stop(bench: Bench) -> None:
    """Row 29: what systemd does then, SIGKILL and ExecStopPost: the wheel is at zero, and the next start tracks."""
    with running(bench) as run:
        first = run.child()
        kill(first, signal.SIGKILL)
        run.process.wait()
        assert rw_ekf("stop", "--config", run.config).returncode == 0
        assert bench.registers.command_A == 0.0
    with running(bench, "--keep-safe") as run:
        assert run.child(besides=(first,)) == run.pid


def test_a_run_that_is_never_read_does_not_wait(tmp_path: Path) -> None:
    """Row 29: systemd's socket is full, or gone: nothing blocks or raises; what was not taken is said again."""
    clock = VirtualClock()
    with listening(str(tmp_path / "notify")) as systemd:
        reported = SystemdWatchdog(systemd.address, 1e-3, clock)
        for number in range(2000):
            clock.sleep(1.0)
            reported.turned(CONNECTING._replace(reason=str(number)))
        assert 0 < systemd.pings() < 2000
        reported.turned(CONNECTING)
        assert systemd.heard()[-2:] == ["STATUS=CONNECTING: the line has been opened", "WATCHDOG=1"]
    reported.turned(CONNECTING._replace(reason="nobody there"))
    reported.over()


def test_pings_are_rare_and_never_too_rare(tmp_path: Path) -> None:
    """Row 29: at 10 turns a second and a patience of 10 s a ping every 2.5 s; one status for each state; one READY."""
    clock = VirtualClock()
    with listening(str(tmp_path / "notify")) as systemd:
        environment = {"NOTIFY_SOCKET": systemd.address, "WATCHDOG_USEC": "10000000", "WATCHDOG_PID": str(os.getpid())}
        reported = systemd_of(environment, clock)
        assert reported is not None
        for _ in range(1000):
            clock.sleep(0.1)
            reported.turned(CONNECTING)
            systemd.heard()
        assert systemd.pings() == pytest.approx(40, abs=2)
        assert systemd.words.count("READY=1") == 1
        assert sum(word.startswith("STATUS=") for word in systemd.words) == 1


def test_without_systemd_nothing_is_said() -> None:
    """Row 29: no socket, or of a kind that is not ours: nobody is told; another process's watchdog gets no ping."""
    clock = VirtualClock()
    assert systemd_of({}, clock) is None
    assert systemd_of({"NOTIFY_SOCKET": "vsock:2:1234"}, clock) is None
    name = f"@rw-ekf-{secrets.token_hex(8)}"
    with listening(name) as systemd:
        reported = systemd_of({"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "1000", "WATCHDOG_PID": "1"}, clock)
        assert reported is not None
        reported.turned(None)
        assert systemd.heard() == ["READY=1"]


def test_supervise_is_refused_under_systemd(bench: Bench) -> None:
    """Row 29: two that watch one run would stop and start it against each other: exit 2, one sentence."""
    refused = rw_ekf(
        "run", "--supervise", "--config", str(bench.config()), env=os.environ | {"NOTIFY_SOCKET": "/nowhere"}
    )
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    assert "leave it out" in refused.stderr
