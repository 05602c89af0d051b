"""The small move before a profile, over simulated wheels of every kind: what it decides, how far it goes, how long."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from rw_ekf.control.confirming_move import ConfirmingMove, MoveLimits
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.records import IssuedCommand, RunState, StateNow, WheelSample
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.watch.sign_watch import SignWatch
from tests.ticks import tick_of
from tests.watch.test_stuck_watch import STRIBECK, Wheel

DELAY_S = 0.01
PROFILE_A = 0.123  # what the profile behind the move asks for
SPEED_LIMIT_RAD_S = 440.0
SAFE = StateNow(RunState.SAFE, "2000-01-01T00:00:00Z", "until a person resumes")


class Moved(NamedTuple):
    """What a move came to."""

    verdict: str
    lasted_s: float
    longest_s: float
    changed_rpm: float  # speed after the move, less that before
    faster_rpm: float  # the most it went beyond the speed at the beginning
    largest_A: float


def drawn(seed: int) -> Wheel:
    """A healthy wheel: gain +-30 %, friction +-50 %, break-away up to 40 % above."""
    rng = np.random.default_rng(seed)
    c = 0.586 * rng.uniform(0.5, 1.5)
    return Wheel(15.2 * rng.uniform(0.7, 1.3), 0.0032 * rng.uniform(0.2, 2.0), c, c * rng.uniform(1.0, 1.4))


def move(
    wheel: Wheel,
    *,
    seed: int = 1,
    speed: float = 0.0,
    speed_scale: float = 1.0,
    current_scale: float = 1.0,
    noise_rpm: float = 1.0,
    limit_A: float = 0.6,
    slew_A_per_s: float = 5.0,
    rate_hz: float = 10.0,
    outside: float = 0.0,
    safe_s: float = 0.0,
) -> Moved:
    """A move to its end. The scales are the wire map's against the wheel's; outside: a torque per inertia [rad/s^2].

    safe_s: so long the run is in SAFE.
    """
    noise_rad_s, period_s = noise_rpm * RAD_S_PER_RPM, 1.0 / rate_hz
    rng = np.random.default_rng(seed)
    watch = SignWatch(DEFAULT_PRIOR.parameters, STRIBECK, noise_rad_s)
    limits = MoveLimits(limit_A, slew_A_per_s, SPEED_LIMIT_RAD_S, period_s, noise_rad_s)
    ended: list[ConfirmingMove] = []
    commander = ConfirmingMove(lambda tick: PROFILE_A, watch, DEFAULT_PRIOR.parameters, limits, ended.append)
    began, fastest, flows, commanded, largest, time_s = speed, abs(speed), 0.0, 0.0, 0.0, 0.0
    while not ended:
        sample = WheelSample(time_s, speed_scale * (speed + rng.normal(0.0, noise_rad_s)))
        held = time_s < safe_s
        wanted = commander(replace(tick_of(sample), state=SAFE if held else None))
        assert not (held and wanted)
        if ended:
            assert wanted == PROFILE_A
            break
        largest = max(largest, abs(wanted))
        most = slew_A_per_s * period_s
        commanded = 0.0 if wanted == 0.0 else commanded + max(-most, min(most, wanted - commanded))
        watch.add(tick_of(sample, IssuedCommand(commanded, DELAY_S)))
        for drive, lasts_s in ((flows, DELAY_S), (commanded, period_s - DELAY_S)):
            speed = wheel.after(speed, current_scale * drive + outside / wheel.k, lasts_s)
        flows = commanded
        fastest = max(fastest, abs(speed))
        time_s += period_s
    verdict = "wrong" if watch.is_wrong else "odd" if watch.odd_factor is not None else "open"
    verdict = "right" if watch.is_right else verdict if watch.pieces else "still"
    rpm = 1.0 / RAD_S_PER_RPM
    return Moved(
        verdict,
        commander.lasted_s,
        commander.longest_s,
        (speed - began) * rpm,
        (fastest - abs(began)) * rpm,
        largest,
    )


SPEEDS = [0.0, 20.0, -209.0, 430.0]  # the last is ten rad/s below the limit


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize(("speed_scale", "current_scale"), [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0)])
def test_sign_is_decided_for_every_healthy_wheel(speed: float, speed_scale: float, current_scale: float) -> None:
    """40 wheels, at rest, turning, near the limit: each confirmed or refused as it is, within eight seconds."""
    truth = "right" if speed_scale * current_scale > 0.0 else "wrong"
    moves = [
        move(drawn(seed), seed=seed, speed=speed, speed_scale=speed_scale, current_scale=current_scale)
        for seed in range(40)
    ]
    assert Counter(m.verdict for m in moves) == {truth: 40}
    assert max(m.lasted_s for m in moves) < 8.0
    coasted = max(m.lasted_s * (1.5 * 0.586 + 2.0 * 0.0032 * abs(speed)) for m in moves) / RAD_S_PER_RPM
    assert all(abs(m.changed_rpm) < coasted + 15.0 for m in moves)  # what friction takes in that time, and little more
    assert all(m.faster_rpm < 30.0 for m in moves)


@pytest.mark.slow
@pytest.mark.parametrize("current_scale", [1.0, -1.0])
def test_no_wrong_verdict_in_two_thousand_moves(current_scale: float) -> None:
    """The stated rate of error: fewer than 1 in 600 at 95 %, with noise of 0.3 to 5 rpm and a torque from outside."""
    rng = np.random.default_rng(3)
    verdicts = Counter(
        move(
            drawn(seed),
            seed=seed,
            speed=float(rng.choice([0.0, rng.uniform(-300.0, 300.0)])),
            current_scale=current_scale,
            noise_rpm=float(rng.choice([0.3, 1.0, 5.0])),
            outside=float(rng.uniform(-0.2, 0.2)),
        ).verdict
        for seed in range(1000)
    )
    assert verdicts["wrong" if current_scale > 0.0 else "right"] == verdicts["odd"] == 0
    assert verdicts["right" if current_scale > 0.0 else "wrong"] > 980


@pytest.mark.parametrize("speed", [0.0, 20.0])
@pytest.mark.parametrize("noise_rpm", [0.3, 5.0])
@pytest.mark.parametrize("current_scale", [1.0, -1.0])
def test_a_fine_and_a_coarse_reading_decide_as_well(speed: float, noise_rpm: float, current_scale: float) -> None:
    """The first current is as large as the noise asks for."""
    verdicts = {
        move(drawn(s), seed=s, speed=speed, noise_rpm=noise_rpm, current_scale=current_scale).verdict for s in range(10)
    }
    assert verdicts == {"right" if current_scale > 0.0 else "wrong"}


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("scale", [10.0, -10.0])
def test_a_current_scale_ten_times_off_is_cut_short_and_named(speed: float, scale: float) -> None:
    """Ten times the torque: the pulses end early, the wheel stays within 200 rpm, nothing is called right."""
    moves = [move(drawn(seed), seed=seed, speed=speed, current_scale=scale) for seed in range(10)]
    assert {m.verdict for m in moves} == {"odd" if scale > 0.0 else "wrong"}
    assert max(abs(m.changed_rpm) for m in moves) < 200.0
    assert max(m.faster_rpm for m in moves) < 200.0
    assert max(m.largest_A for m in moves) < 0.15


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize(
    ("speed_scale", "current_scale"), [(10.0, 1.0), (-10.0, 1.0), (1.0, 0.1), (0.1, 1.0), (-0.1, 1.0)]
)
def test_no_scale_ten_times_off_is_called_right(speed: float, speed_scale: float, current_scale: float) -> None:
    """Whichever scale it is, and whichever way: named, or left open within its time; never confirmed."""
    moves = [
        move(drawn(seed), seed=seed, speed=speed, speed_scale=speed_scale, current_scale=current_scale)
        for seed in range(10)
    ]
    assert "right" not in {m.verdict for m in moves}
    assert all(m.lasted_s <= m.longest_s + 1.0 for m in moves)


@pytest.mark.parametrize("current_scale", [1.0, -1.0])
def test_friction_three_times_as_strong_takes_more_current(current_scale: float) -> None:
    """What 2.5 times the believed break-away does not move, twice as much does."""
    moved = move(Wheel(c=1.8, s=2.0), current_scale=current_scale)
    assert moved.verdict == ("right" if current_scale > 0.0 else "wrong")
    assert 0.15 < moved.largest_A <= 0.6
    assert moved.lasted_s <= 8.0


def test_what_cannot_be_moved_is_not_pushed_for_long() -> None:
    """Break-away above the limit: two pulses at the limit, then the profile; nothing is claimed."""
    moved = move(Wheel(), limit_A=0.02)
    assert moved.verdict == "still"
    assert moved.lasted_s == pytest.approx(2.0, abs=0.2)
    assert moved.largest_A <= 0.02
    assert moved.changed_rpm == 0.0


def test_a_large_limit_is_reached_in_four_steps() -> None:
    """A wheel held fast, a limit of ten amperes: the move ends all the same, within its time."""
    moved = move(Wheel(c=400.0, s=500.0), limit_A=10.0, slew_A_per_s=100.0)
    assert moved.verdict == "still"
    assert moved.largest_A == pytest.approx(10.0)
    assert moved.lasted_s <= 12.0


@pytest.mark.parametrize("rate_hz", [0.5, 1.0, 2.0, 100.0])
def test_other_rates(rate_hz: float) -> None:
    """Pulses are as long as two readings at least; at any rate the verdict is the same."""
    for scale, truth in ((1.0, "right"), (-1.0, "wrong")):
        assert move(drawn(4), speed=20.0, rate_hz=rate_hz, current_scale=scale).verdict == truth


def test_a_slow_slew_makes_longer_pulses() -> None:
    """0.3 A/s: the current is there for some of each pulse, and the wheel is confirmed."""
    moved = move(drawn(5), slew_A_per_s=0.3)
    assert moved.verdict == "right"
    assert moved.lasted_s < 12.0


def test_near_the_speed_limit_the_wheel_is_only_braked() -> None:
    """Ten rad/s below it: no pulse in the direction of turning, for either sense."""
    for speed in (437.0, -437.0):
        wanted: list[float] = []
        watch = SignWatch(DEFAULT_PRIOR.parameters, STRIBECK, 0.1)
        limits = MoveLimits(0.6, 5.0, SPEED_LIMIT_RAD_S, 0.1, 0.1)
        commander = ConfirmingMove(lambda tick: 0.0, watch, DEFAULT_PRIOR.parameters, limits, lambda move: None)
        for i in range(40):
            wanted.append(commander(tick_of(WheelSample(0.1 * i, speed))))
        assert min(a * math.copysign(1.0, speed) for a in wanted) < 0.0
        assert max(a * math.copysign(1.0, speed) for a in wanted) <= 0.0


def test_time_that_the_wheel_s_clock_does_not_give_passes_all_the_same() -> None:
    """A clock that restarts at every reading: the move still comes to its end."""
    watch = SignWatch(DEFAULT_PRIOR.parameters, STRIBECK, 0.1)
    limits = MoveLimits(0.6, 5.0, SPEED_LIMIT_RAD_S, 0.1, 0.1)
    commander = ConfirmingMove(lambda tick: PROFILE_A, watch, DEFAULT_PRIOR.parameters, limits, lambda move: None)
    turns = 0
    while commander.active:
        turns += 1
        commander(tick_of(WheelSample(5.0, 50.0, segment=turns)))
        assert turns < 200


def test_a_run_that_begins_in_safe_is_moved_after_it() -> None:
    """Half a minute of SAFE, in which only zero is written, spends nothing of the move and raises no current."""
    at_once, later = move(drawn(3)), move(drawn(3), safe_s=30.0)
    assert later.verdict == at_once.verdict == "right"
    assert later.largest_A == at_once.largest_A
    assert later.lasted_s < at_once.longest_s
