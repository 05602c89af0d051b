"""What a reading is worth before anybody believes it: what the wheel says of itself, who answers, is it stuck.

No clock is read here, and nothing is written: the live loop calls this, and the guard holds zero while `hold` says why.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from rw_ekf.records import (
    CONDITIONS_THAT_STOP,
    CURRENT_LIMITED,
    FAULT,
    OTHER_MODE,
    OVER_TEMPERATURE,
    Estimate,
    IssuedCommand,
    Outcome,
    WheelIdentity,
    WheelSample,
)
from rw_ekf.units import rpm_from_rad_s

if TYPE_CHECKING:
    from rw_ekf.watch.current_watch import CurrentWatch
    from rw_ekf.watch.stuck_watch import ParameterBelief, StuckWatch

Note = Callable[..., None]

_SENTENCES = {
    FAULT: "the wheel reported a fault (status register)",
    OVER_TEMPERATURE: "the wheel reported over-temperature (status register)",
    CURRENT_LIMITED: "the wheel reported that it limits the current: what flowed may be less than what was commanded",
    OTHER_MODE: (
        "the wheel's mode is not the one in which it takes currents (status register): something else commands it, and "
        "what was written is not what drives it"
    ),
}
_RESTARTS, _AMONG_READINGS = 3, 600  # a brown-out loop: a minute at 10 Hz
STUCK = "telemetry_stuck"
IDENTITY_UNKNOWN = "identity_unknown"


class TelemetryCheck:
    """Judges every reading of one run, reports events as they come, and keeps what the run's document must say."""

    def __init__(
        self,
        note: Note,
        stuck: Sequence[StuckWatch] = (),
        belief: Callable[[], ParameterBelief] | None = None,
        current: CurrentWatch | None = None,
        confirmed: Callable[[], bool] = lambda: True,
        *,
        writes: bool,
    ) -> None:
        """stuck, belief: the tests by the model, and what the estimator believes at present; none: no such test.

        current: the test of what flows. confirmed: whether size and sign of the gain are known: until then a reading
        that hardly moves is the small move's to judge. writes: whether this run commands the wheel at all.
        """
        self._writes = writes
        self._note = note
        self._stuck = stuck if belief is not None else ()
        self._current = current
        self._confirmed = confirmed
        self._restarts: deque[bool] = deque(maxlen=_AMONG_READINGS)
        self.current_fault: str | None = None  # what is wrong with the current at present, in words
        self.doubt: str | None = None  # why nothing of this run may be kept as learned
        self._belief = belief
        self._at_start: WheelIdentity | None = None
        self._asking = False
        self._conditions: frozenset[str] = frozenset()
        self._last: WheelSample | None = None
        self._in_force_A: float | None = None
        self._following: IssuedCommand | None = None
        # Length [s] and mean current [A] of the interval that ends with the sample judged last; None: not known.
        self.interval: tuple[float, float] | None = None
        self._speed_rad_s: float | None = None  # believed after the last sample
        self._sentences: dict[str, tuple[str, int]] = {}
        self.hold: str | None = None  # why nothing but zero may be written
        self.other_wheel: str | None = None  # the sentence, where another wheel answers than at the start

    @property
    def findings(self) -> list[str]:
        """What was found over the run, each once, oldest first, with how often."""
        return [text if times == 1 else f"{text} ({times} times)" for text, times in self._sentences.values()]

    def found(self, event: str, text: str) -> None:
        """Note a finding for the run's document; the first sentence of an event stands, and how often it came."""
        stated, times = self._sentences.get(event, (text, 0))
        self._sentences[event] = stated, times + 1

    def attached(self, identity: WheelIdentity | None) -> None:
        """Keep who answered at the start."""
        self._at_start = identity

    def commanded(self, command: IssuedCommand) -> None:
        """Note the command that follows the sample judged last."""
        self._following = command
        if self._current is not None:
            self._current.commanded(command)

    @property
    def restarts_again(self) -> str | None:
        """That the wheel restarts again and again, in words."""
        times = sum(self._restarts)
        return (
            f"the wheel restarted {times} times within a minute: is its supply too weak?"
            if times >= _RESTARTS
            else None
        )

    def estimated(self, estimate: Estimate) -> None:
        """Note what the estimator made of the sample judged last; only an augmented model says more than its belief."""
        interval, self.interval = self.interval, None
        before, self._speed_rad_s = self._speed_rad_s, estimate.state.speed_rad_s
        if not self._stuck or not estimate.effects or interval is None or before is None:
            return
        if estimate.outcome in (Outcome.UPDATED, Outcome.MISSING, Outcome.GATED):
            for watch in self._stuck:
                watch.note_prediction(before, interval[1], estimate.predicted_speed_rad_s, interval[0])

    def judge(self, sample: WheelSample, identity: WheelIdentity | None) -> tuple[WheelSample, bool]:
        """Return the sample as it may be used, and whether readings have just come back to life.

        A reading that the model shows to be no measurement loses its speed. identity: who answers now; None: the driver
        is still querying.
        """
        restarted = sample.news is not None and sample.news[0] == "wheel_restarted"
        self._restarts.append(restarted)
        if sample.news is not None:
            event, text = sample.news
            self.say(event, text)
        self._note_conditions(sample.conditions)
        self._note_identity(identity)
        self._weigh_current(sample, restarted=restarted)
        apart = False
        self.interval = None
        if self._stuck and sample.speed_rad_s is not None:
            sample, apart = self._weigh(sample, sample.speed_rad_s)
        self._last = sample
        self.hold = self._reason()
        return sample, apart

    def _weigh_current(self, sample: WheelSample, *, restarted: bool) -> None:
        """Note whether the current that flows is another than the one written."""
        if self._current is None:
            return
        if restarted:
            self._current.forget()
        self._current.add(sample)
        fault = self._current.fault
        if fault is None:
            if self.current_fault is not None:
                self._note("current_as_commanded", text="the current is again as it was commanded")
            self.current_fault = None
            return
        event, text = fault
        if self.current_fault is None:
            self.say(event, text)
        self.current_fault = self.doubt = text

    def _reason(self) -> str | None:
        for condition in CONDITIONS_THAT_STOP:
            if condition in self._conditions:
                return f"wheel_{condition}"
        if any(watch.stuck for watch in self._stuck):
            return STUCK
        return IDENTITY_UNKNOWN if self._asking else None

    def say(self, event: str, text: str) -> None:
        """Tell an event as it comes, and keep its sentence for the run's document."""
        self._note(event, text=text)
        self.found(event, text)

    def _note_conditions(self, conditions: frozenset[str]) -> None:
        if conditions == self._conditions:
            return
        if OTHER_MODE in conditions:
            self.doubt = _SENTENCES[OTHER_MODE]
        for name in sorted(conditions - self._conditions):
            zero = self._writes and name in CONDITIONS_THAT_STOP
            self.say(f"wheel_{name}", _SENTENCES[name] + (": zero was written while it did" if zero else ""))
        for name in sorted(self._conditions - conditions):
            self._note(f"wheel_{name}_over")
        self._conditions = conditions

    def _note_identity(self, identity: WheelIdentity | None) -> None:
        """Compare who answers with who answered at the start; a wheel without a serial number is never another one."""
        at_start = self._at_start
        if at_start is None or at_start.serial_number is None:
            return
        if identity is None:
            if not self._asking:
                doing = "holding zero" if self._writes else "waiting"
                self._note(IDENTITY_UNKNOWN, doing=f"{doing} until the wheel says which one it is")
            self._asking = True
            return
        self._asking = False
        if identity.serial_number != at_start.serial_number or identity.kind != at_start.kind:
            text = (
                f"another wheel answers on this port: serial number {identity.serial_number}, not "
                f"{at_start.serial_number} as at the start. {'Zero was written and the' if self._writes else 'The'} "
                "run ended, because its estimates are the first wheel's: start a run of its own for this wheel"
            )
            self.say("another_wheel", text)
            self.other_wheel = text

    def _weigh(self, sample: WheelSample, speed_rad_s: float) -> tuple[WheelSample, bool]:
        assert self._belief is not None
        last = self._last
        if last is not None and sample.segment != last.segment:
            for watch in self._stuck:
                watch.forget()
            self._in_force_A = None
        dt_s = 0.0 if last is None else sample.time_s - last.time_s
        current_A = self._mean_current(sample, dt_s)
        self.interval = None if current_A is None else (dt_s, current_A)
        used, alive, was_stuck = True, False, any(watch.stuck for watch in self._stuck)
        for watch in self._stuck:
            if watch.hums and not self._confirmed():
                watch.forget()
            judged = watch.add(sample.time_s, speed_rad_s, current_A, self._belief)
            used, alive = used and judged.used, alive or judged.news == "alive"
            if judged.news == "stuck" and not was_stuck:
                was_stuck = True
                doing = "Zero is written until it moves again. " if self._writes else ""
                self.say(
                    STUCK,
                    f"the speed reading is stuck: it has read {rpm_from_rad_s(watch.value_rad_s):.6g} rpm for "
                    f"{watch.repeated_s:.2g} s, in which {_must_have_moved(watch)}. {doing}"
                    "(Or the wheel itself is held fast: look at it.)",
                )
        alive = alive and not any(watch.stuck for watch in self._stuck)
        if alive:
            self._note("telemetry_alive", text="the speed reading moves again as the wheel does")
        return (sample if used else replace(sample, speed_rad_s=None)), alive

    def _mean_current(self, sample: WheelSample, dt_s: float) -> float | None:
        """Mean current [A] over the interval that ends with this sample; None where it is not known."""
        following, self._following = self._following, None
        before = self._in_force_A
        if following is None:  # nothing was written, or this run never writes
            current = sample.current_command_A if sample.current_command_A is not None else sample.current_A
            return before if before is not None else current
        if not following.acknowledged:
            self._in_force_A = None
            return None
        self._in_force_A = following.current_A
        if before is None or dt_s <= 0.0:
            return None
        late = min(max(following.delay_s, 0.0) / dt_s, 1.0)
        return late * before + (1.0 - late) * following.current_A


def _must_have_moved(watch: StuckWatch) -> str:
    moved_rpm = rpm_from_rad_s(watch.moved_rad_s)
    if moved_rpm > 0.0:
        return f"the wheel must have changed its speed by {moved_rpm:.2g} rpm at least"
    return f"any wheel that did not move is {watch.distance:.2g} standard deviations from what is known of this one"
