"""The watch in the daemon's loop: alarms go to the log as they begin and end, into every tick, and to the report."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

from rw_ekf.clock import Clock
from rw_ekf.logs.metadata import after_start, utc_text
from rw_ekf.records import ActiveAlarm, Alarms, Tick
from rw_ekf.watch.alarms import Alarm
from rw_ekf.watch.wheel_watch import WatchedFilter, WatchKnobs, WheelWatch

if TYPE_CHECKING:
    from rw_ekf.filter.constants import FilterConstants
    from rw_ekf.settings.schema import Configuration

_RATE_AFTER_S = 10.0
_MOST_SENTENCES = 50  # kept for the report of a run; the log has them all


class AlarmWatch:
    """Feeds the watch and says what it finds, in hours of the day."""

    def __init__(self, watch: WheelWatch, logger: Any, clock: Clock) -> None:
        self._watch: WheelWatch | None = watch
        self._logger = logger
        self._clock = clock
        self._active: dict[str, ActiveAlarm] = {}
        self._sentences: list[str] = []
        self._more = 0
        self._began: tuple[datetime, float] | None = None  # hour and time of the first sample since the clock's start
        self._run_began: str | None = None  # UTC of the run's first sample
        self._segment = 0

    def step(self, tick: Tick) -> Alarms:
        """Let the watch take one turn; log what began, changed or ended."""
        if self._watch is None:
            return Alarms()
        sample = tick.sample
        if self._began is None or sample.segment != self._segment:  # the wheel's clock began anew, or jumped
            self._began = self._clock.utc(), sample.time_s
            self._run_began = self._run_began or utc_text(self._began[0])
        self._segment = sample.segment
        try:
            news = self._watch.step(tick)
        except (ArithmeticError, ValueError) as error:  # whoever watches must never end what is watched
            self._watch = None
            self._active.clear()
            self._logger.error("watch_failed", reason=str(error), do="the run goes on without alarms")
            return Alarms()
        stated = [self._say(alarm, sample.time_s) for alarm in news]
        over = tuple(reported for reported, alarm in zip(stated, news, strict=True) if alarm.ended_s is not None)
        left = self._watch.remaining_drag if self._active else None
        on = self._active.values()
        return Alarms(tuple(on) if left is None else tuple(_with_remaining(alarm, *left) for alarm in on), over)

    @property
    def warnings(self) -> list[str]:
        """What was reported over the run, in sentences, oldest first."""
        return [*self._sentences, f"{self._more} more alarms: see the log"] if self._more else list(self._sentences)

    def _say(self, alarm: Alarm, time_s: float) -> ActiveAlarm:
        """Log an alarm that began, changed or ended; return it as it is reported, `ended_s` among its details."""
        since = self._utc(alarm.since_s, time_s)
        before = self._active.get(alarm.name)
        if before is not None and before.since_s == alarm.since_s:
            since = before.since_utc
        entry = {"since_utc": since, "since_s": alarm.since_s, **alarm.details}
        if alarm.ended_s is None:
            sentence = alarm.sentence(self._words(since))
            reported = ActiveAlarm(alarm.name, sentence, since, alarm.since_s, alarm.details)
            self._active[alarm.name] = reported
        else:
            ended = self._utc(alarm.ended_s, time_s)
            sentence = alarm.sentence(self._words(since), self._words(ended))
            details = {**alarm.details, "ended_utc": ended, "ended_s": alarm.ended_s}
            reported = ActiveAlarm(alarm.name, sentence, since, alarm.since_s, details)
            entry |= details
            self._active.pop(alarm.name, None)
        known = {key: value for key, value in entry.items() if value is not None}
        self._logger.warning(alarm.event, text=sentence, **known)
        if len(self._sentences) < _MOST_SENTENCES:
            self._sentences.append(sentence)
        else:
            self._more += 1
        return reported

    def _words(self, utc: str) -> str:
        """A time as a person reads it: UTC, and since the run's start."""
        return f"{utc}{after_start(self._run_began, utc)}"

    def _utc(self, time_s: float, now_s: float) -> str:
        """UTC of a time of the log [s], given that it is now_s now; the wheel's clock may run at any rate."""
        now, rate = self._clock.utc(), 1.0
        if self._began is not None and now_s - self._began[1] > _RATE_AFTER_S:
            rate = (now - self._began[0]).total_seconds() / (now_s - self._began[1])
        return f"{now - timedelta(seconds=rate * (now_s - time_s)):%Y-%m-%dT%H:%M:%SZ}"


def _with_remaining(alarm: ActiveAlarm, drag_rad_s2: float, std_rad_s2: float) -> ActiveAlarm:
    if "amplitude_rad_s2" not in alarm.details:
        return alarm
    left = {"remaining_rad_s2": drag_rad_s2, "remaining_std_rad_s2": std_rad_s2}
    return replace(alarm, details={**alarm.details, **left})


def alarm_watch_of(
    configuration: Configuration, constants: FilterConstants, inertia_kg_m2: float | None, logger: Any, clock: Clock
) -> AlarmWatch | None:
    """Return the watch that a configuration requests; None where it is switched off."""
    section = configuration.watch
    if not section.enabled:
        return None
    about = WatchedFilter(
        constants.speed_variance,
        constants.acceleration_density,
        constants.stribeck.omega_s,
        1.0 / configuration.loop.rate_hz,
        inertia_kg_m2,
    )
    knobs = WatchKnobs(section.false_alarms_per_1000_h, section.window_s, section.smallest_spike_percent)
    return AlarmWatch(WheelWatch(about, knobs), logger, clock)
