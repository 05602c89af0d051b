"""Four wheels on one line in one loop, on a virtual clock: nobody waits longer for a dead one than its time-out."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.drivers.sim.wheel_line import BusElectronics
from rw_ekf.errors import ConfigError, DriverError
from rw_ekf.filter.estimator import Estimator
from rw_ekf.live.oversight import Oversight
from rw_ekf.logs.reader import read_log
from rw_ekf.records import StateNow
from tests.live.bus import FAMILIES, NAMES, PERIOD_S, TIMEOUT_S, BusBench, BusRan, make_bus, run_bus

EACH_FAMILY = pytest.mark.parametrize("family", FAMILIES)
# A time-out counts from a request's last byte, and a port is looked at every 2 ms: 20 bytes at 115200 baud, and a look.
_AND_SENDING_S = 20 * 10 / 115200 + 0.002


def late_s(ran: BusRan, name: str) -> float:
    """By how much a wheel's latest turn was late."""
    return 1e-3 * float(ran.outcome(name).timing.late_ms_max)


def assert_all_at_zero(bench: BusBench, ran: BusRan, names: tuple[str, ...] = NAMES) -> None:
    """The wheels themselves carry nothing, and said so."""
    for name in names:
        assert bench[name].electronics.command_A == 0.0
        assert bench[name].currents_A[-1] == 0.0
        if ran.wheels[name].outcome is not None:
            assert ran.outcome(name).zero_confirmed


@EACH_FAMILY
def test_a_wheel_dead_from_the_start_and_one_that_dies_delay_nobody_beyond_a_time_out(
    family: str, tmp_path: Path
) -> None:
    """Echo on; one is dead for 20 s, one from 30 to 36 s; both come by themselves; the others lose no turn, no row."""
    bench = make_bus(tmp_path, "nowhere", family, "echo,rw-z=dead@0s:20s,rw-y=dead@30s:6s")
    ran = run_bus(bench, 60.0)
    for name in ("rw-x", "rw-skew"):
        outcome = ran.outcome(name)
        assert late_s(ran, name) <= TIMEOUT_S + _AND_SENDING_S
        assert outcome.timing.overruns == 0
        assert outcome.link.timeouts <= 2  # a boot loader that refuses, until it is started
        assert outcome.statistics.samples == outcome.timing.ticks >= 60.0 / PERIOD_S - 5
        assert outcome.statistics.missing == 0
        steps = np.diff(read_log(outcome.files.log).time_s)
        assert np.max(np.abs(steps - PERIOD_S)) <= TIMEOUT_S + _AND_SENDING_S
    # The one that was not there has a run from when it was, without a word from anybody.
    late_comer = ran.outcome("rw-z")
    assert "no_answer" in ran.notes["rw-z"].events
    assert 60.0 - 20.0 - 10 * PERIOD_S <= late_comer.statistics.duration_s <= 40.0
    assert late_s(ran, "rw-z") <= TIMEOUT_S + _AND_SENDING_S
    # The one that died was lost, is driven again, and was sent zero on its way back.
    assert ran.notes["rw-y"].states[-3:] == ["LOST", "CONNECTING", "TRACKING"]
    log = read_log(ran.outcome("rw-y").files.log)
    speeds = np.isfinite(log.speed_rad_s)
    assert np.count_nonzero(speeds) >= (60.0 - 6.0) / PERIOD_S - 15
    back = [current for at_s, current in bench["rw-y"].written if at_s >= 36.0]
    assert back[0] == 0.0
    assert any(abs(current) > 0.01 for current in back)
    assert_all_at_zero(bench, ran)


def test_three_of_four_dead_cost_a_period_one_time_out(tmp_path: Path) -> None:
    """Of several silent wheels one a period is asked: the one that lives keeps every turn; then all come back."""
    dead = "rw-y=dead@20s:10s,rw-z=dead@20s:10s,rw-skew=dead@20s:10s"
    bench = make_bus(tmp_path, "nowhere", faults=f"echo,{dead}")
    ran = run_bus(bench, 45.0)
    outcome = ran.outcome("rw-x")
    assert outcome.timing.overruns == 0
    assert outcome.statistics.missing == 0
    # In the half second before they count as silent, all three are waited for in each period.
    assert late_s(ran, "rw-x") <= 3 * TIMEOUT_S
    log = read_log(outcome.files.log)
    steps = np.diff(log.time_s[(log.time_s > 21.0) & (log.time_s < 30.0)])
    assert np.max(np.abs(steps - PERIOD_S)) <= TIMEOUT_S + _AND_SENDING_S
    for name in NAMES[1:]:
        assert ran.notes[name].states[-1] == "TRACKING"
    assert_all_at_zero(bench, ran)


def test_a_wheel_that_hears_but_is_not_heard_gets_its_zero(tmp_path: Path) -> None:
    """Its answers are lost while it is driven: it is at zero soon after limits.silence_s, and stays there."""
    bench = make_bus(tmp_path, "nowhere", faults="echo,rw-y=silence@10s")
    ran = run_bus(bench, 20.0)
    within_s = 10.0 + 0.5 + 6 * PERIOD_S
    assert [at_s for at_s, current in bench["rw-y"].written if current != 0.0][-1] <= within_s
    assert bench["rw-y"].electronics.command_A == 0.0
    assert not ran.outcome("rw-y").zero_confirmed
    assert ran.outcome("rw-y").lost
    assert late_s(ran, "rw-z") <= TIMEOUT_S + _AND_SENDING_S
    assert_all_at_zero(bench, ran, ("rw-x", "rw-z", "rw-skew"))


def test_a_run_that_fails_ends_with_its_zero_and_the_others_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a line, row 25: an error in one estimator: zero to its wheel at once, it is said, no other loses a turn."""
    bench = make_bus(tmp_path, "nowhere", wheels={"rw-z": {"filter": {"speed_noise_rpm": 2.0}}})
    honest, taken = Estimator.step, []

    def fail(self: Estimator, sample: Any) -> Any:
        if self.constants.speed_noise_rad_s > 0.15:  # that of rw-z
            taken.append(sample)
            if len(taken) == 100:
                raise ZeroDivisionError("a fault in the filter")
        return honest(self, sample)

    monkeypatch.setattr(Estimator, "step", fail)
    ran = run_bus(bench, 30.0)
    failed = ran.wheels["rw-z"]
    assert failed.outcome is None
    assert "ZeroDivisionError: a fault in the filter" in (failed.failure or "")
    assert "wheel_failed" in ran.notes["rw-z"].events
    at_s = bench["rw-z"].written[-1][0]
    assert at_s < 10.0 + 20 * PERIOD_S  # it was driven no more
    for name in ("rw-x", "rw-y", "rw-skew"):
        assert ran.outcome(name).timing.overruns == 0
        assert ran.outcome(name).statistics.missing == 0
        assert late_s(ran, name) <= PERIOD_S / 4
    assert_all_at_zero(bench, ran)


def test_a_stop_sends_zero_to_all_before_any_stands_down(tmp_path: Path) -> None:
    """With one wheel dead: the living have zero within a period of the stop, all confirm it, the runs end in order."""
    bench = make_bus(tmp_path, "nowhere", faults="echo,rw-x=dead@8s")
    ran = run_bus(bench, None, (20.0, lambda stop: stop.request("SIGTERM")))
    for name in NAMES[1:]:
        after = [(at_s, current) for at_s, current in bench[name].written if at_s > 20.0]
        assert after[0][1] == 0.0
        assert after[0][0] <= 20.0 + PERIOD_S
        assert {current for _, current in after} == {0.0}
        assert ran.outcome(name).stopped_by == "SIGTERM"
    assert not ran.outcome("rw-x").zero_confirmed
    assert_all_at_zero(bench, ran, NAMES[1:])


def test_a_port_that_vanishes_is_opened_once_for_all(tmp_path: Path) -> None:
    """Pulled out for three seconds: every wheel is lost and found again, each is sent zero first."""
    bench = make_bus(tmp_path, "nowhere", faults="echo,hangup@10s:3s")
    ran = run_bus(bench, 30.0)
    for name in NAMES:
        assert ran.outcome(name).link.reconnects == 1
        assert ran.notes[name].states[-3:] == ["LOST", "CONNECTING", "TRACKING"]
        back = [current for at_s, current in bench[name].written if at_s >= 13.0]
        assert back[0] == 0.0
    assert_all_at_zero(bench, ran)


def test_a_line_on_which_nobody_answers_ends_with_a_reason(tmp_path: Path) -> None:
    """All four dead: an error within some seconds, and nothing was commanded."""
    bench = make_bus(tmp_path, "nowhere", faults="echo,dead")
    with pytest.raises(DriverError, match="no valid frame"):
        run_bus(bench, 30.0)
    assert not any(wheel.written for wheel in bench.wheels)


def test_who_watches_hears_of_a_turn_when_every_wheel_has_had_one(tmp_path: Path) -> None:
    """On a line, row 29: one beat a period with one wheel dead, with the worst state; the end is told once."""

    class Watchdog:
        def __init__(self) -> None:
            self.beats: list[StateNow | None] = []
            self.ends = 0

        def turned(self, state: StateNow | None) -> None:
            self.beats.append(state)

        def over(self) -> None:
            self.ends += 1

    watchdog = Watchdog()
    bench = make_bus(tmp_path, "nowhere", faults="echo,rw-y=dead@10s:5s")
    ran = run_bus(bench, 20.0, oversight=Oversight((watchdog,)))
    assert ran.outcome("rw-x").timing.ticks - 5 <= len(watchdog.beats) <= ran.outcome("rw-x").timing.ticks + 5
    assert "LOST" in {state.state.value for state in watchdog.beats if state is not None}
    assert watchdog.ends == 1


def test_a_line_is_not_given_up_for_the_wheel_that_is_asked_first(tmp_path: Path) -> None:
    """Whichever of the four is dead from the start: the other three are driven."""
    for dead in NAMES:
        directory = tmp_path / dead
        directory.mkdir()
        ran = run_bus(make_bus(directory, "nowhere", faults=f"echo,{dead}=dead"), 5.0)
        assert [name for name in NAMES if ran.wheels[name].outcome is None] == [dead]
        assert "never answered" in (ran.wheels[dead].failure or "")


@EACH_FAMILY
def test_the_rate_that_is_allowed_is_one_that_the_line_carries(
    family: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At 38400 baud: just below the most that is told no wheel loses a turn; half as fast again, turns are lost."""

    def at(rate_hz: float) -> BusBench:
        directory = tmp_path / f"{rate_hz:g}"
        directory.mkdir()
        loop = {"rate_hz": rate_hz, "reply_timeout_ms": 400.0 / rate_hz}
        bench = make_bus(directory, "nowhere", family, loop=loop, wheel={"baud": 38400})
        bench.line = BusElectronics([wheel.electronics for wheel in bench.wheels], bench.line.faults, 38400)
        return bench

    with pytest.raises(ConfigError) as refused:
        run_bus(at(100.0), 1.0)
    reported = re.search(r"loop.rate_hz is 100, .* 4 wheels take .* give at most ([\d.]+)", str(refused.value))
    assert reported is not None
    most_hz = float(reported[1])
    ran = run_bus(at(0.9 * most_hz), 10.0)
    for name in NAMES:
        assert ran.outcome(name).timing.overruns == 0
        assert ran.outcome(name).statistics.missing == 0
    monkeypatch.setattr("rw_ekf.attach.opening.beyond_rate", lambda *_: [])
    ran = run_bus(at(1.5 * most_hz), 10.0)
    assert sum(ran.outcome(name).timing.overruns for name in NAMES) > 10
