"""Each part of the daemon raises in the middle of a run: zero and an end that nobody overlooks, or the run goes on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.commands.run_report import exit_status
from rw_ekf.control.commanders import ProfileController
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.filter.estimator import Estimator
from rw_ekf.live.alarm_watch import AlarmWatch
from rw_ekf.live.guard import CurrentGuard
from rw_ekf.live.run_judge import RunJudge
from rw_ekf.live.sign_check import SignCheck
from rw_ekf.live.telemetry import TelemetryCheck
from rw_ekf.sinks.all_sinks import StatisticsSink
from rw_ekf.sinks.events import EventsSink
from rw_ekf.sinks.learned_sink import LearnedSink
from rw_ekf.sinks.log import LogSink
from rw_ekf.sinks.recent import RecentSink
from rw_ekf.sinks.state_file import StateFileSink
from rw_ekf.sinks.status_line import StatusLine
from tests.faults.rig import LineWheel
from tests.faults.supervised import running
from tests.live.bench import Bench
from tests.live.daemon import Notes

FATAL = {
    "driver": (SerialWheel, "read"),
    "telemetry check": (TelemetryCheck, "judge"),
    "estimator": (Estimator, "step"),
    "judge": (RunJudge, "judge"),
    "controller": (ProfileController, "__call__"),
    "guard": (CurrentGuard, "write"),
    "sign": (SignCheck, "step"),
    "watch": (AlarmWatch, "step"),
}
SINKS = (LogSink, StatisticsSink, RecentSink, StateFileSink, EventsSink, LearnedSink, StatusLine)
AT_TURN = 15
AT_ONCE = {"profile": "sine", "amplitude_A": 0.1, "period_s": 4.0, "bias_A": 0.05, "confirm_sign": False}


def raising(good: Callable[..., Any], armed: Callable[[], bool]) -> Callable[..., Any]:
    """A method that works some turns long, and raises at the next call once it is armed."""
    turns = 0

    def method(*arguments: Any, **named: Any) -> Any:
        nonlocal turns
        turns += 1
        if turns >= AT_TURN and armed():
            raise RuntimeError("sabotage")
        return good(*arguments, **named)

    return method


@pytest.mark.parametrize("part", FATAL)
def test_a_part_that_raises_leaves_the_wheel_at_zero(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    """Row 25: raised while the wheel is driven: zero is commanded, nothing is swallowed; the next run tracks."""
    owner, name = FATAL[part]
    notes, wheel = Notes(), LineWheel(tmp_path, speed_rad_s=20.0)
    with monkeypatch.context() as patch:
        patch.setattr(owner, name, raising(getattr(owner, name), wheel.is_driven))
        with pytest.raises(RuntimeError, match="sabotage"):
            wheel.run(60.0, notes=notes, command=AT_ONCE)
    assert any(abs(value) > 0.01 for value in wheel.written_A)
    assert wheel.written_A[-1] == 0.0
    assert "zero_not_confirmed" not in notes.events
    again = wheel.run(1.0, command=AT_ONCE)
    assert "TRACKING" in again.notes.states
    assert exit_status(again.outcome) == 0


@pytest.mark.parametrize("sink", SINKS, ids=lambda sink: sink.__name__)
def test_a_sink_that_raises_does_not_end_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sink: type) -> None:
    """Row 25: the wheel is driven on, it is said once and counted, and the exit status is 1; the next run is whole."""
    wheel = LineWheel(tmp_path, speed_rad_s=20.0)
    with monkeypatch.context() as patch:
        patch.setattr(sink, "write", raising(sink.write, lambda: True) if sink not in SLOW else _raise)  # type: ignore[attr-defined]
        ran = wheel.run(3.0, command=AT_ONCE)
    assert ran.notes.events.count("sink_failed") == 1
    assert sum(ran.outcome.unwritten.failed_sinks.values()) >= 1
    assert ran.outcome.state.state.value == "TRACKING"
    assert ran.outcome.zero_confirmed
    assert exit_status(ran.outcome) == 1
    assert exit_status(wheel.run(1.0, command=AT_ONCE).outcome) == 0


SLOW = (StateFileSink, LearnedSink)  # they get a tick now and then


def _raise(*_: Any) -> None:
    raise RuntimeError("sabotage")


def test_the_process_ends_non_zero_after_zero(bench: Bench) -> None:
    """Row 25: of an estimator that raises in a process of its own: status 1, a traceback, zero; then TRACKING."""
    sabotage = (
        "import rw_ekf.live.daemon as d\n"
        "good, turns = d.Estimator.step, 0\n"
        "def bad(self, sample):\n"
        "    global turns\n"
        "    turns += 1\n"
        "    if turns > 20: raise RuntimeError('sabotage')\n"
        "    return good(self, sample)\n"
        "d.Estimator.step = bad\n"
    )
    with running(bench, sabotage=sabotage) as crashed:
        assert crashed.ended() == 1
        assert crashed.text().count("RuntimeError: sabotage") == 1
        assert crashed.published()["ended_utc"] is None, "it has not ended in order"
    assert any(abs(value) > 0.01 for value in bench.recorder.writes_A())
    assert bench.registers.command_A == 0.0
    with running(bench) as again:
        assert again.child() == again.pid
