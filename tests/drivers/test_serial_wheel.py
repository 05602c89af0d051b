"""The serial driver against a wheel on a pty: normal work, every fault of a line, and recovery from each."""

from __future__ import annotations

import errno
import itertools
import os
import pty
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.checking.findings import Where
from rw_ekf.clock import SystemClock
from rw_ekf.drivers.line.framing import Frame, decode, encode
from rw_ekf.drivers.line.line import Exchange
from rw_ekf.drivers.line.line_errors import open_error
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.drivers.line.wire_layout import Register
from rw_ekf.drivers.line.wire_map import WireMap, wire_map_from_mapping
from rw_ekf.drivers.sim.register_server import RegisterServer
from rw_ekf.errors import DriverError
from rw_ekf.records import FAULT
from tests.injecting import put_faults
from tests.serial_wheels import open_serial_wheel

CLOCK = SystemClock()

Served = Callable[..., AbstractContextManager[RegisterServer]]
TIMEOUT_S = 0.15  # generous: the machine may be busy


@pytest.fixture
def line(wire_map: WireMap, served: Served, tmp_path: Path) -> Iterator[tuple[SerialWheel, RegisterServer]]:
    """An open wheel and the server behind it."""
    with served(wire_map, tmp_path / "wheel") as server:
        wheel = open_serial_wheel(str(tmp_path / "wheel"), wire_map, CLOCK, TIMEOUT_S)
        yield wheel, server
        wheel.close()


def test_a_cycle_carries_everything(line: tuple[SerialWheel, RegisterServer]) -> None:
    """One request gives speed, currents, temperature, pressure, voltage, status; identity came on opening."""
    wheel, _ = line
    sample = wheel.read(1.0)
    assert sample is not None
    assert sample.speed_rad_s == pytest.approx(50.0, abs=0.3)
    assert (sample.current_A, sample.current_command_A) == (0.0, 0.0)
    assert sample.temperature_degC == pytest.approx(20.0, abs=0.5)
    assert (sample.pressure_Pa, sample.bus_voltage_V) == (100.0, 28.0)
    assert sample.status == 8
    assert wheel.identity is not None
    assert (wheel.identity.kind, wheel.identity.version, wheel.identity.serial_number) == (6, 1, 77)
    assert wheel.link.timeouts == wheel.link.stale == wheel.link.damaged == 0


def test_the_reported_delay_is_the_wheel_s(line: tuple[SerialWheel, RegisterServer]) -> None:
    """When the command acts, by the driver's reckoning, is when it took force in the wheel's own time."""
    wheel, server = line
    errors = []
    for i in range(8):
        sample = wheel.read(1.0)
        assert sample is not None
        taken: list[float] = []
        original = server._drive

        def spy(current_A: float, taken: list[float] = taken, original: Any = original) -> None:
            taken.append(server.plant.time_s)
            original(current_A)

        server._drive = spy  # type: ignore[method-assign]
        issued = wheel.command_current(0.01 * i)
        server._drive = original  # type: ignore[method-assign]
        errors.append(sample.time_s + issued.delay_s - (taken[0] - server._uptime_zero_s))
    assert min(abs(error) for error in errors) < 0.003  # the others a busy machine may delay on their way


def test_refused_commands_come_back_with_the_status_s_name(line: tuple[SerialWheel, RegisterServer]) -> None:
    """Out of the wheel's range and refused for a fault: the reason by name, and the old current as still in force."""
    wheel, server = line
    refused = wheel.command_current(1.5)
    assert (refused.current_A, refused.reason) == (0.0, "out_of_range")
    server.fault = True
    refused = wheel.command_current(0.1)
    assert (refused.current_A, refused.reason) == (0.0, "refused_in_this_mode")
    assert wheel.command_current(0.0).acknowledged
    server.fault = False
    issued = wheel.command_current(0.12344)
    assert issued.acknowledged
    assert issued.current_A == pytest.approx(0.1234)


def test_a_current_beyond_the_wire_is_an_error(line: tuple[SerialWheel, RegisterServer]) -> None:
    """What the register cannot carry is never clipped behind the caller's back."""
    with pytest.raises(DriverError, match="beyond what i16 carries"):
        line[0].command_current(3.4)


FAULTS: dict[str, tuple[str, str]] = {
    "silence": ("silence", "timeouts"),
    "wrong bit": ("flip/from", "damaged"),
    "torn frame": ("cut/from:7", "timeouts"),
    "old seq": ("seq", "stale"),
    "late by more than the timeout": (f"delay/from:{TIMEOUT_S * 1.4}", "timeouts"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_costs_samples_and_is_counted_and_passes(fault: str, line: tuple[SerialWheel, RegisterServer]) -> None:
    """During the fault no sample and no acknowledgement; its counter rises; the first cycle behind it works again."""
    wheel, server = line
    assert wheel.read(1.0) is not None
    text, counter = FAULTS[fault]
    put_faults(server, text)
    requested = wheel.link.requests
    assert wheel.read(1.0) is None
    issued = wheel.command_current(0.1)
    assert (issued.acknowledged, issued.reason) == (False, "timeout")
    assert wheel.link.requests <= requested + 3  # one try each, and a look at what is in force: who retries is above
    assert getattr(wheel.link, counter) > 0
    put_faults(server)
    time.sleep(TIMEOUT_S)
    assert wheel.read(1.0) is not None
    assert wheel.command_current(0.0).acknowledged


def test_every_third_reply_lost_loses_every_third_sample(line: tuple[SerialWheel, RegisterServer]) -> None:
    """Faults now and then do not spread to the good exchanges between them."""
    wheel, server = line
    wheel._status_due_s = time.monotonic() + 60.0  # only cycles count here
    put_faults(server, "flip/from:1/3")
    samples = []
    for _ in range(9):
        samples.append(wheel.read(1.0) is not None)
        wheel._status_due_s = time.monotonic() + 60.0
    assert samples == [True, True, False] * 3


def test_a_restarted_wheel_starts_a_new_segment(line: tuple[SerialWheel, RegisterServer]) -> None:
    """After a restart the wheel's time begins anew, the segment number rises once, and work goes on."""
    wheel, server = line
    time.sleep(0.05)
    first = wheel.read(1.0)
    server.restart()
    second, third = wheel.read(1.0), wheel.read(1.0)
    assert first is not None
    assert second is not None
    assert third is not None
    assert (first.segment, second.segment, third.segment) == (0, 1, 1)
    assert second.time_s < first.time_s


def test_uptime_wraps_without_a_new_segment(wire_map: WireMap, served: Served, tmp_path: Path) -> None:
    """2^32 ms pass while we read: time goes on, the segment stays."""
    with served(wire_map, tmp_path / "wheel", first_uptime_s=2**32 / 1000 - 0.15):
        wheel = open_serial_wheel(str(tmp_path / "wheel"), wire_map, CLOCK, TIMEOUT_S)
        before = wheel.read(1.0)
        time.sleep(0.25)
        after = wheel.read(1.0)
        wheel.close()
    assert before is not None
    assert after is not None
    assert 0.2 < after.time_s - before.time_s < 3600.0  # and not the 49 days of the counter
    assert after.segment == 0


def test_a_lost_wheel_is_a_driver_error_and_can_be_opened_again(
    wire_map: WireMap, served: Served, tmp_path: Path
) -> None:
    """The port vanishes in use: DriverError naming it. Reopened, its counters and segments go on."""
    port = str(tmp_path / "wheel")
    with served(wire_map, tmp_path / "wheel"):
        wheel = open_serial_wheel(port, wire_map, CLOCK, TIMEOUT_S)
        assert wheel.read(1.0) is not None
        requests = wheel.link.requests
    with pytest.raises(DriverError, match=r"failed: .*check both"):
        wheel.read(1.0)
    with pytest.raises(DriverError, match="there is no port"):
        open_serial_wheel(port, wire_map, CLOCK, TIMEOUT_S, previous=wheel)
    with served(wire_map, tmp_path / "wheel"):
        again = open_serial_wheel(port, wire_map, CLOCK, TIMEOUT_S, previous=wheel)
        sample = again.read(1.0)
        assert sample is not None
        assert sample.segment == 1
        assert again.link.requests > requests
        assert again.link.reconnects == 1
        again.close()
        with pytest.raises(DriverError, match="failed"):
            again.read(0.1)


@pytest.mark.parametrize(
    ("port", "command"),
    [
        ("/tmp/wheel0", "or try the simulated wheel at /tmp/wheel0: rw-ekf simulate"),
        ("/dev/ttyUSB7", "or try the simulated wheel at /tmp/wheel0: rw-ekf simulate"),
        ("/run/my lab/wheel", "or try a simulated wheel there: rw-ekf simulate --link '/run/my lab/wheel'"),
        ("wheel0", f"or try a simulated wheel there: rw-ekf simulate --link {Path.cwd() / 'wheel0'}"),
    ],
)
def test_a_port_that_is_not_there_names_the_command_that_serves_a_wheel(port: str, command: str) -> None:
    """At that very path, unless it is a device's: then the usual one."""
    assert str(open_error(port, FileNotFoundError(errno.ENOENT, "none"), "none")).endswith(command)


def test_nothing_to_open(wire_map: WireMap, tmp_path: Path) -> None:
    """A missing port, a plain file and a dead server are named, each with what to do."""
    (tmp_path / "file").write_text("x")
    with pytest.raises(DriverError, match=r"no port .*rw-ekf simulate"):
        open_serial_wheel(str(tmp_path / "none"), wire_map, CLOCK, TIMEOUT_S)
    with pytest.raises(DriverError, match=r"not a serial port|could not be opened"):
        open_serial_wheel(str(tmp_path / "file"), wire_map, CLOCK, TIMEOUT_S)
    with pytest.raises(DriverError, match=r"socket://127.0.0.1:1 could not be opened.*ign_set_control"):
        open_serial_wheel("socket://127.0.0.1:1", wire_map, CLOCK, TIMEOUT_S)
    with pytest.raises(DriverError, match="nonsense://x could not be opened"):
        open_serial_wheel("nonsense://x", wire_map, CLOCK, TIMEOUT_S)


@contextmanager
def bare_pty(answer: Callable[[bytes], bytes]) -> Iterator[str]:
    """A pty where `answer` makes bytes of bytes."""
    master, device = pty.openpty()
    tty.setraw(device)
    stop = threading.Event()

    def work() -> None:
        os.set_blocking(master, False)
        while not stop.is_set():
            try:
                os.write(master, answer(os.read(master, 1024)))
            except BlockingIOError:
                time.sleep(0.002)

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield os.ttyname(device)
    finally:
        stop.set()
        thread.join()
        os.close(master)
        os.close(device)


@pytest.mark.parametrize(
    ("answer", "count"), [(lambda b: b"", r"\(0 bytes"), (lambda b: b"\xaa\x55" * 9, r"\(\d+ bytes")]
)
def test_a_port_where_no_wheel_speaks(answer: Callable[[bytes], bytes], count: str, wire_map: WireMap) -> None:
    """Silence or garbage for 2 s: the message counts bytes and names baud and wiring."""
    with (
        bare_pty(answer) as port,
        pytest.raises(DriverError, match=rf"no valid frame in 2.0 s {count}, 0 good CRC\).*38400"),
    ):
        open_serial_wheel(port, wire_map, CLOCK, 0.1)


def test_parity_on_a_pty_is_named(map_data: dict[str, Any], where: Where) -> None:
    """Even parity on a pseudo terminal fails in termios; the message says so."""
    map_data["link"]["parity"] = "even"
    spoilt = wire_map_from_mapping(map_data, where)
    with bare_pty(lambda b: b"") as port:
        try:
            wheel = open_serial_wheel(port, spoilt, CLOCK, 0.05, probe=False)
        except DriverError as error:
            assert "parity even" in str(error)  # noqa: PT017 - some kernels take it
        else:
            wheel.close()


def test_read_never_outlasts_its_timeout(wire_map: WireMap) -> None:
    """A silent or babbling peer holds nobody up beyond the deadline."""
    for answer in (lambda b: b"", lambda b: b"\x1f\x7f" + b"z" * 200):
        with bare_pty(answer) as port:
            wheel = open_serial_wheel(port, wire_map, CLOCK, 0.04, probe=False)
            began = time.monotonic()
            assert wheel.read(0.06) is None
            assert time.monotonic() - began < 30.0  # against a hang alone
            wheel.close()


def test_a_map_without_a_cycle_reads_register_by_register(
    map_data: dict[str, Any], where: Where, served: Served, tmp_path: Path
) -> None:
    """Speed and current come from their own registers, time from the host's clock."""
    map_data["registers"] = [r for r in map_data["registers"] if r["name"] in {"speed", "current", "current_command"}]
    small = wire_map_from_mapping(map_data, where)
    with served(small, tmp_path / "wheel"):
        wheel = open_serial_wheel(str(tmp_path / "wheel"), small, CLOCK, TIMEOUT_S)
        first = wheel.read(1.0)
        wheel.command_current(0.2)
        second = wheel.read(1.0)
        wheel.close()
    assert wheel.identity is None
    assert first is not None
    assert second is not None
    assert second.current_A == pytest.approx(0.2)
    assert (second.temperature_degC, second.status) == (None, None)
    assert second.time_s > first.time_s


@pytest.mark.parametrize(("name", "wild"), [("speed", 3.0e38), ("speed", -1.0e12), ("current", -3.0e38)])
def test_a_value_beyond_any_machine_did_not_arrive(
    map_data: dict[str, Any], where: Where, served: Served, tmp_path: Path, name: str, wild: float
) -> None:
    """A float register that carries 3e38: there is no sample, and it counts as damaged."""
    cycle = next(r for r in map_data["registers"] if r["name"] == "cycle")
    for field in cycle["fields"]:
        if field["name"] == name:
            field["type"] = "f32"
            field.pop("scale", None)
    floating = wire_map_from_mapping(map_data, where)
    with served(floating, tmp_path / "wheel") as server:
        put_faults(server, f"value/cycle:{name}={wild}")
        wheel = open_serial_wheel(str(tmp_path / "wheel"), floating, CLOCK, TIMEOUT_S)
        sample = wheel.read(1.0)
        wheel.close()
    assert wheel.link.damaged >= 1
    assert sample is None


def test_a_clock_too_coarse_for_a_sample_gives_it_no_time(
    map_data: dict[str, Any], where: Where, served: Served, tmp_path: Path
) -> None:
    """An uptime in whole seconds: samples are timed by the host, and each is later than the one before."""
    for register in map_data["registers"]:
        for field in register["fields"]:
            if field["name"] == "uptime":
                field["unit"] = "s"
    coarse = wire_map_from_mapping(map_data, where)
    with served(coarse, tmp_path / "wheel"):
        wheel = open_serial_wheel(str(tmp_path / "wheel"), coarse, CLOCK, TIMEOUT_S)
        samples = [wheel.read(1.0) for _ in range(5)]
        wheel.close()
    times = [sample.time_s for sample in samples if sample is not None]
    assert len(times) == 5
    assert all(a < b for a, b in itertools.pairwise(times))


def test_what_is_asked_beside_never_crowds_the_sample_out_for_good(line: tuple[SerialWheel, RegisterServer]) -> None:
    """Where a status read takes all of a tick's time that sample is lost, and no other: the wheel is never silent."""
    wheel, _ = line
    original, requested = wheel._exchange, [""]

    def crowded(register: Register, deadline_s: float) -> Exchange:
        requested.append(register.name)
        if register is wheel._main and requested[-2] in {"status", "identity"}:
            return Exchange(None, 0.0, 0.0)
        return original(register, deadline_s)

    wheel._exchange = crowded  # type: ignore[method-assign]
    wheel._status_due_s = 0.0
    wheel.doubt_identity()
    assert [wheel.read(1.0) is not None for _ in range(6)] == [False, True, True, True, True, True]
    assert requested.count("status") == 1


def test_what_the_status_flags_mean_stands_in_the_sample(line: tuple[SerialWheel, RegisterServer]) -> None:
    """A fault is in the conditions of the next sample after the flag is read, and gone soon after it has cleared."""
    wheel, server = line

    def conditions_become(wanted: set[str]) -> bool:
        end_s = time.monotonic() + 10.0
        while time.monotonic() < end_s:
            sample = wheel.read(1.0)
            if sample is not None and sample.conditions == wanted:
                return True
        return False

    assert conditions_become(set())
    server.fault = True
    assert conditions_become({FAULT})
    server.fault = False
    assert conditions_become(set())


def test_the_serial_side_loads_nothing_heavy() -> None:
    """`stop` must be quick: the serial driver needs no numpy."""
    code = "import sys, rw_ekf.drivers.line.serial_wheel, rw_ekf.drivers.line.wire_map\n"
    code += "print({'numpy', 'scipy'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_golden_write_and_its_reply(wire_map: WireMap) -> None:
    """100 mA goes out as these bytes, and status 0 comes back for the same seq and id."""
    from rw_ekf.drivers.sim.plant_runner import PlantRunner

    server = RegisterServer(wire_map, PlantRunner(seed=1))
    request = encode(7, 3, bytes.fromhex("e803"))
    (reply,) = server.handle(request, 0.0)
    assert request.hex(" ") == "1f 7f 07 03 e8 03 " + request[-4:].hex(" ")
    assert decode(reply.content).frames == (Frame(7, 3, b"\x00"),)
    assert server.plant.current_A == pytest.approx(0.1)


def test_rounding_on_the_wire_never_carries_a_current_beyond_what_was_asked() -> None:
    """A current between two counts goes out as the smaller one; one on a count goes out as it is."""
    from rw_ekf.drivers.line.current_writer import _toward_zero
    from rw_ekf.drivers.line.wire_layout import Field

    field = Field(name="current_command", type="i16", scale=0.1, unit="mA")
    assert _toward_zero(field, 0.60006) == pytest.approx(0.6000)
    assert _toward_zero(field, -0.60006) == pytest.approx(-0.6000)
    assert _toward_zero(field, 0.60004) == 0.60004  # rounds down by itself
    assert _toward_zero(field, 0.6) == 0.6
    assert _toward_zero(field, 0.0) == 0.0
