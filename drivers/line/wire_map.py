"""The wire map: which register carries what, as one frozen object (docs/wire-protocol.md)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from drivers.line.wire_layout import Field, Framing, LineSettings, Register
from rw_ekf.errors import ConfigError

STATUS_OK = 0


@dataclass(frozen=True, slots=True)
class WireMap:
    """Everything a driver must know to talk to one kind of wheel. Values are SI at every method."""

    name: str
    registers: tuple[Register, ...]
    framing: Framing = field(default_factory=Framing)
    line: LineSettings = field(default_factory=LineSettings)
    statuses: Mapping[int, str] = field(default_factory=dict)  # of a reply to a write
    write_ids: tuple[int, int] = (0, 127)
    read_ids: tuple[int, int] = (128, 255)

    def register(self, name: str) -> Register | None:
        """The register of that name, or None where the wheel has none."""
        return next((register for register in self.registers if register.name == name), None)

    def register_of_id(self, register_id: int) -> Register | None:
        """The register of that id, or None."""
        return next((register for register in self.registers if register.id == register_id), None)

    def readable(self) -> tuple[Register, ...]:
        """The telemetry registers, in the order of the map."""
        return tuple(register for register in self.registers if register.access == "read")

    def is_write_id(self, register_id: int) -> bool:
        """Whether a frame with that id writes (known or not)."""
        return self.write_ids[0] <= register_id <= self.write_ids[1]

    @property
    def current_command(self) -> Register:
        """The register that commands a current (every map has one)."""
        register = self.register("current_command")
        assert register is not None
        return register

    @property
    def current_range_A(self) -> tuple[float, float]:
        """The lowest and highest current that can be commanded [A]."""
        return self.current_command.fields[0].si_range

    @property
    def speed_register(self) -> Register:
        """Where the speed is read: `cycle` if it carries one, else `speed`, else the widest register that does."""
        carriers = [register for register in self.readable() if register.field("speed")]
        for name in ("cycle", "speed"):
            for register in carriers:
                if register.name == name:
                    return register
        return max(carriers, key=lambda register: len(register.fields))

    @property
    def speed_field(self) -> Field:
        """The field the speed is read from."""
        speed = self.speed_register.field("speed")
        assert speed is not None
        return speed

    @property
    def speed_range_rad_s(self) -> tuple[float, float]:
        """The lowest and highest speed that telemetry can carry [rad/s]."""
        return self.speed_field.si_range

    @property
    def speed_step_rad_s(self) -> float:
        """Resolution of a speed reading [rad/s]; 0 where it is a floating-point number."""
        return 0.0 if self.speed_field.type == "f32" else self.speed_field.si_per_count

    def status_name(self, status: int) -> str:
        """The map's word for a status byte."""
        return self.statuses.get(status, f"status_{status}")


Where = Callable[[tuple[str | int, ...]], str]


def wire_map_from_mapping(data: Mapping[str, object], where: Where) -> WireMap:
    """Check plain data (as YAML gives it) and make a wire map of it.

    data: the map file's content. where: turns a path like ("registers", 3, "id") into "file:line:column".
    Raises ConfigError with every finding, each "where: what was found, what to do".
    """
    from drivers.line.wire_map_check import MapReader

    reader = MapReader(where)
    wire_map = reader.wire_map(data)
    if reader.findings or wire_map is None:
        raise ConfigError(reader.findings)
    return wire_map
