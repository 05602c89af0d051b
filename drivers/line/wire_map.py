"""The wire map: which register carries what, as one frozen object (docs/wire-protocol.md)."""

from __future__ import annotations

from typing import Any

from pydantic import Field as Key
from pydantic import ValidationInfo, field_validator

from rw_ekf.checking.findings import Where, checked
from rw_ekf.checking.section import Mistake, Section, refuse
from rw_ekf.drivers.line.framing import Codec, RegisterCodec
from rw_ekf.drivers.line.line import Line
from rw_ekf.drivers.line.serial_link import SerialLink
from rw_ekf.drivers.line.wire_layout import TORQUE_UNITS, Byte, Field, Framing, IdRanges, LineSettings, Name, Register

STATUS_OK = 0
STATUSES = {STATUS_OK: "ok", 1: "unknown_id", 2: "wrong_length", 3: "out_of_range", 4: "refused_in_this_mode"}


class WireMap(Section):
    """Everything a driver must know to talk to one kind of wheel. Values are SI at every method."""

    name: str = Key("wheel", min_length=1, description="what the protocol is called")
    framing: Framing = Framing()
    link: LineSettings = LineSettings()
    ids: IdRanges = IdRanges()
    statuses: dict[Byte, Name] = Key(STATUSES, description="number: name, of the byte that answers a write")
    registers: tuple[Register, ...] = Key(strict=False, description="what can be read and written")

    @field_validator("statuses", check_fields=False)
    @classmethod
    def _ok(cls, statuses: dict[int, str]) -> dict[int, str]:
        if statuses.get(STATUS_OK) != "ok":
            refuse([((), "must name 0 ok: it is what a wheel answers when it accepted a write")])
        return statuses

    @field_validator("registers")
    @classmethod
    def _together(cls, registers: tuple[Register, ...], info: ValidationInfo) -> tuple[Register, ...]:
        ids: IdRanges | None = info.data.get("ids")
        mistakes: list[Mistake] = []
        for index, register in enumerate(registers):
            access = register.access
            first, last = getattr(ids, access) if ids is not None else (register.id, register.id)
            if not first <= register.id <= last:
                found = f"is {register.id}, but register {register.name} has access {access}"
                mistakes.append(((index, "id"), f"{found}; ids that {access} are {first} to {last} (see ids)"))
            for key in ("id", "name"):
                value = getattr(register, key)
                if any(getattr(other, key) == value for other in registers[:index]):
                    mistakes.append(((index, key), f"{value} is already used by a register above"))
        refuse([*mistakes, *(((), words) for words in _lacks(registers))])
        return registers

    def model_post_init(self, context: Any) -> None:
        """Tell the registers in which order their bytes stand."""
        for register in self.registers:
            register._order = "<" if self.framing.byte_order == "little" else ">"

    def codec(self) -> Codec:
        """How its registers are spoken of on a line, for one end of it."""
        return RegisterCodec(self.framing)

    def open_line(self, *line: Any) -> Line:
        """A line on which it is spoken, from what `SerialLink` is made of but the codec. Raises DriverError."""
        settings, *more = line
        return SerialLink(settings, self.codec(), *more)

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
        return self.ids.write[0] <= register_id <= self.ids.write[1]

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
    def current_unit(self) -> str:
        """What the command is in: A, or N m where a torque stands in its place."""
        return "N m" if self.current_command.fields[0].unit in TORQUE_UNITS else "A"

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
        return 0.0 if self.speed_field.is_float else self.speed_field.si_per_count

    def status_name(self, status: int) -> str:
        """The map's word for a status byte."""
        return self.statuses.get(status, f"status_{status}")


def _lacks(registers: tuple[Register, ...]) -> list[str]:
    """What no map may lack: a speed to read and a current to write."""
    found = []
    if not any(register.access == "read" and register.field("speed") for register in registers):
        found.append("need one with access read and a field named speed; the speed is what is estimated from")
    command = [register for register in registers if register.name == "current_command"]
    if not any(register.access == "write" for register in command):
        found.append("need one named current_command with access write; without it no wheel can be driven")
    elif [field.name for field in command[0].fields] != ["current_command"]:
        found.append("current_command must have exactly one field, named current_command")
    return found


def wire_map_from_mapping(data: object, where: Where) -> WireMap:
    """Check plain data (as YAML gives it) and make a wire map of it.

    data: the map file's content. where: turns a path like ("registers", 3, "id") into "file:line:column".
    Raises ConfigError with every finding, each "where: what was found, what to do".
    """
    return checked(WireMap, data, "a wire map", where)
