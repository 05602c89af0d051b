"""The events of a run: each alarm has a line where it begins and one where it ends, with what was found of it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from rw_ekf.clock import VirtualClock
from rw_ekf.records import ActiveAlarm, RunState, StateNow, WheelSample
from rw_ekf.sinks.events import EventsSink
from tests.ticks import tick_of

BEGAN = StateNow(RunState.CONNECTING, "2024-05-17T12:00:00.000000Z", "the line was opened")


def alarm(since_s: float, **details: float | str | None) -> ActiveAlarm:
    """A spike."""
    return ActiveAlarm("drag_spike", "drag spike", "2024-05-17T12:00:00Z", since_s, {"amplitude_mNm": 0.5, **details})


def test_a_train_of_spikes_has_a_line_for_each_beginning_and_end(tmp_path: Path) -> None:
    """One spike gives way to the next in one turn: its end, with the decay, comes before the next one's beginning."""
    clock = VirtualClock()
    sink = EventsSink(tmp_path / "events.jsonl", clock, BEGAN)
    first, second = alarm(1.0), alarm(5.0)
    over = alarm(1.0, decay_s=3.0, end="another one set in", ended_s=5.0)
    tick = replace(tick_of(WheelSample(2.0, 1.0)), host_s=2.5)
    clock.sleep(4.0)  # turns come late
    sink.write(replace(tick, alarms=(first,)))
    sink.write(replace(tick, alarms=(replace(first, details={"amplitude_mNm": 0.5, "remaining_rad_s2": 0.2}),)))
    sink.write(replace(tick, alarms=(second,), alarms_over=(over,)))
    sink.write(replace(tick, alarms=(second,)))
    sink.write(tick)  # the watch has failed: nothing is known of the end
    sink.close()
    events: list[dict[str, Any]] = [json.loads(line) for line in (tmp_path / "events.jsonl").read_text().splitlines()]
    assert [event["event"] for event in events] == ["state", "alarm", "alarm_over", "alarm", "alarm_over", "ended"]
    assert [events[i]["since_s"] for i in (1, 2, 3)] == [1.0, 1.0, 5.0]
    assert (events[2]["decay_s"], events[2]["end"]) == (3.0, "another one set in")
    assert events[4]["name"] == "drag_spike"
    assert (events[0]["time_s"], events[-1]["time_s"]) == (None, tick.estimate.time_s)
    assert [event["run_s"] for event in events] == [0.0, *[2.5] * 5]
