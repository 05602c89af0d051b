"""Wheels that speak NSP (nsp.py): the registers of a wire map are its files and modes (docs/wire-protocol.md#nsp)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal, Self

from pydantic import Field as Key
from pydantic import PrivateAttr, field_validator, model_validator

from rw_ekf.checking.findings import Where
from rw_ekf.checking.section import Mistake, Section, refuse
from rw_ekf.driver import WireItem, WirePacket
from rw_ekf.drivers.line.framing import Codec
from rw_ekf.drivers.line.line import Exchange, Line
from rw_ekf.drivers.line.line_errors import LINE_EXCEPTIONS, lost_error
from rw_ekf.drivers.line.nsp import FIRST_READ, INIT_ID, OK, PING_ID, POLL, READ, REFUSED, WRITE, NspCodec
from rw_ekf.drivers.line.packets import crc_item, field_item
from rw_ekf.drivers.line.register_protocol import AddressedRegisterProtocol, of_content
from rw_ekf.drivers.line.serial_link import SerialLink
from rw_ekf.drivers.line.wire_layout import Byte, IdRanges, Register
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.errors import NotStartedError

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.register_server import RegisterServer

_CRC = "crc16-mcrf4xx"
_START_EVERY_S = 1.0  # a wheel is not started again while it starts
_REFUSED_READS = 2  # of files that it has, in a row
_DEAF_READS = (
    16  # unanswered in a row: a boot loader may be mute. Fewer are lost on a bad line, and INIT ends a program
)
_LONGEST_HUSH = 5.0  # in times that a reply may take
_TEXT_BYTES = 4  # of a PING's answer, as the codec has it


class NspFraming(Section):
    """Addresses, and what generations of wheels differ in."""

    wheel_address: Byte = 0x33
    own_address: Byte = 0x11
    init_address: int = Key(0x1000, ge=0, le=0xFFFF_FFFF, description="where INIT starts the wheel's program")
    echoes_b: Literal["auto", "yes", "no"] = Key("auto", description="whether a reply copies bit B of its request")
    byte_order: Literal["little"] = "little"

    @model_validator(mode="after")
    def _holds(self) -> Self:
        if self.wheel_address == self.own_address:
            refuse([(("own_address",), "is the wheel's address too: an echo of a request would be its reply")])
        return self


class NspLink(SerialLink):
    """A line to a wheel that powers up in a boot loader, and falls back into it: it is started, and that is counted."""

    codec: NspCodec

    def __init__(self, *args: Any, init_data: bytes = b"", starts: bool = True) -> None:
        """starts: False raises NotStartedError in place of an INIT."""
        super().__init__(*args)
        self._init_data = init_data
        self._starts = starts
        self._start_again_s = self._clock.monotonic()
        self._in_vain = 0  # requests running that brought nothing
        self._runs = False  # its program, and not the boot loader, as far as it is known
        self._files: dict[int, int] = {}  # that it has, by id, with the size of their data

    def request(self, register_id: int, data: bytes, reply_bytes: int, timeout_s: float | None = None) -> Exchange:
        """As `SerialLink.request`; a wheel that refuses every read, or hears none though it is there, is started."""
        if not self.may_ask:  # nor is anything of it in vain
            return super().request(register_id, data, reply_bytes, timeout_s)
        if self.in_turns and self._in_vain >= _DEAF_READS and self._clock.monotonic() >= self._start_again_s:
            self._start()
        if register_id == PING_ID:
            return self._identity(reply_bytes, timeout_s)
        if self._in_vain and self.codec.echoes_b is False and not self.in_turns:  # there it has had a period for that
            self._hush()  # a late reply would be taken for the next one's
        ahead = self._wanted_ahead(register_id)
        exchange = super().request(ahead, b"", self._files[ahead], timeout_s) if ahead is not None else None
        if exchange is None or exchange.data is not None:
            exchange = super().request(register_id, data, reply_bytes, timeout_s)
        self._note(register_id, reply_bytes, exchange)
        may_start = self.may_ask and self._clock.monotonic() >= self._start_again_s
        if exchange.data == REFUSED and not self._runs and may_start:
            if self._start():  # idle from then on: a zero is confirmed that way too
                exchange = super().request(register_id, data, reply_bytes)
                self._note(register_id, reply_bytes, exchange)
            return exchange
        if self._in_vain >= (_REFUSED_READS if self.is_refused else _DEAF_READS) and may_start:
            self._start()
        return exchange

    @property
    def is_refused(self) -> bool:
        """A read, by a NACK."""
        return self.codec.refused_to_read

    @property
    def hint(self) -> str:
        """A boot loader answers, and knows no register."""
        return (
            "The wheel answers and refuses every read: it may wait in its boot loader for another framing.init_address "
            "than that of the wire map"
            if super().answers
            else ""
        )

    @property
    def answers(self) -> bool:
        """Whether the wheel's own program does."""
        return super().answers and bool(self._files)

    def _wanted_ahead(self, register_id: int) -> int | None:
        """A file to request first: behind two requests in vain B is again what it was, and an old reply may be late.

        Two in vain, two of the other file, and so on: no reply that is late by one, two or three answers a request.
        """
        if register_id < FIRST_READ or self._in_vain // 2 % 2 == 0:
            return None
        return next((file for file in self._files if file != register_id), None)

    def _note(self, register_id: int, reply_bytes: int, exchange: Exchange) -> None:
        """What an exchange says of who answers. A boot loader refuses writes too, and lacks no file that was read."""
        if exchange.data not in (None, REFUSED):
            self._in_vain, self._runs = 0, True
            if register_id >= FIRST_READ:
                self._files[register_id] = reply_bytes
        elif exchange.data is None and not (self.is_refused and self._files and register_id not in self._files):
            self._in_vain += 1

    def _identity(self, reply_bytes: int, timeout_s: float | None) -> Exchange:
        """What PING answers, if a file can be read behind it: a boot loader's text is not the wheel's."""
        now_s = self._clock.monotonic()
        nobody = Exchange(None, now_s, now_s)
        if not self._runs or self._in_vain:
            return nobody
        exchange = super().request(PING_ID, b"", reply_bytes, timeout_s)
        if exchange.data is None or not self._files:
            return exchange
        file, size = list(self._files.items())[-1]
        return nobody if super().request(file, b"", size).data is None else exchange

    def _start(self) -> bool:
        """PING, and INIT where somebody answers; whether it was taken."""
        self._start_again_s = self._clock.monotonic() + _START_EVERY_S
        self._runs = False
        if super().request(PING_ID, b"", _TEXT_BYTES).data is None:
            self._seq += 1  # B continues between reads as if nothing had been requested
            return False
        if not self._starts:
            raise NotStartedError(f"{self.settings.port}: the wheel answers from its boot loader and refuses reads")
        if super().request(INIT_ID, self._init_data, len(OK)).data != OK:
            return False
        self.restarts += 1
        self._in_vain = 0
        return True

    def _hush(self) -> None:
        """Let pass what still comes of requests that were given up: until nothing has, for as long as a reply takes."""
        gap_s = self.reply_timeout_s
        heard_s = began_s = now_s = self._clock.monotonic()
        while now_s - heard_s < gap_s and now_s - began_s < _LONGEST_HUSH * gap_s:
            try:
                came = self._take(1)
            except LINE_EXCEPTIONS as error:
                raise lost_error(self.settings.port, error) from error
            now_s = self._clock.monotonic()
            heard_s = now_s if came else heard_s


class NspMap(WireMap):
    """A wire map of such a wheel."""

    _starts: bool = PrivateAttr(default=True)
    framing: NspFraming = NspFraming()  # type: ignore[assignment]
    ids: IdRanges = IdRanges(write=(0, INIT_ID - 1), read=(FIRST_READ, PING_ID))

    @field_validator("registers")
    @classmethod
    def _speakable(cls, registers: tuple[Register, ...]) -> tuple[Register, ...]:
        mistakes: list[Mistake] = []
        for index, register in enumerate(registers):
            if register.access == "write" and register.id >= INIT_ID:
                mistakes.append(((index, "id"), f"is {register.id}; a mode has a number of 0 to {INIT_ID - 1}"))
            elif register.access == "read" and register.id < FIRST_READ:
                mistakes.append(((index, "id"), f"is {register.id}; a file has {FIRST_READ} and its number"))
            elif register.id == PING_ID and (register.name != "identity" or register.size != _TEXT_BYTES):
                mistakes.append(((index, "id"), f"is {PING_ID}, what PING answers: identity with one u32, and no file"))
        refuse(mistakes)
        return registers

    def codec(self) -> Codec:
        """For one end of a line."""
        known = {"auto": None, "yes": True, "no": False}[self.framing.echoes_b]
        return NspCodec(self.framing.wheel_address, self.framing.own_address, known)

    def open_line(self, *line: Any) -> Line:
        """A line on which it is spoken."""
        settings, *more = line
        return NspLink(settings, self.codec(), *more, init_data=self.init_data, starts=self._starts)

    @property
    def init_data(self) -> bytes:
        """What INIT carries."""
        return self.framing.init_address.to_bytes(4, "little")


class NspProtocol(AddressedRegisterProtocol):
    """A WheelProtocol over such a map."""

    wire_map: NspMap
    _address_key = "wheel_address"

    @property
    def packets(self) -> tuple[WirePacket, ...]:
        """Commands, with bit B down, and the replies to reads, which are distinguished by their file.

        A reply to a write holds no more than its ack, in the control byte; PING and INIT are the driver's own.
        """
        wheel, own = self.wire_map.framing.wheel_address, self.wire_map.framing.own_address
        found = []
        for register in self.wire_map.registers:
            if register.id == PING_ID:
                continue
            fields = tuple(field_item(field, little=True) for field in register.fields)
            if register.access == "read":
                file = WireItem("file", "u8", True, "what is read", constant=register.id - FIRST_READ)
                asks: tuple[WireItem, ...] = (_byte("control", POLL | READ), file)
                name = f"read_{register.name}"
                reported = (WireItem("control", "u8", True, "final, B, ack, command"), file, *fields)
                items = (_byte("destination", own), _byte("source", wheel), *reported, crc_item(_CRC))
                found.append(WirePacket(register.name, False, items, f"telemetry of file {register.id - FIRST_READ}"))
            else:
                head = (_byte("control", POLL | WRITE), _byte("zero", 0), _byte("mode", register.id))
                asks, name = (*head, *fields), register.name
            items = (_byte("destination", wheel), _byte("source", own), *asks, crc_item(_CRC))
            found.append(WirePacket(name, True, items, f"{register.access}s {register.name}"))
        return tuple(found)

    def reading_only(self) -> NspProtocol:
        """As StartedByWrite has it."""
        held = self.wire_map.model_copy()
        held._starts = False
        return type(self)(held, self.scale_places, self.fingerprint, self.open_port)

    @property
    def electronics(self) -> type[RegisterServer]:
        """What answers in a simulated wheel."""
        from rw_ekf.drivers.sim.nsp_server import NspServer

        return NspServer


def _byte(name: str, value: int) -> WireItem:
    return WireItem(name, "u8", True, name, constant=value)


def protocol_of(data: Mapping[str, object], where: Where) -> NspProtocol:
    """Make the protocol of a map's content. Raises ConfigError with every finding."""
    return of_content(NspProtocol, NspMap, data, where)
