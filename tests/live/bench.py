"""What the tests of the daemon share: a simulated wheel on a pty that keeps a record, its configuration, its run."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from rw_ekf.attach.wire import checked_protocol
from rw_ekf.checking.yaml_loader import load_yaml
from rw_ekf.clock import VirtualClock
from rw_ekf.drivers.line.framing import Frame
from rw_ekf.drivers.line.register_protocol import RegisterProtocol
from rw_ekf.drivers.line.registers import decode_register
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.drivers.protocols import protocol_of
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.pty_server import PtyServer
from rw_ekf.drivers.sim.register_server import RegisterServer
from rw_ekf.drivers.sim.virtual_line import VirtualCable
from rw_ekf.settings.resources import protocol_path
from rw_ekf.settings.schema import Configuration
from rw_ekf.units import RAD_S_PER_RPM
from tests.contract import check_document
from tests.injecting import put_faults

ROOT = Path(__file__).parents[2]
PROGRAM = (sys.executable, "-W", "ignore", "-m", "rw_ekf")
CURRENT_COMMAND, CYCLE = 3, 137
FAMILIES = ("sunspace-wheel", "nsp-wheel", "can-wheel", "ascii-wheel", "vesc-wheel")  # one map of each family of wheels
CONFIRMED_BY_TELEMETRY = ("can-wheel", "vesc-wheel")  # those that answer no command


@dataclass
class Recorder:
    """Remembers what the wheel was sent."""

    wire_map: WireMap
    requests: list[tuple[float, Frame]] = field(default_factory=list)

    def __call__(self, request: Frame) -> None:
        self.requests.append((time.monotonic(), request))

    def writes_A(self) -> list[float]:
        """Every current that a good write frame carried, in order."""
        register = self.wire_map.current_command
        frames = [frame for _, frame in list(self.requests) if frame.id == register.id]
        return [decode_register(register, frame.data)["current_command"] for frame in frames]

    def ids(self) -> set[int]:
        """Ids of all good frames so far."""
        return {frame.id for _, frame in list(self.requests)}


@dataclass
class Bench:
    """A wheel that is being served, and where its runs go. cable: its line, where it is on a virtual clock."""

    directory: Path
    registers: RegisterServer
    recorder: Recorder
    link: str = "wheel"
    protocol: str = "sunspace-wheel"
    cable: VirtualCable | None = None
    _server: PtyServer | None = None
    _thread: threading.Thread | None = None
    _stop: threading.Event = field(default_factory=threading.Event)
    _gone: list[int] = field(default_factory=list)

    def fault(self, text: str) -> None:
        """From now on the wheel has these faults and no others; none where the text is empty."""
        put_faults(self.registers, text)

    def plug(self) -> None:
        """Serve the wheel on a pty; it goes on where it was."""
        self._stop.clear()
        self._server = PtyServer(self.registers, self.directory / self.link)
        self._thread = threading.Thread(target=self._server.run, args=(self._stop.is_set,), daemon=True)
        self._thread.start()

    def unplug(self) -> None:
        """The pty vanishes, as an adapter does that is pulled out; the wheel keeps its current.

        Its number stays taken until `end`: the daemon still claims it, and a test in another process may get it.
        """
        self._stop.set()
        if self._thread is not None and self._server is not None:
            self._thread.join(5.0)
            self._gone.append(os.open(self._server.pty.device_path, os.O_RDWR | os.O_NOCTTY))
            self._server.close()
            self._thread = self._server = None

    def end(self) -> None:
        """No wheel any more, and its ptys' numbers are free."""
        self.unplug()
        while self._gone:
            os.close(self._gone.pop())

    def wheel_time_s(self) -> float:
        """The wheel's time now [s], however far it has been simulated."""
        if self.cable is not None:
            return self.cable.now_s()
        assert self._server is not None
        return self._server.wheel_time_s()

    @property
    def port(self) -> str:
        """Path of the wheel's tty."""
        return str(self.directory / self.link)

    @property
    def runs(self) -> Path:
        """Output directory of the configuration."""
        return self.directory / "runs"

    def logs(self) -> list[Path]:
        """Logs of the runs so far, oldest first."""
        return sorted(p for p in self.runs.glob("*.csv") if not p.name.endswith(".estimates.csv"))

    def config(self, **changes: dict[str, Any]) -> Path:
        """Write a configuration; a section given here is merged over the usual one."""
        wheel = {"protocol": self.protocol} | changes.pop("wheel", {})
        return write_config(self.directory, self.port, wheel=wheel, **changes)


def write_config(directory: Path, port: str, **changes: dict[str, Any]) -> Path:
    """Write a configuration for a wheel at `port`; quick by default, and the profile begins at once."""
    content: dict[str, dict[str, Any]] = {
        "wheel": {"port": port},
        "limits": {"current_A": 0.6, "silence_s": 0.3},
        "command": {"profile": "sine", "amplitude_A": 0.1, "period_s": 4.0, "bias_A": 0.05, "confirm_sign": False},
        "output": {"directory": str(directory / "runs")},
    }
    for name, section in changes.items():
        content[name] = content.get(name, {}) | section
    path = directory / "wheel.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


def protocol_named(name: str) -> RegisterProtocol:
    """A protocol by a name from config/ or a path."""
    document = load_yaml(protocol_path(name))
    made = protocol_of(document.data, document.where)
    assert isinstance(made, RegisterProtocol)
    return made


def wire_map_of(name: str) -> WireMap:
    """A wire map by a name from config/ or a path."""
    return protocol_named(name).wire_map


def spoken_by(configuration: Configuration) -> RegisterProtocol:
    """The protocol of a configuration, checked against it."""
    made = checked_protocol(configuration)
    assert isinstance(made, RegisterProtocol)
    return made


def _wheel(
    directory: Path, initial_speed_rad_s: float, noise_rpm: float, first_uptime_s: float, link: str, protocol: str
) -> Bench:
    spoken = protocol_named(protocol)
    recorder = Recorder(spoken.wire_map)
    plant = PlantRunner(
        PlantParameters(), PlantNoise(noise_rpm * RAD_S_PER_RPM), 5, PlantState(speed_rad_s=initial_speed_rad_s)
    )
    registers = spoken.electronics(spoken.wire_map, plant, watch=recorder, first_uptime_s=first_uptime_s)
    return Bench(directory, registers, recorder, link, protocol)


@contextmanager
def served_wheel(
    directory: Path,
    *,
    initial_speed_rad_s: float = 20.0,
    noise_rpm: float = 1.0,
    first_uptime_s: float = 100.0,
    link: str = "wheel",
    protocol: str = FAMILIES[0],
) -> Iterator[Bench]:
    """A simulated wheel on a pty, served by a thread for the length of a with block."""
    bench = _wheel(directory, initial_speed_rad_s, noise_rpm, first_uptime_s, link, protocol)
    bench.plug()
    try:
        yield bench
    finally:
        bench.end()


def virtual_wheel(
    directory: Path, *, initial_speed_rad_s: float = 20.0, noise_rpm: float = 1.0, protocol: str = FAMILIES[0]
) -> Bench:
    """The same behind the real driver on a virtual clock: what a test says of times is then true on any machine."""
    bench = _wheel(directory, initial_speed_rad_s, noise_rpm, 100.0, "nowhere", protocol)
    bench.cable = VirtualCable(bench.registers, VirtualClock())
    return bench


def program(*arguments: str, **options: Any) -> AbstractContextManager[subprocess.Popen[str]]:
    """`rw-ekf ARGUMENTS` as a process of its own; killed if it outlives the with block."""
    return _process([*PROGRAM, *arguments], **options)


def shell(command: str) -> AbstractContextManager[subprocess.Popen[str]]:
    """A command line of the shell, as `program`."""
    return _process(["/bin/sh", "-c", command])


@contextmanager
def _process(command: list[str], **options: Any) -> Iterator[subprocess.Popen[str]]:
    settings: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "cwd": ROOT}
    process = subprocess.Popen(command, **(settings | options))
    try:
        yield process
    finally:
        if process.poll() is None:
            process.send_signal(signal.SIGKILL)
        process.wait()
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()


def rw_ekf(*arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
    """Run `rw-ekf ARGUMENTS` to its end."""
    settings: dict[str, Any] = {"capture_output": True, "text": True, "cwd": ROOT, "timeout": 60}
    return subprocess.run([*PROGRAM, *arguments], check=False, **(settings | options))


def wait_for(condition: Callable[[], bool], within_s: float = 60.0) -> None:
    """Wait until something holds; fail the test if it does not in time."""
    end_s = time.monotonic() + within_s
    while not condition():
        assert time.monotonic() < end_s, "did not come about in time"
        time.sleep(0.01)


def document_of(text: str) -> dict[str, Any]:
    """The one JSON document of a text, with the keys that the contract shows for it; NaN and Infinity are refused."""

    def refuse(name: str) -> None:
        raise AssertionError(f"{name} is no JSON")

    document: dict[str, Any] = json.loads(text, parse_constant=refuse)
    check_document(document)
    return document


def driven(bench: Bench) -> Callable[[], bool]:
    """Whether the wheel carries a current that is not zero."""
    return lambda: abs(bench.registers.command_A) > 0.01


def open_descriptors() -> int:
    """How many files this process has open."""
    return len(os.listdir("/proc/self/fd"))
