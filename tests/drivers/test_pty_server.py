"""A simulated wheel as a program: its link, its signals, its pace, and what it costs."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest
import serial

from rw_ekf.clock import SystemClock
from rw_ekf.drivers.line.framing import decode, encode
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.drivers.sim.fault_text import parse_faults
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.drivers.sim.register_server import RegisterServer
from rw_ekf.errors import DriverError
from tests.serial_wheels import open_serial_wheel, serve_simulated_wheel

CLOCK = SystemClock()
Served = Callable[..., AbstractContextManager[RegisterServer]]
ROOT = Path(__file__).parents[2]
PROGRAM = """
import sys, yaml
from rw_ekf.drivers.sim.fault_text import parse_faults
from rw_ekf.drivers.sim.plant_parameters import PlantParameters
from rw_ekf.drivers.line.register_protocol import RegisterProtocol
from rw_ekf.drivers.line.wire_map import wire_map_from_mapping

wire_map = wire_map_from_mapping(yaml.safe_load(open("config/sunspace-wheel.yaml")), str)
RegisterProtocol(wire_map).serve(PlantParameters(), sys.argv[1], initial_speed_rad_s=50.0,
                                 on_ready=lambda device: print(device, flush=True))
print("ended", flush=True)
"""


@contextmanager
def program(link_path: Path) -> Iterator[subprocess.Popen[str]]:
    """The simulated wheel in a process of its own, ready to be opened."""
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(link_path)], cwd=ROOT, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline().startswith("/dev/")
    try:
        yield process
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_it_cleanly(number: signal.Signals, tmp_path: Path) -> None:
    """SIGINT, SIGTERM and SIGHUP: it leaves its loop, removes its link and exits 0, at once."""
    link = tmp_path / "wheel"
    with program(link) as process:
        assert link.is_symlink()
        process.send_signal(number)
        assert process.stdout is not None
        assert process.stdout.readline() == "ended\n"
        assert process.wait(2.0) == 0
    assert not os.path.lexists(link)


def test_a_killed_one_leaves_a_link_that_the_next_one_takes_over(wire_map: WireMap, tmp_path: Path) -> None:
    """kill -9 leaves the link behind; it leads nowhere, so starting again just works."""
    link = tmp_path / "wheel"
    with program(link):
        kept = os.open(link, os.O_RDWR | os.O_NOCTTY)  # its number stays taken: a test in another process would get it
    try:
        assert link.is_symlink()
        assert not link.exists()
        serve_simulated_wheel(wire_map, PlantParameters(), link, duration_s=0.05)
        assert not os.path.lexists(link)
    finally:
        os.close(kept)


def test_what_it_does_not_replace(wire_map: WireMap, served: Served, tmp_path: Path) -> None:
    """A file, a link elsewhere and a wheel in use are left alone, with a message; a missing directory is named."""
    file, elsewhere, wheel = tmp_path / "file", tmp_path / "elsewhere", tmp_path / "wheel"
    file.write_text("precious")
    elsewhere.symlink_to(file)
    with served(wire_map, wheel):
        for path, message in (
            (file, "exists and is not a link"),
            (elsewhere, "is a link to .*file, not to a simulated wheel"),
            (wheel, "is in use: another simulated wheel"),
            (tmp_path / "none" / "wheel", "there is no directory"),
        ):
            with pytest.raises(DriverError, match=message):
                serve_simulated_wheel(wire_map, PlantParameters(), path, duration_s=0.05)
        assert wheel.is_symlink()
    assert file.read_text() == "precious"
    assert elsewhere.is_symlink()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["elsewhere", "file"]


def test_stop_ready_and_duration(wire_map: WireMap, tmp_path: Path) -> None:
    """on_ready is told when the link is there; an event, a callable or a duration ends it, in a thread too."""
    stop, seen = threading.Event(), []

    def ready(device: str) -> None:
        seen.append((device, os.readlink(tmp_path / "wheel")))
        stop.set()

    for ending in (stop, stop.is_set):
        stop.clear()
        keys = {"on_ready": ready, "stop": ending}
        thread = threading.Thread(
            target=serve_simulated_wheel, args=(wire_map, PlantParameters(), tmp_path / "wheel"), kwargs=keys
        )
        thread.start()
        thread.join(30.0)  # against a hang alone
        assert not thread.is_alive()
    assert all(device == target for device, target in seen)
    began = time.monotonic()
    serve_simulated_wheel(wire_map, PlantParameters(), tmp_path / "wheel", duration_s=0.2)
    assert time.monotonic() - began > 0.15


def test_clients_come_and_go(wire_map: WireMap, served: Served, tmp_path: Path) -> None:
    """Closing and opening again finds the same wheel, its time and its current going on."""
    with served(wire_map, tmp_path / "wheel"):
        times = []
        for _ in range(3):
            wheel = open_serial_wheel(str(tmp_path / "wheel"), wire_map, CLOCK, 0.2)
            sample = wheel.read(1.0)
            assert sample is not None
            times.append(sample.time_s)
            assert sample.current_A == pytest.approx(0.1 if len(times) > 1 else 0.0)
            wheel.command_current(0.1)
            wheel.close()
    assert times == sorted(times)


def quickest_cycle_s(link: Path, baud: int) -> float:
    """Of ten cycles of 8 bytes out and 24 or so back, over a port of that speed."""
    with serial.Serial(str(link), baud, timeout=0.5) as port:
        took = []
        for seq in range(10):
            began = time.monotonic()
            port.write(encode(seq, 137))
            received = b""
            while not (frames := decode(received).frames):
                received += port.read(1)
            took.append(time.monotonic() - began)
            assert frames[0].seq == seq
    return min(took)


def test_the_line_takes_its_time(wire_map: WireMap, served: Served, tmp_path: Path) -> None:
    """A cycle is no quicker than the line: 38400 baud as the map has it, or faster where the client's port is."""
    with served(wire_map, tmp_path / "wheel"):
        usual, slow, fast = (quickest_cycle_s(tmp_path / "wheel", baud) for baud in (38400, 9600, 115200))
    bits = (8 + 24) * 10
    assert min(usual, slow) >= bits / 38400
    assert bits / 115200 <= fast < min(usual, slow)


def test_speed_factor_makes_time_pass_faster(wire_map: WireMap, served: Served, tmp_path: Path) -> None:
    """At factor 20 a quarter of a second here is five seconds for the wheel."""
    with served(wire_map, tmp_path / "wheel", speed_factor=20.0):
        wheel = open_serial_wheel(str(tmp_path / "wheel"), wire_map, CLOCK, 0.2)
        wanted = time.monotonic()
        first, answered = wheel.read(1.0), time.monotonic()
        time.sleep(0.25)
        wanted_again = time.monotonic()
        second, answered_again = wheel.read(1.0), time.monotonic()
        wheel.close()
    assert first is not None
    assert second is not None
    passed = (second.time_s - first.time_s) / 20.0
    assert wanted_again - answered - 0.001 <= passed <= answered_again - wanted + 0.001  # its clock counts milliseconds


def test_it_costs_little(wire_map: WireMap, tmp_path: Path) -> None:
    """Polled at 10 Hz it waits and does not spin, which a fifth of a core would be enough to show."""
    with program(tmp_path / "wheel") as process:
        wheel = open_serial_wheel(str(tmp_path / "wheel"), wire_map, CLOCK, 0.2)
        before, began = _cpu_s(process.pid), time.monotonic()
        for _ in range(20):
            wheel.read(1.0)
            wheel.command_current(0.05)
            time.sleep(0.08)
        used = (_cpu_s(process.pid) - before) / (time.monotonic() - began)
        wheel.close()
    assert used < 0.2


def test_a_port_that_hangs_up_comes_back_under_its_name(wire_map: WireMap, tmp_path: Path) -> None:
    """The link is gone for its time, then leads to a new pty on which the same wheel answers, its time gone on."""
    link, stop = tmp_path / "wheel", threading.Event()
    led: set[str] = set()
    keys = {"stop": stop, "faults": parse_faults(["hangup@0.5s:0.5s:1s"])}
    thread = threading.Thread(
        target=serve_simulated_wheel, args=(wire_map, PlantParameters(), link), kwargs=keys, daemon=True
    )
    thread.start()
    times: list[float] = []
    end_s = time.monotonic() + 30.0
    while len(led) < 4 and time.monotonic() < end_s:
        with contextlib.suppress(DriverError):
            wheel = open_serial_wheel(str(link), wire_map, CLOCK, 0.05, probe=False)
            led.add(os.readlink(link))
            with contextlib.closing(wheel):
                while True:
                    sample = wheel.read(0.1)
                    times += [] if sample is None else [sample.time_s]
        time.sleep(0.02)
    stop.set()
    thread.join(10.0)
    assert len(led) == 4
    assert times == sorted(times)
    assert max(times) > 2.0
    assert not os.path.lexists(link)


def _cpu_s(pid: int) -> float:
    """Processor time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_the_same_seed_gives_the_same_noise(wire_map: WireMap) -> None:
    """What is random about a served wheel comes from its seed."""
    from rw_ekf.drivers.sim.plant_runner import PlantRunner

    readings = []
    for seed in (1, 1, 2):
        server = RegisterServer(wire_map, PlantRunner(noise=PlantNoise(1.0), seed=seed))
        readings.append([server.handle(encode(i, 133), i * 0.1)[0].content for i in range(10)])
    assert readings[0] == readings[1] != readings[2]
