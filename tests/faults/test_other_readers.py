"""Others on the port: they are kept out, or what they do is said and passes."""

from __future__ import annotations

import array
import contextlib
import fcntl
import itertools
import os
import threading
import time

import numpy as np
import pytest

from rw_ekf.clock import SystemClock
from rw_ekf.drivers.line import serial_port
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.errors import DriverError
from tests.faults.rig import EACH_FAMILY, port_of
from tests.live.bench import Bench, wait_for
from tests.serial_wheels import open_serial_wheel

pytestmark = [EACH_FAMILY, pytest.mark.usefixtures("family")]

TIOCGEXCL = 0x80045440
MODEM_MANAGER = b"AT\r\r\nAT+GCAP\rAT\x7e\x00\x78\xf0\x7e\r"


def test_a_second_opening_says_that_the_port_is_in_use(bench: Bench, wheel: SerialWheel, wire_map: WireMap) -> None:
    """Row 4: two programs on one wheel would steal each other's replies: the second one is told; the first goes on."""
    with pytest.raises(DriverError, match=r"in use by another process.*rw-ekf stop"):
        open_serial_wheel(bench.port, wire_map, SystemClock(), 0.15)
    assert wheel.read(1.0) is not None


def test_the_kernel_keeps_others_out_of_a_true_device(
    bench: Bench, wire_map: WireMap, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Row 4: TIOCEXCL is set where the port is no pseudo terminal (here one that is taken for a device), else not."""

    def exclusive(*, pseudo: bool) -> bool:
        monkeypatch.setattr(serial_port, "_PSEUDO_TERMINALS", range(136, 144) if pseudo else range(0))
        wheel = open_serial_wheel(bench.port, wire_map, SystemClock(), 0.15)
        flag = array.array("i", [0])
        fcntl.ioctl(port_of(wheel)._serial.fd, TIOCGEXCL, flag)
        assert wheel.read(1.0) is not None
        wheel.close()
        return bool(flag[0])

    assert not exclusive(pseudo=True)
    assert exclusive(pseudo=False)


def test_one_who_reads_all_the_same_costs_samples_and_no_more(bench: Bench, wheel: SerialWheel) -> None:
    """Row 4: a thief opens the port beside the lock: samples are missed, none is wrong; then all come again."""
    over, stolen, missed = threading.Event(), [], 0
    thief = os.open(bench.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

    def steal() -> None:
        while not over.is_set():
            with contextlib.suppress(BlockingIOError):
                stolen.append(os.read(thief, 64))
            over.wait(0.0005)

    thread = threading.Thread(target=steal)
    thread.start()
    speeds: list[float] = []
    try:
        patience_end_s = time.monotonic() + 120.0  # who is first is the machine's affair: until both have won
        for count in itertools.count():
            if (count >= 40 and missed and stolen) or time.monotonic() > patience_end_s:
                break
            try:
                sample = wheel.read(0.2)
            except DriverError as error:  # pyserial: readable, and nothing to read
                assert "a second process reads the same port" in str(error)  # noqa: PT017
                sample = None
            missed += sample is None
            speeds += [] if sample is None or sample.speed_rad_s is None else [sample.speed_rad_s]
    finally:
        over.set()
        thread.join()
        os.close(thief)
    assert np.all(np.diff(speeds, prepend=20.0) < 1.0)  # it slows down, the more the longer the machine takes
    assert min(speeds, default=20.0) > -1.0
    assert stolen
    assert missed > 0
    assert all(wheel.read(1.0) is not None for _ in range(10))


def test_a_zero_beside_a_daemon_reaches_the_wheel_whoever_reads_the_answers(bench: Bench, wire_map: WireMap) -> None:
    """What `stop` does beside a daemon that it may not end: each try brings one, though another reads what comes."""
    over = threading.Event()
    thief = os.open(bench.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

    def talk_and_steal() -> None:
        while not over.is_set():
            with contextlib.suppress(BlockingIOError):
                os.read(thief, 64)
            server = bench._server
            assert server is not None
            server.pty.write(b"an answer to somebody else")

    thread = threading.Thread(target=talk_and_steal)
    thread.start()
    try:
        for _ in range(20):
            before = bench.recorder.writes_A().count(0.0)
            beside = open_serial_wheel(bench.port, wire_map, SystemClock(), 0.05, probe=False, exclusive=False)
            beside.stop_current()
            beside.close()
            wait_for(lambda before=before: bench.recorder.writes_A().count(0.0) > before)  # type: ignore[misc]
    finally:
        over.set()
        thread.join()
        os.close(thief)


def test_what_a_modem_manager_writes_is_ignored(bench: Bench, wire_map: WireMap) -> None:
    """Row 5: AT commands before the first frame, between frames, and answered in kind: no sample is lost to them."""
    stranger = os.open(bench.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    os.write(stranger, MODEM_MANAGER)
    server = bench._server
    assert server is not None
    server.pty.write(b"\r\nERROR\r\n" + MODEM_MANAGER)
    wheel = open_serial_wheel(bench.port, wire_map, SystemClock(), 0.15)
    for _ in range(10):
        os.write(stranger, MODEM_MANAGER)
        server.pty.write(MODEM_MANAGER)
        assert wheel.read(1.0) is not None
        assert wheel.command_current(0.01).acknowledged
    os.close(stranger)
    assert wheel.read(1.0) is not None
    wheel.close()
