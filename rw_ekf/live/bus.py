"""Several wheels on one line, in one loop: each has its turn in its own slot of the period, as if it were alone.

A wheel's run is what it is on a line of its own (`turns_of_run`), suspended behind each turn. What a wheel waits for
outside its turns, while zero is tried again or looked for in the motion, is time for the others' turns: `_Meanwhile`.
A wheel that does not answer costs a period one time-out (`Slot`), and of several that do not one a period is polled.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

from rw_ekf.clock import Clock, Slot
from rw_ekf.driver import WheelDriver, WheelProtocol
from rw_ekf.errors import DriverError, RwEkfError
from rw_ekf.learning.run_start import GivenModel
from rw_ekf.live.daemon import Task, turns_of_run
from rw_ekf.live.guard import CurrentGuard, SafetyLimits
from rw_ekf.live.live_wheel import LiveWheel, Place
from rw_ekf.live.oversight import ALONE, Oversight
from rw_ekf.live.run_outcome import RunOutcome
from rw_ekf.live.stop_signal import StopSignal, resume_signal_of
from rw_ekf.records import RunState, StateNow

if TYPE_CHECKING:
    from rw_ekf.attach.opening import SharedLine
    from rw_ekf.settings.schema import Configuration

_FIRST_ANSWER_S = 2.0  # as long as a wheel of its own may be silent when its port is opened
_FIRST_ZEROES = 6  # of a wheel that falls silent: polled ahead of those that were never heard, three by a zero
_LAST_ZERO_S = 1.0  # at the end: as long as a single wheel's line is tried once more
_WORST_LAST = (RunState.TRACKING, RunState.DEGRADED, RunState.CONNECTING, RunState.LOST, RunState.SAFE)


@dataclass
class BusWheel:
    """One wheel of the line: what it is to do, and what has come of it."""

    configuration: Configuration
    protocol: WheelProtocol
    given: GivenModel
    logger: Any
    begin_safe: str | None = None  # why the run before, which died, was in SAFE
    outcome: RunOutcome | None = None
    failure: str | None = None  # why it has no outcome, in a sentence

    @property
    def name(self) -> str:
        """What it is called."""
        return self.configuration.wheel.name


@dataclass(eq=False)
class _Member:
    """A wheel on its way: not heard yet, in its turns, or done."""

    wheel: BusWheel
    slot: Slot
    index: int
    due_s: float
    run: Generator[LiveWheel, None, RunOutcome] | None = None
    live: LiveWheel | None = None
    done: bool = False
    busy: bool = False  # in a turn at this moment, which may be waiting for the others'
    turned: bool = False  # since who watches was last notified
    state: StateNow | None = None
    tries: int = 0  # while it is silent
    ending: bool = False  # its loop is over, and it stands down
    owes_zero: bool = False  # its run is over, and nobody knows whether it carries a current
    is_unheard: bool = False  # and that was reported

    @property
    def may_carry(self) -> bool:
        """Whether the last that was written to it was not confirmed."""
        return self.owes_zero or (not self.done and self.live is not None and self.live.doubtful)

    @property
    def is_quiet(self) -> bool:
        """Whether polling it costs a time-out, as far as is known."""
        return not self.done and (self.live is None or self.live.silent)


class Bus:
    """The loop of all wheels of a line. Made for one run, in one thread."""

    def __init__(
        self,
        wheels: Sequence[BusWheel],
        line: SharedLine,
        stop: StopSignal,
        clock: Clock,
        oversight: Oversight = ALONE,
        duration_s: float | None = None,
    ) -> None:
        """line: of these wheels, in their order. oversight: notified of turns when every wheel has had one."""
        self._line = line
        self._stop = stop
        self._clock = clock
        self._oversight = oversight
        self._duration_s = duration_s
        self._members = [
            _Member(wheel, slot, index, slot.next_s())
            for index, (wheel, slot) in enumerate(zip(wheels, line.slots, strict=True))
        ]
        self._began_s = clock.monotonic()
        self._heard_by_s = self._began_s + _FIRST_ANSWER_S

    def run(self) -> None:
        """Run until a stop, or until every wheel that was heard has come to its end; each wheel then says how.

        Raises DriverError where the port cannot be opened at the start, or no wheel answers for two seconds. Zero is
        sent to every wheel on every way out.
        """
        try:
            self._begin()
            while self._is_going() and not self._wait():
                self._turn(self._next())
            self._zero_all()
            for member in self._going():
                while not member.done and member.run is not None:
                    self._turn(member)
            self._zero_the_owing()
        finally:
            self._zero_all()
            self._close_all()
            self._line.close()
        for member in self._going():
            member.wheel.failure = member.wheel.failure or "it never answered, and nothing was commanded"
        if not any(member.owes_zero for member in self._members):  # else who watches tries on
            self._oversight.over()

    def _begin(self) -> None:
        """Poll every wheel in its slot until one answers."""
        while self._going() and not self._is_going():
            if self._wait():
                return
            error = self._turn(self._next())
            if error is not None and (not self._line.is_open or self._clock.monotonic() > self._heard_by_s):
                raise error

    def _zero_all(self) -> None:
        """Zero to every wheel, before any is watched to stand down; one that was given up for now is tried too."""
        for member in self._going():
            if member.live is not None and not member.busy:
                member.slot.take_up()
                self._zero(member)

    def _zero_again(self) -> None:
        """Whoever waits in the midst of its turn for a zero to be confirmed: it is repeated in its own slot.

        Else it would wait for the turns of all others that are taken meanwhile, and theirs for the next.
        """
        for member in self._going():
            if member.busy and member.may_carry and member.slot.may_ask:
                self._zero(member)

    def _zero(self, member: _Member) -> None:
        """Zero to a wheel; an error in one must not keep it from the others."""
        if member.live is None:
            return
        try:
            member.live.zero_now()
        except Exception as error:  # noqa: BLE001
            member.wheel.logger.error("zero_failed", reason=f"{type(error).__name__}: {error}")

    def _close_all(self) -> None:
        """End the runs that are left, where something went wrong: nobody is driven on while the others stand down."""
        left = [member for member in self._going() if member.run is not None]
        for member in left:
            member.busy = True
        for member in left:
            assert member.run is not None
            try:
                member.run.close()
            except Exception as error:  # noqa: BLE001 - the others' runs must be closed as well
                member.wheel.failure = f"{type(error).__name__}: {error}"
            member.done = True

    def _zero_the_owing(self) -> None:
        """The last tries of wheels whose runs are over without a zero that was confirmed."""
        until_s = self._clock.monotonic() + _LAST_ZERO_S
        while any(member.owes_zero for member in self._members) and self._clock.monotonic() < until_s:
            member = min((one for one in self._members if one.owes_zero), key=lambda one: one.due_s)
            self._clock.sleep(member.due_s - self._clock.monotonic())
            self._turn(member)

    def _going(self) -> list[_Member]:
        return [member for member in self._members if not member.done]

    def _is_going(self) -> bool:
        """Whether a wheel that was heard has not come to its end."""
        return any(member.run is not None for member in self._going())

    def _next(self) -> _Member:
        free = [member for member in self._members if (not member.done or member.owes_zero) and not member.busy]
        return min(free, key=lambda member: member.due_s)

    def _wait(self) -> bool:
        """Wait until a wheel's turn is due; True where a stop is requested."""
        return self._stop.wait(self._next().due_s - self._clock.monotonic(), self._clock)

    def _turns_until(self, time_s: float) -> None:
        """While one wheel waits: the turns of the others that are due before a time [s]."""
        while any(not member.busy and member.due_s <= time_s for member in self._going()):
            self._zero_again()
            member = self._next()
            self._clock.sleep(member.due_s - self._clock.monotonic())
            self._turn(member)
        self._zero_again()

    def _turn(self, member: _Member) -> DriverError | None:
        """One turn of a wheel, or one question to one that was not heard yet; why it was not, where that is so."""
        member.busy = True
        try:
            if member.owes_zero:
                return self._zero_behind(member)
            if member.run is None:
                return self._knock(member)
            member.live = next(member.run)
            member.live.turn_is_over()
            assert member.live.due_s is not None
            member.due_s = member.live.due_s
            if not member.live.silent:
                member.tries = 0
        except StopIteration as end:
            member.done, member.wheel.outcome = True, end.value
            self._owes(member, confirmed=member.wheel.outcome is not None and member.wheel.outcome.zero_confirmed)
        except RwEkfError as error:
            self._failed(member, str(error))
        except Exception as error:  # noqa: BLE001 - an error in one wheel's run must not end the others'
            at = traceback.extract_tb(error.__traceback__)[-1]
            self._failed(member, f"{type(error).__name__}: {error} (line {at.lineno} of {at.name})")
        finally:
            member.busy = False
        return None

    def _failed(self, member: _Member, why: str) -> None:
        """A wheel's run has ended in an error, by way of its zero: the others' continue."""
        member.done, member.wheel.failure = True, why
        self._owes(member, confirmed=member.live is None or member.live.ended_at_zero)
        member.wheel.logger.error("wheel_failed", reason=why, others="go on" if self._going() else "have ended")

    def _owes(self, member: _Member, *, confirmed: bool) -> None:
        """A run is over. Where its zero was not confirmed the wheel gets it in its slot, while the line is ours."""
        member.owes_zero = member.wheel.configuration.command.writes and not confirmed
        member.due_s = member.slot.next_s()

    def _zero_behind(self, member: _Member) -> DriverError | None:
        """Zero once more to a wheel whose run is over."""
        member.due_s = member.slot.next_s()
        if not self._asks(member):
            return None
        try:
            driver = self._line.opener(member.index, probe=False)(None)
        except DriverError as error:
            return error
        try:
            limits = SafetyLimits.of(member.wheel.configuration.limits)
            member.owes_zero = not CurrentGuard(driver, limits, self._clock).zero(within_s=0.0)
        finally:
            driver.close()
        if not member.owes_zero:
            member.wheel.logger.warning("zero_confirmed", after="its run had ended without")
        return None

    def _knock(self, member: _Member) -> DriverError | None:
        """Poll a wheel that was not heard yet; where it answers its run begins."""
        member.due_s = member.slot.next_s()
        if self._stop.requested is not None or not self._asks(member):
            return None
        try:
            first = self._line.opener(member.index)(None)
        except DriverError as error:
            self._say_unheard(member, error)
            return error
        open_wheel = self._line.opener(member.index)
        opened: list[WheelDriver] = [first]

        def open_or_take(lost: WheelDriver | None) -> WheelDriver:
            return opened.pop() if opened else open_wheel(lost)

        wheel = member.wheel
        member.run = turns_of_run(
            Task(wheel.configuration, wheel.protocol, wheel.given, self._left_s()),
            wheel.logger,
            self._stop,
            _Meanwhile(self._clock, member.slot, self._turns_until),
            Oversight((_Watched(member, self._turned),), wheel.begin_safe),
            Place(
                open_or_take,
                lambda: self._in_silence(member),
                member.slot.next_s,
                0.0,
                wheel.name,
                resume_signal_of(member.index),
            ),
        )
        try:
            member.live = next(member.run)
        finally:
            for driver in opened:  # it has not come to taking it
                driver.close()
        assert member.live.due_s is not None
        member.due_s = member.live.due_s
        return None

    def _say_unheard(self, member: _Member, error: DriverError) -> None:
        if self._clock.monotonic() > self._heard_by_s and not member.is_unheard:
            member.is_unheard = True
            do = "the others go on; it is asked again and again, and its run begins when it answers"
            member.wheel.logger.warning("no_answer", reason=str(error), do=do)

    def _left_s(self) -> float | None:
        """How long a run that begins now may last."""
        if self._duration_s is None:
            return None
        return max(self._duration_s - (self._clock.monotonic() - self._began_s), self._members[0].slot.period_s)

    def _asks(self, member: _Member) -> bool:
        """Whether a silent wheel is polled in this period: of several one after the other."""
        if member.may_carry and 0 < member.tries < _FIRST_ZEROES:
            return True
        quiet = [other for other in self._members if other.is_quiet or other.owes_zero] or [member]
        return quiet[member.slot.number() % len(quiet)] is member

    def _in_silence(self, member: _Member) -> tuple[bool, bool]:
        """Whether a silent wheel is polled for a reading, and whether zero is written to it: one of them, in turn."""
        if member.tries == 0:
            member.tries = 1  # what it did before it fell silent is in doubt: it is not put behind those never heard
        elif not self._asks(member):
            return False, False
        else:
            member.tries += 1
        reads = member.tries % 2 == 0 or not member.wheel.configuration.command.writes
        return reads, not reads

    def _turned(self) -> None:
        """A wheel has completed a turn: when all have, who watches is notified, with the worst state."""
        running = [member for member in self._going() if member.run is not None and not member.ending]
        if all(member.turned for member in running):
            states = [member.state for member in running if member.state is not None]
            for member in running:
                member.turned = False
            self._oversight.turned(max(states, key=lambda now: _WORST_LAST.index(now.state), default=None))


@dataclass(eq=False)
class _Watched:
    """Who watches one wheel's turns, as Oversight has it: its end is not yet the end of all."""

    member: _Member
    turned_one: Callable[[], None]

    def turned(self, state: StateNow | None) -> None:
        """A turn of this wheel has been completed."""
        self.member.turned, self.member.state = True, state
        self.turned_one()

    def over(self) -> None:
        """Its loop has ended in order: nobody waits for a turn of it."""
        self.member.ending = True
        self.turned_one()


@dataclass(eq=False)
class _Meanwhile:
    """The clock of one wheel among several: while it waits, the others have their turns."""

    clock: Clock
    slot: Slot
    turns_until: Callable[[float], None]

    def monotonic(self) -> float:
        """Time since some instant [s]; never steps."""
        return self.clock.monotonic()

    def sleep(self, seconds: float, unless: int | None = None) -> None:
        """Wait, by the others' turns and then by the clock; those may take longer, and so may its own next slot."""
        end_s = self.slot.wake_s(self.clock.monotonic() + seconds)
        self.turns_until(end_s)
        self.clock.sleep(end_s - self.clock.monotonic(), unless)

    def patience_s(self, budget_s: float) -> float:
        """That of the clock."""
        return self.clock.patience_s(budget_s)

    def utc(self) -> datetime:
        """The hour of the day."""
        return self.clock.utc()
