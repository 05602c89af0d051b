"""A line of text in both directions: no late answer is a fresh one, no wheel is driven before it is made ready.

An answer has no number. Behind a request that was given up its answer may still come, and would be taken for that of
the next one. So the first answer behind such requests is not believed, and nothing is requested until the line has been
silent for as long as those requests were apart: on a line that keeps every answer, however long, they come as far apart
as their requests, and each that comes makes the silence begin again. So an answer that is lost costs two readings,
and one that is late is none. Where the wheel reports its clock an answer that fits it is believed at once. A command
waits for nothing: whether what confirms it is its own is seen by a question behind it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from rw_ekf.drivers.line.ascii_codec import AsciiCodec
from rw_ekf.drivers.line.ascii_layout import AsciiRegister
from rw_ekf.drivers.line.ascii_protocol import AsciiMap
from rw_ekf.drivers.line.line import Exchange
from rw_ekf.drivers.line.line_errors import LINE_EXCEPTIONS, lost_error
from rw_ekf.drivers.line.registers import decode_register, encode_register, telling_register
from rw_ekf.drivers.line.serial_link import SerialLink
from rw_ekf.drivers.line.wire_layout import Register
from rw_ekf.drivers.line.wire_map import STATUS_OK
from rw_ekf.errors import DriverError

_RESTART_S, _RESTART_REQUESTS = 0.5, 3  # silent for so long, a wheel that says nothing of it may have restarted
_BEGIN_EVERY_S = 1.0  # a wheel that refuses currents all the same is not started again and again
_LATEST_S = 1.0  # an answer is not waited for longer
_FRESH_SHARE = 0.5  # of a reply's time: by how much the clocks at both ends may go apart between two answers
_GAP_SHARE, _LEAST_GAP_S = 0.25, 0.005  # of a reply's time: how much longer a silence must be than requests were apart


@dataclass
class _Owed:
    """Requests since one was given up whose answers look alike."""

    sent_s: float
    apart_s: float = 0.0  # the longest time between two of them
    heard: int = 0  # answers of the form so far, as far as the silence began again with them
    silent_until_s: float | None = None  # when nothing may come any more; None: nothing has come yet

    def add(self, sent_s: float) -> None:
        """One more."""
        self.apart_s = max(self.apart_s, sent_s - self.sent_s)
        self.sent_s = sent_s


class AsciiLink(SerialLink):
    """An open line to a wheel of such a map. Raises DriverError also where the wheel refuses a line of its start."""

    codec: AsciiCodec

    def __init__(self, settings: Any, wire_map: AsciiMap, *more: Any) -> None:
        self._map = wire_map
        self._is_ready = not wire_map.startup  # to be driven, as far as it is known
        self._forms = _forms(wire_map.registers)
        self._owed: dict[int, _Owed] = {}  # by form of the answer
        self._reported: dict[
            int, tuple[float, float]
        ] = {}  # by register: the wheel's clock, and when that was requested
        self._stated_A = 0.0  # the current that was written last
        self._begin_again_s = -math.inf
        self._answered_s = math.inf  # when the wheel has answered last; infinity: never
        self._in_vain = 0  # questions since
        self._telling = telling_register(wire_map)
        self._tells_restart = wire_map.restarted is not None or any(r.field("uptime") for r in wire_map.readable())
        super().__init__(settings, AsciiCodec(wire_map, self._forms), *more)

    def note_restart(self) -> None:
        """The wheel has restarted: the lines of its start are due, before it is driven again."""
        self._is_ready, self._begin_again_s = not self._map.startup, -math.inf

    @property
    def is_refused(self) -> bool:
        """A question, by a line that says so."""
        return self.codec.refused is not None

    @property
    def answers(self) -> bool:
        """Whether a question has been answered."""
        return math.isfinite(self._answered_s)

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
        form, now_s = self._forms[register_id], self._clock.monotonic()
        until_s = now_s + (self.reply_timeout_s if timeout_s is None else timeout_s)
        exchange = Exchange(None, now_s, now_s)
        if not self.may_ask:
            return exchange
        # Where others want the line, the silence is what lies between two turns.
        while exchange.data is None and self._is_settled(form, now_s if self.in_turns else until_s):
            exchange = self._ask(register, None if timeout_s is None else until_s - self._clock.monotonic())
            if form not in self._owed or self._owed[form].silent_until_s is None:
                break
        if exchange.data is not None:
            self._note_answer(register, exchange)
        return exchange

    def _command(self, register: AsciiRegister, data: bytes, timeout_s: float | None) -> Exchange:
        """A command: acknowledged by the line that the map says, or else by an answer to the question behind it."""
        if register.name != "current_command":
            self.note_restart()  # idle, or reset
        else:
            self._stated_A = decode_register(register, data)["current_command"]
            if not self._is_ready and self._stated_A != 0.0 and self._clock.monotonic() >= self._begin_again_s:
                self._begin(register)
        if register.reply is None:
            exchange = self._say(self.codec.request(0, register.id, data))
            if self._telling is not None and register.name == "current_command":
                return exchange._replace(data=None)  # whoever commands queries what is in force
        else:
            exchange = super().request(register.id, data, 1, timeout_s)
            if exchange.data not in (None, bytes((STATUS_OK,))):
                self._is_ready = not self._map.startup  # it may have restarted unseen
            if exchange.data is None and not self.is_refused:
                self._give_up(self._forms[register.id], exchange)
            if exchange.data is None or self._forms[register.id] not in self._owed:
                return exchange
        if exchange.data is not None and self._ask(self._map.speed_register).data is None:
            return exchange._replace(data=None)
        self._owed.pop(self._forms[register.id], None)
        if register.reply is None and self.codec.refused_line is not None:
            self._is_ready = not self._map.startup
            return exchange._replace(data=bytes((self.codec.refused_status,)))
        return exchange

    def _begin(self, command: AsciiRegister) -> None:
        """Zero, and then the lines of the start. Raises DriverError where the wheel refuses one of those."""
        wanted_A, self._begin_again_s = self._stated_A, self._clock.monotonic() + _BEGIN_EVERY_S
        heard = self._command(command, encode_register(command, {"current_command": 0.0}), None)
        if command.reply is None and self._telling is not None:
            heard = self._ask(self._telling)
            if heard.data is not None and decode_register(self._telling, heard.data)["current_command"] != 0.0:
                return
        if heard.data is None:
            return  # the next current tries again
        for line in self._map.startup:
            good = self.good_frames
            sent = self._say(self.codec.startup(line))
            self._listen(sent.received_by_wheel_s + self.reply_timeout_s, good)
            if self.codec.refused_line is not None:
                raise DriverError(
                    f"{self.settings.port}: the wheel answers {self.codec.refused_line!r} to {line!r}, a line of "
                    "startup in its wire map: hold the map against the firmware"
                )
            if self.good_frames == good:
                self._give_up(self._forms[command.id], sent)
        self._is_ready, self._stated_A = True, wanted_A

    def _ask(self, register: Register, timeout_s: float | None = None) -> Exchange:
        """Request once; an answer that may be another's is none."""
        form, now_s = self._forms[register.id], self._clock.monotonic()
        if self.in_turns and not self._is_settled(form, now_s):  # a question would begin the silence again
            return Exchange(None, now_s, now_s)
        exchange = super().request(register.id, b"", register.size, timeout_s)
        owed = self._owed.get(form)
        if exchange.data is None:
            if not self.is_refused:
                if register.name != "identity":  # an old one says the same, and it is requested again and again
                    self._give_up(form, exchange)
                self._in_vain += 1
            return exchange
        if owed is None or self._is_fresh(register, exchange):
            return exchange
        owed.add(exchange.received_by_wheel_s)
        self._be_silent(form, owed, exchange.replied_s)
        return exchange._replace(data=None)

    def _is_fresh(self, register: Register, exchange: Exchange) -> bool:
        """Whether the wheel's clock says that an answer is not an old one; those are older than a reply may be."""
        uptime_s, wanted_s = _uptime_s(register, exchange), exchange.received_by_wheel_s
        before_s, before_wanted_s = self._reported.get(register.id, (math.nan, math.nan))
        return abs((wanted_s - before_wanted_s) - (uptime_s - before_s)) < _FRESH_SHARE * self.reply_timeout_s

    def _be_silent(self, form: int, owed: _Owed, since_s: float) -> None:
        """Nothing is requested from a time [s] on until no more answers of a form can come."""
        gap_s = max(_GAP_SHARE * self.reply_timeout_s, _LEAST_GAP_S)
        owed.heard, owed.silent_until_s = self.codec.heard[form], since_s + owed.apart_s + gap_s

    def _give_up(self, form: int, exchange: Exchange) -> None:
        """A request has no answer yet."""
        self._owed.setdefault(form, _Owed(exchange.received_by_wheel_s)).add(exchange.received_by_wheel_s)

    def _is_settled(self, form: int, until_s: float) -> bool:
        """Whether no old answer of a form can come any more; waits for that until a time [s]."""
        if form in self._owed and self._clock.monotonic() - self._owed[form].sent_s > _LATEST_S:
            del self._owed[form]
        while (owed := self._owed.get(form)) is not None and owed.silent_until_s is not None:
            self._listen(min(owed.silent_until_s, until_s, self._clock.monotonic() + _LEAST_GAP_S))
            now_s = self._clock.monotonic()
            if self.codec.heard[form] != owed.heard:
                self._be_silent(form, owed, now_s)
            if now_s >= owed.silent_until_s:
                del self._owed[form]
            elif now_s >= until_s:
                return False
        return True

    def _note_answer(self, register: Register, exchange: Exchange) -> None:
        """The wheel has answered: it may have restarted meanwhile."""
        self._reported[register.id] = _uptime_s(register, exchange), exchange.received_by_wheel_s
        if register is self._telling:
            assert exchange.data is not None
            reported_A = decode_register(self._telling, exchange.data)["current_command"]
            if abs(reported_A - self._stated_A) > self._map.current_command.fields[0].si_per_count:
                self._is_ready = not self._map.startup  # it may have restarted unseen
        was_away = self._in_vain >= _RESTART_REQUESTS and self._clock.monotonic() - self._answered_s > _RESTART_S
        if self.codec.has_restarted or (was_away and self._map.startup and not self._tells_restart):
            self.codec.has_restarted = False
            self.restarts += self.answers
            self.note_restart()
        self._answered_s, self._in_vain = self._clock.monotonic(), 0

    def _listen(self, until_s: float, good: int = -1) -> None:
        """Take what comes until a time [s], of no meaning but a refusal; or until more than so many good lines came."""
        try:
            while self._clock.monotonic() < until_s and good in (-1, self.good_frames):
                self._take(1, keep=None if good == -1 else [])
        except LINE_EXCEPTIONS as error:
            raise lost_error(self.settings.port, error) from error

    def _say(self, line: bytes) -> Exchange:
        """Send a line that nothing answers; its data says whether it was sent."""
        exchange = self._tell(line, self.codec.expect_refusal)
        return exchange if exchange.data is None else exchange._replace(data=bytes((STATUS_OK,)))

    def _drop_unfinished(self, now_s: float) -> None:
        """As of a frame; what still comes of the line may look like an answer."""
        damaged = self.counters.damaged
        super()._drop_unfinished(now_s)
        if self.counters.damaged != damaged:
            self._give_up(self._forms[self._map.speed_register.id], Exchange(None, now_s, now_s))


def _forms(registers: tuple[AsciiRegister, ...]) -> dict[int, int]:
    """By id of a register the form of its answers: the same number where one of them could be read as the other's."""
    ones = dict.fromkeys((field.name for register in registers for field in register.fields), 1.0)
    forms = {register.id: register.id for register in registers}
    for one in registers:
        for other in registers:
            read, answers = one._answers, other._answers
            if read is not None and answers is not None and read.read(answers.printed(ones)) is not None:
                forms = {key: forms[one.id] if form == forms[other.id] else form for key, form in forms.items()}
    return forms


def _uptime_s(register: Register, exchange: Exchange) -> float:
    """When the wheel answered, by its clock [s]; NaN where it does not say."""
    assert exchange.data is not None
    return decode_register(register, exchange.data).get("uptime", math.nan)
