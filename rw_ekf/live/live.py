"""A wheel on a line as a source of samples at a steady rate: pacing, silence, a lost link, reconnection."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from rw_ekf.errors import DriverError
from rw_ekf.live.guard import CurrentGuard, SafetyLimits
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.live.telemetry import TelemetryCheck
from rw_ekf.records import (
    Controller,
    IssuedCommand,
    LinkCounters,
    LinkState,
    Reading,
    Tick,
    WheelDriver,
    WheelSample,
)

_REOPEN_EVERY_S = 0.5
_LAST_TRY_S = 2.0
_REOPEN_SILENT_S = 5.0  # a port that stays open but says nothing is opened anew, so often
_RATE_AFTER_S = 10.0  # sooner, milliseconds of jitter would pass for a clock that runs at another rate
_LATENESS_KEPT = 36_000  # an hour at 10 Hz: the percentiles are those of the last hour, and memory stays flat

Note = Callable[..., None]


@dataclass
class LoopTiming:
    """When the ticks came (the `loop` object of `run --json`)."""

    ticks: int = 0
    overruns: int = 0
    late_ms_max: float = 0.0
    late_ms: list[float] = field(default_factory=list)

    def note(self, late_s: float) -> None:
        """Note one tick that began late_s after its time."""
        late = 1e3 * max(late_s, 0.0)
        if len(self.late_ms) < _LATENESS_KEPT:
            self.late_ms.append(late)
        else:
            self.late_ms[self.ticks % _LATENESS_KEPT] = late
        self.ticks += 1
        self.late_ms_max = max(self.late_ms_max, late)

    def percentile_ms(self, share: float) -> float:
        """Percentile of the lateness [ms], nearest rank; 0.0 before the first tick."""
        if not self.late_ms:
            return 0.0
        ordered = sorted(self.late_ms)
        return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


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
        open_wheel: Callable[[WheelDriver | None], WheelDriver],
        limits: SafetyLimits,
        rate_hz: float,
        stop: StopSignal,
        *,
        writes: bool = True,
        note: Note = lambda event, **context: None,
        check: TelemetryCheck | None = None,
        speed_step_rad_s: float = 0.0,
    ) -> None:
        """Open the line (DriverError if that fails) and, where this run writes at all, command zero.

        note: receives named events for the log, e.g. note("link_lost", reason="..."). check: judges every reading; the
        usual one has no model, and knows only what the wheel says of itself. speed_step_rad_s: noise or resolution.
        """
        self._open = open_wheel
        self._limits = limits
        self._period_s = 1.0 / rate_hz
        self._stop = stop
        self._writes = writes
        self._note = note
        self.timing = LoopTiming()
        self.driver = open_wheel(None)
        self.guard = CurrentGuard(self.driver, limits, speed_step_rad_s=speed_step_rad_s)
        self.check = check if check is not None else TelemetryCheck(note, writes=writes)
        self.check.attached(self.driver.identity)
        self.halted: str | None = None  # why the run must not go on
        self.lost = False
        self.silent = False  # no telemetry for longer than limits.silence_s
        self._heard_s = time.monotonic()
        self._last: WheelSample | None = None
        self._last_tick_s = 0.0
        self._began: tuple[WheelSample, float] | None = None  # first sample of the segment, and its tick
        self._told_A: float | None = None  # the last current that the log and the filter were told of
        self._broken = False
        self._breaks = 0
        self._zeroed_after_s: float | None = None  # in silence: the zero was confirmed, so long after the tick
        self._unknown_since_zero = False  # in silence: a zero may have been taken before the one that was confirmed
        self._repeating = False  # replies come, but their time stands still
        self._retry_at = 0.0
        self._reopened_s = 0.0
        self._changed_for: str | None = None
        if writes:
            self.guard.zero()

    @property
    def link(self) -> LinkCounters:
        """Counters of the line, over all reconnections."""
        return self.driver.link

    def readings(self, duration_s: float | None = None) -> Iterator[Reading]:
        """Readings, one per tick, until a stop is asked for or `duration_s` of samples have come.

        Time counts as the samples tell it, and by the host's clock where none come.
        """
        deadline = told_s = time.monotonic()
        covered_s = 0.0
        before: WheelSample | None = None
        while not self._stop.wait(deadline - time.monotonic()):
            now = time.monotonic()
            self.timing.note(now - deadline)
            reading = self._read(now)
            if self.halted is not None:
                return
            if reading is not None:
                sample = reading.sample
                known = before is not None and sample.segment == before.segment
                covered_s += max(sample.time_s - before.time_s, 0.0) if known and before else now - told_s
                before, told_s = sample, now
                yield reading
                if self.halted is not None:
                    return
            deadline += self._period_s
            after = time.monotonic()
            if after > deadline:
                self.timing.overruns += 1
            if after - deadline > self._period_s:  # skip the ticks that are past, keep the phase
                deadline += self._period_s * int((after - deadline) / self._period_s)
            if duration_s is not None and covered_s + now - told_s >= duration_s - 0.5 * self._period_s:
                return

    def issue(self, controller: Controller, tick: Tick) -> IssuedCommand | None:
        """Command the wheel after a sample: what the controller asks for, through the guard."""
        self.check.estimated(tick.estimate)
        if tick.link is not LinkState.ANSWERED:
            return self._command_of_a_missed_tick()
        try:
            command = self.guard.write(controller(tick), tick.sample, self.check.hold)
        except DriverError as error:
            self._lose(error)
            return None
        self._told_A = command.current_A
        self.check.commanded(command)
        if command.reason != self._changed_for:
            self._changed_for = command.reason
            if command.reason is not None:
                self._note("command_changed", reason=command.reason, current_A=command.current_A)
        return command

    def halt(self, why: str) -> None:
        """End the run for a reason that forbids to drive the wheel on: zero now, and no sample any more."""
        self.halted = self.halted or why
        if self._writes and not self.lost:
            self.guard.zero(within_s=0.0)

    def close(self) -> bool:
        """Command zero (unless this run never writes) and release the line; True if the wheel confirmed zero."""
        confirmed = True
        if self._writes:
            confirmed = not self.lost and self.guard.zero()
            if not confirmed:
                confirmed = self._zero_over_new_line()
        self.driver.close()
        return confirmed

    def _read(self, tick_s: float) -> Reading | None:
        if self.lost and not self._reconnect():
            return None
        try:
            sample = self.driver.read(0.5 * self._period_s)
        except DriverError as error:
            self._lose(error)
            return None
        self._repeating = sample is not None and not self._is_later(sample)
        if sample is None or self._repeating:
            return self._missed(tick_s)
        now = time.monotonic()
        if self.silent:
            self._note("telemetry_back", silent_s=round(now - self._heard_s, 2))
        unsure = (self._broken or self.guard.doubtful) and not self._as_told(sample)
        if (unsure or self._unknown_since_zero) and self._last is not None:
            self._breaks += 1
        self._heard_s, self._last_tick_s = now, tick_s
        self.silent = self._broken = self._unknown_since_zero = False
        self._zeroed_after_s = None
        restarted = sample.news is not None and sample.news[0] == "wheel_restarted"
        if restarted and self._writes:  # set up anew: whatever it carries, the way up starts from zero
            self.guard.zero(within_s=0.0)
        sample = replace(sample, segment=sample.segment + self._breaks)
        sample, alive = self.check.judge(sample, self.driver.identity)
        if alive:  # what it was while nothing could be believed of it is not known
            self._breaks += 1
            sample = replace(sample, segment=sample.segment + 1)
        self._last = sample
        if self._began is None or self._began[0].segment != sample.segment:
            self._began = sample, tick_s
        if self.check.other_wheel is not None:
            self.halt(self.check.other_wheel)
            return None
        return Reading(sample)

    def _is_later(self, sample: WheelSample) -> bool:
        """Whether a reading was taken after the one before it."""
        last = self._last
        return last is None or sample.segment + self._breaks != last.segment or sample.time_s > last.time_s

    def _missed(self, tick_s: float) -> Reading | None:
        """Answer for a tick without a reply: a sample without a speed, at the time it would have had.

        In silence there is one only where the current changes: when the wheel confirms the zero.
        """
        quiet_s = time.monotonic() - self._heard_s
        if quiet_s > self._limits.silence_s:
            if not self.silent:
                doing = "writing zero, retrying" if self._writes else "waiting"
                why = "one reply is repeated, its time stands still" if self._repeating else "no reply"
                self._note("silence", seconds=round(quiet_s, 2), why=why, doing=doing)
                if self._repeating:
                    self.check.found(
                        "telemetry_repeats",
                        "telemetry repeated one reply whose time stood still: that is silence, and zero was written",
                    )
            self.silent = True
            if min(quiet_s - self._limits.silence_s, time.monotonic() - self._reopened_s) > _REOPEN_SILENT_S:
                self._reopened_s = time.monotonic()
                self._lose(DriverError("the port is open but the wheel says nothing; opening it anew"))
                return None
            known = self._zeroed_after_s is not None
            if not self._writes:
                return None
            if not self.guard.zero(within_s=0.0):
                self._unknown_since_zero = self._unknown_since_zero or not known
                return None
            if known:
                return None
            self._zeroed_after_s = time.monotonic() - tick_s
        if self._last is None:
            return None
        passed_s = (tick_s - self._last_tick_s) * self._clock_rate()
        sample = WheelSample(self._last.time_s + passed_s, None, segment=self._last.segment)
        return Reading(sample, LinkState.SILENT if self.silent else LinkState.MISSED)

    def _clock_rate(self) -> float:
        """Seconds of the samples' time per second of the host's, once there are enough to tell."""
        if self._began is None or self._last is None or self._last_tick_s - self._began[1] < _RATE_AFTER_S:
            return 1.0
        return (self._last.time_s - self._began[0].time_s) / (self._last_tick_s - self._began[1])

    def _command_of_a_missed_tick(self) -> IssuedCommand | None:
        if self._zeroed_after_s is None:
            return None
        self._told_A = 0.0
        command = IssuedCommand(0.0, self._zeroed_after_s)
        self.check.commanded(replace(command, acknowledged=False))  # from when on it acts is known to a tick only
        return command

    def _as_told(self, sample: WheelSample) -> bool:
        """Whether telemetry reports the current that the log says was in force."""
        said = sample.current_command_A
        return said is not None and self._told_A is not None and math.isclose(said, self._told_A, abs_tol=1e-7)

    def _lose(self, error: DriverError) -> None:
        if not self.lost:
            self._note("link_lost", reason=str(error))
        self.lost = self._broken = True
        self._retry_at = time.monotonic()

    def _reconnect(self) -> bool:
        if time.monotonic() < self._retry_at:
            return False
        self._retry_at = time.monotonic() + _REOPEN_EVERY_S
        try:
            self.driver = self._open(self.driver)
        except DriverError:
            return False
        self.guard.driver = self.driver
        self.lost = False
        if self._writes:
            self.guard.zero()
        self._note("link_back", reconnects=self.driver.link.reconnects)
        return True

    def _zero_over_new_line(self) -> bool:
        """Last resort on the way out: a line that was pulled out may be back within a moment."""
        end_s = time.monotonic() + _LAST_TRY_S
        while True:
            try:
                self.driver = self._open(self.driver)
                break
            except DriverError:
                if time.monotonic() >= end_s:
                    return False
                time.sleep(0.1)
        self.guard.driver = self.driver
        return self.guard.zero(1.0)
