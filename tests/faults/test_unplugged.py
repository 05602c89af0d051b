"""The port goes: an error by one name, closed, opened again under its name, zero first, and on as before."""

from __future__ import annotations

import errno
import os
import termios
from pathlib import Path

import numpy as np
import pytest
import serial

from rw_ekf.clock import SystemClock
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.errors import DriverError
from tests.faults.ports import Failing, opening
from tests.faults.rig import EACH_FAMILY, port_of
from tests.live.bench import FAMILIES, Bench, open_descriptors, wait_for
from tests.live.daemon import run
from tests.serial_wheels import open_serial_wheel

pytestmark = pytest.mark.usefixtures("family")

CLOCK = SystemClock()
ERRORS: list[BaseException] = [
    serial.SerialException("device disconnected"),
    OSError(errno.EIO, "Input/output error"),
    termios.error(errno.EIO, "Input/output error"),
    TypeError("'NoneType' object cannot be interpreted as an integer"),
]


def reopened(wheel: SerialWheel, bench: Bench, wire_map: WireMap) -> SerialWheel:
    """The wheel on its new line, as soon as there is one; a lost wheel is not waited for to answer."""
    found: list[SerialWheel] = []

    def tried() -> bool:
        try:
            found.append(open_serial_wheel(bench.port, wire_map, CLOCK, 0.15, probe=False, previous=wheel))
        except DriverError:
            return False
        return True

    wait_for(tried)
    return found[0]


def until_lost(wheel: SerialWheel) -> None:
    """Read until the line fails."""

    def failed() -> bool:
        try:
            wheel.read(0.2)
        except DriverError:
            return True
        return False

    wait_for(failed)


@EACH_FAMILY
def test_fifty_times_out_and_in(bench: Bench, wheel: SerialWheel, wire_map: WireMap) -> None:
    """Row 1: each time a DriverError and nothing else, then a new segment of the same wheel; no descriptor is kept."""
    path, before = Path(bench.port), 0
    for turn in range(50):
        if turn == 10:  # the simulator keeps the last few numbers taken
            before = open_descriptors()
        wait_for(lambda wheel=wheel: wheel.read(1.0) is not None)  # type: ignore[misc]
        bench.fault("hangup")
        until_lost(wheel)
        wait_for(lambda: not path.is_symlink())
        with pytest.raises(DriverError, match="there is no port"):
            open_serial_wheel(bench.port, wire_map, CLOCK, 0.15, previous=wheel)
        bench.fault("")
        wheel = reopened(wheel, bench, wire_map)
        wait_for(lambda wheel=wheel: wheel.command_current(0.0).acknowledged)  # type: ignore[misc]
        assert wheel.identity is None  # until the wheel says who it is
        wait_for(lambda wheel=wheel: wheel.read(1.0) is not None)  # type: ignore[misc]
        wait_for(lambda wheel=wheel: wheel.identity is not None or not wheel.read(1.0))  # type: ignore[misc]
    assert open_descriptors() <= before
    assert wheel.link.reconnects == 50
    wheel.close()


@EACH_FAMILY
def test_the_daemon_is_lost_at_once_and_takes_the_line_up_again_with_zero_first(bench: Bench) -> None:
    """Row 1: LOST, no update meanwhile; back: the first write is zero, a new segment, then the profile and TRACKING."""
    back: list[int] = []

    def plug() -> None:
        back.append(len(bench.recorder.writes_A()))
        bench.plug()

    patient = {"silence_s": 2.0}  # a lost line is told at once; a reply that is late is none
    ran = run(bench, 4.0, (1.0, bench.unplug), (1.8, plug), limits=patient)
    assert ran.outcome.link.reconnects == 1
    assert not ran.outcome.lost
    assert ran.outcome.zero_confirmed
    writes = bench.recorder.writes_A()[back[0] :]
    assert writes[0] == 0.0
    assert any(abs(value) > 0.01 for value in writes[1:-1])
    assert bench.registers.command_A == 0.0
    assert ran.notes.events.count("link_lost") == 1
    assert ran.notes.events.count("link_back") == 1
    assert ran.outcome.statistics.rejected == 0
    assert np.unique(ran.log.segment).size == 2
    lost = ran.notes.states.index("LOST")
    assert ran.notes.states[lost : lost + 3] == ["LOST", "CONNECTING", "TRACKING"]


@EACH_FAMILY
def test_it_comes_back_as_another_device(bench: Bench, wheel: SerialWheel, wire_map: WireMap) -> None:
    """Row 2: the old number is still taken, the link leads to a new one: the old is closed, the new opened."""
    old_device, old_port = os.readlink(bench.port), port_of(wheel)._serial
    bench.fault("hangup")
    until_lost(wheel)
    bench.fault("")
    wait_for(lambda: os.path.exists(bench.port) and os.readlink(bench.port) != old_device)
    again = reopened(wheel, bench, wire_map)
    assert old_port.fd is None
    assert os.ttyname(port_of(again)._serial.fd) == os.readlink(bench.port)
    assert again.read(1.0) is not None
    again.close()


@pytest.mark.parametrize(
    ("family", "error"),
    [
        *((FAMILIES[0], error) for error in ERRORS),
        *((family, ERRORS[0]) for family in (*FAMILIES[1:], "odrive-ascii-wheel")),  # what these add is where they call
    ],
    ids=lambda given: given if isinstance(given, str) else f"{type(given).__module__}.{type(given).__name__}",
    indirect=["family"],
)
def test_every_call_of_a_port_may_fail(bench: Bench, wire_map: WireMap, error: BaseException) -> None:
    """Row 3: raised at call k, for every k of a session: a DriverError or nothing, then reopened; all is closed."""
    before, at_call, went_through = open_descriptors(), 0, False
    while not went_through:
        at_call += 1
        port: list[Failing] = []

        def wrap(opened: object, at_call: int = at_call, port: list[Failing] = port) -> Failing:
            port.append(Failing(opened, at_call, error))
            return port[0]

        wheel: SerialWheel | None = None
        try:
            wheel = open_serial_wheel(bench.port, wire_map, CLOCK, 0.1, open_port=opening(wrap))
            wheel.read(0.2)
            wheel.command_current(0.1)
            wheel.read(0.2)
            wheel.close()
        except DriverError as reported:
            assert "failed" in str(reported) or "could not be opened" in str(reported)  # noqa: PT017
        went_through = not port[0].raised
        port[0]._port.close()  # where close itself is what failed
        again = open_serial_wheel(bench.port, wire_map, CLOCK, 0.15, previous=wheel)
        wait_for(lambda again=again: again.read(1.0) is not None)  # type: ignore[misc]
        again.close()
        assert open_descriptors() <= before  # what an earlier test has left may go meanwhile
    assert at_call > 20
