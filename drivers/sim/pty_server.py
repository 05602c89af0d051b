"""A simulated wheel at the far end of a serial line: serves a pty in real time, or speed_factor times faster.

The line is simulated too. A request counts as received when its last byte would have arrived at the map's baud rate,
and a reply is sent when its last byte would have; so delays that the driver works out from the baud rate are true.
"""

from __future__ import annotations

import contextlib
import heapq
import os
import select
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

from drivers.line.wire_map import WireMap
from drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from drivers.sim.plant_runner import PlantRunner
from drivers.sim.pty_link import PtyLink
from drivers.sim.register_server import RegisterServer

TURNAROUND_S = 0.0005  # from the last byte of a request to the first of its reply
IDLE_ADVANCE_S = 0.5  # without requests the plant is brought up to date this often, never with hours at once
STOP_POLL_S = 0.1

RECEIVED, SEND = 0, 1  # kinds of event


class PtyServer:
    """Serves one RegisterServer on one pty. `run` in a thread or as the main loop; `close` when done."""

    def __init__(self, server: RegisterServer, link_path: str | Path, speed_factor: float = 1.0) -> None:
        if not speed_factor > 0.0:
            raise ValueError(f"speed_factor must be above 0, not {speed_factor}")
        self.server = server
        self.pty = PtyLink(link_path)
        self._factor = speed_factor
        self._byte_s = server.wire_map.line.bits_per_byte / server.wire_map.line.baud
        self._host_zero_s = time.monotonic()
        self._wheel_zero_s = server.plant.time_s
        self._events: list[tuple[float, int, int, bytes]] = []  # (wheel time, order, kind, bytes)
        self._order = 0
        self._receiving_until_s = self._sending_until_s = self._wheel_zero_s

    def wheel_time_s(self) -> float:
        """The wheel's time now [s]."""
        return self._wheel_zero_s + (time.monotonic() - self._host_zero_s) * self._factor

    def run(self, stop: Callable[[], bool], wake: int | None = None) -> None:
        """Serve until stop() is true; it is asked every 0.1 s, and whenever the descriptor `wake` becomes readable."""
        watched = [self.pty.master] if wake is None else [self.pty.master, wake]
        while not stop():
            ready, _, _ = select.select(watched, [], [], self._pause_s())
            if self.pty.master in ready:
                self._take(self.pty.read())
            self._do_due()

    def close(self) -> None:
        """Remove the link and close the pty."""
        self.pty.close()

    def _pause_s(self) -> float:
        """Host time until something is due."""
        if not self._events:
            return STOP_POLL_S
        return min(max((self._events[0][0] - self.wheel_time_s()) / self._factor, 0.0), STOP_POLL_S)

    def _take(self, content: bytes) -> None:
        """Bytes from the client: received when the line has carried them."""
        if content:
            begin_s = max(self.wheel_time_s(), self._receiving_until_s)
            self._receiving_until_s = begin_s + len(content) * self._byte_s
            self._push(self._receiving_until_s, RECEIVED, content)

    def _do_due(self) -> None:
        """Work off what is due, and keep an idle wheel's time moving."""
        while self._events and self._events[0][0] <= self.wheel_time_s():
            time_s, _, kind, content = heapq.heappop(self._events)
            if kind == SEND:
                self.pty.write(content)
                continue
            for reply in self.server.handle(content, time_s):
                begin_s = max(time_s + TURNAROUND_S, self._sending_until_s) + reply.late_s
                end_s = begin_s + len(reply.content) * self._byte_s
                if reply.late_s == 0.0:
                    self._sending_until_s = end_s
                self._push(end_s, SEND, reply.content)
        now_s = self.wheel_time_s()
        if not self._events and now_s - self.server.plant.time_s > IDLE_ADVANCE_S * self._factor:
            self.server.advance_to(now_s)

    def _push(self, time_s: float, kind: int, content: bytes) -> None:
        """Note something to do at a wheel time; equal times in the order they came."""
        self._order += 1
        heapq.heappush(self._events, (time_s, self._order, kind, content))


def serve_simulated_wheel(
    wire_map: WireMap,
    parameters: PlantParameters,
    link_path: str | Path,
    *,
    seed: int = 0,
    speed_factor: float = 1.0,
    noise: PlantNoise | None = None,
    initial_speed_rad_s: float = 0.0,
    on_ready: Callable[[str], None] | None = None,
    stop: threading.Event | Callable[[], bool] | None = None,
    duration_s: float | None = None,
) -> None:
    """Serve a simulated wheel at `link_path` until SIGINT, SIGTERM or SIGHUP, `stop`, or duration_s [s] of host time.

    on_ready: called with the device's path when a client can open the link. Signals are handled in the main thread
    only. Raises DriverError where the link cannot be made.
    """
    state = PlantState(speed_rad_s=initial_speed_rad_s, temperature_degC=parameters.ambient_degC)
    plant = PlantRunner(parameters, noise, seed, state)
    registers = RegisterServer(wire_map, plant, serial_number=(seed % 65535) + 1)
    asked = stop.is_set if isinstance(stop, threading.Event) else (stop or (lambda: False))
    end_s = None if duration_s is None else time.monotonic() + duration_s
    with _signals() as (signalled, wake):
        server = PtyServer(registers, link_path, speed_factor)
        try:
            if on_ready is not None:
                on_ready(server.pty.device_path)
            server.run(lambda: signalled.is_set() or asked() or (end_s is not None and time.monotonic() >= end_s), wake)
        finally:
            server.close()


@contextlib.contextmanager
def _signals() -> Iterator[tuple[threading.Event, int | None]]:
    """Turn the signals that end a program into an event, and a descriptor that wakes a select."""
    signalled = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield signalled, None
        return
    reader, writer = os.pipe()
    os.set_blocking(writer, False)

    def note(number: int, frame: FrameType | None) -> None:
        signalled.set()
        with contextlib.suppress(BlockingIOError):
            os.write(writer, b"!")

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield signalled, reader
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        os.close(reader)
        os.close(writer)
