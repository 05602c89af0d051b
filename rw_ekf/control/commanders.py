"""What current is requested after each sample: a profile of time, or a recorded current repeated."""

from __future__ import annotations

import bisect
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rw_ekf.control.confirming_move import ConfirmingMove
from rw_ekf.control.from_rest import FromRest
from rw_ekf.control.profiles.make_profile import Profile, make_profile
from rw_ekf.records import Controller, Tick, WheelSample

if TYPE_CHECKING:
    from rw_ekf.settings.schema import CommandSection

Phase = Callable[[float], str]


class ProfileController:
    """Current of a profile at the sample's time since the first sample; continues through restarts of the wheel."""

    def __init__(self, profile: Profile) -> None:
        self.profile = profile
        self._elapsed_s = 0.0
        self._last: WheelSample | None = None

    def __call__(self, tick: Tick) -> float:
        """Return the current [A] to request after this tick's sample."""
        sample = tick.sample
        if self._last is not None and sample.segment == self._last.segment:
            self._elapsed_s += max(sample.time_s - self._last.time_s, 0.0)
        self._last = sample
        return self.profile.current_A(self._elapsed_s)


@dataclass(frozen=True)
class Commander:
    """What is requested, for how long, and what it is at: a profile, behind a small move or a brake where due."""

    controller: Controller
    profile: Profile
    move: ConfirmingMove | None = None
    rest: FromRest | None = None  # after the move

    def lasts_s(self) -> float | None:
        """How long it lasts [s], as far as is known by now; None: for ever."""
        if self.profile.duration_s is None:
            return None
        before = [stage.longest_s if stage.active else stage.lasted_s for stage in self._before]
        return self.profile.duration_s + sum(before)

    @property
    def _before(self) -> list[ConfirmingMove | FromRest]:
        return [stage for stage in (self.move, self.rest) if stage is not None]

    def phase(self, time_s: float) -> str:
        """What it is at, by its time [s]."""
        for stage in self._before:
            if stage.active or time_s < stage.lasted_s:
                return stage.phase
            time_s -= stage.lasted_s
        return self.profile.name if self.profile.phase is None else self.profile.phase(time_s)


def commander_of(command: CommandSection) -> Commander:
    """Return what a configuration requests, without a move before it.

    Profile `none` does not come here: a run that never writes has no commander.
    """
    profile = profile_of(command)
    return Commander(ProfileController(profile), profile)


def profile_of(command: CommandSection) -> Profile:
    """Return the profile that a configuration names; `log` reads the log and repeats its current."""
    if command.profile == "log":
        assert command.log is not None
        return logged_profile(command.log)
    return make_profile(
        command.profile,
        amplitude_A=command.amplitude_A,
        period_s=command.period_s,
        bias_A=command.bias_A,
        seed=command.seed,
    )


def logged_profile(path: str) -> Profile:
    """Return the current of a log as a profile: each value holds from its own time to the next."""
    from rw_ekf.logs.reader import read_log

    log = read_log(path)
    times: list[float] = []
    elapsed = 0.0
    for i in range(len(log)):
        if i > 0 and log.segment[i] == log.segment[i - 1]:
            elapsed += float(log.time_s[i] - log.time_s[i - 1])
        times.append(elapsed)
    currents = [float(v) for v in log.current_A]

    def law(time_s: float) -> float:
        return currents[max(bisect.bisect_right(times, time_s) - 1, 0)]

    return Profile(f"log {path}", times[-1] if times else 0.0, law)
