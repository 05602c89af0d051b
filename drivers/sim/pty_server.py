"""A simulated wheel at the far end of a serial line: serves a pty in real time, or speed_factor times faster."""

from __future__ import annotations

import contextlib
import math
import os
import select
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import FrameType

from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.drivers.sim.faults import Fault, FaultInjector
from rw_ekf.drivers.sim.plant import advance
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import Advance, PlantRunner
from rw_ekf.drivers.sim.pty_link import PtyLink
from rw_ekf.drivers.sim.register_server import RegisterServer
from rw_ekf.drivers.sim.wheel_line import BusElectronics, WheelLine
from rw_ekf.errors import BadInputError

IDLE_ADVANCE_S = 0.5  # without requests the plant is brought up to date this often, never with hours at once
STOP_POLL_S = 0.1


class PtyServer:
    """Serves one RegisterServer, or a bus of them, on a pty. `run` in a thread or as main loop; `close` when done."""

    def __init__(
        self, server: RegisterServer | BusElectronics, link_path: str | Path, speed_factor: float = 1.0
    ) -> None:
        if not speed_factor > 0.0:
            raise ValueError(f"speed_factor must be above 0, not {speed_factor}")
        self.server = server
        self.pty = PtyLink(link_path)
        self._line = WheelLine(server)
        self._factor = speed_factor
        self._host_zero_s = time.monotonic()
        self._wheel_zero_s = server.plant.time_s

    def wheel_time_s(self) -> float:
        """The wheel's time now [s]."""
        return self._wheel_zero_s + (time.monotonic() - self._host_zero_s) * self._factor

    def run(self, stop: Callable[[], bool], wake: int | None = None) -> None:
        """Serve until stop() is true; it is called every 0.1 s, and whenever the descriptor `wake` becomes readable."""
        while not stop():
            now_s = self.wheel_time_s()
            self._follow_the_cable(now_s)
            watched = [] if wake is None else [wake]
            if self.pty.is_plugged and self._line.takes(now_s):
                watched.append(self.pty.master)
            ready, _, _ = select.select(watched, [], [], self._pause_s(now_s))
            if self.pty.is_plugged and self.pty.master in ready:
                self._line.carries((self.pty.baud or 0) / self._factor)
                self._line.take(self.pty.read(), self.wheel_time_s())
            now_s = self.wheel_time_s()
            came = self._line.work(now_s)
            if came and self.pty.is_plugged:
                self.pty.write(came)
            self._line.idle(now_s, IDLE_ADVANCE_S * self._factor)

    def close(self) -> None:
        """Remove the link and close the pty."""
        self.pty.close()

    def _follow_the_cable(self, now_s: float) -> None:
        """The port goes and comes as the faults have it."""
        if self._line.is_plugged(now_s) == self.pty.is_plugged:
            return
        if self.pty.is_plugged:
            self.pty.unplug()
            self._line.unplug()
        else:
            self.pty.plug()

    def _pause_s(self, now_s: float) -> float:
        """Host time until something is due."""
        due_s = self._line.next_s(now_s)
        return min((due_s - now_s) / self._factor, STOP_POLL_S) if math.isfinite(due_s) else STOP_POLL_S


def simulated_electronics(
    electronics: type[RegisterServer],
    wire_map: WireMap,
    parameters: PlantParameters,
    *,
    seed: int = 0,
    noise: PlantNoise | None = None,
    initial_speed_rad_s: float = 0.0,
    faults: Sequence[Fault] = (),
    law: Advance = advance,
) -> RegisterServer:
    """What answers for a simulated wheel. Raises BadInputError for a fault of what the map does not have.

    law: of the plant's motion, where it has a formula of a user's own.
    """
    check_faults(faults, wire_map)
    state = PlantState(speed_rad_s=initial_speed_rad_s, temperature_degC=parameters.ambient_degC)
    plant = PlantRunner(parameters, noise, seed, state, law=law)
    return electronics(wire_map, plant, serial_number=(seed % 65535) + 1, faults=FaultInjector(faults, seed))


def serve_electronics(
    served: RegisterServer | BusElectronics,
    link_path: str | Path,
    *,
    speed_factor: float = 1.0,
    on_ready: Callable[[str], None] | None = None,
    stop: threading.Event | Callable[[], bool] | None = None,
    duration_s: float | None = None,
) -> None:
    """Serve a wheel's electronics, or a bus of them, until SIGINT, SIGTERM or SIGHUP, `stop`, or the end of duration_s.

    duration_s: of host time [s]. on_ready: called with the device's path when a client can open the link. Signals are
    handled in the main thread only. Raises DriverError where the link cannot be made.
    """
    wanted = stop.is_set if isinstance(stop, threading.Event) else (stop or (lambda: False))
    end_s = None if duration_s is None else time.monotonic() + duration_s
    with _signals() as (signalled, wake):
        server = PtyServer(served, link_path, speed_factor)
        try:
            if on_ready is not None:
                on_ready(server.pty.device_path)
            server.run(
                lambda: signalled.is_set() or wanted() or (end_s is not None and time.monotonic() >= end_s), wake
            )
        finally:
            server.close()


def check_faults(faults: Sequence[Fault], wire_map: WireMap) -> None:
    """Raise BadInputError for a fault of a register or a field that the wire map does not have."""
    registers = [register.name for register in wire_map.registers]
    fields = sorted({field.name for register in wire_map.readable() for field in register.fields} | {"all"})
    for fault in faults:
        if fault.register is not None and fault.register not in registers:
            raise BadInputError(
                f"--fault {fault.text!r}: the wire map has no register {fault.register!r}; it has: "
                + ", ".join(registers)
            )
        if fault.name and fault.name not in fields:
            raise BadInputError(
                f"--fault {fault.text!r}: no register of the wire map tells {fault.name!r}; they tell: "
                + ", ".join(fields)
            )


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
