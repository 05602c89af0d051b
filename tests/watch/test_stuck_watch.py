"""A stuck reading told from a wheel at steady speed: an own wheel, own readings, virtual time."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.model.friction import GAUSS
from rw_ekf.model.state import FrictionParameters
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.watch.standing_proof import StandingProof
from rw_ekf.watch.stuck_watch import ParameterBelief, StuckWatch

PERIOD_S = 0.1
SILENCE_S = 0.5
STRIBECK = 4.0 * RAD_S_PER_RPM
PRIOR = ParameterBelief(DEFAULT_PRIOR.parameters, DEFAULT_PRIOR.parameter_covariance)


class Wheel(NamedTuple):
    """Truth of a wheel, per unit inertia."""

    k: float = 15.2
    b: float = 0.0032
    c: float = 0.586
    s: float = 0.62

    def after(self, speed: float, current: float, dt: float) -> float:
        """Speed after dt [s], in steps of 10 ms."""
        for _ in range(round(dt / 0.01)):
            drive = self.k * current
            if speed == 0.0:
                speed = math.copysign((abs(drive) - self.s) * 0.01, drive) if abs(drive) > self.s else 0.0
                continue
            following = speed + 0.01 * (drive - math.copysign(self.b * abs(speed) + self.c, speed))
            speed = 0.0 if following * speed < 0.0 and abs(drive) <= self.s else following
        return speed

    @property
    def belief(self) -> ParameterBelief:
        """What an estimator has learnt of it in a minute: 3 % of k, 30 % of the friction."""
        std = np.array([0.03 * self.k, 0.3 * self.b, 0.3 * self.c, 0.3 * self.s])
        return ParameterBelief(FrictionParameters(*self), np.diag(std * std))


def watch(step_rpm: float = 0.5, noise_rpm: float = 1.0) -> StuckWatch:
    return StuckWatch(step_rpm * RAD_S_PER_RPM, noise_rpm * RAD_S_PER_RPM, SILENCE_S, STRIBECK, GAUSS)


def news(
    judge: StuckWatch,
    wheel: Wheel,
    current: Callable[[float], float],
    duration_s: float,
    *,
    speed: float = 0.0,
    step_rpm: float = 0.5,
    noise_rpm: float = 0.0,
    belief: ParameterBelief | None = None,
    frozen: Callable[[float], bool] = lambda t: False,
    refresh: int = 1,
) -> list[tuple[float, str]]:
    """What is said over a run, with its times; the wheel coasts while it is stuck."""
    believed = belief if belief is not None else wheel.belief
    noise = np.random.default_rng(7).normal(0.0, max(noise_rpm, 1e-12), round(duration_s / PERIOD_S) + 1)
    stated, flows, reading = [], 0.0, 0.0
    for i in range(round(duration_s / PERIOD_S)):
        t = PERIOD_S * i
        if i % refresh == 0 and not frozen(t):
            reading = round((speed / RAD_S_PER_RPM + noise[i]) / step_rpm) * step_rpm * RAD_S_PER_RPM
        judged = judge.add(t, reading, flows, lambda: believed)
        if judged.news is not None:
            stated.append((t, judged.news))
        flows = 0.0 if judged.stuck else current(t)
        speed = wheel.after(speed, flows, PERIOD_S)
    return stated


@pytest.mark.parametrize(
    ("current_A", "step_rpm", "off"), [(0.1, 0.5, 1.0), (0.1, 0.5, 1.04), (0.06, 2.0, 0.97), (-0.2, 0.5, 1.0)]
)
def test_hours_at_steady_speed_are_no_alarm(current_A: float, step_rpm: float, off: float) -> None:
    """Readings that repeat to the last bit, with a gain that is right or 4 % off: nothing is said.

    For six hours, seventy times the viscous time constant, in which whatever the watch expects has settled.
    """
    wheel = Wheel()
    speed = math.copysign((wheel.k * abs(current_A) - wheel.c) / wheel.b, current_A)
    reading = round(speed / RAD_S_PER_RPM / step_rpm) * step_rpm * RAD_S_PER_RPM
    believed = wheel._replace(k=off * wheel.k).belief._replace(covariance=wheel.belief.covariance)
    judge = watch(step_rpm)
    judged = {judge.add(PERIOD_S * i, reading, current_A, lambda: believed) for i in range(6 * 36_000)}
    assert judged == {(True, False, None)}


@pytest.mark.parametrize("rate_A_per_s", [2e-6, -2e-6])
def test_a_slow_ramp_is_no_alarm(rate_A_per_s: float) -> None:
    """Hours in which the speed creeps from one step of the reading to the next: nothing is said."""
    wheel = Wheel()
    steady = (wheel.k * 0.1 - wheel.c) / wheel.b
    assert news(watch(), wheel, lambda t: 0.1 + rate_A_per_s * t, 7200.0, speed=steady) == []


@pytest.mark.parametrize("current_A", [0.0, 0.01, 0.039, -0.039])
def test_a_wheel_at_rest_below_break_away_is_no_alarm(current_A: float) -> None:
    """Zero is read again and again because the wheel stands: nothing is said, with the default prior or better."""
    for belief in (None, PRIOR):
        assert news(watch(), Wheel(), lambda t: current_A, 600.0, belief=belief) == []


@pytest.mark.parametrize("share", [0.7, 1.3])
@pytest.mark.parametrize("period_s", [3.0, 30.0])
def test_a_healthy_wheel_under_a_wide_prior_is_no_alarm(share: float, period_s: float) -> None:
    """k 30 % off the default prior and nothing learnt, readings with and without noise, through reversals: nothing."""
    wheel = Wheel(k=15.2 * share, c=0.586 * (2.0 - share), s=0.65 * (2.0 - share))
    for noise_rpm in (0.0, 1.0):
        stated = news(
            watch(),
            wheel,
            lambda t: 0.1 * math.sin(2.0 * math.pi * t / period_s),
            120.0,
            belief=PRIOR,
            noise_rpm=noise_rpm,
        )
        assert stated == []


@pytest.mark.parametrize(("refresh", "period_s"), [(3, 20.0), (5, 60.0)])
def test_telemetry_refreshed_more_slowly_than_it_is_read_is_not_stuck(refresh: int, period_s: float) -> None:
    """Each reading is sent three or five times, up to the silence: repeats teach nothing, and nothing is said."""
    stated = news(watch(), Wheel(), lambda t: 0.3 * math.sin(2.0 * math.pi * t / period_s), 120.0, refresh=refresh)
    assert stated == []


@pytest.mark.parametrize("current_A", [0.15, 0.3, 0.6, -0.4])
@pytest.mark.parametrize("speed_rpm", [40.0, -700.0, 2000.0])
@pytest.mark.parametrize("noise_rpm", [0.0, 1.0])
def test_a_reading_that_freezes_under_current_is_found(current_A: float, speed_rpm: float, noise_rpm: float) -> None:
    """From then on the wheel must move: found no sooner than the silence, and before it is two seconds old."""
    wheel = Wheel()
    steady = (wheel.k * abs(current_A) - wheel.c - wheel.b * abs(speed_rpm) * RAD_S_PER_RPM) * math.copysign(
        1, current_A
    )
    assert abs(steady) > 0.3  # else it is near its own steady speed, and would not move
    stated = news(
        watch(),
        wheel,
        lambda t: current_A,
        8.0,
        speed=speed_rpm * RAD_S_PER_RPM,
        noise_rpm=noise_rpm,
        frozen=lambda t: t > 2.0,
    )
    ((at_s, what),) = stated
    assert what == "stuck"
    assert 2.0 + SILENCE_S - 2.0 * PERIOD_S <= at_s <= 4.0


def test_a_coasting_wheel_whose_reading_freezes_is_found() -> None:
    """Without any current friction alone must slow it down."""
    stated = news(watch(), Wheel(), lambda t: 0.0, 8.0, speed=100.0, frozen=lambda t: t > 2.0)
    assert [what for _, what in stated] == ["stuck"]


@pytest.mark.parametrize("share", [0.7, 1.0, 1.3])
def test_a_reading_frozen_from_the_start_is_found_under_the_default_prior(share: float) -> None:
    """Nothing was ever learnt, k is within 30 %: a wheel that reads zero under 0.3 A is not believed for long."""
    stated = news(watch(), Wheel(k=15.2 * share), lambda t: 0.3, 5.0, belief=PRIOR, frozen=lambda t: True)
    assert [what for _, what in stated] == ["stuck"]
    assert stated[0][0] < 2.0


@pytest.mark.parametrize("after_s", [0.3, 1.0, 1.9, 2.8])
@pytest.mark.parametrize("share", [0.7, 1.0, 1.3])
def test_a_reading_frozen_in_the_first_second_of_a_sine_is_found_under_the_default_prior(
    after_s: float, share: float
) -> None:
    """A current that changes its sign before it proves anything by itself: what all of it says together is enough."""
    stated = news(
        watch(),
        Wheel(k=15.2 * share),
        lambda t: 0.05 + 0.085 * math.sin(0.5 * math.pi * t),
        20.0,
        speed=20.0,
        noise_rpm=1.0,
        belief=PRIOR,
        frozen=lambda t: t > after_s,
    )
    assert [what for _, what in stated] == ["stuck"]
    assert stated[0][0] < after_s + 8.0  # two periods


@pytest.mark.parametrize("seed", range(30))
def test_coarse_readings_of_a_wheel_far_from_the_prior_are_no_alarm(seed: int) -> None:
    """Gain and friction drawn from .4 to 1.8 of the default prior, steps of up to 10 rpm, weak and slow currents."""
    rng = np.random.default_rng(seed)
    c = 0.586 * rng.uniform(0.4, 1.8)
    wheel = Wheel(15.2 * rng.uniform(0.4, 1.6), 0.0032 * rng.uniform(0.2, 3.0), c, c * rng.uniform(1.0, 1.3))
    amplitude, period_s = 10.0 ** rng.uniform(-2.3, -0.5), 10.0 ** rng.uniform(0.3, 2.3)
    bias, step_rpm = rng.uniform(-0.5, 1.5) * c / wheel.k, float(rng.choice([0.5, 2.0, 5.0, 10.0]))
    stated = news(
        watch(step_rpm),
        wheel,
        lambda t: bias + amplitude * math.sin(2.0 * math.pi * t / period_s),
        120.0,
        speed=rng.uniform(-100.0, 100.0),
        step_rpm=step_rpm,
        belief=PRIOR,
    )
    assert stated == []


def test_the_distance_to_a_wheel_that_stands_is_the_least_cost_of_one() -> None:
    """Eq. 4 by recursion against the same least squares solved at once."""
    rng = np.random.default_rng(3)
    mean, within, dt = np.array([15.2, 0.0032, 0.586, 0.6]), 0.4, 0.1
    P = np.diag(np.square(0.3 * mean))
    proof = StandingProof(mean.tolist(), P, within)
    phi = rng.normal(size=(40, 4))
    for row in phi:
        proof.add(row.tolist(), 0.2, dt)
    paths = np.vstack([dt * np.cumsum(phi, axis=0) * math.sqrt(dt) / within, np.linalg.inv(np.linalg.cholesky(P))])
    beyond = -0.2 * dt * np.arange(1, 41) * math.sqrt(dt) / within
    target = np.concatenate([beyond, np.linalg.solve(np.linalg.cholesky(P), mean)])
    residual = target - paths @ np.linalg.lstsq(paths, target, rcond=None)[0]
    assert proof.squared_distance == pytest.approx(float(residual @ residual), rel=1e-9)


def test_a_reading_that_moves_again_is_believed_only_after_it_moved_as_the_wheel_does() -> None:
    """Frozen for three seconds: alive again no sooner than twice the silence after it moved, and then not stuck."""
    sine = lambda t: 0.1 * math.sin(t)  # noqa: E731
    stated = news(watch(), Wheel(), sine, 20.0, speed=30.0, noise_rpm=1.0, frozen=lambda t: 3.0 < t < 6.0)
    assert [what for _, what in stated] == ["stuck", "alive"]
    assert stated[1][0] >= 6.0 + 2.0 * SILENCE_S - PERIOD_S


def test_readings_that_jump_about_after_they_were_stuck_are_not_believed() -> None:
    """What moves by hundreds of rpm from sample to sample is not a coasting wheel: stuck it stays."""
    wheel, judge = Wheel(), watch()
    stated = news(judge, wheel, lambda t: 0.3, 4.0, speed=30.0, frozen=lambda t: t > 1.0)
    assert [what for _, what in stated] == ["stuck"]
    for i in range(100):
        judged = judge.add(4.0 + PERIOD_S * i, 50.0 * (i % 2) + 1.0, 0.0, lambda: wheel.belief)
        assert judged == (False, True, None)


def test_a_torque_that_only_an_effect_of_the_model_explains_is_no_alarm() -> None:
    """A declared offset holds the wheel at a steady speed: without it the four parameters would call it stuck."""
    wheel, offset = Wheel(), 0.8
    current = (wheel.c + wheel.b * 100.0 + offset) / wheel.k
    for reported in (True, False):
        judge = watch()
        for i in range(600):
            judge.add(PERIOD_S * i, 100.0 + (1e-3 * i if i < 30 else 0.0), current, lambda: wheel.belief)
            if reported:
                judge.note_prediction(100.0, current, 100.0, PERIOD_S)
        assert judge.stuck is not reported


def test_a_belief_that_no_wheel_can_have_accuses_none() -> None:
    """An undeclared torque has taught the filter negative friction: what it started from is asked instead."""
    wheel = Wheel()
    wild = FrictionParameters(wheel.k, -4.0 * wheel.b, 2.0 * wheel.c, -wheel.s)
    absurd = ParameterBelief(wild, 1e-2 * wheel.belief.covariance)
    current = -(wheel.c + wheel.b * 1.3) / wheel.k
    for first, accused in ((wheel.belief, False), (absurd, True)):
        judge = watch()
        judge.add(0.0, -1.0, current, lambda first=first: first)  # type: ignore[misc]
        for i in range(1, 100):
            judge.add(PERIOD_S * i, -1.3, current, lambda: absurd)
        assert judge.stuck is accused


def test_a_belief_that_earlier_runs_led_astray_proves_nothing() -> None:
    """A wheel that holds 15 rpm against a torque that the model lacks, believed with a negative friction: no alarm.

    The estimator goes on from what such runs have learned: a viscous friction below zero by 4.6 of its sigmas, and the
    others as narrow. Against that belief alone the wheel must have moved; the configuration's, which is a wheel's, says
    that it need not.
    """
    stds = np.array([0.128, 0.0023, 0.013, 0.05])
    misled = ParameterBelief(FrictionParameters(14.46, -0.0106, 0.173, 1.437), np.diag(stds * stds))
    readings = 15.0 + np.random.default_rng(3).normal(0.0, 1.0, 40)
    stated = {}
    for name, first in (("of earlier runs", None), ("of the configuration", PRIOR)):
        noise = 1.0 * RAD_S_PER_RPM
        judge = StuckWatch(0.5 * noise, noise, SILENCE_S, STRIBECK, GAUSS, within_rad_s=4.0 * noise, first=first)
        judged = [
            judge.add(PERIOD_S * i, float(reading) * RAD_S_PER_RPM, 0.071, lambda: misled)
            for i, reading in enumerate(readings)
        ]
        stated[name] = [one.news for one in judged if one.news]
    assert stated == {"of earlier runs": ["stuck"], "of the configuration": []}
