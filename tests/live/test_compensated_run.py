"""Runs that compensate friction, over the real serial driver on a virtual clock: a reversal, rest, and trouble."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.reader import read_table
from rw_ekf.settings.schema import RUN_SCHEMES
from rw_ekf.units import rad_s_from_rpm
from tests.faults.rig import LineWheel
from tests.live.daemon import Ran
from tests.live.torque_client import Answer, TorqueClient

INERTIA = 1.5e-3
# Known before, as an identification leaves it: valid from the first sample.
KNOWN = {
    "prior": {
        "motor_gain": {"value": 15.1, "std": 0.15},
        "viscous": {"value": 0.0033, "std": 0.0003},
        "coulomb": {"value": 0.59, "std": 0.01},
        "static": {"value": 0.61, "std": 0.02},
    }
}
ACCELERATION = -0.3  # rad/s^2, half of what friction takes: a wheel that is not compensated stops and stays
BEGINS_S = 10.0  # behind the move that confirms the sign


def run(
    directory: Path,
    duration_s: float,
    torque_Nm: Callable[[float], float],
    scheme: str,
    *,
    speed_rad_s: float = 6.0,
    faults: str = "",
    noise_rpm: float = 1.0,
    filter_: dict[str, Any] = KNOWN,
) -> Done:
    """A run that takes torques."""
    path = str(directory / "s")
    with TorqueClient(path, torque_Nm) as client:
        wheel = LineWheel(
            directory, speed_rad_s=speed_rad_s, faults=faults, noise_rpm=noise_rpm, meanwhile=client.begin
        )
        compensation = {"scheme": scheme, "request": "socket", "socket": path}
        ran = wheel.run(duration_s, compensation=compensation, filter=filter_, command={"profile": "zero"})
    assert not Path(path).exists()
    return Done(ran, wheel, client.answers)


class Done(NamedTuple):
    """A run that took torques: what it came to, the wheel, and what the client was told."""

    ran: Ran
    wheel: LineWheel
    answers: list[Answer]


def brakes(now_s: float) -> float:
    """A constant torque, once the sign is known."""
    return INERTIA * ACCELERATION if now_s >= BEGINS_S else 0.0


def column(answers: list[Answer], key: str) -> Float64Array:
    return np.array([np.nan if answer[key] is None else answer[key] for answer in answers])


def speed_errors_rad_s(answers: list[Answer]) -> Float64Array:
    """How far the speed is from the integral of the torque that was taken, from when it began to be asked for."""
    taken = column(answers, "torque_Nm") / INERTIA
    first = int(np.argmax(taken != 0.0))
    time_s, speed = column(answers, "time_s")[first:], rad_s_from_rpm(1.0) * column(answers, "speed_rpm")[first:]
    wanted = speed[0] + np.concatenate(([0.0], np.cumsum(taken[first:-1] * np.diff(time_s))))
    return np.asarray(speed - wanted)


def test_a_reversal_follows_the_torque_with_compensation_and_stops_without(tmp_path: Path) -> None:
    """One torque from 6 rad/s through zero: without, the wheel stands; with it, it goes on as if without friction."""
    errors = {}
    for scheme in ("pid_current", "dmc", "predictive_crossing"):
        (tmp_path / scheme).mkdir()
        done = run(tmp_path / scheme, 60.0, brakes, scheme)
        errors[scheme] = np.max(np.abs(speed_errors_rad_s(done.answers)))
        if scheme == "pid_current":
            assert done.wheel.speeds_rad_s[-1] == 0.0
            continue
        assert done.wheel.speeds_rad_s[-1] < -6.0
        assert done.answers[-1]["compensating"]
        assert done.answers[-1]["parameters"] == "filter"
        assert done.ran.outcome.statistics.rejected <= 1
        assert errors[scheme] < 0.1 * errors["pid_current"]
        assert errors[scheme] < 1.0


def test_the_log_and_the_filter_have_the_current_that_was_issued(tmp_path: Path) -> None:
    """What the client is told is what the log has; the log replays to the estimates of the run."""
    from rw_ekf.log_replay import replay_log
    from rw_ekf.settings.load import load_configuration
    from rw_ekf.wheel.model_file import read_model

    done = run(tmp_path, 30.0, brakes, "dmc")
    reported = {answer["time_s"]: answer["current_A"] for answer in done.answers}
    logged = dict(zip(done.ran.log.time_s.tolist(), done.ran.log.current_A.tolist(), strict=True))
    assert len(reported.keys() & logged.keys()) > 250
    assert all(
        logged[time_s] == pytest.approx(reported[time_s], abs=1e-9) for time_s in reported.keys() & logged.keys()
    )
    estimates = read_table(done.ran.outcome.files.estimates, ColumnMap())
    at_s, added = estimates.floats(0), estimates.floats(estimates.names.index("compensation_A"))
    added_reported = {answer["time_s"]: answer["compensation_A"] for answer in done.answers}
    written = dict(zip(at_s.tolist(), added.tolist(), strict=True))
    assert all(written[t] == pytest.approx(added_reported[t], abs=1e-9) for t in written.keys() & added_reported.keys())
    assert np.nanmax(np.abs(added)) > 0.02
    again = replay_log(
        done.ran.log, load_configuration(tmp_path / "wheel.yaml"), read_model(done.ran.outcome.files.start)
    )
    assert np.allclose(again.belief.mean, done.ran.outcome.belief.mean, rtol=1e-6)


# What is slow to build up has ten minutes, where noise is strongest.
CREEPS = [("dmc", 180.0, 0.0, 1.0), ("dmc", 180.0, 2.0, 1.0), ("dmc", 600.0, -2.0, 5.0), ("dmc", 180.0, 6.0, 1.0)]
OTHERS = [(name, 60.0, 2.0, 1.0) for name in RUN_SCHEMES if name != "dmc"]


@pytest.mark.parametrize(
    ("scheme", "lasts_s", "creep_rpm", "noise_rpm"),
    [("dmc", 60.0, 2.0, 1.0), *[pytest.param(*case, marks=pytest.mark.slow) for case in CREEPS + OTHERS]],
)
def test_no_limit_cycle_at_a_request_of_zero(
    tmp_path: Path, scheme: str, lasts_s: float, creep_rpm: float, noise_rpm: float
) -> None:
    """Minutes, compensation on, from rest and from a creep: the wheel stops, never moves again, has no current."""
    begins_s, rate = 20.0, 0.1
    creeps_s = begins_s + abs(rad_s_from_rpm(creep_rpm)) / rate

    def torque_Nm(now_s: float) -> float:
        return math.copysign(INERTIA * rate, creep_rpm) if begins_s <= now_s < creeps_s else 0.0

    filter_ = KNOWN | {"speed_noise_rpm": noise_rpm}
    done = run(tmp_path, creeps_s + lasts_s, torque_Nm, scheme, speed_rad_s=0.0, noise_rpm=noise_rpm, filter_=filter_)
    assert sum(answer["compensating"] for answer in done.answers) > 10.0 * lasts_s - 10
    quiet = round(10.0 * lasts_s) - 100  # ten seconds to come to rest
    speeds, currents = np.array(done.wheel.speeds_rad_s), np.array(done.wheel.written_A)
    assert creep_rpm == 0.0 or np.max(np.abs(speeds[: -quiet - 50])) > 0.5 * abs(rad_s_from_rpm(creep_rpm))
    assert np.count_nonzero(speeds[-quiet:]) == 0
    assert np.count_nonzero(currents[-quiet:]) == 0


def test_noise_in_the_request_does_not_shake_a_wheel_at_rest(tmp_path: Path) -> None:
    """A controller's noise, 1 % of the break-away torque: the wheel does not move, and the current stays as small."""
    noise = np.random.default_rng(3).normal(0.0, 0.006 * INERTIA, 10_000)
    done = run(
        tmp_path, 120.0, lambda now_s: float(noise[int(10.0 * now_s)]) if now_s > 20.0 else 0.0, "dmc", speed_rad_s=0.0
    )
    late = np.array(done.wheel.speeds_rad_s)[400:]
    assert np.count_nonzero(late) == 0


@pytest.mark.parametrize(
    ("faults", "state"),
    [("spike:400@30s:1s", "DEGRADED"), ("silence@30s:0.3s", "DEGRADED"), ("silence@30s:2s", "LOST")],
)
def test_off_at_once_in_trouble_and_back_after_it(tmp_path: Path, faults: str, state: str) -> None:
    """Readings that are refused, or missing: in the turn that says so nothing is added; later it is faded in again."""
    done = run(tmp_path, 50.0, brakes, "dmc", faults=faults)
    states = [answer["state"] for answer in done.answers]
    assert state in states
    bad = states.index("DEGRADED")
    assert done.answers[bad - 3]["compensating"]
    assert done.answers[bad - 3]["compensation_A"] < -0.03
    for answer in done.answers[bad:]:
        if answer["state"] != "TRACKING":
            assert not answer["compensating"]
            assert answer["compensation_A"] == 0.0
            if answer["current_A"] is not None and answer["torque_Nm"] == INERTIA * ACCELERATION:
                assert abs(answer["current_A"]) <= abs(ACCELERATION) / 15.0 + 1e-4
    back = next(i for i in range(bad, len(states)) if states[i] == "TRACKING")
    assert abs(done.answers[back]["compensation_A"]) < 0.005
    assert done.answers[-1]["compensating"]
    assert done.answers[-1]["compensation_A"] < -0.03
    stated = [context["on"] for event, context in done.ran.notes.stated if event == "compensation"]
    assert stated == [False, True, False, True] if state == "DEGRADED" else stated[-1]
    lines = [json.loads(line) for line in done.ran.outcome.files.events.read_text().splitlines()]
    assert [line["on"] for line in lines if line["event"] == "compensation"][-2:] == [False, True]


def test_a_profile_is_a_request(tmp_path: Path) -> None:
    """A sine that friction swallows moves a compensated wheel as it would a wheel without friction."""
    wheel = LineWheel(tmp_path, speed_rad_s=0.0)
    command = {"profile": "sine", "amplitude_A": 0.02, "period_s": 20.0, "bias_A": 0.0}
    wheel.run(80.0, command=command, compensation={"scheme": "dmc", "request": "profile"}, filter=KNOWN)
    speeds = np.array(wheel.speeds_rad_s)[300:]
    assert np.ptp(speeds) == pytest.approx(2.0 * 15.2 * 0.02 * 20.0 / (2.0 * np.pi), rel=0.25)


def test_without_a_scheme_a_run_is_as_it_was(tmp_path: Path) -> None:
    """The other keys of the section change nothing: not a current, not an event, not a file."""
    files = []
    for name, compensation in (("a", {}), ("b", {"request": "socket", "limit_A": 0.01})):
        (tmp_path / name).mkdir()
        wheel = LineWheel(tmp_path / name, speed_rad_s=20.0)
        ran = wheel.run(40.0, compensation=compensation)
        assert "compensation" not in ran.notes.events
        files.append((wheel.written_A, sorted(path.name for path in (tmp_path / name / "runs").glob("*.sock"))))
    assert files[0] == files[1]
    assert files[0][1] == []


def test_what_is_known_of_nothing_compensates_nothing(tmp_path: Path) -> None:
    """From the built-in prior the request's current goes out alone, as long as the filter has not seen a reversal."""
    done = run(tmp_path, 30.0, brakes, "dmc", filter_={})
    assert not any(answer["compensating"] for answer in done.answers)
    assert {answer["compensation_A"] for answer in done.answers} == {0.0}
