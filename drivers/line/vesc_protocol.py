"""Wheels on a VESC (`family: vesc`), by its binary packets on a UART or USB (docs/wire-protocol.md#vesc)."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

from pydantic import Field as Key
from pydantic import field_validator, model_validator

from rw_ekf.checking.findings import Where
from rw_ekf.checking.section import NOT_NULL, Mistake, Section, refuse
from rw_ekf.driver import WireLimits
from rw_ekf.drivers.line.framing import Codec
from rw_ekf.drivers.line.line import Exchange, Line
from rw_ekf.drivers.line.register_protocol import RegisterProtocol, of_content
from rw_ekf.drivers.line.registers import decode_register
from rw_ekf.drivers.line.serial_link import SerialLink
from rw_ekf.drivers.line.unacknowledged_commands import STATUSES, Bearing, Standing
from rw_ekf.drivers.line.vesc import (
    FIRST_READ,
    IDENTITY_ID,
    SET_CURRENT,
    SET_CURRENT_BRAKE,
    VALUE_BYTES,
    VALUES_ID,
    VescCodec,
)
from rw_ekf.drivers.line.wire_layout import Field, IdRanges, Register
from rw_ekf.drivers.line.wire_map import STATUS_OK, WireMap

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.register_server import RegisterServer

FLAG_FAULT, FLAG_OVER_TEMPERATURE = 1, 4
_CODES = {FLAG_OVER_TEMPERATURE: (5, 6), FLAG_FAULT: (4,)}  # FAULT_CODE_OVER_TEMP_FET, _MOTOR; _ABS_OVER_CURRENT
_CODE_SHIFT = 8
_REPLIES = 2  # each of which may take its time: as a write and its reading back of another wheel
_IDS = {("write", SET_CURRENT), ("write", SET_CURRENT_BRAKE), ("read", IDENTITY_ID), ("read", VALUES_ID)}


class VescFraming(Section):
    """Nothing that wheels of this family differ in."""

    byte_order: Literal["big"] = "big"


class VescCommand(Section):
    """What is known of a current that is commanded."""

    tolerance: float = Key(0.02, gt=0.0, description="of a current in force, as it is told [A]")
    watchdog_ms: Annotated[float | None, NOT_NULL] = Key(
        1000.0, gt=0.0, description="the VESC's own time-out, after which it lets go (timeout_msec of its app settings)"
    )


class VescField(Field):
    """One number of its values. Its fault code is reported as flags, with the code in the byte above them."""

    pole_pairs: Annotated[int | None, NOT_NULL] = Key(
        None, ge=1, description="of the motor: electrical turns in one of the wheel; required for speed"
    )

    @property
    def si_per_count(self) -> float:
        """SI units per count, of the wheel and not of the field that turns in the motor."""
        return super().si_per_count / (self.pole_pairs or 1)

    def to_si(self, number: float) -> float:
        """SI value of a number on the wire."""
        if self.name != "flags":
            return super().to_si(number / (self.pole_pairs or 1))
        code = int(number)
        flag = 0 if code == 0 else FLAG_OVER_TEMPERATURE if code in _CODES[FLAG_OVER_TEMPERATURE] else FLAG_FAULT
        return float(code << _CODE_SHIFT | flag)

    def to_wire(self, value_si: float) -> float:
        """Number on the wire, not yet rounded, of an SI value; of flags the code that they stand for."""
        if self.name != "flags":
            return super().to_wire(value_si) * (self.pole_pairs or 1)
        return next((codes[0] for flag, codes in _CODES.items() if int(value_si) & flag), 0)


class VescRegister(Register):
    """A command, or the values that a mask requests."""

    mask: Annotated[int | None, NOT_NULL] = Key(
        None, ge=1, lt=1 << len(VALUE_BYTES), description="which values, as COMM_GET_VALUES_SELECTIVE has its bits"
    )
    fields: tuple[VescField, ...] = Key(strict=False, description="in the order of their bytes")

    @model_validator(mode="after")
    def _holds(self) -> Self:
        super()._holds()  # type: ignore[operator]
        refuse(self._mistakes())
        return self

    def _mistakes(self) -> list[Mistake]:
        if (self.access, self.id) not in _IDS:
            known = ", ".join(f"{number} ({access})" for access, number in sorted(_IDS))
            return [(("id",), f"is {self.id} ({self.access}); a VESC is asked and commanded by {known}")]
        if self.id != VALUES_ID:
            return []
        if self.mask is None:
            return [(("mask",), "is required: which values are asked for, bit by bit")]
        wanted = [size for bit, sizes in enumerate(VALUE_BYTES) if self.mask >> bit & 1 for size in sizes]
        found: list[Mistake] = []
        have = [struct.calcsize(field.code) for field in self.fields]
        if wanted != have:
            words = "asks for numbers of {} bytes, but the fields have {}".format(
                *(", ".join(map(str, sizes)) for sizes in (wanted, have))
            )
            found.append((("mask",), f"{words}: one field for each, from the lowest bit on"))
        return found + [
            (("fields", index, "name"), "needs pole_pairs: a VESC tells the electrical speed")
            for index, field in enumerate(self.fields)
            if field.name == "speed" and field.pole_pairs is None
        ]


class VescMap(WireMap):
    """A wire map of such a wheel: its registers are a VESC's commands and values."""

    framing: VescFraming = VescFraming()  # type: ignore[assignment]
    ids: ClassVar[IdRanges] = IdRanges(write=(0, FIRST_READ - 1), read=(FIRST_READ, 255))  # type: ignore[misc]
    statuses: ClassVar[dict[int, str]] = STATUSES  # type: ignore[misc]
    command: VescCommand = VescCommand()
    registers: tuple[VescRegister, ...] = Key(strict=False, description="what can be read and written")

    @field_validator("registers")
    @classmethod
    def _confirming(cls, registers: tuple[VescRegister, ...]) -> tuple[VescRegister, ...]:
        refuse(
            ((index, "fields"), "need one named current, by which a command is seen to be in force: bit 5 of the mask")
            for index, register in enumerate(registers)
            if register.id == VALUES_ID and register.field("current") is None
        )
        return registers

    @property
    def mask(self) -> int:
        """Of the values that are requested."""
        return next((register.mask for register in self.registers if register.mask is not None), 0)

    def codec(self) -> Codec:
        """For one end of a line."""
        return VescCodec(self.mask)

    def open_line(self, *line: Any) -> Line:
        """A line on which it is spoken."""
        settings, *more = line
        return VescLink(settings, self, *more)


class VescLink(SerialLink):
    """An open line: nothing answers a command, so the current that flows behind it says whether it was taken.

    A VESC reports the mean current since the last request. So the first reading behind a command may hold some of the
    one before it: it can bear the command out, and does not count against it.
    """

    def __init__(self, settings: Any, wire_map: VescMap, *more: Any) -> None:
        self._map = wire_map
        self._sent_A = 0.0  # the last that was commanded
        self._standing = Standing()
        super().__init__(settings, wire_map.codec(), *more)

    def request(self, register_id: int, data: bytes, reply_bytes: int, timeout_s: float | None = None) -> Exchange:
        """As `SerialLink.request`; a command is acknowledged when the current behind it is the one commanded."""
        if register_id >= FIRST_READ:
            return super().request(register_id, data, reply_bytes, timeout_s)
        command = self._map.current_command
        wanted_A = decode_register(command, data)["current_command"] if register_id == command.id else 0.0
        limit_s = _REPLIES * self.reply_timeout_s if timeout_s is None else timeout_s
        exchange = self._confirmed(self.codec.request(0, register_id, data), wanted_A, limit_s)
        self._sent_A = wanted_A
        return exchange

    def _confirmed(self, frame: bytes, wanted_A: float, limit_s: float) -> Exchange:
        """Send a command and query the current; taken where it is this one, refused where several are another."""
        sent = self._tell(frame)
        until_s = sent.received_by_wheel_s + limit_s
        bearing, reported_A = (
            Bearing(wanted_A, self._sent_A, self._map.command.tolerance),
            self._reported_A(sent, until_s),
        )
        if reported_A is not None and abs(reported_A - wanted_A) > self._map.command.tolerance:
            reported_A = self._reported_A(sent, until_s)
        while reported_A is not None:
            if bearing.is_borne_out(reported_A):
                self._standing.note_taken()
                return sent._replace(data=bytes((STATUS_OK,)), replied_s=self._came_s)
            if bearing.is_refused:
                break
            if bearing.is_due_again:
                sent = self._tell(frame)
            reported_A = self._reported_A(sent, until_s)
        if bearing.status is None:
            return sent._replace(data=None)
        self.news = self._standing.note_against(self._clock.monotonic()) or self.news
        return sent._replace(data=bytes((bearing.status,)), replied_s=self._clock.monotonic())

    def _reported_A(self, sent: Exchange, until_s: float) -> float | None:
        """The current that is reported; None where nothing was sent, or no reply comes until a time [s]."""
        register, left_s = self._map.speed_register, until_s - self._clock.monotonic()
        if sent.data is None or left_s <= 0.0:
            return None
        data = super().request(register.id, b"", register.size, left_s).data
        return None if data is None else decode_register(register, data)["current"]


class VescProtocol(RegisterProtocol):
    """A WheelProtocol over such a map."""

    undescribed = (
        "what a reply of a VESC holds is chosen by the mask of its request, and its packets are those of its "
        "firmware: give the ground system the map as it is"
    )

    wire_map: VescMap

    @property
    def limits(self) -> WireLimits:
        """What the packets can carry, and how soon a current must be repeated."""
        watchdog_ms = self.wire_map.command.watchdog_ms
        return super().limits._replace(command_within_s=None if watchdog_ms is None else 1e-3 * watchdog_ms)

    @property
    def electronics(self) -> type[RegisterServer]:
        """What answers in a simulated wheel."""
        from rw_ekf.drivers.sim.vesc_server import VescServer

        return VescServer


def protocol_of(data: Mapping[str, object], where: Where) -> VescProtocol:
    """Make the protocol of a map's content. Raises ConfigError with every finding."""
    return of_content(VescProtocol, VescMap, data, where)
