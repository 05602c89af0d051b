"""What a driver is to those above it: a wheel that is read and commanded, and what is spoken on its line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol, runtime_checkable

from rw_ekf.clock import Clock
from rw_ekf.records import IssuedCommand, LinkCounters, WheelIdentity, WheelSample


@runtime_checkable
class WheelDriver(Protocol):
    """A wheel, real, simulated or replayed. DriverError: the link failed; EndOfRecord: a replay is over."""

    source: str  # "serial+/dev/ttyUSB0", "sim+in-process", "replay+run_012.csv": no record hides where it came from
    link: LinkCounters
    identity: WheelIdentity | None

    def read(self, timeout_s: float) -> WheelSample | None:
        """Take the next sample; None: nothing valid came within `timeout_s`."""
        ...

    def command_current(self, current_A: float) -> IssuedCommand:
        """Write one current. Only the guard of rw_ekf.live.guard may call this."""
        ...

    def close(self) -> None:
        """Release the line. Safe to call twice."""
        ...


class WireLimits(NamedTuple):
    """What a wheel's wire can carry."""

    current_A: tuple[float, float]  # lowest and highest that can be commanded
    speed_rad_s: tuple[float, float]  # lowest and highest that can be read
    speed_step_rad_s: float = 0.0  # resolution of a reading; 0: none
    hottest_degC: float | None = None  # None: no temperature in telemetry
    tells_current: bool = True  # whether telemetry has the current, commanded or measured


class WheelProtocol(Protocol):
    """What is spoken on the line of one family of wheels; drivers.protocols has them all."""

    scale_places: Mapping[str, str]  # where in its file the scales of "speed" and "current" stand
    fingerprint: str | None  # sha256 of what is spoken: signs, scales, units; None: of no file

    @property
    def limits(self) -> WireLimits:
        """What it can carry."""
        ...

    def open_wheel(
        self,
        port: str,
        clock: Clock,
        reply_timeout_s: float,
        *,
        baud: int | None = None,
        probe: bool = True,
        exclusive: bool = True,
        previous: WheelDriver | None = None,
    ) -> WheelDriver:
        """Open a wheel. Raises DriverError: no such port, busy, no permission, nobody answers.

        probe: wait until it answers. exclusive: refuse a port that another process has locked. previous: the wheel that
        was lost on this port; counters, clock and segments go on from it.
        """
        ...

    def serve(self, plant: Any, link_path: str, **options: Any) -> None:
        """Serve a simulated wheel of this family on a pseudo-terminal at link_path until a signal."""
        ...
