"""A daemon over the real serial driver on a virtual clock: what the wheel is, and what the wire map says of it."""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.clock import VirtualClock
from rw_ekf.commands.inputs import read_wheel_model
from rw_ekf.drivers.can.can_link import CanLink
from rw_ekf.drivers.line.framing import Frame
from rw_ekf.drivers.line.registers import decode_register
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.drivers.sim.plant_batch import compiled_advance
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.virtual_line import VirtualCable
from rw_ekf.learning.run_start import GivenModel
from rw_ekf.live.daemon import Task, run_daemon
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.settings.load import load_configuration
from rw_ekf.units import RAD_S_PER_RPM
from tests.injecting import put_faults
from tests.live.bench import FAMILIES, Bench, protocol_named, spoken_by, write_config
from tests.live.daemon import Notes, Ran

EACH_FAMILY = pytest.mark.parametrize("family", FAMILIES, indirect=True)  # `usefixtures` where it is not asked for
# Where no daemon runs, a wheel that takes a torque too, confirms no write, and must be made ready.
EACH_FAMILY_ON_A_LINE = pytest.mark.parametrize("family", [*FAMILIES, "odrive-ascii-wheel"], indirect=True)
FAMILY = ContextVar("FAMILY", default=FAMILIES[0])  # of the wheels of a test that does not say
BEGAN = datetime(2026, 3, 1, 6, 0, tzinfo=UTC)


def is_unsolicited(wheel: SerialWheel) -> bool:
    """Whether its telemetry comes though nobody asks: then what was sent before a fault may be read behind it."""
    return isinstance(wheel._line, CanLink)


def let_pass(wheel: SerialWheel) -> None:
    """Read off what was sent before the fault that is there now."""
    if is_unsolicited(wheel):
        wheel._line._clock.sleep(0.05)  # type: ignore[attr-defined]
        wheel.read(0.001)


def open_timed(bench: Bench, family: str, reply_timeout_s: float) -> SerialWheel:
    """The real driver of a wheel on a virtual clock."""
    assert bench.cable is not None
    opened = bench.cable.carrying(protocol_named(family)).open_wheel(bench.port, bench.cable.clock, reply_timeout_s)
    assert isinstance(opened, SerialWheel)
    return opened


def port_of(wheel: SerialWheel) -> Any:
    """What holds the wheel's port, as `_serial`, and the bytes of an unfinished frame, as `_rest`."""
    return getattr(wheel._line, "bus", wheel._line)


@dataclass
class LineWheel:
    """A wheel as it is, whatever a wire map says; each run is its next hour or minute."""

    directory: Path
    parameters: PlantParameters = field(default_factory=PlantParameters)
    serial_number: int = 1
    protocol: str = ""  # what it speaks; "": what the test is about
    speed_rad_s: float = 0.0
    noise_rpm: float = 1.0
    faults: str = ""  # as `rw-ekf simulate --fault` takes them, in the wheel's time
    resumes_at_s: float | None = None  # when a person says so, by the daemon's clock
    meanwhile: Callable[[VirtualClock], None] = lambda clock: None  # puts what else shall happen on the daemon's clock
    written_A: list[float] = field(default_factory=list)
    speeds_rad_s: list[float] = field(default_factory=list)  # the true ones, whenever a current was written

    def run(
        self,
        duration_s: float | None,
        *,
        at: datetime = BEGAN,
        fresh: bool = False,
        named: str | None = None,
        other_wheel: bool = False,
        notes: Notes | None = None,
        **changes: dict[str, Any],
    ) -> Ran:
        """A run on this wheel from its first speed; at: the hour; named: as --model; changes: of the configuration."""
        usual: dict[str, dict[str, Any]] = {
            "limits": {"silence_s": 0.5},
            "command": {"profile": "random-sines", "period_s": 20.0},
        }
        usual["command"]["confirm_sign"] = True
        usual["wheel"] = {"protocol": self.protocol or FAMILY.get()}
        sections = {name: usual.get(name, {}) | changes.get(name, {}) for name in {*usual, *changes}}
        configuration = load_configuration(write_config(self.directory, str(self.directory / "wheel"), **sections))
        clock, notes = VirtualClock(at), notes if notes is not None else Notes()
        noise = PlantNoise(self.noise_rpm * RAD_S_PER_RPM)
        state = PlantState(speed_rad_s=self.speed_rad_s)
        plant = PlantRunner(self.parameters, noise, 5, state, 0.01, compiled_advance)
        true = protocol_named(self.protocol or FAMILY.get())
        command = true.wire_map.current_command

        def watch(frame: Frame) -> None:
            if frame.id == command.id:
                self.written_A.append(decode_register(command, frame.data)["current_command"])
                self.speeds_rad_s.append(plant.speed_rad_s)

        server = true.electronics(
            true.wire_map, plant, serial_number=self.serial_number, first_uptime_s=100.0, watch=watch
        )
        put_faults(server, self.faults)
        protocol = VirtualCable(server, clock).carrying(spoken_by(configuration))
        given = GivenModel(
            read_wheel_model(named, configuration),
            named or configuration.filter.model,
            named=named is not None,
            fresh=fresh,
            other_wheel=other_wheel,
        )
        with StopSignal() as stop:
            if self.resumes_at_s is not None:
                clock.at(self.resumes_at_s, stop.resume)
            self.meanwhile(clock)
            outcome = run_daemon(Task(configuration, protocol, given, duration_s), notes, stop, clock)
        return Ran(outcome, notes)

    def is_driven(self) -> bool:
        """Whether the current that was written last is not zero."""
        return bool(self.written_A) and abs(self.written_A[-1]) > 0.01

    @property
    def learned(self) -> Path:
        """The file of what was learned."""
        return next((self.directory / "runs").glob("*.learned.yaml"))
