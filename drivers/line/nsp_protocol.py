"""Wheels that speak NSP (nsp.py): the registers of a wire map are its files and modes (docs/wire-protocol.md#nsp)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field as Key

from rw_ekf.checking.findings import Where
from rw_ekf.checking.section import Section
from rw_ekf.drivers.line.framing import Codec
from rw_ekf.drivers.line.line_errors import LINE_EXCEPTIONS, lost_error
from rw_ekf.drivers.line.nsp import INIT_ID, OK, PING_ID, REFUSED, NspCodec
from rw_ekf.drivers.line.register_protocol import RegisterProtocol, of_content
from rw_ekf.drivers.line.serial_link import Exchange, SerialLink
from rw_ekf.drivers.line.wire_layout import Byte
from rw_ekf.drivers.line.wire_map import WireMap

if TYPE_CHECKING:
    from rw_ekf.drivers.sim.register_server import RegisterServer

_START_EVERY_S = 1.0  # a wheel is not started again while it starts
_REFUSED_READS = 2  # in a row: one alone is of a file that this wheel does not have
_DEAF_READS = 3  # unanswered in a row: then it is asked whether anybody is there, who may wait for INIT
_LONGEST_HUSH = 5.0  # in times that a reply may take
_TEXT_BYTES = 4  # of a PING's answer, as the codec has it


class NspFraming(Section):
    """Addresses, and what generations of wheels differ in."""

    wheel_address: Byte = 0x33
    own_address: Byte = 0x11
    init_address: int = Key(0x1000, ge=0, le=0xFFFF_FFFF, description="where INIT starts the wheel's program")
    echoes_b: Literal["auto", "yes", "no"] = Key("auto", description="whether a reply copies bit B of its request")
    byte_order: Literal["little"] = "little"


class NspLink(SerialLink):
    """A line to a wheel that powers up in a boot loader, and falls back into it: it is started, and that is counted."""

    codec: NspCodec

    def __init__(self, *args: Any, init_data: bytes = b"") -> None:
        super().__init__(*args)
        self._init_data = init_data
        self._start_again_s = self._clock.monotonic()
        self._in_vain = 0  # requests running that brought nothing
        self._runs = False  # its program, and not the boot loader, as far as it is known

    def request(self, register_id: int, data: bytes, reply_bytes: int, timeout_s: float | None = None) -> Exchange:
        """As `SerialLink.request`; a wheel that refuses every read, or hears none though it is there, is started."""
        if register_id == PING_ID and not self._runs:  # a boot loader's text is not what the wheel is known by
            now_s = self._clock.monotonic()
            return Exchange(None, now_s, now_s)
        if self._in_vain and self.codec.echoes_b is False:
            self._hush()  # a late reply would be taken for the next one's
        exchange = super().request(register_id, data, reply_bytes, timeout_s)
        self._in_vain = 0 if exchange.data is not None else self._in_vain + 1
        self._runs = self._runs or exchange.data not in (None, REFUSED)
        may_start = self._clock.monotonic() >= self._start_again_s
        if exchange.data == REFUSED and not self._runs and may_start:
            self._start()  # idle from then on: a zero is confirmed that way too
            return super().request(register_id, data, reply_bytes) if self._runs else exchange
        if self._in_vain >= (_REFUSED_READS if self.is_refused else _DEAF_READS) and may_start:
            self._start()
        return exchange

    @property
    def is_refused(self) -> bool:
        """A read, by a NACK."""
        return self.codec.refused_to_read

    @property
    def answers(self) -> bool:
        """Whether the wheel's own program does."""
        return super().answers and self._runs

    def _start(self) -> None:
        """PING, and INIT where somebody answers."""
        self._start_again_s = self._clock.monotonic() + _START_EVERY_S
        self._runs = False
        if super().request(PING_ID, b"", _TEXT_BYTES).data is None:
            return
        if super().request(INIT_ID, self._init_data, len(OK)).data == OK:
            self.restarts += 1
            self._in_vain = 0
            self._runs = True

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

    framing: NspFraming = NspFraming()  # type: ignore[assignment]

    def codec(self) -> Codec:
        """For one end of a line."""
        known = {"auto": None, "yes": True, "no": False}[self.framing.echoes_b]
        return NspCodec(self.framing.wheel_address, self.framing.own_address, known)

    def open_line(self, *line: Any) -> SerialLink:
        """A line on which it is spoken."""
        settings, *more = line
        return NspLink(settings, self.codec(), *more, init_data=self.init_data)

    @property
    def init_data(self) -> bytes:
        """What INIT carries."""
        return self.framing.init_address.to_bytes(4, "little")


class NspProtocol(RegisterProtocol):
    """A WheelProtocol over such a map."""

    wire_map: NspMap

    @property
    def electronics(self) -> type[RegisterServer]:
        """What answers in a simulated wheel."""
        from rw_ekf.drivers.sim.nsp_server import NspServer

        return NspServer


def protocol_of(data: Mapping[str, object], where: Where) -> NspProtocol:
    """Make the protocol of a map's content. Raises ConfigError with every finding."""
    return of_content(NspProtocol, NspMap, data, where)
