"""Wheels that are read and commanded through registers, as a wire map describes them (docs/wire-protocol.md)."""

from __future__ import annotations

import hashlib
import json
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar

from rw_ekf.checking.findings import Where, checked
from rw_ekf.clock import Clock
from rw_ekf.driver import USUAL_LINES, ControlLines, WheelDriver, WireLimits, WirePacket
from rw_ekf.drivers.line.packets import packets_of
from rw_ekf.drivers.line.registers import registers_beside
from rw_ekf.drivers.line.serial_port import PortSettings, open_serial_port
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.drivers.line.shared_port import OpenPort
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.errors import ConfigError

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.register_server import RegisterServer

Kind = TypeVar("Kind", bound="RegisterProtocol")


class RegisterProtocol:
    """A WheelProtocol over a wire map."""

    def __init__(
        self,
        wire_map: WireMap,
        scale_places: Mapping[str, str] | None = None,
        fingerprint: str | None = None,
        open_port: OpenPort = open_serial_port,
    ) -> None:
        """scale_places: where the scales of "speed" and "current" stand, for whoever finds one wrong.

        fingerprint: of all that the wire map says. open_port: opens a port in pyserial's place.
        """
        self.wire_map = wire_map
        self.fingerprint = fingerprint
        self.scale_places = scale_places if scale_places is not None else {}
        self.open_port = open_port

    def over(self, open_port: OpenPort) -> Self:
        """The same over another way to open a port."""
        return type(self)(self.wire_map, self.scale_places, self.fingerprint, open_port)

    @property
    def limits(self) -> WireLimits:
        """What the registers can carry."""
        reported = [field for register in self.wire_map.readable() for field in register.fields]
        return WireLimits(
            current_A=self.wire_map.current_range_A,
            current_unit=self.wire_map.current_unit,
            speed_rad_s=self.wire_map.speed_range_rad_s,
            speed_step_rad_s=self.wire_map.speed_step_rad_s,
            hottest_degC=max((field.si_range[1] for field in reported if field.name == "temperature"), default=None),
            tells_current=any(field.name in ("current_command", "current") for field in reported),
        )

    def open_wheel(
        self,
        port: str,
        clock: Clock,
        reply_timeout_s: float,
        *,
        baud: int | None = None,
        probe: bool = True,
        exclusive: bool = True,
        control: ControlLines = USUAL_LINES,
        previous: WheelDriver | None = None,
    ) -> WheelDriver:
        """Open a wheel on a serial port. Raises DriverError: no such port, busy, no permission, no answer.

        probe: wait up to 2 s for a first valid reply. baud: None: the wire map's.
        """
        lost = previous if isinstance(previous, SerialWheel) else None
        if lost is not None:
            lost.close()
        link = self.wire_map.link
        settings = PortSettings(port, baud if baud is not None else link.baud, link, exclusive, control)
        counters, past = (None, None) if lost is None else (lost.link, lost.clock)
        line = self.wire_map.open_line(settings, reply_timeout_s, clock, counters, self.open_port)
        wheel = SerialWheel(line, self.wire_map, clock, past)
        if lost is not None:
            wheel.go_on_from(lost)
        try:
            if probe:
                wheel.probe()
        except BaseException:
            wheel.close()
            raise
        if lost is not None:
            wheel.link.reconnects += 1
        return wheel

    def serve(
        self,
        plant: Any,
        link_path: str | Path,
        *,
        speed_factor: float = 1.0,
        on_ready: Callable[[str], None] | None = None,
        stop: threading.Event | Callable[[], bool] | None = None,
        duration_s: float | None = None,
        **options: Any,
    ) -> None:
        """Serve a simulated wheel with these registers, as `rw_ekf.drivers.sim.pty_server.serve_electronics`.

        options: of `simulated`.
        """
        from rw_ekf.drivers.sim.pty_server import serve_electronics

        serve_electronics(
            self.simulated(plant, **options),
            link_path,
            speed_factor=speed_factor,
            on_ready=on_ready,
            stop=stop,
            duration_s=duration_s,
        )

    def simulated(self, plant: Any, **options: Any) -> RegisterServer:
        """The electronics of such a wheel, with options as `simulated_electronics` has them."""
        from rw_ekf.drivers.sim.pty_server import simulated_electronics

        return simulated_electronics(self.electronics, self.wire_map, plant, **options)

    @property
    def electronics(self) -> type[RegisterServer]:
        """What answers in a simulated wheel."""
        from rw_ekf.drivers.sim.register_server import RegisterServer

        return RegisterServer


class AddressedRegisterProtocol(RegisterProtocol):
    """One whose frames can bear a wheel's address, so that several wheels can be distinguished on one line."""

    _address_key = "address"  # of the map's `framing`

    @property
    def address(self) -> int | None:
        """The wheel's; None: its frames have none."""
        address: int | None = getattr(self.wire_map.framing, self._address_key)
        return address

    @property
    def own_address(self) -> int | None:
        """What the wheel answers to, of the program itself; None: its frames have none."""
        address: int | None = getattr(self.wire_map.framing, "own_address", None)
        return address

    def turn_s(self, baud: int | None, *, writes: bool) -> float:
        """Time [s] that the line takes for the bytes of a turn: a sample, one question beside it, and a command.

        What the wheel takes to answer comes on top. baud: None: that of the map. writes: whether there is a command.
        """
        wire_map, codec = self.wire_map, self.wire_map.codec()
        beside = [one for one in wire_map.readable() if one.name in ("status", "identity")]
        beside = sorted(beside, key=lambda one: one.size)[-1:]
        wanted = [wire_map.speed_register, *registers_beside(wire_map.speed_register, wire_map), *beside]
        sent = [(codec.request(0, one.id, b""), one.size) for one in wanted]
        if writes:
            command = wire_map.current_command
            sent.append((codec.request(0, command.id, bytes(command.size)), 1))  # answered by a status
        count = sum(len(request) + codec.overhead_bytes + size for request, size in sent)
        return count * wire_map.link.bits_per_byte / (baud or wire_map.link.baud)

    def at(self, address: int) -> Self:
        """The same for the wheel of another address. Raises ConfigError where no wheel can have it."""
        framing = self.wire_map.framing
        if self.own_address == address:
            raise ConfigError(f"is {address}, which is this program's own (framing.own_address): give another one")
        wire_map = self.wire_map.model_copy(update={"framing": framing.model_copy(update={self._address_key: address})})
        return type(self)(wire_map, self.scale_places, self.fingerprint, self.open_port)


class FramedRegisterProtocol(AddressedRegisterProtocol):
    """One whose frames are those of `rw_ekf.drivers.line.framing`, which can be written down."""

    @property
    def packets(self) -> tuple[WirePacket, ...]:
        """Requests and replies, for other programs."""
        return packets_of(self.wire_map)


def protocol_of(data: Mapping[str, object], where: Where) -> FramedRegisterProtocol:
    """Make the protocol of a wire map's content. Raises ConfigError with every finding."""
    return of_content(FramedRegisterProtocol, WireMap, data, where)


def of_content(kind: type[Kind], maps: type[WireMap], data: Mapping[str, object], where: Where) -> Kind:
    """The protocol of that kind over a file's content, checked as such a map. Raises ConfigError with every finding."""
    content = {key: value for key, value in data.items() if key != "family"} if isinstance(data, Mapping) else data
    wire_map = checked(maps, content, "a wire map", where)
    stated = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    return kind(wire_map, _scale_places(wire_map, where), stated)


def _scale_places(wire_map: WireMap, where: Where) -> dict[str, str]:
    """Where the scales of speed and current stand: file:line and register."""
    places = {}
    for word, register, name in (
        ("speed", wire_map.speed_register, "speed"),
        ("current", wire_map.current_command, wire_map.current_command.fields[0].name),
    ):
        at = wire_map.registers.index(register)
        field = [f.name for f in register.fields].index(name)
        place = where(("registers", at, "fields", field, "scale")).rsplit(":", 1)[0]
        places[word] = f"{place} (scale of {name} in register {register.name})"
    return places
