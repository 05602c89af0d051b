"""A wheel on a serial line: register values become WheelSamples, currents become register writes."""

from __future__ import annotations

from rw_ekf.clock import Clock
from rw_ekf.drivers.line.current_writer import CurrentWriter, Written
from rw_ekf.drivers.line.line import Exchange, Line
from rw_ekf.drivers.line.registers import (
    FLAG_RESET,
    MODES_OF_CURRENT,
    conditions,
    decode_register,
    is_plausible,
    possible_temperature,
    registers_beside,
    uptime_field,
)
from rw_ekf.drivers.line.wheel_clock import WheelClock
from rw_ekf.drivers.line.wire_layout import Register
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.records import OTHER_MODE, IssuedCommand, LinkCounters, WheelIdentity, WheelSample

_WANTED_IN_TURN = 4  # times; a boot loader refuses twice before it obeys the command to start
PROBE_S = 2.0  # how long a wheel may be silent when the port is opened
STATUS_EVERY_S = 1.0  # how often the status register is read beside the cycle ...
ALARMED_EVERY_S = 0.2  # ... and while a flag is up, so that its end is soon known too
IDENTITY_EVERY_S = 5.0  # another wheel may answer without a gap: two on one bus, a switch in the line
WRAP_WITHIN_S = 1.0
QUIET_S = 0.3  # no wheel is unplugged and another plugged in sooner

_PLACES = 6  # of a host's time [s]: a microsecond is far below what a line resolves


class SerialWheel:
    """A WheelDriver on a line."""

    def __init__(self, link: Line, wire_map: WireMap, host: Clock, clock: WheelClock | None = None) -> None:
        self.source = link.name
        self.link: LinkCounters = link.counters
        self.identity: WheelIdentity | None = None
        self._line = link
        self._host = host
        self._map = wire_map
        self._writer = CurrentWriter(link, wire_map, host)
        self.clock = clock if clock is not None else WheelClock()
        self._main = wire_map.speed_register
        self._others = registers_beside(self._main, wire_map)
        self._uptime_field = uptime_field((self._main, *self._others))
        self._flags: int | None = None
        self._status_due_s = 0.0
        self._identity_due_s = host.monotonic() + IDENTITY_EVERY_S
        self._mode: float | None = None  # as the status register last reported it
        self._crowded_out = False  # what was read beside the last sample left no time for it
        self._expected: WheelIdentity | None = None  # who answered before, while it is not known who answers now
        self._quiet_since_s: float | None = None
        self._opened_s = self._host.monotonic()
        self._restarts = 0
        self._speed: tuple[float, float] | None = None  # the last reading [rad/s], and when it came [s]
        self._doubted: tuple[float, float] | None = None  # the reading just before, where it was not believed
        self._sample_at_s: float | None = None  # host time at which the wheel took the request of the last sample

    def read(self, timeout_s: float) -> WheelSample | None:
        """One sample, or None if no valid one came within timeout_s [s] and the reply timeout. Raises DriverError."""
        deadline_s = self._host.monotonic() + timeout_s
        # On a slow line at a high rate what is read beside it may take the sample's time: never twice running.
        beside = not self._crowded_out and self._read_beside(deadline_s)
        exchange = self._exchange(self._main, deadline_s)
        values = self._values(self._main, exchange)
        if values is not None and self._has_jumped(values["speed"], exchange.replied_s):
            self.link.damaged += 1
            values = None
        self._crowded_out = beside and values is None
        if values is None:
            if not beside:
                self._status_due_s = 0.0  # the wheel may have restarted: query before the next sample
            self._note_quiet()
            return None
        self._quiet_since_s = None
        if self._line.restarts != self._restarts:
            self._restarts = self._line.restarts
            if self._uptime_field is not None:
                self.clock.note_restart()
            else:
                self.clock.begin_segment("wheel_restarted", "the wheel restarted, and has been made ready again")
            self.doubt_identity()
        for register in self._others:
            values = (self._values(register, self._exchange(register, deadline_s)) or {}) | values
        if "uptime" not in values and any(register.field("uptime") for register in (self._main, *self._others)):
            return None  # of no time: the host's clock in its place would be a jump
        self._sample_at_s = exchange.received_by_wheel_s
        segment = self.clock.segment
        time_s = self._time_s(values, exchange)
        if self.clock.segment != segment:
            self._line.note_restart()
            self.doubt_identity()
            self._read_identity_if_due(deadline_s)
        news, self.clock.news = self.clock.news, None
        if news is None:
            news, self._line.news = self._line.news, None
        flags = values.get("flags", self._flags)
        stated = conditions(flags)
        if self._mode is not None and self._writer.drives and self._mode not in MODES_OF_CURRENT:
            stated |= {OTHER_MODE}
        return WheelSample(
            time_s=time_s,
            speed_rad_s=values["speed"],
            current_A=values.get("current"),
            current_command_A=values.get("current_command"),
            temperature_degC=possible_temperature(values.get("temperature")),
            pressure_Pa=values.get("pressure"),
            bus_voltage_V=values.get("bus_voltage"),
            angle_rad=values.get("angle"),
            status=None if flags is None else int(flags),
            segment=self.clock.segment,
            conditions=stated,
            news=news,
        )

    def command_current(self, current_A: float) -> IssuedCommand:
        """Write a current [A]; what is reported is what the wire carries, and from when after the last sample it acts.

        A write that was refused or not answered in time may have acted: telemetry, where it has the command, is read
        at once for what is in force, and that is reported as acknowledged, with the reason where it is another current.
        Unacknowledged means that nobody knows. Reasons: "timeout", or the map's name of the status; after a refusal of
        what is in force all the same, ACTED_THOUGH and that name. Raises DriverError for a current that the wire cannot
        carry or a lost line.
        """
        return self._issued(self._writer.command(current_A))

    def stop_current(self, by: str | None = None) -> IssuedCommand:
        """Write zero; where the wheel refuses it, set it to idle, and where it refuses that too, reset it.

        by: ZERO_BY_MODE or ZERO_BY_RESET: in that way alone, though the wheel may have acknowledged a zero. As far as
        the map has those registers. Acknowledged is zero alone. Reasons beside those of command_current: ZERO_BY_MODE,
        ZERO_BY_RESET. Raises DriverError for a lost line.
        """
        return self._issued(self._writer.stop(by))

    def close(self) -> None:
        """Release the port. Safe to call twice. Writes nothing: whoever commanded a current must have sent zero."""
        self._line.close()

    def probe(self, within_s: float = PROBE_S) -> None:
        """Wait for the first valid reply and read who answers. Raises DriverError if none comes within_s [s].

        On a line that is shared in turns only one that answers in some way is queried again, a few times.
        """
        identity = self._map.register("identity")
        deadline_s = self._host.monotonic() + within_s
        wanted = 0
        while not self._line.answers:
            wanted += 1
            for register in filter(None, (identity, self._main)):
                self._note_identity(self._values(register, self._exchange(register, deadline_s)), register)
            if self._line.in_turns and (wanted >= _WANTED_IN_TURN or not self._line.may_ask):
                break
            if self._host.monotonic() >= deadline_s:
                break
        if not self._line.answers:
            raise self._line.unanswered(within_s)
        self._restarts = self._line.restarts  # one that had to be started to be attached has not restarted
        soon_s = self._host.monotonic() + 4.0 * self._line.reply_timeout_s
        if identity is not None and self.identity is None:
            self._note_identity(self._values(identity, self._exchange(identity, soon_s)), identity)
        self._read_status_if_due(soon_s)

    # --- what the wheel says ------------------------------------------------------------------------------------

    def _issued(self, written: Written) -> IssuedCommand:
        """A write as those above see it: sent in host time, it acts in wheel time."""
        after_s = written.received_s - self._sample_at_s if self._sample_at_s is not None else 0.0
        delay_s = round(after_s * self.clock.rate, _PLACES)
        return IssuedCommand(written.current_A, delay_s, written.acknowledged, written.reason)

    def _exchange(self, register: Register, deadline_s: float) -> Exchange:
        """Request a register; at the deadline nothing is sent, for its reply would only come in the way of the next."""
        now_s = self._host.monotonic()
        if now_s >= deadline_s:
            return Exchange(None, now_s, now_s)
        return self._line.request(register.id, b"", register.size, deadline_s - now_s)

    def _values(self, register: Register, exchange: Exchange) -> dict[str, float] | None:
        """SI values of a reply; None where there was none, or where it holds a number that no wheel can have."""
        if exchange.data is None:
            return None
        values = decode_register(register, exchange.data)
        if not is_plausible(register, values):
            self.link.damaged += 1
            return None
        return values

    def _has_jumped(self, speed_rad_s: float, came_s: float) -> bool:
        """Whether the speed changed by more than a wheel can: its number went round its end, or lost a digit."""
        field, last, reading = self._map.speed_field, self._speed, (speed_rad_s, came_s)
        doubted, self._doubted = self._doubted, None
        if last is not None and came_s - last[1] < WRAP_WITHIN_S:
            believed = [last] if doubted is None or not field.is_believed_twice else [last, doubted]
            if all(abs(speed_rad_s - rad_s) > field.most_change_si(came_s - at_s) for rad_s, at_s in believed):
                self._doubted = reading
                return True
        self._speed = reading
        return False

    def _time_s(self, values: dict[str, float], exchange: Exchange) -> float:
        """When the speed was read: by the wheel's clock, else when the request reached the wheel, since opening."""
        host_s = exchange.received_by_wheel_s
        field = self._uptime_field
        if field is None:
            turned = self._main.field("turned")
            if turned is not None:
                self.clock.note_turned(values["turned"], turned.si_span)
            return round(host_s - self._opened_s, _PLACES)
        if "uptime" not in values:  # its register was lost: where the clock would be
            return self.clock.between_s(host_s)
        counts = not field.is_float
        span_s, count_s = (field.si_span, field.si_per_count) if counts else (None, 0.0)
        return self.clock.time_s(values["uptime"], host_s, span_s, exchange.replied_s, count_s)

    def _read_beside(self, deadline_s: float) -> bool:
        """Read what is due beside the sample before it: behind it, it would delay the command. Whether anything was."""
        status = self._read_status_if_due(deadline_s)
        if status and self._expected is None:  # one at a time, unless it is in doubt who answers
            return True
        return self._read_identity_if_due(deadline_s) or status

    def _read_status_if_due(self, deadline_s: float) -> bool:
        """Read the status register now and then; whether it was done."""
        register = self._map.register("status")
        now_s = self._host.monotonic()
        if register is None or register.access != "read" or now_s < self._status_due_s:
            return False
        values = self._values(register, self._exchange(register, deadline_s))
        if values is None or "flags" not in values:
            return True
        first = self._flags is None
        self._flags = int(values["flags"])
        self._mode = values.get("mode")
        self._status_due_s = now_s + (ALARMED_EVERY_S if conditions(self._flags) else STATUS_EVERY_S)
        if self._flags & FLAG_RESET and self._uptime_field is not None:
            self.clock.note_restart()
        elif self._flags & FLAG_RESET and not first:
            self.clock.begin_segment("wheel_restarted", "the wheel restarted: its status says so")
        return True

    def go_on_from(self, previous: SerialWheel) -> None:
        """Take over what was known of the wheel that was lost on this port."""
        self.identity = previous.identity if previous.identity is not None else previous._expected
        self.doubt_identity()
        self._opened_s = previous._opened_s

    def doubt_identity(self) -> None:
        """Another wheel may answer from now on: query before the next sample. Until it says, it has no identity."""
        if self.identity is not None and self.identity.serial_number is not None:
            self._expected, self.identity = self.identity, None

    def _note_quiet(self) -> None:
        """Whoever is silent for longer than a cycle or two may have been changed for another."""
        now_s = self._host.monotonic()
        if self._quiet_since_s is None:
            self._quiet_since_s = now_s
        elif now_s - self._quiet_since_s > QUIET_S:
            self.doubt_identity()

    def _read_identity_if_due(self, deadline_s: float) -> bool:
        """Query who answers, while that is in doubt, and now and then; whether it was done."""
        register = self._map.register("identity")
        now_s = self._host.monotonic()
        known = self.identity is None or self.identity.serial_number is None or now_s < self._identity_due_s
        if register is None or (self._expected is None and known):
            return False
        self._note_identity(self._values(register, self._exchange(register, deadline_s)), register)
        self._identity_due_s = now_s + IDENTITY_EVERY_S
        if self.identity is not None:
            self._expected = None
        return True

    def _note_identity(self, values: dict[str, float] | None, register: Register) -> None:
        """Keep who answered."""
        if values is None or register.name != "identity":
            return
        self.identity = WheelIdentity(
            kind=_whole(values.get("type")),
            version=_whole(values.get("version")),
            serial_number=_whole(values.get("serial_number")),
            uptime_s=values.get("uptime"),
        )


def _whole(value: float | None) -> int | None:
    """A number that counts something."""
    return None if value is None else int(value)
