"""How a wheel is opened: on a line of its own, on one of several, or in a record. Here a driver is picked."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

from rw_ekf.attach.wire import CAN_PORT, beyond_line, beyond_rate
from rw_ekf.clock import Clock, Slot
from rw_ekf.driver import ControlLines, WheelDriver, WheelProtocol
from rw_ekf.errors import ConfigError
from rw_ekf.records import IssuedCommand, WheelSample

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration


class SharedLine:
    """One line for several wheels, each with a slot of the loop's period in which it may be polled."""

    def __init__(
        self, configurations: Sequence[Configuration], protocols: Sequence[WheelProtocol], clock: Clock
    ) -> None:
        """Nothing is opened yet. Raises ConfigError where the wheels could not be distinguished, or polled so often."""
        from rw_ekf.drivers.line.register_protocol import AddressedRegisterProtocol
        from rw_ekf.drivers.line.shared_port import SharedPort

        found = beyond_line(configurations, protocols) or beyond_rate(configurations, protocols)
        if found:
            raise ConfigError([text for _, _, text in found])
        spoken = [protocol for protocol in protocols if isinstance(protocol, AddressedRegisterProtocol)]
        period_s = 1.0 / configurations[0].loop.rate_hz
        self._clock = clock
        self._configurations = configurations
        self._port = SharedPort(spoken[0].open_port, clock, echoes=configurations[0].wheel.echo, keeps=True)
        self.slots = [Slot(clock, period_s, period_s * index / len(spoken)) for index in range(len(spoken))]
        self.protocols = [
            protocol.over(self._port.end(slot)) for protocol, slot in zip(spoken, self.slots, strict=True)
        ]

    @property
    def is_open(self) -> bool:
        """Whether the port is there, as far as is known."""
        return self._port.is_open

    def close(self) -> None:
        """Release the port."""
        self._port.fail()

    def opener(self, index: int, *, probe: bool = True) -> Callable[[WheelDriver | None], WheelDriver]:
        """What opens the line of one wheel, as `opener`; with a probe that queries once and does not wait."""
        configuration = self._configurations[index]
        return _opener(configuration, self.protocols[index], self._clock, probe=probe)


def opener(
    configuration: Configuration, protocol: WheelProtocol, clock: Clock, *, probe: bool = True, exclusive: bool = True
) -> Callable[[WheelDriver | None], WheelDriver]:
    """Return what opens the wheel's line; given the wheel that was lost, its clock and counters continue.

    probe: the first time, wait until the wheel answers. Never for a wheel that was lost: zero must reach it first, even
    where its answers do not come through. exclusive: False writes beside a process that has locked the port.
    """
    from rw_ekf.drivers.line.register_protocol import RegisterProtocol
    from rw_ekf.drivers.line.shared_port import SharedPort

    serial = protocol.limits.telemetry_s is None and not configuration.wheel.port.startswith(CAN_PORT)
    if configuration.wheel.echo and serial and isinstance(protocol, RegisterProtocol):
        protocol = protocol.over(SharedPort(protocol.open_port, clock, echoes=True).end())
    return _opener(configuration, protocol, clock, probe=probe, exclusive=exclusive)


def _opener(
    configuration: Configuration, protocol: WheelProtocol, clock: Clock, *, probe: bool, exclusive: bool = True
) -> Callable[[WheelDriver | None], WheelDriver]:
    """The same over the protocol as it is."""

    def open_wheel(lost: WheelDriver | None) -> WheelDriver:
        return protocol.open_wheel(
            configuration.wheel.port,
            clock,
            1e-3 * configuration.loop.reply_timeout_ms,
            baud=configuration.wheel.baud,
            probe=probe and lost is None,
            exclusive=exclusive,
            control=ControlLines(configuration.wheel.dtr, configuration.wheel.rts),
            previous=lost,
        )

    return open_wheel


def replay_wheel(rows: Iterable[tuple[WheelSample, IssuedCommand]], name: str) -> WheelDriver:
    """Return a logged run as a wheel."""
    from rw_ekf.drivers.replay_wheel import ReplayWheel

    return ReplayWheel(rows, name)
