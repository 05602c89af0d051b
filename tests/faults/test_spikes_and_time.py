"""Speeds that no wheel can have, and time that stands, steps, or is slept through: through the real serial driver."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.clock import VirtualClock
from rw_ekf.course.course import Course
from rw_ekf.drivers.line.framing import Frame
from rw_ekf.drivers.sim.plant_batch import compiled_advance
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.register_server import RegisterServer
from rw_ekf.drivers.sim.virtual_line import VirtualCable
from rw_ekf.filter import gating
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.filter.estimator import Estimator
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.learning.run_start import GivenModel
from rw_ekf.live.daemon import Task, run_daemon
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.model.state import PARAMETERS
from rw_ekf.records import IssuedCommand, Outcome, WheelSample
from rw_ekf.settings.load import load_configuration
from rw_ekf.units import RAD_S_PER_RPM
from tests.injecting import put_faults
from tests.live.bench import CYCLE, served_wheel, spoken_by, wire_map_of, write_config
from tests.live.daemon import Notes, Ran, resume, run
from tools.measure.runs import constants_for

LASTS_S = 120.0
AT_S = 60.0


class HostClock(VirtualClock):
    """A computer's: its hour can be set, and it can be stopped while the wheel goes on."""

    def __init__(self) -> None:
        super().__init__()
        self._slept_s = 0.0
        self._hour = timedelta()

    def monotonic(self) -> float:
        """Time since the clock was made, slept through or not."""
        return super().monotonic() + self._slept_s

    def utc(self) -> datetime:
        """The hour that it was set to."""
        return super().utc() + self._hour

    def stop_the_host(self, seconds: float) -> None:
        """As SIGSTOP and SIGCONT do, or the lid of a laptop."""
        self._slept_s += seconds

    def set_hour(self, later: timedelta) -> None:
        """Somebody, or the network, sets the computer's hour."""
        self._hour += later


@dataclass
class Held:
    """A wheel on a virtual line, and when it was asked for its speed."""

    directory: Path
    clock: HostClock = field(default_factory=HostClock)
    wanted_s: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        noise, state = PlantNoise(RAD_S_PER_RPM), PlantState(speed_rad_s=40.0)
        plant = PlantRunner(PlantParameters(), noise, 5, state, 0.01, compiled_advance)
        self.server = RegisterServer(wire_map_of("sunspace-wheel"), plant, first_uptime_s=100.0, watch=self._watch)

    def _watch(self, frame: Frame) -> None:
        if frame.id == CYCLE:
            self.wanted_s.append(self.clock.monotonic())

    def fault(self, text: str) -> None:
        """The wheel has this fault and no other."""
        put_faults(self.server, text)

    def push(self, rad_s: float) -> None:
        """Somebody's hand changes the wheel's speed."""
        plant = self.server.plant
        plant.state = plant.state._replace(speed_rad_s=plant.state.speed_rad_s + rad_s)

    def run(
        self, *events: tuple[float, Callable[[], object]], lasts_s: float = LASTS_S, **changes: dict[str, Any]
    ) -> Ran:
        """Two minutes of sines, or more; each event is a time [s] and what happens then."""
        usual: dict[str, dict[str, Any]] = {
            "command": {"profile": "random-sines", "period_s": 20.0, "confirm_sign": False},
            "limits": {"silence_s": 1.0},
        }
        sections = {name: usual.get(name, {}) | changes.get(name, {}) for name in {*usual, *changes}}
        configuration = load_configuration(write_config(self.directory, str(self.directory / "wheel"), **sections))
        protocol = VirtualCable(self.server, self.clock).carrying(spoken_by(configuration))
        notes = Notes()
        with StopSignal() as stop:
            for time_s, action in events:
                self.clock.at(time_s, action)
            outcome = run_daemon(Task(configuration, protocol, GivenModel(), lasts_s), notes, stop, self.clock)
        return Ran(outcome, notes)


def filtered(ran: Ran) -> FilterRun:
    """The run's log through the compiled filter from the run's own start: what became of each sample."""
    setup = ran.outcome.setup
    return filter_log(
        Course.of_log(ran.log), setup.constants, setup.prior.mean, setup.prior.covariance, keep_states=True, mends=True
    )


def away(ran: Ran) -> float:
    """Of the parameters from the wheel's own, in their sigmas, the largest."""
    belief, true = ran.outcome.belief, PlantParameters()
    truth = np.array([true.motor_gain, true.viscous, true.coulomb, true.static])
    return float(np.max(np.abs(belief.mean[PARAMETERS] - truth) / belief.std[PARAMETERS]))


@pytest.mark.parametrize("count", [1, 5, 50])
@pytest.mark.parametrize("rpm", [80.0, 500.0, 3000.0])
def test_speed_spikes_are_gated(tmp_path: Path, count: int, rpm: float) -> None:
    """Row 20: 1, 5 or 50 readings off by that much, either way at random: gated, nothing learned, used again."""
    held = Held(tmp_path)
    ran = held.run((AT_S, lambda: held.fault(f"spike:{rpm}")), (AT_S + 0.1 * count - 0.05, lambda: held.fault("")))
    passed = filtered(ran)
    refused = np.flatnonzero((passed.outcome == gating.GATED) | (passed.outcome == gating.RESEEDED))
    spikes = np.flatnonzero(np.abs(passed.innovation_rad_s) > 0.5 * rpm * RAD_S_PER_RPM)
    assert count - 1 <= spikes.size <= count + 10
    assert set(spikes) <= set(refused)
    last = int(spikes[-1])
    assert np.flatnonzero(passed.outcome[last + 1 :] == gating.UPDATED)[0] <= 6
    assert away(ran) < 4.5
    assert ran.outcome.state.state == "TRACKING"
    assert ran.outcome.zero_confirmed


def test_speed_spikes_over_a_pty(tmp_path: Path) -> None:
    """Row 20: every tenth reading off by 500 rpm, over a real port: gated, and the run tracks on."""
    with served_wheel(tmp_path) as bench:
        put_faults(bench.registers, "spike:500:1/10")
        ran = run(bench, 6.0)
    assert ran.outcome.statistics.rejected >= 3
    assert ran.outcome.statistics.used > 2 * ran.outcome.statistics.rejected
    assert ran.outcome.zero_confirmed


def test_a_speed_that_really_jumped_is_taken_from_readings_that_agree(tmp_path: Path) -> None:
    """Row 20: a hand changes the speed by 10 rad/s: gated, SAFE, re-seeded where readings agree; at a word it goes on.

    No current can have done that, so until a person has looked it may as well be the tachometer that jumped.
    """
    held = Held(tmp_path)
    ran = held.run((AT_S, lambda: held.push(10.0)), (AT_S + 20.0, resume))
    assert "SAFE" in ran.notes.states
    passed = filtered(ran)
    at = int(np.flatnonzero(passed.outcome == gating.RESEEDED)[0])
    assert (passed.outcome[at - 4 : at] == gating.GATED).all()
    assert np.array_equal(passed.states[at, PARAMETERS], passed.states[at - 5, PARAMETERS])
    assert np.count_nonzero(passed.outcome[at + 1 : at + 20] == gating.UPDATED) >= 18
    assert away(ran) < 4.5
    assert ran.outcome.state.state == "TRACKING"


@pytest.mark.parametrize("hours", [1.0, -1.0])
def test_a_stepped_wall_clock_changes_nothing_but_labels(tmp_path: Path, hours: float) -> None:
    """Row 21: the hour is set by one forward or back in the middle: every time, estimate and state is as without it."""
    (tmp_path / "still").mkdir()
    (tmp_path / "stepped").mkdir()
    still = Held(tmp_path / "still").run()
    held = Held(tmp_path / "stepped")
    stepped = held.run((AT_S, lambda: held.clock.set_hour(timedelta(hours=hours))))
    assert np.array_equal(still.log.time_s, stepped.log.time_s)
    assert np.array_equal(still.log.speed_rad_s, stepped.log.speed_rad_s)
    assert np.array_equal(still.outcome.belief.mean, stepped.outcome.belief.mean)
    assert still.notes.states == stepped.notes.states == ["TRACKING"]
    assert still.outcome.link == stepped.outcome.link
    assert stepped.outcome.findings == still.outcome.findings


@pytest.mark.parametrize("seconds", [3.0, 8 * 3600.0])
def test_a_host_that_was_stopped_goes_on_without_a_burst(tmp_path: Path, seconds: float) -> None:
    """Row 22: SIGSTOP for 3 s, a laptop asleep for 8 hours: one gap, the speed afresh, no burst of polls."""
    held, limits = Held(tmp_path), {"safe_after_s": None}
    ran = held.run((AT_S, lambda: held.clock.stop_the_host(seconds)), lasts_s=LASTS_S + seconds, limits=limits)
    wanted = np.array(held.wanted_s)
    back_s = AT_S + seconds
    assert np.count_nonzero((wanted >= back_s) & (wanted < back_s + 1.0)) <= 13
    steps = np.diff(ran.log.time_s)
    assert np.count_nonzero(steps > 1.0) == 1
    assert np.max(steps) == pytest.approx(seconds, abs=1.0)
    passed = filtered(ran)
    at = int(np.argmax(steps)) + 1
    assert passed.outcome[at] in (gating.RESEEDED, gating.MISSING)
    assert np.flatnonzero(passed.outcome[at:] == gating.UPDATED)[0] <= 10
    assert np.isfinite(passed.states).all()
    assert away(ran) < 4.5
    assert ran.outcome.state.state == "TRACKING"
    assert ran.outcome.zero_confirmed


@pytest.mark.parametrize(
    ("dt", "outcome"),
    [
        (0.0, Outcome.REPEATED),
        (-1e-9, Outcome.BACKWARD),
        (-1e9, Outcome.BACKWARD),
        (math.nan, Outcome.BACKWARD),
        (math.inf, Outcome.BACKWARD),
        (1e-9, Outcome.UPDATED),
        (1.9, Outcome.UPDATED),
        (2.1, Outcome.RESEEDED),
        (1e9, Outcome.RESEEDED),
    ],
)
def test_a_time_step_that_is_none_has_a_name(dt: float, outcome: Outcome) -> None:
    """Row 22: zero, negative, not a number, tiny, huge: a named outcome, numbers in it, and the next sample is used."""
    estimator = Estimator(constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
    for i in range(50):
        estimator.step(WheelSample(0.1 * i, 20.0))
        estimator.command_issued(IssuedCommand(0.04))
    odd = estimator.step(WheelSample(4.9 + dt, 20.0))
    assert odd.outcome is outcome
    assert all(math.isfinite(v) for v in (*odd.state, *odd.std))
    assert abs(odd.state.speed_rad_s - 20.0) < 1.0
    following = 4.9 + max(dt if math.isfinite(dt) else 0.0, 0.0) + 0.1
    after = estimator.step(WheelSample(following, 20.0))
    assert after.outcome is Outcome.UPDATED
    assert all(math.isfinite(v) for v in (*after.state, *after.std))


def test_a_first_sample_without_a_time_is_no_first_sample() -> None:
    """Row 22: NaN for the very first time is refused, and the run begins with the next."""
    estimator = Estimator(constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
    assert estimator.step(WheelSample(math.nan, 20.0)).outcome is Outcome.BACKWARD
    assert estimator.step(WheelSample(0.0, 20.0)).outcome is Outcome.FIRST


@pytest.mark.parametrize("text", ["repeat:1", "clock:3600s", "clock:-5s"])
def test_a_wheel_clock_that_stands_or_jumps(tmp_path: Path, text: str) -> None:
    """Row 22: the wheel's own time stands still for 2 s, or jumps an hour on or 5 s back: no step, used again."""
    held = Held(tmp_path)
    ran = held.run(
        (AT_S, lambda: held.fault(text)), (AT_S + 2.0, lambda: held.fault("")), limits={"safe_after_s": None}
    )
    passed = filtered(ran)
    assert np.isfinite(passed.states).all()
    assert away(ran) < 4.5
    assert np.count_nonzero(passed.outcome[-400:] == gating.UPDATED) > 390
    assert ran.outcome.state.state == "TRACKING"
