"""What is heard on a bus, sorted: telemetry kept as last reported, and the rest counted by why it is not taken."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

from rw_ekf.drivers.can.can_bus import CanBus
from rw_ekf.drivers.can.can_frames import CanFrame
from rw_ekf.drivers.can.can_protocol import CanMap
from rw_ekf.errors import DriverError
from rw_ekf.records import LinkCounters

_ECHO_S = 0.2  # a frame of our own that comes back does so soon
_QUIET_S = 0.3  # behind it another wheel may speak: nothing that was reported before it counts
# Error frames as SocketCAN's linux/can/error.h has them.
CONTROLLER, BUS_OFF, RESTARTED = 0x004, 0x040, 0x100  # classes: bits of the identifier
_STATE_BYTE = 1  # of the data, where the class is CONTROLLER
WARNING, PASSIVE, ACTIVE = 0x0C, 0x30, 0x40
IS_ACTIVE, IS_WARNING, IS_PASSIVE, IS_OFF = "active", "warning", "passive", "off"
_SOONEST = 0.25  # of a period: the same bytes again within it are the same frame again


class Hearing:
    """Takes in the frames of one wheel's bus."""

    def __init__(self, port: str, can_map: CanMap, bus: CanBus, counters: LinkCounters, now_s: float) -> None:
        """counters: of the link, counted on."""
        layout = can_map.layout
        keys = layout.file.cycle
        within_s = 1e-3 * (keys.within_ms if keys.within_ms is not None else 0.5 * keys.period_ms)
        self.cycle = Cycle(keys.messages, within_s, same_alive=keys.same_alive)
        self.newest: dict[str, Reported] = {}  # by message
        self.news: tuple[str, str] | None = None
        self.frames = self.good_frames = 0  # of any kind; of telemetry
        self._layout = layout
        self._bus = bus
        self._counters = counters
        self._watch = BusWatch(port, counters)
        reported = dict.fromkeys(m for r in can_map.readable() for m in layout.messages_of(r.name))
        self._telling = {(layout.codecs[name].id, layout.codecs[name].extended): name for name in reported}
        self._ours = {(c.id, c.extended) for name, c in layout.codecs.items() if name not in reported}
        self._fresh: dict[str, Fresh] = {}
        for name in reported:
            period_s = 1e-3 * layout.care(name).period_ms
            self._fresh[name] = Fresh(period_s, layout.codecs[name].alive_span, keys.missing_after * period_s)
        self._sent: deque[tuple[CanFrame, float]] = deque(maxlen=16)
        self._damaged_lines = 0
        self._cycle_at_s = now_s

    def sent(self, frame: CanFrame, now_s: float) -> None:
        """Note a frame of our own."""
        self._sent.append((frame, now_s))

    def take(self, wait_s: float) -> None:
        """Take in what has come, waiting for something. Raises DriverError where the bus is off."""
        dropped = self.cycle.dropped
        for frame in self._bus.receive(wait_s):
            self.frames += 1
            self._note(frame)
        self._counters.stale += self.cycle.dropped - dropped
        lines = getattr(self._bus, "damaged", 0)
        self._counters.damaged += lines - self._damaged_lines
        self._damaged_lines = lines

    def _note(self, frame: CanFrame) -> None:
        """Keep one frame's content, or count why it is not taken."""
        if frame.error:
            self.news = self._watch.note(frame) or self.news
            return
        key = frame.id, frame.extended
        if key in self._ours:
            self._note_of_ours(frame)
        elif key in self._telling:
            if not frame.remote:
                self._note_telemetry(self._telling[key], frame)
        elif (frame.id, not frame.extended) in self._telling or (frame.id, not frame.extended) in self._ours:
            self._counters.foreign += 1

    def _note_of_ours(self, frame: CanFrame) -> None:
        """A frame that only this program should send: an echo of it, or another master."""
        ours = [one.data for one, at_s in self._sent if one.id == frame.id and frame.time_s - at_s < _ECHO_S]
        if frame.data in ours:
            self._counters.stale += 1
            return
        self._counters.foreign += 1
        self.news = (
            "other_master",
            f"something else on the bus sends {frame.id:#x}, by which this program commands the wheel: what drives the "
            "wheel may be another's command. Silence that sender",
        )

    def _note_telemetry(self, name: str, frame: CanFrame) -> None:
        unpacked = self._layout.codecs[name].unpack(frame)
        if unpacked is None:
            self._counters.damaged += 1
            return
        numbers, alive = unpacked
        if not self._fresh[name].takes(frame.data, alive, frame.time_s):
            self._counters.stale += 1
            return
        self.good_frames += 1
        self._watch.heard()
        if name in self._layout.file.cycle.messages:
            if frame.time_s - self._cycle_at_s > _QUIET_S:
                self.newest.clear()
            self._cycle_at_s = frame.time_s
            self.cycle.add(name, numbers, alive, frame.time_s)
        self.newest[name] = Reported({name: numbers}, frame.time_s)


class BusWatch:
    """Follows the controller's state, and counts."""

    def __init__(self, port: str, counters: LinkCounters) -> None:
        self._port = port
        self._counters = counters

    def heard(self) -> None:
        """A good frame came: a controller that is off hears none."""
        if self._counters.bus in (None, IS_OFF):
            self._counters.bus = IS_ACTIVE

    def note(self, frame: CanFrame) -> tuple[str, str] | None:
        """Take an error frame: an event and its sentence where the state is new. Raises DriverError for bus-off."""
        self._counters.bus_errors += 1
        was = self._counters.bus
        if frame.id & BUS_OFF:
            self._counters.bus = IS_OFF
            raise DriverError(
                f"{self._port} failed: the controller is bus-off, it counted too many errors. Check bit rate, "
                "termination and wiring; it comes back by restart-ms (ip link set ... type can restart-ms 100)"
            )
        stated = frame.data[_STATE_BYTE] if frame.id & CONTROLLER and len(frame.data) > _STATE_BYTE else 0
        if stated & PASSIVE:
            self._counters.bus = IS_PASSIVE
        elif stated & WARNING:
            self._counters.bus = IS_WARNING
        elif stated & ACTIVE or frame.id & RESTARTED:
            self._counters.bus = IS_ACTIVE
        if self._counters.bus == was or self._counters.bus != IS_PASSIVE:
            return None
        return (
            "bus_error_passive",
            "the CAN controller became error-passive: many frames are damaged, or nobody acknowledges them. Check "
            "termination, bit rate and the wheel's power",
        )


class Reported(NamedTuple):
    """What the messages of one moment reported."""

    numbers: Mapping[str, Mapping[str, float]]  # by message and signal
    time_s: float  # when the first of them came, by the host's monotonic clock


class Fresh:
    """Whether each frame of one message is a new one: its count moves on, or there is none and its time does."""

    def __init__(self, period_s: float, alive_span: int, missing_after_s: float) -> None:
        self._period_s = period_s
        self._span = alive_span
        self._missing_s = missing_after_s
        self._last: tuple[bytes, int | None, float] | None = None

    def takes(self, data: bytes, alive: int | None, time_s: float) -> bool:
        """Whether it is; one that stands still, or counts back while others come, is not."""
        if self._last is not None:
            before, count, at_s = self._last
            if alive is None or count is None:
                if data == before and time_s - at_s < _SOONEST * self._period_s:
                    return False
            else:
                ahead = (alive - count) % self._span
                if ahead == 0 or (ahead > self._span // 2 and time_s - at_s < self._missing_s):
                    return False
        self._last = (data, alive, time_s)
        return True


class Cycle:
    """The messages of one moment, in the order in which they are sent.

    A set begins with the first message, and the others must follow in their order, within a time of it; where the map
    says so, with the same count. Anything else is of another cycle, and what is left without its rest is dropped.
    """

    def __init__(self, messages: tuple[str, ...], within_s: float, *, same_alive: bool = False) -> None:
        self._messages = messages
        self._within_s = within_s
        self._same_alive = same_alive
        self._begun: list[tuple[Mapping[str, float], int | None, float]] = []
        self.newest: Reported | None = None
        self.dropped = 0  # frames whose cycle never was whole

    def add(self, message: str, numbers: Mapping[str, float], alive: int | None, time_s: float) -> bool:
        """Take one fresh frame; whether it made a set whole."""
        at = self._messages.index(message)
        if at != len(self._begun) or not self._belongs(alive, time_s):
            if self.newest is not None:  # the first look falls into the middle of a cycle
                self.dropped += len(self._begun) + (at != 0)
            self._begun.clear()
            if at != 0:
                return False
        self._begun.append((numbers, alive, time_s))
        if len(self._begun) < len(self._messages):
            return False
        reported = {name: part[0] for name, part in zip(self._messages, self._begun, strict=True)}
        self.newest = Reported(reported, self._begun[0][2])
        self._begun.clear()
        return True

    def _belongs(self, alive: int | None, time_s: float) -> bool:
        if not self._begun:
            return True
        _, first_alive, first_s = self._begun[0]
        return time_s - first_s <= self._within_s and not (self._same_alive and alive != first_alive)
