"""Ten minutes of motion that show everything, within the limits, by the daemon's own loop and into a log of its own."""

from __future__ import annotations

from typing import Any

from rw_ekf.clock import Clock
from rw_ekf.commissioning.dialogue import RefusedError, Stopped
from rw_ekf.commissioning.guarded_wheel import not_confirmed
from rw_ekf.commissioning.setting import SLEW_PER_LIMIT, write_configuration
from rw_ekf.commissioning.step_context import Work
from rw_ekf.control.commanders import Commander, ProfileController
from rw_ekf.control.profiles.identification import law_for, sizes_of
from rw_ekf.control.profiles.make_profile import Profile
from rw_ekf.errors import DriverError
from rw_ekf.learning.run_start import GivenModel
from rw_ekf.live.daemon import Task, run_daemon
from rw_ekf.live.oversight import Oversight
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.records import Controller, RunState, StateNow, Tick
from rw_ekf.settings.load import load_configuration
from rw_ekf.units import rpm_from_rad_s

_MOST_SHARE = 0.95  # of the current limit: the guard clamps nothing
_FASTEST_SHARE = 0.6  # of the speed limit, that coast-downs begin at
_HELD_SHARE = 0.8  # of it, above which no current that makes the wheel faster is requested
_SLEW_SHARE = 0.8
_WAITS_S = 10.0  # for a line that is lost, or for zero to be over
DIRECTORY = "identification"


def identify(work: Work) -> dict[str, Any]:
    """Drive the wheel and log it. Raises Stopped, RefusedError with what the run found, DriverError for a lost line."""
    path = write_configuration(work.progress)
    configuration = load_configuration(path)
    output = configuration.output.model_copy(update={"directory": str(work.progress.directory / DIRECTORY)})
    command = configuration.command.model_copy(update={"profile": "identification"})
    filter_ = configuration.filter.model_copy(update={"speed_noise_rpm": _noise_rpm(work)})
    configuration = configuration.model_copy(update={"output": output, "command": command, "filter": filter_})
    commander = commander_within(work)
    began_s = work.clock.monotonic()
    try:
        outcome = run_daemon(
            Task(configuration, work.spoken(configuration), GivenModel(fresh=True), planned=commander),
            work.logger,
            work.stop,
            work.clock,
            Oversight((_Impatience(work.stop, work.clock),)),
        )
    finally:
        work.progress.spent(work.clock.monotonic() - began_s)
    if outcome.lost:
        zero = "" if outcome.zero_confirmed else f": {not_confirmed(path)}"
        raise DriverError(
            f"the wheel stopped answering during the identification; zero was tried{zero}. Look at supply and cable, "
            "then start again: what was found until here is kept"
        )
    if not outcome.zero_confirmed:
        raise DriverError(not_confirmed(path))
    if outcome.halted is not None:
        raise RefusedError(outcome.halted)
    if outcome.state.state is RunState.SAFE:
        raise RefusedError(f"the identification was held at zero: {outcome.state.reason}")
    if outcome.stopped_by is not None:
        raise Stopped
    if outcome.unwritten.log_rows:
        raise RefusedError(f"the log of the identification has gaps: {outcome.unwritten.text()}")
    text = f"{outcome.statistics.samples} samples in {outcome.statistics.duration_s:.0f} s: {outcome.files.log}"
    work.dialogue.say("identification", text)
    return {
        "log": str(outcome.files.log.absolute()),
        "samples": outcome.statistics.samples,
        "duration_s": outcome.statistics.duration_s,
        "alarms": list(outcome.alarms),
        "findings": list(outcome.findings),
    }


def commander_within(work: Work) -> Commander:
    """The profile by currents of this wheel; none that would drive it on near the speed limit."""
    sign, limit_A = work.progress["sign"], work.progress["limits"]["current_A"]
    limit_rad_s = work.speed_limit_rad_s
    sizes = sizes_of(sign["motor_gain"], sign["coulomb"], _MOST_SHARE * limit_A, _FASTEST_SHARE * limit_rad_s)
    law, phase = law_for(sizes, _SLEW_SHARE * SLEW_PER_LIMIT * limit_A)
    profile = Profile("identification", law.duration_s, law.current_A, phase)
    return Commander(_held(ProfileController(profile), _HELD_SHARE * limit_rad_s), profile)


def _noise_rpm(work: Work) -> float:
    """What a reading may be off for a filter that knows of no delay yet: it must not refuse this wheel's motion."""
    delay, sign = work.progress["delay"], work.progress["sign"]
    late_s = 1e-3 * abs(delay["beyond_line_ms"] or 0.0)
    by_delay_rpm = rpm_from_rad_s(late_s * sign["motor_gain"] * work.progress["limits"]["current_A"])
    return max(rpm_from_rad_s(work.still.noise_rad_s), delay["noise_moving_rpm"] or 0.0, by_delay_rpm)


class _Impatience:
    """Ends a run that no longer drives the wheel: a daemon waits for a person or a cable, a commissioning does not."""

    def __init__(self, stop: StopSignal, clock: Clock) -> None:
        self._stop = stop
        self._clock = clock
        self._since_s: float | None = None

    def turned(self, state: StateNow | None) -> None:
        """A turn has been completed."""
        if state is None or state.state not in (RunState.LOST, RunState.SAFE):
            self._since_s = None
            return
        now_s = self._clock.monotonic()
        self._since_s = now_s if self._since_s is None else self._since_s
        if now_s - self._since_s > _WAITS_S:
            self._stop.request(state.reason)

    def over(self) -> None:
        """Nothing to be reported."""


def _held(wanted: Controller, fast_rad_s: float) -> Controller:
    """A controller that requests nothing that would make a fast wheel faster."""

    def held_A(tick: Tick) -> float:
        current_A, speed = wanted(tick), tick.sample.speed_rad_s or 0.0
        return 0.0 if abs(speed) > fast_rad_s and current_A * speed > 0.0 else current_A

    return held_A
