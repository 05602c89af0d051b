"""A wheel's electronics at the end of a serial line with faults, in the wheel's time: bytes in, bytes out.

A request counts as received when its last byte would have arrived at the line's baud rate, the map's or a faster one
that the client has set, and a reply is sent when its last byte would have; so delays that the driver works out from the
baud rate are true. Whoever has a clock drives it: a pseudo terminal in real time (`pty_server`), or a port in this
process on any clock (`virtual_line`).
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence

from rw_ekf.drivers.sim.faults import FROM, TO, FaultInjector
from rw_ekf.drivers.sim.line_stage import LineStage
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.register_server import RegisterServer, Reply


class BusElectronics:
    """What `WheelLine` needs of a wheel's electronics, for all wheels of a line.

    faults: of the line and its port; a wheel's own are with its electronics, `silence` too: of that wheel alone then.
    """

    def __init__(
        self, wheels: Sequence[RegisterServer], faults: FaultInjector | None = None, baud: int | None = None
    ) -> None:
        """baud: of the line; None: the first wheel's."""
        self.wheels = wheels
        self.faults = faults if faults is not None else FaultInjector()
        wire_map = wheels[0].wire_map
        link = wire_map.link if baud is None else wire_map.link.model_copy(update={"baud": baud})
        self.wire_map = wire_map.model_copy(update={"link": link})

    @property
    def plant(self) -> PlantRunner:
        """Whose time is that of all."""
        return self.wheels[0].plant

    def handle(self, received: bytes, time_s: float) -> list[Reply]:
        """Replies of all wheels to bytes whose last one arrived at a time [s]; usually of one."""
        replies: list[Reply] = []
        for wheel in self.wheels:
            stated = wheel.handle(received, time_s)
            replies += [] if wheel.faults.on("silence", time_s) else stated
        return replies

    def advance_to(self, time_s: float) -> None:
        """Let all wheels run."""
        for wheel in self.wheels:
            wheel.advance_to(time_s)

    def unsolicited(self, time_s: float) -> list[Reply]:
        """What wheels say unprompted."""
        return [reply for wheel in self.wheels for reply in wheel.unsolicited(time_s)]

    def next_unsolicited_s(self, time_s: float) -> float:
        """When one of them next does; infinity: never."""
        return min(wheel.next_unsolicited_s(time_s) for wheel in self.wheels)


TURNAROUND_S = 0.0005  # from the last byte of a request to the first of its reply
FLOOD_EVERY_S = 0.01  # junk is put on the line so often
RECEIVED, SEND = 0, 1  # kinds of event


class WheelLine:
    """One RegisterServer, or a bus of them, and its line, with the server's faults.

    Times are the wheel's [s], and never go back.
    """

    def __init__(self, server: RegisterServer | BusElectronics) -> None:
        self.server = server
        self._faults = server.faults
        self._stage = LineStage(self._faults)
        self._link = server.wire_map.link
        self._byte_s = self._link.bits_per_byte / self._link.baud
        self._events: list[tuple[float, int, int, bytes]] = []  # (time, order, kind, bytes)
        self._order = 0
        self._receiving_until_s = self._sending_until_s = server.plant.time_s

    def carries(self, baud: float) -> None:
        """The client's port runs at this speed, in bits per second of the wheel's time: so does a line that is slower.

        A client that is slower than the map has it is heard all the same: a bench of its own time sets nothing.
        """
        self._byte_s = self._link.bits_per_byte / max(baud, self._link.baud)

    def is_plugged(self, now_s: float) -> bool:
        """Whether there is a port at all."""
        return not self._faults.on("hangup", now_s)

    def takes(self, now_s: float) -> bool:
        """Whether the far end takes bytes."""
        return not self._faults.on("block", now_s)

    def next_s(self, now_s: float) -> float:
        """When something is due next, now or later; infinity: nothing until bytes come."""
        due_s = self._faults.next_change_s(now_s)
        if self._faults.on("flood", now_s):
            due_s = min(due_s, now_s + FLOOD_EVERY_S)
        if self._events:
            due_s = min(due_s, self._events[0][0])
        due_s = min(due_s, self.server.next_unsolicited_s(now_s))
        return max(due_s, now_s)

    def take(self, content: bytes, now_s: float) -> None:
        """Bytes from the client: received when the line has carried them."""
        if not content:
            return
        begin_s = max(now_s, self._receiving_until_s)
        self._receiving_until_s = begin_s + len(content) * self._byte_s
        for piece in self._stage.carry(TO, content, now_s):
            self._push(self._receiving_until_s + piece.late_s, RECEIVED, piece.content)
        self._push(self._receiving_until_s, SEND, self._stage.echo(content, now_s))

    def work(self, now_s: float) -> bytes:
        """Work off what is due; the bytes that have come to the client's end."""
        came = b""
        if self._faults.on("flood", now_s):
            came = self._stage.junk(FROM, now_s)
            self._push(now_s, RECEIVED, self._stage.junk(TO, now_s))
        unsolicited = self.server.unsolicited(now_s)
        if unsolicited:
            self._send(unsolicited, now_s)
        while self._events and self._events[0][0] <= now_s:
            time_s, _, kind, content = heapq.heappop(self._events)
            if kind == SEND:
                came += content
            else:
                self._answer(content, time_s)
        return came

    def idle(self, now_s: float, longest_s: float) -> None:
        """Keep the wheel's time moving where nothing is requested: never with hours at once."""
        if not self._events and now_s - self.server.plant.time_s > longest_s:
            self.server.advance_to(now_s)

    def unplug(self) -> None:
        """Lose what is on the line."""
        self._events.clear()

    def _answer(self, content: bytes, time_s: float) -> None:
        """The wheel has got these bytes: its replies go on the line."""
        self._send(self.server.handle(content, time_s), time_s)

    def _send(self, replies: list[Reply], time_s: float) -> None:
        """Put on the line what the wheel says."""
        for reply in replies:
            end_s = max(time_s + TURNAROUND_S, self._sending_until_s) + len(reply.content) * self._byte_s
            pieces = self._stage.carry(FROM, reply.content, time_s, reply.register)
            if any(piece.late_s == 0.0 for piece in pieces):
                self._sending_until_s = end_s
            for piece in pieces:
                self._push(end_s + piece.late_s, SEND, piece.content)

    def _push(self, time_s: float, kind: int, content: bytes) -> None:
        """Note something to do at a time; equal times in the order they came."""
        if content:
            self._order += 1
            heapq.heappush(self._events, (time_s, self._order, kind, content))
