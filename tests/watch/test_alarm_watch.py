"""What the daemon says of the watch: hour of the day, state file, report; and that it never ends a run."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest

from rw_ekf.clock import VirtualClock
from rw_ekf.live.alarm_watch import AlarmWatch
from rw_ekf.records import ActiveAlarm, Alarms, Tick, WheelSample
from rw_ekf.watch.alarms import DRAG_SPIKE, RESIDUAL, Alarm
from rw_ekf.watch.wheel_watch import WheelWatch
from tests.live.daemon import Notes
from tests.ticks import tick_of
from tools.measure.watch_runs import OMEGA_S, commands, drawn_wheel, filtered, simulated, stream, watch_of

NOON = datetime(2024, 5, 17, 12, 0, tzinfo=UTC)


class Reported(WheelWatch):
    """A watch that says what it is told to."""

    def __init__(self, *news: Alarm | Exception | None) -> None:
        self._news = list(news)

    def step(self, tick: Tick) -> list[Alarm]:
        item = self._news.pop(0)
        if isinstance(item, Exception):
            raise item
        return [] if item is None else [item]

    @property
    def remaining_drag(self) -> tuple[float, float] | None:
        return 0.1, 0.01


def spike(ended_s: float | None = None) -> Alarm:
    details: dict[str, Any] = {
        "amplitude_rad_s2": 0.3, "std_rad_s2": 0.02, "amplitude_mNm": 0.45, "std_mNm": 0.03, "bound": None,
    }  # fmt: skip
    if ended_s is not None:
        details |= {"decay_s": 61.0, "end": "faded"}
    return Alarm(DRAG_SPIKE, 95.0, details, ended_s)


def residual() -> Alarm:
    return Alarm(RESIDUAL, 60.0, {"largest_dependence": "temperature", "deviation": 7.0, "after": None})


def fed(*news: Alarm | Exception) -> tuple[AlarmWatch, Notes, tuple[ActiveAlarm, ...]]:
    """The watch, what it logged, and the alarms that are on at the end."""
    notes = Notes()
    active: tuple[ActiveAlarm, ...] = ()
    watch = AlarmWatch(Reported(*news), notes, VirtualClock(NOON))
    for _ in news:
        active = watch.step(tick_of(WheelSample(100.0, 1.0))).on
    return watch, notes, active


def test_times_of_the_log_become_hours_of_the_day() -> None:
    """An onset 5 s before a sample that comes at noon was at 11:59:55; nothing undefined is logged."""
    _, notes, _ = fed(spike())
    (event, fields) = notes.stated[0]
    assert event == "drag_spike"
    assert fields["since_utc"].startswith("2024-05-17T11:59:55")
    assert fields["since_s"] == 95.0
    assert fields["amplitude_mNm"] == 0.45
    assert "bound" not in fields
    assert "0.45 mNm" in fields["text"]


def test_a_wheel_six_times_as_fast_was_disturbed_after_the_run_began() -> None:
    """A simulated wheel's clock may run faster than the day's: 60 s of it ago are 10 s of ours."""
    notes, clock = Notes(), VirtualClock(NOON)
    watch = AlarmWatch(Reported(None, replace(residual(), since_s=540.0)), notes, clock)
    for time_s in (0.0, 600.0):
        watch.step(tick_of(WheelSample(time_s, 1.0)))
        clock.sleep(100.0)
    assert notes.stated[0][1]["since_utc"] == "2024-05-17T12:01:30Z"


def test_an_alarm_is_told_in_utc_and_since_the_run_s_start() -> None:
    """The sentence has both, of the beginning and of the end, also where the wheel's clock began anew in between."""
    notes, clock = Notes(), VirtualClock(NOON)
    news = (None, None, replace(residual(), since_s=30.0), replace(residual(), since_s=30.0, ended_s=55.0))
    watch = AlarmWatch(Reported(*news), notes, clock)
    for time_s, segment in ((0.0, 0), (0.0, 1), (40.0, 1), (60.0, 1)):
        watch.step(tick_of(WheelSample(time_s, 1.0, segment=segment)))
        clock.sleep(40.0 if time_s == 0.0 else 20.0)
    begun, over = (fields["text"] for _, fields in notes.stated)
    assert "not noise since 2024-05-17T12:01:10Z (70.0 s after the run's start), largest" in begun
    assert "noise again since 2024-05-17T12:01:35Z (95.0 s after the run's start) (it was not since" in over


def test_the_issue_s_sentence() -> None:
    """The alarm reads as it was asked for."""
    watch, notes, _ = fed(residual())
    assert "residual is not noise since 2024-05-17T11:59:20" in notes.stated[0][1]["text"]
    assert notes.stated[0][1]["text"].endswith("largest dependence: temperature")
    assert watch.warnings == [notes.stated[0][1]["text"]]


def test_active_alarms_are_published_until_they_end() -> None:
    """The state file's list has the alarm with what is left of the drag, is JSON, and is empty after the end."""
    _, _, (alarm,) = fed(spike())
    entry = alarm.document()
    assert entry["name"] == DRAG_SPIKE
    assert entry["remaining_rad_s2"] == 0.1
    assert json.loads(json.dumps(entry, allow_nan=False)) == entry
    watch, notes, active = fed(spike(), spike(ended_s=98.0))
    assert active == ()
    assert notes.events == ["drag_spike", "drag_spike_over"]
    assert notes.stated[1][1]["ended_utc"].startswith("2024-05-17T11:59:58")
    assert notes.stated[1][1]["since_utc"] == notes.stated[0][1]["since_utc"]
    assert len(watch.warnings) == 2


def test_what_ended_is_told_once_with_all_that_was_found() -> None:
    """The turn in which a spike ends has its decay, reason and end; in a train the next one is on in the same turn."""

    class Train(Reported):
        def step(self, tick: Tick) -> list[Alarm]:
            return [spike(ended_s=98.0), replace(spike(), since_s=98.0)] if self._news.pop(0) is None else [spike()]

    watch = AlarmWatch(Train(spike(), None), Notes(), VirtualClock(NOON))
    assert watch.step(tick_of(WheelSample(100.0, 1.0))).over == ()
    on, over = watch.step(tick_of(WheelSample(100.1, 1.0)))
    assert [alarm.since_s for alarm in on] == [98.0]
    (ended,) = over
    assert (ended.since_s, ended.details["ended_s"], ended.details["decay_s"]) == (95.0, 98.0, 61.0)
    assert ended.details["end"] == "faded"


def test_a_broken_watch_does_not_end_the_run() -> None:
    """An arithmetic error within the watch is reported once; the samples go on without alarms."""
    watch, notes, active = fed(residual(), ZeroDivisionError("float division by zero"))
    assert notes.events == ["residual_not_noise", "watch_failed"]
    assert active == ()
    assert watch.step(tick_of(WheelSample(101.0, 1.0))) == Alarms()


def test_the_report_stays_short() -> None:
    """A hundred alarms give fifty sentences and a count."""
    watch, _, _ = fed(*[spike() for _ in range(100)])
    assert len(watch.warnings) == 51
    assert watch.warnings[-1].startswith("50 more")


@pytest.mark.parametrize("segment_s", [150.0])
def test_a_restarted_clock_raises_nothing(segment_s: float) -> None:
    """A wheel whose clock begins anew in mid-run, speed seeded afresh: no alarm."""
    time_s, current_A = commands("P2", 0.1, 4)
    run = simulated(drawn_wheel(4, 0.3), time_s, current_A, 4)
    constants, done = filtered(run)
    watch = watch_of(constants)
    assert constants.stribeck.omega_s == OMEGA_S
    stated = []
    for tick in stream(run, constants, done):
        sample = tick.sample
        if sample.time_s >= segment_s:
            late = WheelSample(
                sample.time_s - segment_s, sample.speed_rad_s, temperature_degC=sample.temperature_degC, segment=1
            )
            stated += watch.step(replace(tick, sample=late))
        else:
            stated += watch.step(tick)
    assert stated == []
