"""`run --supervise`: a light parent that starts the run as a child, and writes zero when the child dies or hangs.

The wheel holds its last current for ever, so a process must be left that can write zero when the daemon cannot. This
one does nothing but wait: it needs no arrays, no filter, and not the loop.
"""

from __future__ import annotations

import itertools
import os
import select
import signal
import sys
from collections import deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from rw_ekf.clock import Clock
from rw_ekf.console import STATUS
from rw_ekf.errors import DriverError
from rw_ekf.live.guard import STAND_DOWN_S, zero_each
from rw_ekf.live.oversight import OVER, REPORTED, TURN, Heartbeat
from rw_ekf.live.port_claim import PortClaim
from rw_ekf.live.process import ProcessHandle
from rw_ekf.live.stop_signal import ForwardedSignals
from rw_ekf.live.stop_word import REPORTED_TO_STOP, stop_requested

if TYPE_CHECKING:
    from rw_ekf.driver import WheelProtocol
    from rw_ekf.settings.schema import Configuration

_LOOK_S = 0.25
_ZERO_WITHIN_S = 1.0
_ZERO_AGAIN_S, _ZERO_EVERY_S = 0.05, 0.5
_NOT_CONFIRMED = "NOT confirmed"
_KILL_WITHIN_S = 2.0
_MOST_CRASHES, _WITHIN_S = 5, 600.0
_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 0.5, 30.0


@dataclass(frozen=True)
class Patience:
    """How long a child may be without a completed turn before it counts as hung [s]."""

    start_s: float = 300.0  # routines may have to be compiled; nothing is driven yet
    turn_s: float = 5.0
    stop_s: float = 5.0  # from the signal to zero
    report_s: float = 120.0  # after the loop: the run's end is judged and printed

    @classmethod
    def of(cls, configuration: Configuration, wheels: int = 1) -> Patience:
        """A line over a network is opened with pyserial's own patience, which is five seconds and more.

        wheels: on the line, each of which may have to be waited for to stand down.
        """
        line_s = 20.0 if "://" in configuration.wheel.port else 5.0
        others_s = STAND_DOWN_S * (wheels - 1)
        return cls(turn_s=max(line_s, 10.0 / configuration.loop.rate_hz) + others_s, stop_s=line_s + others_s)


class Birth(NamedTuple):
    """What a child knows of those before it."""

    heartbeat: Heartbeat
    before: int  # children
    elapsed_s: float  # since the first began


@dataclass
class _Child:
    """One child, and what it has reported so far."""

    handle: ProcessHandle
    beats: int  # the reading end of its pipe
    turns: int = 0
    over: bool = False
    reported: bool = False
    idle_s: float = 0.0
    killed_for: str | None = None
    code: int = 0  # as os.waitstatus_to_exitcode has it

    def listen(self) -> None:
        """Take what it has reported."""
        while True:
            try:
                stated = os.read(self.beats, 4096)
            except BlockingIOError:
                return
            if not stated:
                return
            self.idle_s = 0.0
            self.turns += stated.count(TURN)
            self.over = self.over or OVER in stated
            self.reported = self.reported or REPORTED in stated

    def reap(self) -> None:
        """Take its exit status; it has ended."""
        self.listen()
        _, status = os.waitpid(self.handle.pid, 0)
        self.code = os.waitstatus_to_exitcode(status)
        os.close(self.beats)

    @property
    def exit_status(self) -> int:
        """As the caller shall see it: 1 where a signal ended it."""
        return max(self.code, 0) or int(self.code < 0)

    def ended_by(self, numbers: Collection[int]) -> bool:
        """Whether one of the signals ended it before it could act on it."""
        return -self.code in numbers

    @property
    def death(self) -> str:
        """How it ended, for a person."""
        if self.killed_for is not None:
            return self.killed_for
        if self.code < 0:
            return f"it was ended by {signal.Signals(-self.code).name}"
        return f"it ended by itself with exit status {self.code}"


@dataclass
class Supervisor:
    """Starts a run, watches it, and starts it again where it crashed."""

    wheels: Sequence[tuple[Configuration, WheelProtocol]]  # of the run; more than one where they share a line
    logger: Any
    clock: Clock
    patience: Patience
    _signals: ForwardedSignals = field(default_factory=ForwardedSignals)
    _stopping: bool = False

    def supervise(self) -> int | Birth:
        """Return in the parent: the exit status, when all is over. In each child: its birth; it is the run then.

        Raises DriverError where another daemon has the port.
        """
        port = self.wheels[0][0].wheel.port
        claim = PortClaim(port, self.clock, supervises=True)
        with self._signals, claim:
            if stop_requested(port):
                self.logger.warning("not_begun", reason=REPORTED_TO_STOP)
                return 0
            crashes: deque[float] = deque(maxlen=_MOST_CRASHES)
            turned = False
            pause_s = _FIRST_PAUSE_S
            began_s = self.clock.monotonic()
            zeroed = True  # nothing has been driven yet
            for number in itertools.count():
                child = self._born(claim)
                if child is None:
                    zeroed = self._pause(_LONGEST_PAUSE_S, zeroed=zeroed)
                    if self._stopping:
                        return 0 if zeroed else 1
                    continue
                if isinstance(child, Heartbeat):
                    return Birth(child, number, self.clock.monotonic() - began_s)
                with child.handle:
                    self._watch(child, claim)
                turned = turned or child.turns > 0
                if child.over or (child.reported and (child.exit_status != 1 or not turned)):
                    return self._end(child)
                zeroed = self._zero_at_once()
                self._say_died(child, _NOT_CONFIRMED if not zeroed else self._done)
                if self._stopping:
                    return 0 if zeroed and child.ended_by(self._signals.stops) else 1
                now = self.clock.monotonic()
                if child.turns > 0 or not child.reported:  # a wheel that is not there yet is no crash
                    if len(crashes) == _MOST_CRASHES and now - crashes[0] < _WITHIN_S:
                        return self._give_up()
                    crashes.append(now)
                    pause_s = _FIRST_PAUSE_S * 2.0 ** (sum(now - at < _WITHIN_S for at in crashes) - 1)
                else:
                    pause_s = min(2.0 * pause_s, _LONGEST_PAUSE_S)
                self.logger.warning("restart", in_s=pause_s)
                zeroed = self._pause(pause_s, zeroed=zeroed)
                if self._stopping:
                    return 0 if zeroed else 1
        raise AssertionError("never reached")

    def _born(self, claim: PortClaim) -> _Child | Heartbeat | None:
        """Fork; None where the machine has no room for another process now."""
        reader = writer = pid = -1
        sys.stdout.flush()
        sys.stderr.flush()
        supervisor = os.getpid()
        try:
            reader, writer = os.pipe()
            pid = os.fork()
            handle = ProcessHandle(pid) if pid else None
        except OSError as error:
            self._not_born(error.strerror or str(error), pid, reader, writer)
            return None
        os.set_blocking(reader, False)
        if handle is None:
            os.close(reader)
            claim.leave_to_parent()
            self._signals.leave_to_parent()
            return Heartbeat(writer, supervisor)
        os.close(writer)
        self.logger.info("supervising", pid=pid)
        return _Child(handle, reader)

    def _not_born(self, reason: str, pid: int, *pipe: int) -> None:
        for end in pipe:
            if end >= 0:
                os.close(end)
        if pid > 0:  # born, but nobody could watch it
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
        self.logger.error("not_started", reason=reason, again_in_s=_LONGEST_PAUSE_S)

    def _watch(self, child: _Child, claim: PortClaim) -> None:
        """Until it has ended: pass signals on, count its turns, kill it where it hangs."""
        while True:
            before_s = self.clock.monotonic()
            select.select([child.handle.fileno(), child.beats, self._signals.fileno()], [], [], _LOOK_S)
            # What passed while this process itself did not run says nothing of the child.
            child.idle_s += min(self.clock.monotonic() - before_s, 2.0 * _LOOK_S)
            child.listen()
            if child.over:
                claim.release()
            for number in self._signals.taken():
                child.handle.send(number)
                if number in self._signals.stops and not self._stopping:
                    self._stopping, child.idle_s = True, 0.0
            if child.handle.ended():
                child.reap()
                return
            hung = self._hung(child)
            if hung is not None:
                self._kill(child, hung)

    def _hung(self, child: _Child) -> str | None:
        """Why the child must be killed."""
        patience = self.patience
        if child.over:
            most_s, doing = patience.report_s, "its loop was over, but the process did not end"
        elif self._stopping:
            most_s, doing = patience.stop_s, "it was told to stop, but did not"
        elif child.turns > 0:
            most_s, doing = patience.turn_s, "it hung: no turn of its loop was completed"
        else:
            most_s, doing = patience.start_s, "its loop did not begin"
        return f"{doing} for {most_s:g} s, and it was killed" if child.idle_s > most_s else None

    def _kill(self, child: _Child, why: str) -> None:
        child.killed_for = child.killed_for or why
        child.handle.send(signal.SIGKILL)
        child.idle_s = 0.0
        if not child.handle.ended(_KILL_WITHIN_S):
            zero = self._done if self._zero(exclusive=False) else _NOT_CONFIRMED
            do = "it hangs in the kernel, in the port's driver most likely: pull the adapter out"
            self.logger.error("daemon_not_killed", pid=child.handle.pid, zero_current=zero, do=do)

    def _end(self, child: _Child) -> int:
        if child.code < 0:
            self._say_died(child, "sent before")
        stopped = self._stopping and child.ended_by(self._signals.stops)  # on its way out, after its last word
        return 0 if stopped else child.exit_status

    def _say_died(self, child: _Child, zero: str) -> None:
        if STATUS.is_terminal:
            sys.stderr.write("\n")  # below the line that it kept changing
        self.logger.error("daemon_died", pid=child.handle.pid, how=child.death, zero_current=zero)

    @property
    def _writes(self) -> bool:
        return any(configuration.command.writes for configuration, _ in self.wheels)

    @property
    def _done(self) -> str:
        return "confirmed" if self._writes else "left to who commands the wheel"

    def _zero_at_once(self) -> bool:
        """Zero over the line that the dead child has left; tried for a while, a port may be away for a moment."""
        end_s = self.clock.monotonic() + _ZERO_WITHIN_S
        while not (zeroed := self._zero()) and self.clock.monotonic() < end_s:
            self.clock.sleep(_ZERO_AGAIN_S)
        return zeroed

    def _zero(self, *, exclusive: bool = True) -> bool:
        """Write zero over a line of our own; True if every wheel confirmed it, or if this run never writes."""
        from rw_ekf.attach.opening import opener

        openers = [
            (opener(configuration, protocol, self.clock, probe=False, exclusive=exclusive), configuration.limits)
            for configuration, protocol in self.wheels
            if configuration.command.writes
        ]
        try:
            return all(zero_each(openers, self.clock))
        except DriverError:
            return False

    def _pause(self, seconds: float, *, zeroed: bool) -> bool:
        """Wait before the next start, unless a stop is requested; try on to write zero. Whether it was confirmed."""
        end_s = self.clock.monotonic() + seconds
        while (left_s := end_s - self.clock.monotonic()) > 0.0:
            self.clock.sleep(min(left_s, _ZERO_EVERY_S), self._signals.fileno())
            if not zeroed and self._zero():
                zeroed = True
                self.logger.warning("zero_confirmed")
            self._stopping = any(number in self._signals.stops for number in self._signals.taken())
            if self._stopping:
                break
        return zeroed

    def _give_up(self) -> int:
        do = "find out why, then start it again"
        self.logger.error("given_up", crashes=_MOST_CRASHES + 1, within_min=_WITHIN_S / 60.0, do=do)
        return 1
