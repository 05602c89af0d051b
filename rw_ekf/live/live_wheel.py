"""A wheel on a line as a source of readings at a steady rate: pacing, silence, segments, commands."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from rw_ekf.clock import Clock
from rw_ekf.driver import WheelDriver
from rw_ekf.errors import DriverError
from rw_ekf.live.command_acceptance import ChangedCommands
from rw_ekf.live.connection import Connection, Note, Opener
from rw_ekf.live.guard import SafetyLimits, SpeedLimit
from rw_ekf.live.stop_signal import RESUME, StopSignal
from rw_ekf.live.telemetry import TelemetryCheck
from rw_ekf.live.timing import SampleTime
from rw_ekf.live.zero_in_force import Slowing
from rw_ekf.records import (
    Controller,
    IssuedCommand,
    LinkCounters,
    LinkState,
    Reading,
    Tick,
    WheelSample,
)
from rw_ekf.statistics import LoopTiming

InSilence = Callable[[], tuple[bool, bool]]

_REOPEN_SILENT_S = 5.0  # a port that stays open but says nothing is opened anew, so often


@dataclass(frozen=True)
class Place:
    """A wheel's place on its line: what opens it, and what it may wait for while it is silent.

    in_silence: what a turn may wait for then, for a reading and for the answer to a zero: both, unless others want the
    line.
    """

    open_wheel: Opener
    in_silence: InSilence = lambda: (True, True)
    begins_s: Callable[[], float | None] = lambda: None  # when its first turn is due, by the clock; None: at once
    back_at_zero_within_s: float = 0.5  # how long zero is tried on a line that was lost and is back [s]
    label: str = ""  # what distinguishes it from others on one terminal
    resumed_by: int | None = RESUME  # the signal that is a word for this wheel and no other


class LiveWheel:
    """Reads the wheel at each tick and writes what the guard allows. One of these per `run`.

    A tick without a reply is a sample without a speed: the current of the sample before holds. Where the current in
    force cannot be known (nobody confirmed a command, and telemetry contradicts the log), a new segment begins, so that
    the filter, and whoever replays the log, starts the speed afresh instead of believing a wrong current.

    Only a reading later than the one before it is telemetry: a reply that is repeated, its time standing still, is
    silence, whatever comes over the line. And only a reading that the wheel can have is a speed (`TelemetryCheck`).
    """

    def __init__(
        self,
        place: Place,
        limits: SafetyLimits,
        rate_hz: float,
        stop: StopSignal,
        clock: Clock,
        *,
        writes: bool = True,
        note: Note = lambda event, **context: None,
        speed_step_rad_s: float = 0.0,
    ) -> None:
        """Open the line (DriverError if that fails) and, where this run writes at all, command zero.

        speed_step_rad_s: noise or resolution of a reading.
        """
        self.check = TelemetryCheck(note, writes=writes)
        self._connection = Connection(
            place.open_wheel,
            limits,
            clock,
            note,
            writes=writes,
            speed_step_rad_s=speed_step_rad_s,
            back_at_zero_within_s=place.back_at_zero_within_s,
            say=lambda event, text: self.check.say(event, text),  # noqa: PLW0108 - whichever judges by then
        )
        self._silence_s = limits.silence_s
        self._period_s = 1.0 / rate_hz
        self._stop = stop
        self._clock = clock
        self._writes = writes
        self._note = note
        self.timing = LoopTiming()
        self.judged_by(self.check)
        self.halted: str | None = None  # why the run must not continue
        self.silent = False  # no telemetry for longer than limits.silence_s
        self.ended_at_zero = False  # closed, and the wheel confirmed zero
        self.due_s: float | None = None  # when the next turn begins, by the clock; None: at once
        self._is_over = False  # the present turn, and the next is planned
        self._in_silence = place.in_silence
        self._time = SampleTime()
        self._heard_s, self._stale_when_heard = clock.monotonic(), 0
        self._reported_A: float | None = None  # the last current that the log and the filter were given
        self._broken = False  # the line was lost since the last reading
        self._breaks = 0
        self._zeroed_after_s: float | None = None  # in silence: the zero was confirmed, so long after the tick
        self._unknown_since_zero = False  # in silence: a zero may have been taken before the one that was confirmed
        self._repeating = False  # replies come, but their time stands still
        self._reopened_s = 0.0
        self._changed = ChangedCommands(note)

    def judged_by(
        self,
        check: TelemetryCheck,
        hold: Callable[[], str | None] | None = None,
        speed_limit: Callable[[], SpeedLimit] = SpeedLimit,
        slowing: Slowing = lambda speed_rad_s: None,
    ) -> None:
        """Let `check` judge every reading; at first one does that has no model, and knows what the wheel itself says.

        hold: why nothing but zero may be written now, or None; usually what `check` says. speed_limit: what else than
        the reading is held against the limit. slowing: the friction, as far as it is known (`ZeroSight`).
        """
        self._connection.guard.speed_limit = speed_limit
        self._connection.guard.slowing = slowing
        self.check = check
        check.attached(self.driver.identity)
        self._hold = hold if hold is not None else lambda: check.hold

    @property
    def driver(self) -> WheelDriver:
        """The wheel on its present line."""
        return self._connection.driver

    @property
    def link(self) -> LinkCounters:
        """Counters of the line, over all reconnections."""
        return self.driver.link

    @property
    def lost(self) -> bool:
        """Whether the line is down, or the wheel silent."""
        return self._connection.lost or self.silent

    def readings(self, lasts_s: Callable[[], float | None] = lambda: None) -> Iterator[Reading]:
        """Readings, one per tick, until a stop is requested or `lasts_s()` of samples have come (None: for ever).

        Time counts as the samples give it, and by the host's clock where none come. A turn that brought nothing for a
        log has a reading without a sample.
        """
        clock = self._clock
        self.due_s = reported_s = self.due_s if self.due_s is not None else clock.monotonic()
        covered_s = 0.0
        before: WheelSample | None = None
        while not self._stop.wait(self.due_s - clock.monotonic(), clock):
            now = clock.monotonic()
            self.timing.note(now - self.due_s)
            reading = self._read(now)._replace(host_s=now)
            if self.halted is not None:
                return
            sample = reading.sample
            if sample is not None:
                known = before is not None and sample.segment == before.segment
                covered_s += max(sample.time_s - before.time_s, 0.0) if known and before else now - reported_s
                before, reported_s = sample, now
            self._is_over = False
            yield reading
            if self.halted is not None:
                return
            if not self._is_over:
                self.turn_is_over()
            duration_s = lasts_s()
            if duration_s is not None and covered_s + now - reported_s >= duration_s - 0.5 * self._period_s:
                return

    def turn_is_over(self) -> None:
        """Plan the next turn. For whoever does something else between two turns; else `readings` sees to it."""
        assert self.due_s is not None
        self._is_over = True
        self.due_s += self._period_s
        after = self._clock.monotonic()
        if after > self.due_s:
            self.timing.overruns += 1
        if after - self.due_s > self._period_s:  # skip the ticks that are past, keep the phase
            self.due_s += self._period_s * int((after - self.due_s) / self._period_s)

    def issue(self, controller: Controller, tick: Tick) -> IssuedCommand | None:
        """Command the wheel after a sample: what the controller requests, through the guard."""
        self.check.estimated(tick.estimate)
        if tick.link is not LinkState.ANSWERED:
            return self._command_of_a_missed_tick()
        try:
            command = self._connection.guard.write(controller(tick), tick.sample, self._hold())
        except DriverError as error:
            self._lose(error)
            return None
        self._reported_A = command.current_A
        self.check.commanded(command)
        self._changed.take(command, self._clock.monotonic())
        return command

    def halt(self, why: str) -> None:
        """End the run for a reason that forbids to drive the wheel on: zero now, and no sample any more."""
        self.halted = self.halted or why
        self.zero_now()

    @property
    def doubtful(self) -> bool:
        """Whether the last that was written was not confirmed, and may be in force or not."""
        return self._connection.guard.doubtful

    def zero_now(self) -> None:
        """Command zero at once, without waiting for the next turn; reported nowhere if the line is down."""
        if not self._connection.lost:
            self._connection.zero(within_s=0.0)

    def close(self) -> bool:
        """Command zero (unless this run never writes) and release the line; True if the wheel confirmed zero."""
        self._changed.end(math.inf)
        self.ended_at_zero = self._connection.close()
        return self.ended_at_zero

    def _read(self, tick_s: float) -> Reading:
        quiet_s = self._clock.monotonic() - self._heard_s
        reads, zeroes = self._in_silence() if self.silent else (True, True)
        if not (reads or zeroes):
            return Reading(None, LinkState.DOWN if self._connection.lost else LinkState.SILENT, quiet_s)
        if not self._connection.is_up():
            return Reading(None, LinkState.DOWN, quiet_s)
        try:
            sample = self.driver.read(0.5 * self._period_s) if reads else None
        except DriverError as error:
            self._lose(error)
            return Reading(None, LinkState.DOWN, quiet_s)
        self._repeating = sample is not None and not self._is_later(sample)
        if sample is None or self._repeating:
            return self._missed(tick_s, zeroes=zeroes)
        now = self._clock.monotonic()
        if self.silent:
            self._note("telemetry_back", silent_s=round(now - self._heard_s, 2))
        unsure = (self._broken or self._connection.guard.doubtful) and not self._as_reported(sample)
        if (unsure or self._unknown_since_zero) and self._time.last is not None:
            self._breaks += 1
        if self._time.last is None:
            quiet_s = 0.0  # what went before the first reading is no silence: nothing has been commanded yet
        self._heard_s, self._stale_when_heard = now, self.link.stale
        self.silent = self._broken = self._unknown_since_zero = False
        self._zeroed_after_s = None
        if sample.news is not None and sample.news[0] == "wheel_restarted":
            self._connection.zero(within_s=0.0)  # set up anew: whatever it carries, the way up starts from zero
        sample = replace(sample, segment=sample.segment + self._breaks)
        sample, apart = self.check.judge(sample, self.driver.identity)
        if apart:  # what drove it until now, or what it was, is not known
            self._breaks += 1
            sample = replace(sample, segment=sample.segment + 1)
        self._time.note(sample, tick_s)
        if self.check.other_wheel is not None:
            self.halt(self.check.other_wheel)
            return Reading(None, LinkState.ANSWERED, quiet_s)
        return Reading(sample, LinkState.ANSWERED, quiet_s)

    def _is_later(self, sample: WheelSample) -> bool:
        """Whether a reading was taken after the one before it."""
        last = self._time.last
        return last is None or sample.segment + self._breaks != last.segment or sample.time_s > last.time_s

    def _missed(self, tick_s: float, *, zeroes: bool) -> Reading:
        """Answer for a tick without a reply: a sample without a speed, at the time it would have had.

        In silence there is one only where the current changes: when the wheel confirms the zero.
        """
        now = self._clock.monotonic()
        quiet_s = now - self._heard_s
        if quiet_s > self._silence_s:
            if not self.silent:
                self._say_silent(quiet_s)
            self.silent = True
            if min(quiet_s - self._silence_s, now - self._reopened_s) > _REOPEN_SILENT_S:
                self._reopened_s = now
                says = "its replies come too late" if self._replies_late else "the wheel says nothing"
                self._lose(DriverError(f"the port is open but {says}; opening it anew"))
                return Reading(None, LinkState.SILENT, quiet_s)
            if not zeroes or not self._zeroed_in_silence(tick_s):
                return Reading(None, LinkState.SILENT, quiet_s)
        link = LinkState.SILENT if self.silent else LinkState.MISSED
        return Reading(self._time.missing(tick_s), link, quiet_s)

    def _zeroed_in_silence(self, tick_s: float) -> bool:
        """Write zero; whether it was confirmed for the first time in this silence, which belongs into the log."""
        known = self._zeroed_after_s is not None
        if not self._writes:
            return False
        if not self._connection.zero(within_s=0.0):
            self._unknown_since_zero = self._unknown_since_zero or not known
            return False
        if known:
            return False
        self._zeroed_after_s = self._clock.monotonic() - tick_s
        return True

    @property
    def _replies_late(self) -> bool:
        """Whether, since telemetry was heard last, replies came that were those of earlier requests."""
        return self.link.stale > self._stale_when_heard

    def _say_silent(self, quiet_s: float) -> None:
        doing = "writing zero, retrying" if self._writes else "waiting"
        why = "no reply"
        if self._repeating:
            why = "one reply is repeated, its time stands still, or `uptime` of the wire map is no clock"
        elif self._replies_late:
            why = "replies come, but too late: a longer loop.reply_timeout_ms, or a shorter way to the wheel"
        self._note("silence", seconds=round(quiet_s, 2), why=why, doing=doing)
        if self._repeating:
            self.check.found(
                "telemetry_repeats",
                "telemetry repeated one reply whose time stood still: that is silence, and zero was written",
            )

    def _command_of_a_missed_tick(self) -> IssuedCommand | None:
        if self._zeroed_after_s is None:
            return None
        self._reported_A = 0.0
        command = IssuedCommand(0.0, self._zeroed_after_s)
        self.check.commanded(replace(command, acknowledged=False))  # from when on it acts is known to a tick only
        return command

    def _as_reported(self, sample: WheelSample) -> bool:
        """Whether telemetry reports the current that the log says was in force."""
        stated = sample.current_command_A
        return (
            stated is not None and self._reported_A is not None and math.isclose(stated, self._reported_A, abs_tol=1e-7)
        )

    def _lose(self, error: DriverError) -> None:
        self._connection.lose(error)
        self._broken = True
