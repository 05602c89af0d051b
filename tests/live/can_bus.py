"""A simulated wheel on a virtual bus of python-can, in this process, and a second node that does as it likes."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rw_ekf.clock import SystemClock
from rw_ekf.drivers.can import slcan
from rw_ekf.drivers.can.can_frames import CanFrame, MessageCodec
from rw_ekf.drivers.can.can_protocol import CanMap
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.drivers.sim.can_server import CanServer
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.register_server import Reply
from rw_ekf.units import RAD_S_PER_RPM
from tests.live.bench import Bench, Recorder, protocol_named

POLL_S = 0.001


@dataclass
class BusBench(Bench):
    """A wheel on a virtual bus, and the other node."""

    channel: str = ""
    echo: bool = False  # a gateway sends back what it hears
    lost: bool = False  # the wheel is not on the bus: it says nothing and hears nothing
    _over: threading.Event = field(default_factory=threading.Event)
    _other: Any = None

    @property
    def port(self) -> str:
        """Name of the bus."""
        return f"can:virtual:{self.channel}"

    def plug(self) -> None:
        """Put the wheel on the bus."""
        import can

        self._other = can.Bus(interface="virtual", channel=self.channel)
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Nobody is on the bus any more."""
        self._over.set()
        if self._thread is not None:
            self._thread.join(5.0)
        self._other.shutdown()

    def send(self, frame: CanFrame) -> None:
        """The other node sends."""
        import can

        self._other.send(
            can.Message(
                arbitration_id=frame.id,
                data=frame.data,
                is_extended_id=frame.extended,
                is_error_frame=frame.error,
                check=False,
            )
        )

    def _serve(self) -> None:
        import can

        server, began_s = self.registers, time.monotonic()
        assert isinstance(server, CanServer)
        server.handle(b"O\r", server.plant.time_s)
        zero_s = server.plant.time_s
        with can.Bus(interface="virtual", channel=self.channel) as bus:
            while not self._over.is_set():
                message = bus.recv(POLL_S)
                now_s = zero_s + time.monotonic() - began_s
                replies = server.unsolicited(now_s)
                if message is not None and not message.is_error_frame:
                    heard = CanFrame(
                        message.arbitration_id, bytes(message.data), message.is_extended_id, message.is_remote_frame
                    )
                    replies += [] if self.lost else server.hear(heard, now_s)
                    replies += [Reply(slcan.encode(heard))] if self.echo else []
                for reply in [] if self.lost else replies:
                    for frame in slcan.decode(reply.content).frames:
                        bus.send(can.Message(arbitration_id=frame.id, data=frame.data, is_extended_id=frame.extended))


def codec_of(bench: Bench, message: str) -> MessageCodec:
    """A message of the bench's map."""
    wire_map = bench.registers.wire_map
    assert isinstance(wire_map, CanMap)
    return wire_map.layout.codecs[message]


@contextmanager
def on_a_bus(directory: Path, protocol: str = "can-wheel", *, noise_rpm: float = 0.0) -> Iterator[BusBench]:
    """A simulated wheel on a virtual bus for the length of a with block."""
    spoken = protocol_named(protocol)
    recorder = Recorder(spoken.wire_map)
    noise = PlantNoise(noise_rpm * RAD_S_PER_RPM)
    plant = PlantRunner(PlantParameters(), noise, 5, PlantState(speed_rad_s=20.0))
    server = spoken.electronics(spoken.wire_map, plant, watch=recorder, first_uptime_s=100.0)
    bench = BusBench(directory, server, recorder, protocol=protocol, channel=directory.name)
    bench.plug()
    try:
        yield bench
    finally:
        bench.end()


def opened(bench: Bench, **how: Any) -> SerialWheel:
    """The real driver on that bus."""
    wheel = protocol_named(bench.protocol).open_wheel(bench.port, SystemClock(), 0.15, **how)
    assert isinstance(wheel, SerialWheel)
    return wheel
