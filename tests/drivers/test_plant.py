"""The simulated plant against closed forms and an independent integrator; it is the truth others are judged by."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rw_ekf.drivers.sim.plant import advance
from rw_ekf.drivers.sim.plant_batch import plain_run, simulate_run
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_effects import EFFECTS
from rw_ekf.drivers.sim.plant_parameters import FINE_STEP_S, QUICK_STEP_S, PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.units import RAD_S_PER_RPM

WHEEL = PlantParameters()
QUIET = PlantNoise(0.0)


def exact(p: PlantParameters, speed_rad_s: float, current_A: float, duration_s: float) -> float:
    """The speed by an adaptive integrator of order 8 with located zero crossings (base model, Gauss)."""
    drive = p.motor_gain * current_A
    now_s = 0.0
    while now_s < duration_s:
        if speed_rad_s == 0.0 and abs(drive) <= p.static:
            return 0.0
        direction = math.copysign(1.0, speed_rad_s if speed_rad_s != 0.0 else drive)

        def slope(t: float, y: list[float], direction: float = direction) -> list[float]:
            bump = (p.static - p.coulomb) * math.exp(-((y[0] / p.stribeck_speed_rad_s) ** 2))
            return [drive - p.viscous * y[0] - direction * (p.coulomb + bump)]

        def stops(t: float, y: list[float], begin: float = now_s, direction: float = direction) -> float:
            return float(y[0]) if t > begin + 1e-7 else direction

        stops.terminal = True  # type: ignore[attr-defined]
        done = solve_ivp(
            slope, (now_s, duration_s), [speed_rad_s], "DOP853", events=stops, rtol=1e-12, atol=1e-12, max_step=0.05
        )
        if not done.t_events[0].size:
            return float(done.y[0, -1])
        now_s, speed_rad_s = float(done.t_events[0][0]), 0.0
    return speed_rad_s


def test_coast_down_is_the_closed_form() -> None:
    """Without the Stribeck bump a coast-down is an exponential, and it ends at rest at the right instant and stays."""
    p = WHEEL._replace(static=WHEEL.coulomb)
    ratio = p.coulomb / p.viscous
    state = advance(p, PlantState(speed_rad_s=100.0), 0.0, 60.0, FINE_STEP_S)
    assert state.speed_rad_s == pytest.approx((100.0 + ratio) * math.exp(-p.viscous * 60.0) - ratio, abs=1e-8)
    assert state.angle_rad == pytest.approx(
        (100.0 + ratio) * (1 - math.exp(-p.viscous * 60.0)) / p.viscous - ratio * 60.0, rel=1e-7
    )
    stop_s = math.log(1.0 + 100.0 / ratio) / p.viscous
    assert advance(p, PlantState(speed_rad_s=100.0), 0.0, stop_s - 1e-3, FINE_STEP_S).speed_rad_s > 0.0
    assert advance(p, PlantState(speed_rad_s=100.0), 0.0, stop_s + 1e-3, FINE_STEP_S).speed_rad_s == 0.0
    assert advance(p, PlantState(speed_rad_s=100.0), 0.0, stop_s + 9.0, FINE_STEP_S).speed_rad_s == 0.0


@pytest.mark.parametrize("step_s", [FINE_STEP_S, QUICK_STEP_S])
@pytest.mark.parametrize("current_A", [-0.05, -0.2, -0.6, -0.0398, 0.0])
def test_a_reversal_is_exact_to_far_below_a_thousandth_of_a_rpm(current_A: float, step_s: float) -> None:
    """From 5 and 1.5 rad/s through zero: the error against an event-located order 8 integrator is below 1e-6 rpm."""
    for speed_rad_s in (1.5, 5.0):
        state = advance(WHEEL, PlantState(speed_rad_s=speed_rad_s), current_A, 4.0, step_s)
        error_rad_s = abs(state.speed_rad_s - exact(WHEEL, speed_rad_s, current_A, 4.0))
        assert error_rad_s < 1e-6 * RAD_S_PER_RPM


def test_equilibrium_is_where_the_torques_balance() -> None:
    """After many time constants k I = b omega + c."""
    state = advance(WHEEL, PlantState(speed_rad_s=100.0), 0.08, 4000.0, 5e-3)
    assert state.speed_rad_s == pytest.approx((15.205 * 0.08 - 0.5863) / 0.00322, rel=1e-4)


def test_it_sticks_below_the_break_away_friction_and_leaves_above() -> None:
    """At rest: |k I| just below s holds for ever, just above it moves, the same both ways."""
    limit_A = WHEEL.static / WHEEL.motor_gain
    for sign in (1.0, -1.0):
        assert advance(WHEEL, PlantState(), sign * limit_A * 0.999, 50.0, FINE_STEP_S).speed_rad_s == 0.0
        assert sign * advance(WHEEL, PlantState(), sign * limit_A * 1.001, 5.0, FINE_STEP_S).speed_rad_s > 0.001


def test_energy_only_falls_without_a_current() -> None:
    """A coasting wheel, with every opposing effect at once, never gains speed."""
    p = parse_effects(
        ["quadratic_drag", "drag_spike:onset_s=1", "coulomb_temperature", "drag_bump", "friction_lag", "cubic_drag"]
    )
    state, speeds = PlantState(speed_rad_s=8.0), []
    for _ in range(200):
        state = advance(p, state, 0.0, 0.1, QUICK_STEP_S)
        speeds.append(state.speed_rad_s)
    assert all(late <= early for early, late in pairwise(speeds))
    assert speeds[-1] == 0.0


def test_the_wheel_is_symmetric() -> None:
    """Mirrored current, mirrored motion, to the last bit."""
    times = np.arange(400) * 0.1
    current = 0.1 * np.sin(times)
    one, other = (simulate_run(WHEEL, sign * current, times, QUIET, command_delay_s=0.01) for sign in (1.0, -1.0))
    assert np.array_equal(one.speed_rad_s, -other.speed_rad_s)
    assert np.ptp(one.speed_rad_s) > 1.0


@pytest.mark.parametrize("effect", [None, *EFFECTS])
def test_compiled_and_plain_runs_are_the_same_bits(effect: str | None) -> None:
    """The very functions that Python runs are compiled."""
    p = parse_effects([effect] if effect else [])
    times = np.arange(150) * 0.1
    current = 0.1 * np.sin(times)
    keys = {"seed": 3, "command_delay_s": 0.012, "initial_speed_rad_s": 1.0, "fine_step_s": 1e-3}
    compiled = simulate_run(p, current, times, PlantNoise(0.1, 0.01), **keys)  # type: ignore[arg-type]
    plain = simulate_run(p, current, times, PlantNoise(0.1, 0.01), run=plain_run, **keys)  # type: ignore[arg-type]
    for name in ("measured_speed_rad_s", "speed_rad_s", "temperature_degC", "angle_rad", "current_A"):
        assert np.array_equal(getattr(compiled, name), getattr(plain, name)), name


def test_the_runner_and_the_batch_are_one_wheel() -> None:
    """The same commands with the same delay give the same speeds live and in a batch."""
    times = np.arange(100) * 0.1
    current = 0.15 * np.sin(times)
    batch = simulate_run(WHEEL, current, times, QUIET, command_delay_s=0.03, fine_step_s=QUICK_STEP_S)
    runner = PlantRunner(WHEEL, QUIET)
    for i, time_s in enumerate(times):
        runner.advance_to(float(time_s))
        assert runner.speed_rad_s == pytest.approx(batch.speed_rad_s[i], abs=1e-12)
        runner.command(float(current[i]), float(time_s) + 0.03)


def test_commands_act_when_their_delay_says() -> None:
    """A delay of two and a half samples moves the speed by as much as the step's integral says."""
    times = np.arange(60) * 0.1
    current = np.where(times >= 1.0, 0.2, 0.1)
    early, late = (
        simulate_run(WHEEL, current, times, QUIET, command_delay_s=delay_s, initial_speed_rad_s=50.0)
        for delay_s in (0.0, 0.25)
    )
    lost = 15.205 * 0.1 * 0.25 + 15.205 * 0.1 * 0.25  # the step 0.25 s late, and the first 0.25 s without a current
    assert early.speed_rad_s[-1] - late.speed_rad_s[-1] == pytest.approx(lost, rel=0.02)


def test_noise_is_what_it_says_and_comes_from_the_seed() -> None:
    """Reading noise and process noise have the deviation asked for; the seed repeats them."""
    times = np.arange(20000) * 0.1
    current = np.full(times.size, 0.08)
    noise = PlantNoise(0.1, 0.02)
    keys = {"initial_speed_rad_s": 190.0, "fine_step_s": 1e-3}
    one, same = (simulate_run(WHEEL, current, times, noise, seed=4, **keys) for _ in range(2))  # type: ignore[arg-type]
    other = simulate_run(WHEEL, current, times, noise, seed=5, **keys)  # type: ignore[arg-type]
    assert np.array_equal(one.measured_speed_rad_s, same.measured_speed_rad_s)
    assert not np.array_equal(one.measured_speed_rad_s, other.measured_speed_rad_s)
    assert np.std(one.measured_speed_rad_s - one.speed_rad_s) == pytest.approx(0.1, rel=0.03)
    kicks = np.diff(one.speed_rad_s - other.speed_rad_s) / math.sqrt(2.0)
    assert np.std(kicks) == pytest.approx(0.02 * math.sqrt(0.1), rel=0.03)


def test_bad_input_to_a_run_is_refused() -> None:
    """Shapes that differ, times that stand still and currents that are no numbers are errors, not results."""
    times = np.arange(5) * 0.1
    for current, when in ((np.zeros(4), times), (np.zeros(5), times * 0.0), (np.full(5, np.nan), times)):
        with pytest.raises(ValueError, match="must be"):
            simulate_run(WHEEL, current, when)


def test_it_warms_up_and_cools_down() -> None:
    """First order towards ambient plus self heating, with the time constant given."""
    p = WHEEL._replace(thermal_time_s=100.0, ambient_cycle_degC=0.0, heating_degC_s_rad=0.05, heating_degC_A2=0.0)
    state = advance(p, PlantState(speed_rad_s=0.0, temperature_degC=30.0), 0.0, 100.0, QUICK_STEP_S)
    assert state.temperature_degC == pytest.approx(20.0 + 10.0 * math.exp(-1.0), abs=1e-6)
    hot = advance(p, PlantState(speed_rad_s=200.0), (0.5863 + 0.00322 * 200.0) / 15.205, 1000.0, 5e-3)
    assert hot.temperature_degC == pytest.approx(30.0, abs=0.05)
    cycled = p._replace(ambient_cycle_degC=8.0, ambient_period_s=400.0, thermal_time_s=0.1)
    assert advance(cycled, PlantState(), 0.0, 100.0, QUICK_STEP_S).temperature_degC == pytest.approx(28.0, abs=0.01)
