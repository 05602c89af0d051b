"""One request in flight on a serial line: frames out, the one reply that belongs to them in, everything else counted.

Knows ports, time and counters, but nothing of registers' meaning (serial_wheel.py does).
"""

from __future__ import annotations

from collections.abc import Callable

import serial

from rw_ekf.clock import Clock
from rw_ekf.drivers.line.framing import Codec, Frame
from rw_ekf.drivers.line.line import Exchange
from rw_ekf.drivers.line.line_errors import LINE_EXCEPTIONS, lost_error, silent_error
from rw_ekf.drivers.line.serial_port import (
    PortSettings,
    await_bytes,
    close_serial_port,
    let_pass,
    open_serial_port,
    read_port,
)
from rw_ekf.drivers.line.shared_port import LineEnd, OpenPort
from rw_ekf.errors import DriverError
from rw_ekf.records import LinkCounters

DRAIN_LIMIT_BYTES = 65536  # a babbling peer must not keep us from requesting


class SerialLink:
    """An open line. Raises DriverError when the port cannot be opened or fails; a missing reply is not an error."""

    def __init__(
        self,
        settings: PortSettings,
        codec: Codec,
        reply_timeout_s: float,
        clock: Clock,
        counters: LinkCounters | None = None,
        open_port: OpenPort = open_serial_port,
    ) -> None:
        """Open the port. reply_timeout_s: behind a request's last byte. open_port: opens it in pyserial's place."""
        self.settings = settings
        self.name = f"serial+{settings.port}"
        self.news: tuple[str, str] | None = None  # an event of the link and its sentence, until it is reported
        self._clock = clock
        self.codec = codec
        self.restarts = 0  # of the wheel, that this end had to see to
        self.byte_s = settings.line.bits_per_byte / settings.baud
        self.reply_timeout_s = reply_timeout_s
        self.counters = counters if counters is not None else LinkCounters()
        self.received_bytes = 0
        self.good_frames = 0
        self._seq = 0
        self._rest = b""
        self._came_s = clock.monotonic()  # when bytes came last
        self._serial = open_port(settings, max(reply_timeout_s, 0.050))
        self._end = self._serial if isinstance(self._serial, LineEnd) else None
        try:
            # Beside another process that talks there is no quiet to wait for; on a line that others use there was one.
            if settings.exclusive and (self._end is None or self._end.is_fresh):
                let_pass(self._serial, clock)
        except LINE_EXCEPTIONS as error:
            self.close()
            raise lost_error(settings.port, error) from error

    def request(self, register_id: int, data: bytes, reply_bytes: int, timeout_s: float | None = None) -> Exchange:
        """Send one frame and wait for the reply with the same seq and id and `reply_bytes` of data.

        Replies to earlier requests are dropped and counted as stale, frames with a bad CRC or another length as
        damaged. Returns within timeout_s (default: sending time + reply timeout), at once where this is not its turn.
        Raises DriverError if the port fails.
        """
        if not self.may_ask:
            now_s = self._clock.monotonic()
            return Exchange(None, now_s, now_s)
        self._seq = (self._seq + 1) & 0xFF
        frame = self.codec.request(self._seq, register_id, data)
        started_s = self._clock.monotonic()
        limit_s = self.transmit_s(len(frame)) + self.reply_timeout_s
        deadline_s = started_s + (limit_s if timeout_s is None else min(limit_s, max(timeout_s, 0.0)))
        try:
            self._drop_unfinished(started_s)
            self._drain()
            self.counters.requests += 1
            sent_s = self._clock.monotonic()
            reply = self._wait(register_id, reply_bytes, deadline_s) if self._send(frame) else None
            if reply is None and self.settings.is_local:
                self._serial.reset_output_buffer()  # what could not be sent by now must not come at some later time
            if reply is None and self._end is not None:
                self._give_up_turn(self._end)
        except LINE_EXCEPTIONS as error:
            raise lost_error(self.settings.port, error) from error
        arrived_s = sent_s + self.transmit_s(len(frame))
        if reply is None:
            self.counters.timeouts += 1
            return Exchange(None, arrived_s, self._clock.monotonic())
        took_s = self._came_s - arrived_s - self.transmit_s(self.codec.overhead_bytes + reply_bytes)
        self.counters.note_reply(1e3 * max(took_s, 0.0))
        return Exchange(reply, arrived_s, self._came_s)

    def _tell(self, frame: bytes, meanwhile: Callable[[], object] = lambda: None) -> Exchange:
        """Send a frame that nothing answers; its data is empty, or None where it could not be sent, or was not echoed.

        meanwhile: called when what came before has been taken, and the frame has not gone out.
        """
        try:
            self._drop_unfinished(self._clock.monotonic())
            self._drain()
            meanwhile()
            self.counters.requests += 1
            sent_s = self._clock.monotonic()
            is_sent = self._send(frame)
            if not is_sent and self.settings.is_local:
                self._serial.reset_output_buffer()
            if is_sent and self._end is not None:
                is_sent = self._is_echoed(self._end, sent_s + self.transmit_s(len(frame)) + self.reply_timeout_s)
        except LINE_EXCEPTIONS as error:
            raise lost_error(self.settings.port, error) from error
        return Exchange(b"" if is_sent else None, sent_s + self.transmit_s(len(frame)), self._clock.monotonic())

    def _is_echoed(self, end: LineEnd, until_s: float) -> bool:
        """Wait for the echo of what was sent, where there is one, until a time [s]; whether none is missing."""
        while end.awaits_echo and self._clock.monotonic() < until_s:
            self._take(1)
        is_missing = end.awaits_echo
        if is_missing:
            self.counters.timeouts += 1
            self._give_up_turn(end)
        return not is_missing

    @property
    def in_turns(self) -> bool:
        """Whether others speak on the line too, so that nobody is waited for twice in a turn."""
        return self._end is not None and self._end.slot is not None

    @property
    def may_ask(self) -> bool:
        """Whether its turn is not over: always, where it has the line for itself."""
        return self._end is None or self._end.may_ask

    def _give_up_turn(self, end: LineEnd) -> None:
        """No reply has come: its turn is over, unless the wheel has answered in another way."""
        lost = end.echoes_lost
        try:
            if not self.is_refused:
                end.give_up()
        finally:
            if end.echoes_lost != lost:
                self.counters.echoes_lost += end.echoes_lost - lost

    @property
    def is_refused(self) -> bool:
        """Whether the last request was answered by a refusal that is no reply: nothing more is waited for."""
        return False

    @property
    def hint(self) -> str:
        """Why what has come may be no answer; empty where nothing is known."""
        return ""

    def note_restart(self) -> None:
        """The wheel has restarted, as its clock says."""

    @property
    def answers(self) -> bool:
        """Whether a good frame has come since it was opened."""
        return self.good_frames > 0

    def unanswered(self, waited_s: float) -> DriverError:
        """What to say where it never did."""
        settings = self.settings
        heard = (self.received_bytes, self.good_frames, self.hint)
        return silent_error(settings.port, settings.baud, waited_s, *heard)

    def transmit_s(self, byte_count: int) -> float:
        """How long bytes take on the line [s]."""
        return byte_count * self.byte_s

    def close(self) -> None:
        """Release the port. Safe to call twice, and on a port that has vanished."""
        close_serial_port(self._serial)

    def _drop_unfinished(self, now_s: float) -> None:
        """Drop the beginning of a frame whose end has not come in the time of a reply: no later byte is its end."""
        if len(self._rest) > 1 and now_s - self._came_s > self.reply_timeout_s:
            self.counters.damaged += 1
            self._rest = b""

    def _send(self, frame: bytes) -> bool:
        """Write a frame; False if the far end takes no bytes (then nothing of it may come later)."""
        try:
            self._serial.write(frame)
        except serial.SerialTimeoutException:
            return False
        return True

    def _drain(self) -> None:
        """Take what came since the last request, so that no old reply can answer this one; count what it was."""
        taken = 0
        while taken < DRAIN_LIMIT_BYTES:
            waiting = self._serial.in_waiting
            if not waiting:
                return
            came = self._take(waiting)
            if not came:
                return
            taken += len(came)

    def _wait(self, register_id: int, reply_bytes: int, deadline_s: float) -> bytes | None:
        """The data of the reply, or None at the deadline."""
        reply: bytes | None = None
        while reply is None and not self.is_refused and (now_s := self._clock.monotonic()) < deadline_s:
            await_bytes(self._serial, deadline_s - now_s)
            frames: list[Frame] = []
            self._take(1, keep=frames)
            for frame in frames:
                if reply is not None or (frame.seq, frame.id) != (self._seq, register_id):
                    self.counters.stale += 1
                elif len(frame.data) == reply_bytes:
                    reply = frame.data
                else:
                    self.counters.damaged += 1  # e.g. our own request, echoed by a two-wire adapter
        return reply

    def _take(self, at_least: int, keep: list[Frame] | None = None) -> bytes:
        """Read what is there, waiting one poll for it; frames go to `keep`, or without it count as stale."""
        chunk = read_port(self._serial, at_least, self.settings.exclusive)
        if chunk and keep is not None:
            more = min(self._serial.in_waiting, DRAIN_LIMIT_BYTES)
            chunk += read_port(self._serial, more, self.settings.exclusive)
        if not chunk:
            return chunk
        self._came_s = self._clock.monotonic()
        decoded = self.codec.replies(self._rest + chunk)
        self._rest = decoded.rest
        self.received_bytes += len(chunk)
        self.good_frames += len(decoded.frames)
        self.counters.damaged += decoded.damaged
        if keep is None:
            self.counters.stale += len(decoded.frames)
        else:
            keep.extend(decoded.frames)
        return chunk
