"""A wheel's link over a CAN bus: what it sends unrequested is kept and given as registers, currents go out as messages.

A register that is read is the newest whole set of its messages (can_hearing.py), each set given once where it is the
cycle's. A current that is written is acknowledged when a cycle behind it says that it is in force.
"""

from __future__ import annotations

from collections.abc import Mapping

from rw_ekf.clock import Clock
from rw_ekf.drivers.can.can_bus import SERIAL_INTERFACE, CanBus, CanPort, PythonCanBus
from rw_ekf.drivers.can.can_file import FLAG_BITS, Sent
from rw_ekf.drivers.can.can_frames import CanFrame
from rw_ekf.drivers.can.can_hearing import Hearing, Reported
from rw_ekf.drivers.can.can_protocol import CanMap, Layout
from rw_ekf.drivers.can.slcan import SlcanBus
from rw_ekf.drivers.line.line import Exchange
from rw_ekf.drivers.line.registers import decode_register
from rw_ekf.drivers.line.serial_port import PortSettings, open_serial_port
from rw_ekf.drivers.line.shared_port import OpenPort
from rw_ekf.drivers.line.unacknowledged_commands import Bearing, Standing
from rw_ekf.drivers.line.wire_layout import Register
from rw_ekf.errors import DriverError
from rw_ekf.records import LinkCounters

_OK = bytes((0,))
_CYCLES_WAITED = 1.5
_F32_PART = 1.0e-6
_NO_ROOM_S = 0.5  # a bus that takes no frame for so long is lost: the wheel cannot be stopped over it


class CanLink:
    """An open bus, as SerialLink is an open line. Raises DriverError when it cannot be opened or fails."""

    in_turns, may_ask = False, True  # on a bus nobody is polled

    def __init__(
        self,
        can_map: CanMap,
        settings: PortSettings,
        reply_timeout_s: float,
        clock: Clock,
        counters: LinkCounters | None = None,
        open_port: OpenPort = open_serial_port,
    ) -> None:
        """Open it. reply_timeout_s: how long a command's confirmation is waited for."""
        layout = can_map.layout
        self.settings = settings
        self.name = f"can+{settings.port}"
        self.counters = counters if counters is not None else LinkCounters()
        self.restarts = 0
        self.reply_timeout_s = reply_timeout_s
        self._map = can_map
        self._layout: Layout = layout
        self._clock = clock
        self._bitrate = layout.file.bus.bitrate
        self._given: Reported | None = None
        self._alive = dict.fromkeys(layout.codecs, 0)
        self._sent_A = 0.0  # the last that was commanded
        self._no_room_since_s: float | None = None
        self._wait_s = _CYCLES_WAITED * layout.period_s("cycle")
        self._standing = Standing()
        self._opened_s = clock.monotonic()
        port = CanPort.of(settings.port)
        self.bus: CanBus
        if port.interface == SERIAL_INTERFACE:
            self.bus = SlcanBus(settings._replace(port=port.channel), self._bitrate, clock, open_port)
        else:
            self.bus = PythonCanBus(port, self._bitrate, clock)
        self._heard = Hearing(settings.port, can_map, self.bus, self.counters, self._opened_s)

    @property
    def news(self) -> tuple[str, str] | None:
        """An event of the bus and its sentence, until it is reported."""
        return self._heard.news

    @news.setter
    def news(self, news: tuple[str, str] | None) -> None:
        self._heard.news = news

    def request(self, register_id: int, data: bytes, reply_bytes: int, timeout_s: float | None = None) -> Exchange:
        """Give what a register holds, or write one, within timeout_s. Raises DriverError if the bus fails."""
        register = self._map.register_of_id(register_id)
        assert register is not None
        now_s = self._clock.monotonic()
        self._heard.take(0.0)
        if register.access == "write":
            limit_s = self.reply_timeout_s if timeout_s is None else min(timeout_s, self.reply_timeout_s)
            return self._write(register, data, now_s + limit_s)
        if register.name != "cycle":
            return self._reported(register)
        limit_s = max(self.reply_timeout_s, self._wait_s)
        return self._next_cycle(register, now_s + (limit_s if timeout_s is None else min(limit_s, timeout_s)))

    @property
    def answers(self) -> bool:
        """Whether a whole cycle has come, and who the wheel is, where it says so as often as the map has it."""
        if self._heard.cycle.newest is None:
            return False
        who = self._layout.messages_of("identity") if self._map.register("identity") is not None else ()
        waited_s = self._clock.monotonic() - self._opened_s
        return all(m in self._heard.newest or waited_s > 1.5e-3 * self._layout.care(m).period_ms for m in who)

    def note_restart(self) -> None:
        """Nothing of a bus is the wheel's."""

    def unanswered(self, waited_s: float) -> DriverError:
        """What to say where no wheel reports anything."""
        heard = self._heard
        return DriverError(
            f"{self.settings.port} opened but no whole cycle of telemetry in {waited_s:.1f} s ({heard.frames} frames, "
            f"{heard.good_frames} of them this map's). Check bus.bitrate ({self._bitrate}), identifiers, termination "
            "and wheel power, or try the simulated wheel: rw-ekf simulate --config F --link /tmp/wheel0"
        )

    def close(self) -> None:
        """Let go of the bus. Safe to call twice."""
        self.bus.close()

    # --- what is read -----------------------------------------------------------------------------------------------

    def _next_cycle(self, register: Register, deadline_s: float) -> Exchange:
        """The newest set that was not given yet, or the next one.

        Where it is not known when a frame came, the next one, if it can be waited for.
        """
        wanted_s = self._ask()
        if not self.bus.stamps_arrival and deadline_s - self._clock.monotonic() > self._wait_s:
            self._given = self._heard.cycle.newest
        missing_s = self._layout.file.cycle.missing_after * self._layout.period_s("cycle")
        while True:
            now_s = self._clock.monotonic()
            reported = self._heard.cycle.newest
            if (
                reported is not None
                and reported is not self._given
                and (wanted_s is None or reported.time_s >= wanted_s)
            ):
                self._given = reported
                if now_s - reported.time_s <= missing_s:
                    return Exchange(self._packed(register, reported.numbers), reported.time_s, now_s)
                self.counters.stale += 1
            if now_s >= deadline_s:
                self.counters.timeouts += 1
                return Exchange(None, now_s, now_s)
            self._heard.take(deadline_s - now_s)

    def _ask(self) -> float | None:
        """Ask for a cycle where the wheel sends on request only; when that was."""
        request = self._layout.file.cycle.request
        if request is None:
            return None
        wanted_s = self._clock.monotonic()
        if isinstance(request, Sent):
            self._send(request.message, request.signals)
        else:
            for name in self._layout.file.cycle.messages:
                codec = self._layout.codecs[name]
                self.bus.send(CanFrame(codec.id, b"", codec.extended, remote=True))
        self.counters.requests += 1
        return wanted_s

    def _reported(self, register: Register) -> Exchange:
        """What was reported of a register at its own pace, unless that is too long ago."""
        now_s = self._clock.monotonic()
        messages = self._layout.messages_of(register.name)
        reported = [self._heard.newest[name] for name in messages if name in self._heard.newest]
        oldest_s = min((one.time_s for one in reported), default=now_s)
        may_s = self._layout.file.cycle.missing_after * self._layout.period_s(register.name)
        if len(reported) < len(messages) or now_s - oldest_s > may_s:
            return Exchange(None, now_s, now_s)
        numbers = {name: part for one in reported for name, part in one.numbers.items()}
        return Exchange(self._packed(register, numbers), oldest_s, now_s)

    def _packed(self, register: Register, numbers: Mapping[str, Mapping[str, float]]) -> bytes:
        """What the messages say as the register's data."""
        sources = self._layout.sources[register.name]
        found: list[float] = []
        for field in register.fields:
            if field.name == "flags":
                up = (b for flag, b in FLAG_BITS.items() if (s := sources.get(flag)) and numbers[s.message][s.signal])
                found.append(sum(up))
            else:
                number = numbers[sources[field.name].message][sources[field.name].signal]
                if field.name == "mode":  # above: 0 and 1 are modes in which a current is taken
                    number = 1 if number in self._layout.file.telemetry["mode"].of_current else 2
                found.append(number)
        return register.packing.pack(*found)

    # --- what is written --------------------------------------------------------------------------------------------

    def _write(self, register: Register, data: bytes, deadline_s: float) -> Exchange:
        """Send what a register's write means, and wait until a cycle bears it out."""
        file = self._layout.file
        sent = {"mode": file.idle, "reset": file.reset}.get(register.name)
        current_A = 0.0
        if sent is not None:
            message, numbers = sent.message, dict[str, float](sent.signals)
        else:
            (number,) = register.packing.unpack(data)
            current_A = register.fields[0].to_si(number)
            message = self._layout.command.message
            numbers = dict[str, float](file.command.constants) | {self._layout.command.signal: number}
            if current_A != 0.0 and self._sent_A == 0.0 and file.enable is not None:
                self._send(file.enable.message, file.enable.signals)
        self.counters.requests += 1
        exchange = self._confirmed(message, numbers, current_A, deadline_s)
        self._sent_A = current_A
        return exchange

    def _confirmed(self, message: str, numbers: Mapping[str, float], current_A: float, deadline_s: float) -> Exchange:
        """Send; acknowledged where a cycle behind it has this current, refused where several have another."""
        arrived_s = self._send(message, numbers)
        seen, can_tell = self._heard.cycle.newest, self._confirming is not None
        bearing = Bearing(current_A, self._sent_A, self._may_A(current_A))
        while arrived_s is not None and can_tell and self._clock.monotonic() < deadline_s:
            self._heard.take(deadline_s - self._clock.monotonic())
            reported = self._heard.cycle.newest
            if reported is None or reported is seen or reported.time_s <= arrived_s:
                continue
            seen = reported
            if bearing.is_borne_out(self._reported_A(reported)):
                self.counters.note_reply(1e3 * (reported.time_s - arrived_s))
                self._standing.note_taken()
                return Exchange(_OK, arrived_s, reported.time_s)
            if bearing.is_due_again:
                arrived_s = self._send(message, numbers)
            elif bearing.is_refused:
                break
        now_s = self._clock.monotonic()
        if bearing.status is not None:
            self._heard.news = self._standing.note_against(now_s) or self._heard.news
            self.bus.forget_unsent()
            return Exchange(bytes((bearing.status,)), arrived_s or now_s, now_s)
        if can_tell or arrived_s is None:
            self.counters.timeouts += 1
            self.bus.forget_unsent()
        return Exchange(None, now_s if arrived_s is None else arrived_s, now_s)

    def _send(self, message: str, numbers: Mapping[str, float]) -> float | None:
        """Send a message: when it was at the wheel [s]; None where there was no room for it."""
        self._alive[message] += 1
        frame = self._layout.codecs[message].pack(numbers, self._alive[message])
        self._heard.sent(frame, self._clock.monotonic())
        at_s = self.bus.send(frame)
        if at_s is not None:
            self._no_room_since_s = None
            return at_s + frame.lasts_s(self._bitrate)
        now_s = self._clock.monotonic()
        if self._no_room_since_s is None:
            self._no_room_since_s = now_s
        elif now_s - self._no_room_since_s > _NO_ROOM_S:
            raise DriverError(
                f"{self.settings.port} failed: it takes no frames, its queue is full. Nobody acknowledges them, or the "
                "adapter hangs: check the wheel's power, termination and bit rate"
            )
        return None

    @property
    def _confirming(self) -> str | None:
        """What says which current is in force; None: nothing does."""
        file = self._layout.file
        if file.command.confirmed_by is not None:
            return file.command.confirmed_by
        return "current_command" if "current_command" in self._layout.sources["cycle"] else None

    def _reported_A(self, reported: Reported) -> float:
        register = self._map.speed_register
        return decode_register(register, self._packed(register, reported.numbers))[self._confirming or ""]

    def _may_A(self, current_A: float) -> float:
        """By how much a current in force may differ as reported."""
        may_A = self._layout.file.command.tolerance
        for field in (self._map.speed_register.field(self._confirming or ""), self._map.current_command.fields[0]):
            if field is not None:
                may_A = max(may_A, _F32_PART * abs(current_A) if field.is_float else 0.5 * field.si_per_count)
        return may_A
