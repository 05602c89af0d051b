"""Several simulated wheels on one line: each hears what is sent, and answers what bears its address."""

from __future__ import annotations

from collections.abc import Sequence

from rw_ekf.drivers.sim.faults import FaultInjector
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
            said = wheel.handle(received, time_s)
            replies += [] if wheel.faults.on("silence", time_s) else said
        return replies

    def advance_to(self, time_s: float) -> None:
        """Let all wheels run."""
        for wheel in self.wheels:
            wheel.advance_to(time_s)

    def unasked(self, time_s: float) -> list[Reply]:
        """What wheels say that nobody asks."""
        return [reply for wheel in self.wheels for reply in wheel.unasked(time_s)]

    def next_unasked_s(self, time_s: float) -> float:
        """When one of them next does; infinity: never."""
        return min(wheel.next_unasked_s(time_s) for wheel in self.wheels)
