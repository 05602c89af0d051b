"""Each effect, by id, does what its docstring says; the text form says what is wrong with it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rw_ekf.drivers.sim.plant import advance
from rw_ekf.drivers.sim.plant_batch import PlantRun, simulate_run
from rw_ekf.drivers.sim.plant_effect_text import describe_effects, parse_effect, parse_effects
from rw_ekf.drivers.sim.plant_effects import CATALOGUE_IDS, EFFECTS
from rw_ekf.drivers.sim.plant_parameters import FINE_STEP_S, PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.errors import BadInputError

BASE = PlantParameters()
SHORT_S = 1.0e-3


def slowing(effect: str, speed_rad_s: float, current_A: float, time_s: float, degC: float) -> float:
    """By how much the effect slows the wheel [rad/s^2], over a millisecond from this state."""
    state = PlantState(time_s, speed_rad_s, 0.0, degC, current_A)
    speeds = [
        advance(p, state, current_A, SHORT_S, FINE_STEP_S).speed_rad_s for p in (BASE, parse_effects([effect], BASE))
    ]
    return (speeds[0] - speeds[1]) / SHORT_S


def run(effect: str | None, amplitude_A: float = 0.15, period_s: float = 10.0, speed_rad_s: float = 0.0) -> PlantRun:
    """Forty seconds of a sine without noise, on a warm wheel."""
    times = np.arange(400) * 0.1
    current = amplitude_A * np.sin(2.0 * np.pi * times / period_s)
    p = parse_effects([effect] if effect else [], BASE)
    return simulate_run(
        p, current, times, PlantNoise(0.0), initial_speed_rad_s=speed_rad_s, initial_temperature_degC=30.0
    )


# effect, speed [rad/s], current [A], time [s], temperature [degC], slowing expected [rad/s^2]
STEADY = [
    ("offset_torque:torque_rad_s2=0.03", 50.0, 0.0, 0.0, 20.0, 0.03),
    ("offset_torque:torque_rad_s2=0.03", -50.0, 0.0, 0.0, 20.0, 0.03),
    ("viscous_asymmetry:difference_1_s=0.0002", 100.0, 0.0, 0.0, 20.0, 0.02),
    ("viscous_asymmetry:difference_1_s=0.0002", -100.0, 0.0, 0.0, 20.0, 0.02),
    ("quadratic_drag:coefficient_1_rad=1e-6", 200.0, 0.0, 0.0, 20.0, 0.04),
    ("quadratic_drag:coefficient_1_rad=1e-6", -200.0, 0.0, 0.0, 20.0, -0.04),
    ("cubic_drag:coefficient_s_rad2=5e-9", 200.0, 0.0, 0.0, 20.0, 0.04),
    ("viscous_temperature:slope_1_K=-0.02", 100.0, 0.0, 0.0, 30.0, -0.2 * 0.322),
    ("coulomb_temperature:slope_1_K=-0.01", 100.0, 0.0, 0.0, 30.0, -0.1 * 0.5863),
    ("coulomb_temperature:slope_1_K=-0.01", -100.0, 0.0, 0.0, 30.0, 0.1 * 0.5863),
    ("motor_gain_temperature:slope_1_K=-0.002", 100.0, 0.5, 0.0, 30.0, 0.02 * 15.205 * 0.5),
    ("motor_saturation:slope_1_A=0.1", 100.0, 0.5, 0.0, 20.0, 0.05 * 15.205 * 0.5),
    ("motor_saturation:slope_1_A=0.1", 100.0, -0.5, 0.0, 20.0, -0.05 * 15.205 * 0.5),
    ("current_deadzone:width_A=0.002", 100.0, 0.1, 0.0, 20.0, 15.205 * 0.002),
    ("current_deadzone:width_A=0.002", 100.0, 0.001, 0.0, 20.0, 15.205 * 0.001),
    ("torque_ripple:amplitude_rad_s2=0.03,order=0.001,phase_rad=1.5707963", 5.0, 0.0, 0.0, 20.0, 0.03),
    ("drag_spike:amplitude_rad_s2=0.05,onset_s=10,decay_s=60", 50.0, 0.0, 9.0, 20.0, 0.0),
    ("drag_spike:amplitude_rad_s2=0.05,onset_s=10,decay_s=60", 50.0, 0.0, 10.0, 20.0, 0.05),
    ("drag_spike:amplitude_rad_s2=0.05,onset_s=10,decay_s=60", -50.0, 0.0, 70.0, 20.0, -0.05 * math.exp(-1.0)),
    ("coulomb_drift:rate_rad_s3=-2e-4,time_constant_s=300", 50.0, 0.0, 300.0, 20.0, -0.06 * (1 - math.exp(-1.0))),
    ("coulomb_drift:rate_rad_s3=1e-4,time_constant_s=0", -50.0, 0.0, 100.0, 20.0, -0.01),
    ("external_torque:amplitude_rad_s2=0.03,frequency_Hz=0.05", 50.0, 0.0, 5.0, 20.0, 0.03),
    ("stribeck_shape:speed_rad_s=1.0", 1.0, 0.0, 0.0, 20.0, 0.0174 * (math.exp(-1) - math.exp(-((1 / 0.41888) ** 2)))),
    ("stribeck_shape:speed_rad_s=1.0,law=tustin", 3.0, 0.0, 0.0, 20.0, 0.0174 * math.exp(-3.0)),
    ("stribeck_shape:speed_rad_s=1.0,law=lorentz", 3.0, 0.0, 0.0, 20.0, 0.0174 / 10.0),
    ("drag_bump:amplitude_rad_s2=0.05,speed_rad_s=60", 60.0, 0.0, 0.0, 20.0, 0.05),
    ("drag_bump:amplitude_rad_s2=0.05,speed_rad_s=60", -60.0, 0.0, 0.0, 20.0, -0.05),
    ("motor_gain_speed:slope_s_rad=3e-4", -60.0, 0.2, 0.0, 20.0, 3.0e-4 * 60.0 * 15.205 * 0.2),
    ("acceleration_friction:ratio=0.03", 60.0, 0.2, 0.0, 20.0, 0.03 * 15.205 * 0.2),
    ("acceleration_friction:ratio=0.03", 60.0, -0.2, 0.0, 20.0, 0.03 * 15.205 * 0.2),
]


@pytest.mark.parametrize(("effect", "speed", "current", "time_s", "degC", "expected"), STEADY)
def test_it_slows_the_wheel_by_its_formula(
    effect: str, speed: float, current: float, time_s: float, degC: float, expected: float
) -> None:
    """f of the docstring, with its sign: f > 0 slows a wheel turning forward."""
    assert slowing(effect, speed, current, time_s, degC) == pytest.approx(expected, rel=2e-3, abs=2e-5)


READINGS = {"speed_quantisation", "speed_averaging"}  # of the sensor: the wheel does not notice


@pytest.mark.parametrize("effect", [name for name in EFFECTS if name not in READINGS])
def test_every_default_shows_in_a_record(effect: str) -> None:
    """With its defaults alone every effect moves the true speed; the base is the same run without it."""
    speed = 70.0 if effect in {"drag_bump", "cubic_drag", "quadratic_drag"} else 0.0
    settings = ":onset_s=5" if effect == "drag_spike" else ""
    difference = run(effect + settings, speed_rad_s=speed).speed_rad_s - run(None, speed_rad_s=speed).speed_rad_s
    assert np.sqrt(np.mean(difference**2)) > 1e-4


def test_actuator_lag_and_transport_delay_shift_a_ramp_alike() -> None:
    """On a ramp of current both cost the same speed: ramp times time constant, or delay."""
    times = np.arange(100) * 0.02
    current = 0.1 * times
    base, lagged, delayed = (
        simulate_run(parse_effects(effects), current, times, PlantNoise(0.0), initial_speed_rad_s=50.0)
        for effects in ([], ["actuator_lag:time_constant_s=0.04"], ["transport_delay:delay_s=0.04"])
    )
    lost = 15.205 * 0.1 * 0.04 * (times[-1] - 0.02)  # the mean of the ramp lost over the run
    for later in (lagged, delayed):
        assert base.speed_rad_s[-1] - later.speed_rad_s[-1] == pytest.approx(lost, rel=0.06)
    assert lagged.current_A[1] == pytest.approx(0.0, abs=1e-9)
    assert 0.0 < lagged.current_A[-1] < current[-2]


@pytest.mark.parametrize("time_constant_s", [0.005, 0.02, 0.1])
def test_a_wheel_breaks_away_when_the_lagging_current_is_there(time_constant_s: float) -> None:
    """From rest: the winding's current is its exponential to the last digits, whatever the wheel does meanwhile, and
    the speed that of an adaptive integrator from the instant at which the drive exceeds the static friction.

    Measured: within 4e-8 rad/s; 1.0e-3 where a step that looks at a wheel at rest had moved the current on as well.
    """
    p = BASE._replace(actuator_lag_s=time_constant_s)
    command_A, end_s = 0.12, 0.5
    state = advance(p, PlantState(), command_A, end_s, FINE_STEP_S)
    assert state.winding_current_A == pytest.approx(command_A * -math.expm1(-end_s / time_constant_s), rel=1e-9)
    begin_s = -time_constant_s * math.log1p(-p.static / (p.motor_gain * command_A))

    def slope(t: float, y: list[float]) -> list[float]:
        bump = (p.static - p.coulomb) * math.exp(-((y[0] / p.stribeck_speed_rad_s) ** 2))
        drive = p.motor_gain * command_A * -math.expm1(-t / time_constant_s)
        return [drive - p.viscous * y[0] - p.coulomb - bump]

    exact = solve_ivp(slope, (begin_s, end_s), [0.0], "DOP853", rtol=1e-12, atol=1e-12, max_step=0.01).y[0, -1]
    assert state.speed_rad_s == pytest.approx(exact, abs=1e-6)


def test_presliding_springs_back_below_break_away_and_leaves_above() -> None:
    """Half of the break-away torque bends the bristle about half way; released, the wheel comes back; twice leaves."""
    p = parse_effects(["presliding_hysteresis:deflection_rad=0.05,damping=0.5"])
    half_A = 0.5 * BASE.static / BASE.motor_gain
    bent = advance(p, PlantState(), half_A, 10.0, FINE_STEP_S)
    assert 0.02 < bent.angle_rad < 0.06
    back = advance(p, bent, 0.0, 10.0, FINE_STEP_S)
    assert abs(back.angle_rad) < 0.8 * bent.angle_rad
    assert abs(back.speed_rad_s) < 1e-3
    assert advance(p, PlantState(), 4.0 * half_A, 5.0, FINE_STEP_S).angle_rad > 1.0


def test_presliding_becomes_coulomb_friction_at_speed() -> None:
    """Far from zero the bristle is bent to the full and the wheel slows as the base does."""
    p = parse_effects(["presliding_hysteresis"])
    settled = advance(p, PlantState(speed_rad_s=60.0), 0.0, 1.0, FINE_STEP_S)
    later = advance(p, settled, 0.0, 5.0, FINE_STEP_S)
    base = advance(BASE, settled, 0.0, 5.0, FINE_STEP_S)
    assert later.speed_rad_s == pytest.approx(base.speed_rad_s, abs=1e-6)


def test_friction_lag_delays_the_change_of_sign() -> None:
    """Just behind a reversal the old friction still acts: the wheel gets away faster than the base, then alike."""
    reversal = PlantState(speed_rad_s=0.05, winding_current_A=-0.2, lagged_friction_rad_s2=0.6)
    lagged = advance(parse_effects(["friction_lag:time_constant_s=0.1"]), reversal, -0.2, 0.1, FINE_STEP_S)
    base = advance(BASE, reversal, -0.2, 0.1, FINE_STEP_S)
    assert lagged.speed_rad_s < base.speed_rad_s - 0.02


def test_ripple_far_faster_than_a_step_averages_out() -> None:
    """Order 12 at 300 rad/s has 570 periods a second: the speed moves by no more than a ripple's own swing."""
    p = parse_effects(["torque_ripple:amplitude_rad_s2=0.5,order=12"])
    rippled = advance(p, PlantState(speed_rad_s=300.0), 0.1, 5.0, FINE_STEP_S)
    base = advance(BASE, PlantState(speed_rad_s=300.0), 0.1, 5.0, FINE_STEP_S)
    assert abs(rippled.speed_rad_s - base.speed_rad_s) < 2.0 * 0.5 / (12 * 300.0)


def test_ripple_holds_a_wheel_at_rest() -> None:
    """Cogging adds to break-away where it opposes, and helps where it drives."""
    against, along = (
        parse_effects([f"torque_ripple:amplitude_rad_s2=0.03,phase_rad={phase}"])
        for phase in (math.pi / 2, -math.pi / 2)
    )
    for current_A, p, moves in (
        (0.0405, BASE, True),
        (0.0405, against, False),
        (0.0385, BASE, False),
        (0.0385, along, True),
    ):
        assert (advance(p, PlantState(), current_A, 1.0, FINE_STEP_S).speed_rad_s > 0.0) is moves


def test_three_ripples_and_no_fourth() -> None:
    """Several orders are given one by one."""
    p = parse_effects([f"torque_ripple:order={order}" for order in (1, 2, 6)])
    assert (p.ripple_1_order, p.ripple_2_order, p.ripple_3_order) == (1.0, 2.0, 6.0)
    with pytest.raises(BadInputError, match="3 times at most"):
        parse_effects(["torque_ripple"] * 4)


def test_quantisation_puts_readings_on_a_grid() -> None:
    """Readings are multiples of the grid; the true speed is not touched."""
    runner = PlantRunner(parse_effects(["speed_quantisation:grid_rad_s=0.5"]), PlantNoise(0.1), 1)
    readings = [runner.read_speed() for _ in range(20)]
    assert all(reading % 0.5 == 0.0 for reading in readings)
    quantised = run("speed_quantisation:grid_rad_s=0.5")
    assert np.all(quantised.measured_speed_rad_s % 0.5 == 0.0)
    assert np.array_equal(quantised.speed_rad_s, run(None).speed_rad_s)


@pytest.mark.parametrize("window_s", [0.03, 0.1, 0.25])
def test_averaging_reads_the_mean_of_the_speed_before(window_s: float) -> None:
    """Live and in a batch a reading is the mean of the true speed over the window; the true speed is not touched."""
    p = parse_effects([f"speed_averaging:window_s={window_s}"])
    times, fine = np.arange(60) * 0.1, np.arange(5901) * 1e-3
    currents = 0.3 * np.sign(np.sin(times))
    truth = simulate_run(BASE, np.repeat(currents, 100)[: fine.size], fine, PlantNoise(0.0)).speed_rad_s
    batch = simulate_run(p, currents, times, PlantNoise(0.0))
    runner = PlantRunner(p, PlantNoise(0.0))
    for i in range(60):
        runner.advance_to(times[i])
        runner.command(currents[i])
        if times[i] <= window_s:
            continue
        inside = truth[round(1e3 * (times[i] - window_s)) : round(1e3 * times[i]) + 1]
        mean = float(np.mean(0.5 * (inside[1:] + inside[:-1])))
        assert batch.measured_speed_rad_s[i] == pytest.approx(mean, abs=2e-4)
        assert runner.read_speed() == pytest.approx(mean, abs=5e-3)
    assert np.max(np.abs(batch.speed_rad_s - truth[::100])) < 1e-5


def test_a_drifting_coulomb_friction_wanders_from_the_seed() -> None:
    """The random walk has the spread asked for, live and in a batch."""
    p = parse_effects(["coulomb_drift:rate_rad_s3=0,wander_rad_s2=0.01"])
    ends = []
    for seed in range(200):
        runner = PlantRunner(p, PlantNoise(0.0), seed, PlantState(speed_rad_s=100.0), 5e-3)
        for i in range(10):
            runner.advance_to(i * 0.1)
        ends.append(runner.state.coulomb_wander_rad_s2)
    assert np.std(ends) == pytest.approx(0.01 * math.sqrt(0.9), rel=0.2)
    one, two = (simulate_run(p, np.zeros(300), np.arange(300) * 0.1, seed=s, initial_speed_rad_s=90.0) for s in (1, 2))
    assert np.std(one.speed_rad_s - two.speed_rad_s) > 0.01


def test_all_effects_at_once_stay_finite() -> None:
    """Effects combine: all of them together give a wheel that still turns and stops."""
    p = parse_effects(list(EFFECTS))
    times = np.arange(600) * 0.1
    result = simulate_run(p, 0.2 * np.sin(times / 3.0), times)
    assert np.isfinite(result.measured_speed_rad_s).all()
    assert np.ptp(result.speed_rad_s) > 1.0


def test_strangers_are_flagged_and_every_effect_has_defaults_and_a_description() -> None:
    """What the catalogue does not know says so, and nothing else does; each line can be given as it stands."""
    strangers = {name for name, effect in EFFECTS.items() if "NOT IN THE CATALOGUE" in effect.meaning}
    assert strangers == set(EFFECTS) - set(CATALOGUE_IDS)
    assert strangers >= {"motor_gain_speed", "acceleration_friction"}
    lines = describe_effects()
    assert len(lines) == len(EFFECTS)
    for line in lines:
        parse_effect(line.split("  ")[0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("windage", r"unknown effect 'windage' in 'windage'; there are: offset_torque, .*acceleration_friction"),
        ("offset_torque:torque=1", r"'torque=1' is not name=value of a parameter; it has: torque_rad_s2=0.03"),
        ("offset_torque:torque_rad_s2", "is not name=value"),
        ("offset_torque:torque_rad_s2=much", "torque_rad_s2 must be a number, not 'much'"),
        ("offset_torque:torque_rad_s2=nan", "must be a number, not 'nan'"),
        ("offset_torque:torque_rad_s2=1,torque_rad_s2=2", "torque_rad_s2 is given twice"),
        ("actuator_lag:time_constant_s=-1", "time_constant_s must not be below 0"),
        ("stribeck_shape:law=square", "unknown law 'square'; one of gauss, tustin, lorentz"),
        ("stribeck_shape:speed_rad_s=0", "speed_rad_s must be above 0"),
        ("drag_spike:decay_s=0", "decay_s must be above 0"),
        ("drag_bump:width_rad_s=0", "width_rad_s must be above 0"),
    ],
)
def test_a_bad_effect_says_what_exists(text: str, message: str) -> None:
    """Every mistake in --effect is one sentence with the choices."""
    with pytest.raises(BadInputError, match=message):
        parse_effect(text)


def test_the_same_effect_twice_is_refused() -> None:
    """Twice the same would silently keep one."""
    with pytest.raises(BadInputError, match="given twice"):
        parse_effects(["friction_lag", "friction_lag"])
