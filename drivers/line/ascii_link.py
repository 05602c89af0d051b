"""A line of text in both directions: no late answer is a fresh one, no wheel is driven before it is made ready.

An answer has no number. Behind a request that was given up its answer may still come, and would be taken for that of
the next one. So for a second requests are kept a gap apart and every answer is checked: the same is asked again at
once, and only if that is answered in time as well, and no third line comes soon, is the second answer believed. On a
line that keeps every answer for longer than a reply may take the check fails, however long it keeps them: answers come
as far apart as the requests were sent, and those were a reply's time and the gap apart. On one that keeps some, and
lets others overtake them, the answer that was overtaken is the third line, or is older than the first by the wheel's
clock. A command waits for nothing; a question behind it is its check.
"""

from __future__ import annotations

import math
from typing import Any

from rw_ekf.drivers.line.ascii_codec import AsciiCodec
from rw_ekf.drivers.line.ascii_map import AsciiMap, AsciiRegister
from rw_ekf.drivers.line.line_errors import LINE_EXCEPTIONS, lost_error
from rw_ekf.drivers.line.registers import decode_register, encode_register
from rw_ekf.drivers.line.serial_link import Exchange, SerialLink
from rw_ekf.drivers.line.wheel_registers import telling_register
from rw_ekf.drivers.line.wire_layout import Register
from rw_ekf.drivers.line.wire_map import STATUS_OK
from rw_ekf.errors import DriverError

_RESTART_S = 0.5  # silent for so long, a wheel that says nothing of it may have restarted
_LATEST_S = 1.0  # behind a request that was given up no answer is believed unchecked for so long
_LISTEN_LINES, _LISTEN_S = 1.5, 0.005  # how long a checked answer must be the last, in answers' lengths, and beside it
_GAP_SHARE, _LEAST_GAP_S = 0.25, 0.010  # of a reply's time: by how much two requests in vain are apart beside it


class AsciiLink(SerialLink):
    """An open line to a wheel of such a map. Raises DriverError also where the wheel refuses a line of its start."""

    codec: AsciiCodec

    def __init__(self, settings: Any, wire_map: AsciiMap, *more: Any) -> None:
        self._map = wire_map
        self._is_ready = not wire_map.startup  # to be driven, as far as it is known
        self._gave_up_s: dict[int, float] = {}  # when a request of that id was whose answer may still come
        self._alike = {register.id: _alike(register, wire_map.registers) for register in wire_map.registers}
        self._answered_s: float | None = None
        self._telling = telling_register(wire_map)
        self._tells_restart = wire_map.restarted is not None or any(r.field("uptime") for r in wire_map.readable())
        super().__init__(settings, AsciiCodec(wire_map), *more)

    def note_restart(self) -> None:
        """The wheel has restarted: the lines of its start are due, before it is driven again."""
        self._is_ready = not self._map.startup

    @property
    def is_refused(self) -> bool:
        """A question, by a line that says so."""
        return self.codec.refused is not None

    @property
    def answers(self) -> bool:
        """Whether a question has been answered."""
        return self._answered_s is not None

    @property
    def hint(self) -> str:
        """What came and was no answer, for whoever wrote the map."""
        odd = self.codec.odd or self._rest.decode("ascii", "backslashreplace").strip()
        return f"What came last was {odd[:80]!r}: no line of the wire map, or without its end" if odd else ""

    def request(self, register_id: int, data: bytes, reply_bytes: int, timeout_s: float | None = None) -> Exchange:
        """As `SerialLink.request`, of which an answer that may be an old one is none."""
        register = self._map.register_of_id(register_id)
        assert isinstance(register, AsciiRegister)
        if register.access == "write":
            return self._command(register, data, timeout_s)
        began_s = self._clock.monotonic()
        doubted = self._is_in_doubt(register)
        if doubted:
            until_s = self._doubted_since_s(register) + max(_GAP_SHARE * self.reply_timeout_s, _LEAST_GAP_S)
            self._listen(until_s if timeout_s is None else min(until_s, began_s + timeout_s))
        now_s = self._clock.monotonic()
        left_s = None if timeout_s is None else timeout_s - (now_s - began_s)
        if left_s is not None and left_s <= 0.0:
            return Exchange(None, now_s, now_s)
        exchange = self._noted(register, super().request(register_id, data, reply_bytes, left_s))
        if doubted and exchange.data is not None:
            exchange = self._checked(register, exchange)
        if exchange.data is not None:
            self._note_answer()
        return exchange

    def _command(self, register: AsciiRegister, data: bytes, timeout_s: float | None) -> Exchange:
        """A command: acknowledged by the line that the map says, or else by an answer to the question behind it."""
        if register.name != "current_command":
            self.note_restart()  # idle, or reset
        elif not self._is_ready and decode_register(register, data)["current_command"] != 0.0:
            self._begin(register)
        doubted = self._is_in_doubt(register)
        if register.reply is not None:
            exchange = self._noted(register, super().request(register.id, data, 1, timeout_s))
        else:
            exchange = self._say(self.codec.request(0, register.id, data))
            if self._telling is not None and register.name == "current_command":
                return exchange._replace(data=None)  # whoever commands asks what is in force
            doubted = True
        if doubted and exchange.data is not None and self._checked(self._map.speed_register).data is None:
            return exchange._replace(data=None)
        return exchange

    def _begin(self, command: AsciiRegister) -> None:
        """Zero, and then the lines of the start. Raises DriverError where the wheel refuses one of those."""
        heard = self._command(command, encode_register(command, {"current_command": 0.0}), None)
        if command.reply is None and self._telling is not None:
            heard = self._checked(self._telling)
            if heard.data is not None and decode_register(self._telling, heard.data)["current_command"] != 0.0:
                return
        if heard.data is None:
            return  # the next current tries again
        for line in self._map.startup:
            good = self.good_frames
            sent = self._say(self.codec.plain(line))
            self._listen(sent.received_by_wheel_s + self.reply_timeout_s, good)
            if self.codec.refused is not None:
                raise DriverError(
                    f"{self.settings.port}: the wheel answers {self.codec.refused!r} to {line!r}, a line of startup in "
                    "its wire map: hold the map against the firmware"
                )
            if self.good_frames == good:
                self._gave_up_s[command.id] = self._clock.monotonic()
        self._is_ready = True

    def _checked(self, register: Register, first: Exchange | None = None) -> Exchange:
        """The answer to a question, where it comes by itself; behind a first one in its time, and as the younger."""
        answers, now_s = self.codec.answers, self._clock.monotonic()
        left_s = None if first is None else max(first.replied_s + self.reply_timeout_s - now_s, 0.0)
        exchange = self._noted(register, super().request(register.id, b"", register.size, left_s))
        if exchange.data is None:
            return exchange
        line_s = self.transmit_s(self.codec.overhead_bytes + register.size)
        self._listen(exchange.replied_s + min(_LISTEN_LINES * line_s + _LISTEN_S, self.reply_timeout_s))
        older = first is not None and _uptime_s(register, exchange) < _uptime_s(register, first)
        if older or self.codec.answers - answers > 1:
            self._gave_up_s[register.id] = exchange.replied_s
            return exchange._replace(data=None)
        return exchange

    def _doubted_since_s(self, register: Register) -> float:
        """When a request was given up last whose answer looks like one of this register's."""
        return max(self._gave_up_s.get(other, -math.inf) for other in self._alike[register.id])

    def _is_in_doubt(self, register: Register) -> bool:
        """Whether what answers a request may be the answer to another."""
        return self._clock.monotonic() - self._doubted_since_s(register) < _LATEST_S

    def _noted(self, register: Register, exchange: Exchange) -> Exchange:
        """An exchange; given up, its answer may still come."""
        if exchange.data is None and not self.is_refused:
            self._gave_up_s[register.id] = exchange.replied_s
        return exchange

    def _note_answer(self) -> None:
        """The wheel has answered: it may have restarted meanwhile."""
        now_s, before_s = self._clock.monotonic(), self._answered_s
        self._answered_s = now_s
        was_away = not self._tells_restart and before_s is not None and now_s - before_s > _RESTART_S
        if self.codec.has_restarted or (was_away and self._map.startup):
            self.codec.has_restarted = False
            self.restarts += before_s is not None
            self.note_restart()

    def _listen(self, until_s: float, good: int = -1) -> None:
        """Take what comes until a time [s], of no meaning but a refusal; or until more than so many good lines came."""
        try:
            while self._clock.monotonic() < until_s and good in (-1, self.good_frames):
                self._take(1)
        except LINE_EXCEPTIONS as error:
            raise lost_error(self.settings.port, error) from error

    def _say(self, line: bytes) -> Exchange:
        """Send a line that nothing answers; its data says whether it was sent."""
        try:
            self._drop_unfinished(self._clock.monotonic())
            self._drain()
            self.codec.refused = None
            self.counters.requests += 1
            sent_s = self._clock.monotonic()
            is_sent = self._send(line)
            if not is_sent and self.settings.is_local:
                self._serial.reset_output_buffer()
        except LINE_EXCEPTIONS as error:
            raise lost_error(self.settings.port, error) from error
        arrived_s = sent_s + self.transmit_s(len(line))
        return Exchange(bytes((STATUS_OK,)) if is_sent else None, arrived_s, self._clock.monotonic())

    def _drop_unfinished(self, now_s: float) -> None:
        """As of a frame; what still comes of the line may look like an answer."""
        damaged = self.counters.damaged
        super()._drop_unfinished(now_s)
        if self.counters.damaged != damaged:
            self._gave_up_s[self._map.speed_register.id] = now_s


def _uptime_s(register: Register, exchange: Exchange) -> float:
    """When the wheel answered, by its clock [s]; 0 where it tells none."""
    assert exchange.data is not None
    return decode_register(register, exchange.data).get("uptime", 0.0)


def _alike(register: AsciiRegister, registers: tuple[AsciiRegister, ...]) -> tuple[int, ...]:
    """Ids of those whose answers have a form that this one's may have, itself among them."""
    read = register._answers.read if register._answers is not None else lambda line: None
    ones = dict.fromkeys((field.name for other in registers for field in other.fields), 1.0)
    printed = {other.id: other._answers.printed(ones) for other in registers if other._answers is not None}
    return (register.id, *(number for number, line in printed.items() if read(line) is not None))
