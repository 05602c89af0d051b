"""The daemon's own loop on a virtual clock, over a wheel simulated in this process: hours in seconds."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from rw_ekf.units import RAD_S_PER_RPM
from tests.live.virtual import run, setting

HOUR_S = 3600.0


def test_two_hours_with_a_silence_a_lost_line_and_a_stop(tmp_path: Path) -> None:
    """Each is said once, ends, and costs a gap; the log keeps the rate, the estimate the truth, the wheel gets zero."""
    ran, wheel = run(
        tmp_path,
        None,
        (0.5 * HOUR_S, setting(silent=True)),
        (0.5 * HOUR_S + 20.25, setting(silent=False)),
        (1.0 * HOUR_S, setting(unplugged=True)),
        (1.0 * HOUR_S + 60.25, setting(unplugged=False)),
        (2.0 * HOUR_S, lambda wheel, stop: stop.request("enough")),
        limits={"silence_s": 1.5, "safe_after_s": None},
    )
    assert ran.notes.states.count("LOST") == 2
    outcome, events = ran.outcome, ran.notes.events
    assert outcome.stopped_by == "enough"
    assert outcome.zero_confirmed
    assert not outcome.lost
    assert wheel.truth.current_A == 0.0
    assert outcome.timing.ticks == pytest.approx(2.0 * 2.0 * HOUR_S, abs=5)
    assert outcome.timing.overruns <= 6  # zero is tried for half a second on every line that is opened again
    assert (events.count("silence"), events.count("telemetry_back")) == (1, 1)
    # A port that says nothing is opened anew now and then, so that the silence counts reconnections too.
    assert events.count("link_lost") == events.count("link_back") == outcome.link.reconnects
    log = ran.log
    assert len(log) == outcome.statistics.samples
    steps = np.diff(log.time_s)
    assert np.median(steps) == pytest.approx(0.5, abs=1e-6)
    assert sorted(np.round(steps[steps > 3.0])) == [pytest.approx(19.0, abs=2.0), pytest.approx(60.0, abs=2.0)]
    assert outcome.statistics.rejected <= 10
    truth, found = wheel.truth.parameters, outcome.belief
    for name in ("motor_gain", "coulomb"):
        value, std = getattr(found.parameters, name), getattr(found.parameter_std, name)
        assert abs(value - getattr(truth, name)) < 4.0 * std
        assert std < 0.02 * value
    state = json.loads(outcome.files.state.read_text(encoding="utf-8"))
    assert state["time_s"] == log.time_s[-1]


def test_a_line_that_stays_lost_ends_with_its_duration(tmp_path: Path) -> None:
    """Unplugged and never back: the run ends on the clock, lost, and zero is tried to the last and not confirmed."""
    ran, _ = run(tmp_path, 600.0, (300.0, setting(unplugged=True)))
    assert ran.outcome.lost
    assert not ran.outcome.zero_confirmed
    assert ran.log.time_s[-1] == pytest.approx(300.0, abs=1.0)
    assert "zero_not_confirmed" in ran.notes.events


def test_a_wheel_silent_to_the_end_is_given_zero_all_the_same(tmp_path: Path) -> None:
    """It takes what nobody hears it confirm: lost, and the wheel is without current soon after the silence is known."""
    held: list[float] = []
    ran, wheel = run(
        tmp_path,
        120.0,
        (60.0, setting(silent=True)),
        (60.2, lambda wheel, stop: held.append(wheel.truth.current_A)),
        (63.0, lambda wheel, stop: held.append(wheel.truth.current_A)),
    )
    assert held[0] != 0.0
    assert held[1] == 0.0
    assert ran.outcome.lost
    assert not ran.outcome.zero_confirmed
    assert math.isfinite(wheel.truth.speed_rad_s)


def test_after_a_silence_the_speed_starts_afresh_where_the_current_is_not_known(tmp_path: Path) -> None:
    """The wheel took a zero that it could not confirm, at a time nobody knows: a new segment, no wrong prediction."""
    ran, _ = run(tmp_path, 120.0, (60.0, setting(silent=True)), (64.0, setting(silent=False)))
    assert list(np.unique(ran.log.segment)) == [0, 1]
    assert ran.outcome.statistics.reseeded == 1
    assert ran.outcome.statistics.rejected == 0


def test_a_wheel_too_fast_is_only_braked(tmp_path: Path) -> None:
    """Above limits.speed_rpm no current in the direction of turning is ever written, all of it is zero or brakes."""
    steps = {"profile": "sine", "amplitude_A": 0.3, "period_s": 20.0, "bias_A": 0.0}
    ran, _ = run(tmp_path, 120.0, limits={"speed_rpm": 100.0, "silence_s": 1.5}, command=steps)
    fast = ran.log.speed_rad_s > 100.0 * RAD_S_PER_RPM
    assert fast.sum() > 10
    assert np.all(ran.log.current_A[fast] <= 0.0)
    assert np.any(ran.log.current_A[fast] < 0.0)


def test_the_same_run_twice_leaves_the_same_log(tmp_path: Path) -> None:
    """Nothing but the clock and the seed decides: two runs of a quarter of an hour are equal to the last digit."""
    blink = (400.0, setting(silent=True)), (403.0, setting(silent=False))
    logs = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        logs.append(run(tmp_path / name, 900.0, *blink)[0].outcome.files.log.read_text(encoding="utf-8"))
    assert logs[0] == logs[1]
    assert len(logs[0].splitlines()) > 1700
