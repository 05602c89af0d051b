"""Four simulated wheels on one line in this process, on a virtual clock or a pty, and the loop that drives them."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from rw_ekf.attach.opening import SharedLine
from rw_ekf.attach.wire import checked_protocol
from rw_ekf.clock import VirtualClock
from rw_ekf.commands.inputs import read_wheel_model
from rw_ekf.drivers.line.framing import Frame
from rw_ekf.drivers.line.register_protocol import AddressedRegisterProtocol, RegisterProtocol
from rw_ekf.drivers.line.registers import decode_register
from rw_ekf.drivers.sim.fault_text import parse_bus_faults, parse_faults
from rw_ekf.drivers.sim.faults import FaultInjector
from rw_ekf.drivers.sim.plant_batch import compiled_advance
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.pty_server import PtyServer
from rw_ekf.drivers.sim.register_server import RegisterServer
from rw_ekf.drivers.sim.virtual_line import VirtualCable
from rw_ekf.drivers.sim.wheel_line import BusElectronics
from rw_ekf.learning.run_start import GivenModel
from rw_ekf.live.bus import Bus, BusWheel
from rw_ekf.live.oversight import ALONE, Oversight
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.settings.load import load_configurations
from rw_ekf.settings.schema import Configuration
from rw_ekf.units import RAD_S_PER_RPM
from tests.live.bench import protocol_named
from tests.live.daemon import Notes

NAMES = ("rw-x", "rw-y", "rw-z", "rw-skew")
LINES = str(Path(__file__).with_name("addressed-lines.yaml"))
FAMILIES = ("nsp-wheel", "sunspace-wheel", LINES)  # those whose frames, or lines, bear an address
PERIOD_S, TIMEOUT_S = 0.1, 0.025
# In the computer's own time, where a busy machine answers late: a reply has longer, and so has a silence.
PATIENT: dict[str, dict[str, Any]] = {
    "loop": {"rate_hz": 5.0, "reply_timeout_ms": 45.0},
    "limits": {"silence_s": 2.0},
}


@dataclass
class Wheel:
    """A simulated wheel, and every current that it was sent, with its time [s]."""

    name: str
    electronics: RegisterServer
    written: list[tuple[float, float]] = field(default_factory=list)

    @property
    def currents_A(self) -> list[float]:
        return [current for _, current in self.written]


@dataclass
class BusBench:
    """A line of four wheels and its configuration."""

    path: Path
    configurations: tuple[Configuration, ...]
    wheels: list[Wheel]
    line: BusElectronics

    def __getitem__(self, name: str) -> Wheel:
        return next(wheel for wheel in self.wheels if wheel.name == name)


@dataclass
class BusRan:
    """What came of it, by name."""

    wheels: dict[str, BusWheel]
    notes: dict[str, Notes]

    def outcome(self, name: str) -> Any:
        found = self.wheels[name].outcome
        assert found is not None, self.wheels[name].failure
        return found


def write_bus(directory: Path, port: str, family: str = FAMILIES[0], **changes: Any) -> Path:
    """A configuration of four wheels at `port`; changes: of its sections, and of `wheels` by name."""
    entries = changes.pop("wheels", {})
    content: dict[str, Any] = {
        "wheel": {"port": port, "protocol": family, "baud": 115200, "echo": True},
        "wheels": [{"name": name, "address": 0x40 + index} | entries.get(name, {}) for index, name in enumerate(NAMES)],
        "limits": {"current_A": 0.6, "silence_s": 0.5, "safe_after_s": None},
        "loop": {"rate_hz": 1.0 / PERIOD_S, "reply_timeout_ms": 1e3 * TIMEOUT_S},
        "command": {"profile": "sine", "amplitude_A": 0.1, "period_s": 4.0, "bias_A": 0.05, "confirm_sign": False},
        "output": {"directory": str(directory / "runs")},
    }
    for name, section in changes.items():
        content[name] = content.get(name, {}) | section
    path = directory / "bus.yaml"
    path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return path


def make_bus(directory: Path, port: str, family: str = FAMILIES[0], faults: str = "echo", **changes: Any) -> BusBench:
    """Four wheels of a family; faults: as `rw-ekf simulate --fault` takes them for a bus."""
    path = write_bus(directory, port, family, **changes)
    configurations = load_configurations(path)
    of_line, of_wheel = parse_bus_faults([faults] if faults else [], NAMES)
    wheels = []
    for index, configuration in enumerate(configurations):
        spoken, address = protocol_named(family), configuration.wheel.address  # whatever its configuration says
        assert isinstance(spoken, AddressedRegisterProtocol)
        assert address is not None
        protocol = spoken.at(address)
        plant = PlantRunner(PlantParameters(), PlantNoise(RAD_S_PER_RPM), 11 + index, law=compiled_advance)
        made = Wheel(configuration.wheel.name, protocol.electronics(protocol.wire_map, plant))
        made.electronics = protocol.electronics(
            protocol.wire_map,
            plant,
            serial_number=index + 1,
            faults=FaultInjector(of_wheel[made.name], index),
            watch=_noting(made, protocol, plant),
        )
        wheels.append(made)
    line = BusElectronics([wheel.electronics for wheel in wheels], FaultInjector(of_line, 7), 115200)
    return BusBench(path, configurations, wheels, line)


def _noting(wheel: Wheel, protocol: RegisterProtocol, plant: PlantRunner) -> Callable[[Frame], None]:
    register = protocol.wire_map.current_command

    def note(frame: Frame) -> None:
        if frame.id == register.id:
            wheel.written.append((plant.time_s, decode_register(register, frame.data)["current_command"]))

    return note


def run_bus(
    bench: BusBench,
    duration_s: float | None,
    *events: tuple[float, Callable[[StopSignal], object]],
    oversight: Oversight = ALONE,
    clock: VirtualClock | None = None,
    wrap: Callable[[Any], Any] = lambda port: port,
) -> BusRan:
    """Run on a virtual clock; each event is a time [s] and what happens then. wrap: what is made of an open port."""
    clock = clock or VirtualClock()
    cable = VirtualCable(bench.line, clock)
    protocols = []
    for configuration in bench.configurations:
        spoken = checked_protocol(configuration)
        assert isinstance(spoken, RegisterProtocol)
        carried = cable.carrying(spoken)
        protocols.append(carried.over(lambda *wanted, made=carried.open_port: wrap(made(*wanted))))
    line = SharedLine(bench.configurations, protocols, clock)
    notes = {name: Notes() for name in NAMES}
    wheels = [
        BusWheel(
            configuration,
            protocol,
            GivenModel(read_wheel_model(None, configuration), configuration.filter.model),
            notes[configuration.wheel.name],
        )
        for configuration, protocol in zip(bench.configurations, line.protocols, strict=True)
    ]
    with StopSignal() as stop:
        for time_s, action in events:
            clock.at(time_s, lambda action=action: action(stop))  # type: ignore[misc]
        Bus(wheels, line, stop, clock, oversight, duration_s).run()
    return BusRan({wheel.name: wheel for wheel in wheels}, notes)


@contextmanager
def served_bus(directory: Path, family: str = FAMILIES[0], faults: str = "echo", **changes: Any) -> Iterator[BusBench]:
    """Four wheels behind one pty, served by a thread for the length of a with block."""
    sections = {name: PATIENT.get(name, {}) | changes.get(name, {}) for name in {*PATIENT, *changes}}
    bench = make_bus(directory, str(directory / "bus"), family, faults, **sections)
    stop = threading.Event()
    server = PtyServer(bench.line, directory / "bus")
    thread = threading.Thread(target=server.run, args=(stop.is_set,), daemon=True)
    thread.start()
    try:
        yield bench
    finally:
        stop.set()
        thread.join(5.0)
        server.close()


def put(bench: BusBench, name: str, faults: str) -> None:
    """From now on a wheel has these faults and no others."""
    bench[name].electronics.faults.put(*(parse_faults([faults]) if faults else ()))
