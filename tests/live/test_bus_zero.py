"""On a line of four wheels every one of them gets its zero, whatever becomes of the run of another."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.filter.estimator import Estimator
from rw_ekf.live.live_wheel import LiveWheel
from rw_ekf.live.oversight import Oversight
from rw_ekf.live.published_state import safe_before
from rw_ekf.live.supervisor import Patience
from rw_ekf.records import StateNow
from tests.live.bus import FAMILIES, NAMES, PERIOD_S, BusBench, make_bus, run_bus

EACH_FAMILY = pytest.mark.parametrize("family", FAMILIES)
_DRIVEN = {"bias_A": 0.2, "amplitude_A": 0.05}


class _Watcher:
    """Who watches a bus: its last word."""

    def __init__(self) -> None:
        self.is_over = False

    def turned(self, state: StateNow | None) -> None:
        """A turn."""
        self.is_over = False

    def over(self) -> None:
        """The end, in order."""
        self.is_over = True


def _deaf(bench: BusBench, name: str, from_s: float, to_s: float, *, to_us: bool = False) -> None:
    """A wheel hears nothing for a while; to_us: it hears, and is not heard."""
    electronics = bench[name].electronics
    honest = electronics.handle

    def handle(received: bytes, time_s: float) -> Any:
        if not from_s <= time_s < to_s:
            return honest(received, time_s)
        if to_us:
            honest(received, time_s)
        return []

    electronics.handle = handle  # type: ignore[method-assign]


def _zero_after(bench: BusBench, name: str, time_s: float) -> float:
    """How long after a time a wheel carried something [s]."""
    written = bench[name].written
    last = max((at for at, current in written if current != 0.0), default=0.0)
    return next(at for at, current in written if current == 0.0 and at > last) - time_s


@EACH_FAMILY
def test_a_reply_lost_just_before_a_stop_costs_no_more_than_a_period(family: str, tmp_path: Path) -> None:
    """The wheel was given up for its turn; its zero does not wait for the others to stand down (it took a second)."""
    bench = make_bus(tmp_path, "nowhere", family, "echo", command=_DRIVEN)
    _deaf(bench, "rw-x", 19.9, 19.95, to_us=True)
    run_bus(bench, None, (19.97, lambda stop: stop.request("SIGTERM")))
    assert _zero_after(bench, "rw-x", 19.97) <= PERIOD_S
    assert all(wheel.electronics.command_A == 0.0 for wheel in bench.wheels)


def test_a_wheel_whose_run_crashed_while_it_was_deaf_gets_zero_when_it_hears_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It kept .22 A for as long as the others' runs went on."""
    bench = make_bus(
        tmp_path, "nowhere", FAMILIES[0], "echo", command=_DRIVEN, wheels={"rw-z": {"filter": {"speed_noise_rpm": 2.0}}}
    )
    _deaf(bench, "rw-z", 10.05, 15.0)
    honest, turns = Estimator.step, [0]

    def step(self: Estimator, sample: Any) -> Any:
        if self.constants.speed_noise_rad_s > 0.15:  # rw-z's
            turns[0] += 1
            if turns[0] == 100:
                raise ZeroDivisionError("injected")
        return honest(self, sample)

    monkeypatch.setattr(Estimator, "step", step)
    ran = run_bus(bench, 30.0)
    failure = ran.wheels["rw-z"].failure
    assert failure is not None
    assert "injected" in failure
    assert 0.0 < _zero_after(bench, "rw-z", 15.0) <= 2 * PERIOD_S
    assert bench["rw-z"].electronics.command_A == 0.0
    assert ran.notes["rw-z"].events[-2:] == ["wheel_failed", "zero_confirmed"]
    assert all(ran.outcome(name).zero_confirmed for name in NAMES if name != "rw-z")


def test_who_watches_is_not_told_of_an_end_where_a_wheel_may_carry_a_current(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All four crash and the line is deaf: the supervisor has to see it, and try on."""
    bench = make_bus(tmp_path, "nowhere", FAMILIES[1], "echo", command=_DRIVEN)
    honest, turns = Estimator.step, [0]

    def step(self: Estimator, sample: Any) -> Any:
        turns[0] += 1
        if turns[0] > 400:
            raise ZeroDivisionError("injected")
        return honest(self, sample)

    heard = bench.line.handle
    monkeypatch.setattr(Estimator, "step", step)
    monkeypatch.setattr(bench.line, "handle", lambda data, at: [] if turns[0] > 400 else heard(data, at))
    watcher = _Watcher()
    run_bus(bench, None, oversight=Oversight((watcher,)))
    assert not watcher.is_over
    assert all(wheel.electronics.command_A != 0.0 for wheel in bench.wheels)  # the line was as bad as that


def test_an_error_in_the_zero_of_one_wheel_keeps_it_from_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An error that no driver should raise, at the stop."""
    bench = make_bus(tmp_path, "nowhere", FAMILIES[0], "echo", command=_DRIVEN)
    honest = LiveWheel.zero_now
    broken: list[LiveWheel] = []

    def zero_now(self: LiveWheel) -> None:
        broken[:] = broken or [self]
        if self is broken[0]:
            raise ZeroDivisionError("injected")
        honest(self)

    monkeypatch.setattr(LiveWheel, "zero_now", zero_now)
    run_bus(bench, None, (15.0, lambda stop: stop.request("SIGTERM")))
    assert all(wheel.electronics.command_A == 0.0 for wheel in bench.wheels)
    late = sorted(_zero_after(bench, name, 15.0) for name in NAMES)
    assert late[-2] <= PERIOD_S


def test_a_wheel_that_had_ended_when_the_daemon_died_begins_in_safe(tmp_path: Path) -> None:
    """Halted because another wheel answered, say; those that were driven go on, one that was in SAFE stays there."""
    published: dict[str, dict[str, Any]] = {
        "driven": {"run_state": "TRACKING", "ended_utc": None, "reason": None},
        "latched": {"run_state": "SAFE", "ended_utc": None, "reason": "silence"},
        "halted": {"run_state": "CONNECTING", "ended_utc": "2026-01-01T00:00:00.000Z", "reason": "another wheel"},
        "of before": {"run_state": "TRACKING", "ended_utc": "2025-01-01T00:00:00.000Z", "reason": None, "pid": 3},
    }
    for name, content in published.items():
        document = {"schema": "rw_ekf.state/1", "pid": 2**22 + 7, "start_ticks": 1} | content
        (tmp_path / name).write_text(json.dumps(document), encoding="utf-8")
    driven, latched, halted, before, none = safe_before([tmp_path / name for name in [*published, "nothing"]])
    assert (driven, before, none) == (None, None, None)
    assert latched == "silence"
    assert halted is not None
    assert "another wheel" in halted


def test_a_watchdog_waits_for_all_wheels_to_stand_down(tmp_path: Path) -> None:
    """Four that do not answer take two seconds each, one after the other."""
    bench = make_bus(tmp_path, "nowhere")
    alone, together = (Patience.of(bench.configurations[0], wheels) for wheels in (1, 4))
    assert together.turn_s >= alone.turn_s + 6.0
    assert together.stop_s >= alone.stop_s + 6.0
