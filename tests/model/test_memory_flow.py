"""Friction with a memory: against an adaptive integrator with events, the simulated wheel, limits and physical laws."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from rw_ekf.compiled import Kernel
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.effects.friction_lag import FrictionLag
from rw_ekf.effects.presliding_hysteresis import PreslidingHysteresis
from rw_ekf.model import flow as propagation
from rw_ekf.model import friction as model_friction
from rw_ekf.model import memory_coast, memory_flow
from rw_ekf.model.flow import flow
from rw_ekf.model.friction import GAUSS, LAW_CODES, FrictionCurve
from rw_ekf.model.memory_coast import BRISTLE, LAG, Wheel
from rw_ekf.model.memory_flow import bristle_flow, lag_flow
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.units import RAD_S_PER_RPM
from tests.counting import lines_of

K, B, C, S = CK13_STATISTICAL
OMEGA_S = 4.0 * RAD_S_PER_RPM
DAMPING = 0.3
MOST_LINES = 1_200_000  # twice the most that was counted
KINDS = {"friction_lag": LAG, "presliding_hysteresis": BRISTLE}
# Every size the flow is made for: tau [s], deflection [rad].
SIZES = {LAG: (0.005, 0.02, 0.1, 0.3, 1.0), BRISTLE: (0.002, 0.01, 0.05, 0.2, 0.5)}


class Case(NamedTuple):
    """Arguments of a flow without duration; size: time constant [s] or deflection [rad]."""

    omega: float
    memory: float
    drive: float
    b: float
    c: float
    s: float
    omega_s: float
    law: int
    size: float

    @property
    def curve(self) -> FrictionCurve:
        """The friction's numbers, as the flows take them."""
        return FrictionCurve(self.b, self.c, self.s, self.omega_s, self.law)


def run(kind: int, case: Case, duration: float) -> tuple[float, float]:
    """The flow of either effect."""
    effect = FrictionLag if kind == LAG else PreslidingHysteresis
    return effect.flow(case.omega, case.memory, case.drive, case.curve, case.size, (DAMPING, 0.0, 0.0), duration)


def exact(kind: int, case: Case, duration: float) -> tuple[float, float]:
    """scipy's adaptive integration of the printed equations in (omega, F) or (omega, z), cut at zero speed."""
    omega, memory, drive, b, c, s, omega_s, law, size = case
    stiffness = s / size
    damping = 2.0 * DAMPING * math.sqrt(stiffness)
    scale = stiffness if kind == BRISTLE else 1.0

    def level(speed: float) -> float:
        u = speed / omega_s
        return c + (s - c) * (math.exp(-u * u), math.exp(-u), 1.0 / (1.0 + u * u))[law]

    def at_rest(_t: float, y: Sequence[float]) -> float:
        return y[0]

    at_rest.terminal = True  # type: ignore[attr-defined]
    left, x = duration, memory / scale
    for _ in range(200):
        if omega == 0.0 and kind == LAG and abs(drive) <= s:
            return 0.0, drive
        net = drive - scale * x
        if omega == 0.0 and abs(net) < 1e-9 * s:
            break
        sign = math.copysign(1.0, omega if omega != 0.0 else net)
        at_rest.direction = -sign  # type: ignore[attr-defined]

        def slope(_t: float, y: Sequence[float], sign: float = sign) -> list[float]:
            dry = level(sign * y[0])
            if kind == LAG:
                return [drive - b * y[0] - y[1], (sign * dry - y[1]) / size]
            bending = y[0] - sign * y[0] * y[1] * stiffness / dry
            return [drive - b * y[0] - stiffness * y[1] - damping * bending, bending]

        atol = [1e-11 * omega_s, 1e-11 * s / scale]
        solved = solve_ivp(slope, (0.0, left), [omega, x], method="LSODA", rtol=1e-10, atol=atol, events=at_rest)
        omega, x = (float(value) for value in solved.y[:, -1])
        if solved.status == 0:
            break
        left -= float(solved.t[-1])
        omega = 0.0
    return omega, scale * x


def draw(rng: np.random.Generator, kind: int, wide: bool = False, law: int = GAUSS) -> Case:
    """Somewhere near zero speed or far from it, with a memory of either sign, driven below or above break-away."""
    c = C * math.exp(0.3 * rng.standard_normal()) if wide else C
    s = c * rng.uniform(0.9, 1.4) if wide else S
    omega = rng.choice([0.0, 0.02, 0.1, 1.0, 5.0, 50.0]) * rng.standard_normal()
    drive = K * rng.choice([0.02, 0.04, 0.1, 0.4]) * rng.standard_normal()
    memory = c * rng.choice([-1.0, -0.5, 0.0, 1.0])
    size = SIZES[kind][int(rng.integers(5))]
    return Case(float(omega), float(memory), float(drive), B, c, float(s), OMEGA_S, law, size)


@pytest.mark.parametrize("law", LAW_CODES)
@pytest.mark.parametrize("duration", [5e-4, 0.1, 1.0])
@pytest.mark.parametrize("effect", KINDS)
def test_the_flow_is_that_of_an_adaptive_integrator(effect: str, duration: float, law: str) -> None:
    """Reversing, creeping, breaking away, held or swinging on the bristle: 1e-5 rad/s, a tenth of what is asked."""
    rng = np.random.default_rng([KINDS[effect], round(1e4 * duration), LAW_CODES[law]])
    for i in range(24):
        case = draw(rng, KINDS[effect], i % 2 == 1, LAW_CODES[law])
        omega, memory = run(KINDS[effect], case, duration)
        omega_true, memory_true = exact(KINDS[effect], case, duration)
        assert omega == pytest.approx(omega_true, rel=1e-8, abs=1e-5), case
        assert memory == pytest.approx(memory_true, abs=1e-3 * case.c), case


@pytest.mark.parametrize("effect", KINDS)
def test_a_plant_of_another_size_is_as_exact(effect: str) -> None:
    """A carriage: metres per second a thousandth of a wheel's rad/s; errors are a hundred-thousandth of ITS omega_s."""
    rng = np.random.default_rng([31, KINDS[effect]])
    omega_s, c, s = 1e-3, 0.21, 0.24
    for size in {LAG: (2e-4, 0.002, 0.05), BRISTLE: (1e-7, 1e-6, 3e-5)}[KINDS[effect]]:
        for _ in range(8):
            start, drive = omega_s * rng.choice([0.0, 0.3, 3.0, 100.0]) * rng.standard_normal(), rng.uniform(-2.0, 2.0)
            memory = float(c * rng.choice([-1.0, 0.0, 1.0]))
            case = Case(float(start), memory, float(drive), 2.1, c, s, omega_s, GAUSS, size)
            for duration in (1e-3, 0.01):
                found, expected = run(KINDS[effect], case, duration), exact(KINDS[effect], case, duration)
                assert found[0] == pytest.approx(expected[0], rel=1e-7, abs=1e-5 * omega_s), case
                assert found[1] == pytest.approx(expected[1], abs=1e-3 * c), case


@pytest.mark.parametrize("size", [0.01, 0.1, 0.4])
@pytest.mark.parametrize("effect", KINDS)
def test_the_simulated_wheel_does_the_same(effect: str, size: float) -> None:
    """Over 32 s of reversals, creep and rest, step by step, the speed stays within 1e-5 rad/s of the plant's."""
    field = "friction_lag_s" if effect == "friction_lag" else "presliding_rad"
    p = PlantParameters(presliding_damping=DAMPING)._replace(**{field: size})
    for period_s in (0.01, 0.1):
        times_s = np.arange(0.0, 32.0, period_s)
        currents_A = 0.12 * np.sin(1.7 * times_s) * (1.0 + np.cos(0.2 * times_s))
        truth = simulate_run(p, currents_A, times_s, PlantNoise(0.0), fine_step_s=5e-5).speed_rad_s
        omega, memory, reversals, worst = 0.0, 0.0, 0, 0.0
        for i in range(1, times_s.size):
            case = Case(omega, memory, K * float(currents_A[i - 1]), B, C, S, OMEGA_S, GAUSS, size)
            before = omega
            omega, memory = run(KINDS[effect], case, period_s)
            reversals += before * omega < 0.0
            worst = max(worst, abs(omega - truth[i]))
        assert reversals > 5
        assert worst < 1e-5


@pytest.mark.parametrize("effect", KINDS)
def test_a_short_memory_is_none(effect: str) -> None:
    """As the time constant or the deflection goes to zero the flow goes to the model's own, and is it from zero on."""
    rng = np.random.default_rng([3, KINDS[effect]])
    shrinking = {LAG: (1e-3, 1e-5), BRISTLE: (1e-5, 1e-9)}[KINDS[effect]]
    for _ in range(60):
        case = draw(rng, KINDS[effect])
        settled = math.copysign(C, case.omega) if case.omega != 0.0 else min(max(case.drive, -S), S)
        case = case._replace(memory=settled)
        curve = FrictionCurve(case.b, case.c, case.s, case.omega_s, case.law)
        plain = flow(case.omega, case.drive, curve, 0.1, False)[0]
        far, near = (abs(run(KINDS[effect], case._replace(size=size), 0.1)[0] - plain) for size in shrinking)
        assert far < 5e-3
        assert near < 5e-5
        for size in (0.0, -0.3):
            omega, memory = run(KINDS[effect], case._replace(size=size), 0.1)
            assert omega == plain
            assert abs(memory) <= S
            assert memory * (omega if omega != 0.0 else case.drive) >= 0.0


@pytest.mark.parametrize("effect", KINDS)
def test_far_from_zero_a_settled_memory_changes_nothing(effect: str) -> None:
    """A fast wheel that has long turned one way moves as in the model without a memory, to rounding."""
    for omega, drive in ((150.0, -2.0), (-40.0, 0.0), (3.0, 5.0)):
        case = Case(omega, math.copysign(C, omega), drive, B, C, S, OMEGA_S, GAUSS, 0.1)
        plain = flow(omega, drive, FrictionCurve(B, C, S, OMEGA_S, GAUSS), 0.5, False)[0]
        assert run(KINDS[effect], case, 0.5) == pytest.approx((plain, case.memory), rel=1e-14)


def test_a_fast_wheel_whose_bristle_is_not_bent_yet_is_exact_without_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Driven hard and braked, with any excess of friction: most cases need no step, and all are those of scipy."""
    steps, step = 0, memory_flow._step

    def counted(*arguments: Any) -> tuple[float, float, float, float]:
        nonlocal steps
        steps += 1
        return step(*arguments)

    monkeypatch.setattr(memory_flow, "_step", counted)
    rng = np.random.default_rng(73)
    without = 0
    for _ in range(200):
        c = C * math.exp(0.3 * rng.standard_normal())
        omega = float(rng.choice([2.6, 5.0, 30.0]) * rng.uniform(0.8, 1.3))
        memory = float(c * (1.0 - rng.choice([2.0, 1.0, -0.3, 0.1, 0.01, 1e-4]) * rng.uniform(0.5, 1.0)))
        drive, b = float(0.4 * K * rng.standard_normal()), float(rng.choice([B, 0.05, 1.0]))
        case = Case(omega, memory, drive, b, c, 1.2 * c, OMEGA_S, GAUSS, float(rng.choice([0.002, 0.01, 0.05, 0.2])))
        duration_s = float(rng.choice([0.005, 0.02, 0.1, 0.3]))
        steps = 0
        found, true = run(BRISTLE, case, duration_s), exact(BRISTLE, case, duration_s)
        without += steps == 0
        assert found[0] == pytest.approx(true[0], rel=1e-8, abs=2e-6), case
        assert found[1] == pytest.approx(true[1], abs=1e-4 * c), case
    assert without > 120


def test_a_friction_that_brakes_through_zero_and_fades_is_not_missed() -> None:
    """Fast at both ends of the interval, through zero in between: no closed form may jump over that."""
    case = Case(2.6, 300.0, 60.0, B, C, S, OMEGA_S, GAUSS, 0.02)
    expected = exact(LAG, case, 0.2)
    assert expected[0] > model_friction.far_limit(GAUSS) * OMEGA_S
    assert run(LAG, case, 0.2) == pytest.approx(expected, abs=1e-5)


def test_a_wheel_that_lags_holds_at_rest_with_the_drive_as_its_friction() -> None:
    """At rest below break-away nothing moves and the memory is the drive; it stops there, too, when it comes by."""
    at = Case(0.0, 0.2, 0.5, B, C, S, OMEGA_S, GAUSS, 0.1)
    assert run(LAG, at, 0.1) == (0.0, 0.5)
    assert run(LAG, at._replace(omega=0.03, memory=C, drive=-0.4), 0.1) == (0.0, -0.4)
    omega, memory = run(LAG, at._replace(drive=0.62), 0.1)
    assert omega > 0.0
    assert 0.2 < memory < S


def test_a_bristle_yields_and_springs_back() -> None:
    """Below break-away the wheel swings to rest with the drive as its memory, and back if released; above it leaves."""
    at = Case(0.0, 0.0, 0.3, B, C, S, OMEGA_S, GAUSS, 0.05)
    omega, memory = at.omega, at.memory
    speeds = []
    for _ in range(200):
        omega, memory = run(BRISTLE, at._replace(omega=omega, memory=memory), 0.1)
        speeds.append(omega)
    assert max(speeds) > 0.03
    assert min(speeds) < 0.0
    assert abs(omega) < 1e-4
    assert memory == pytest.approx(0.3, abs=1e-4)
    assert run(BRISTLE, at._replace(memory=memory, drive=0.0), 0.1)[0] < -0.02
    assert run(BRISTLE, at._replace(drive=0.8), 1.0)[0] > 0.2


cases = {
    kind: st.builds(
        Case,
        st.one_of(st.just(0.0), st.floats(-1.0, 1.0), st.floats(-200.0, 200.0)),
        st.floats(-C, C),
        st.floats(-6.0, 6.0),
        st.floats(0.0, 0.01),
        st.floats(0.4, 0.8),
        st.floats(0.4, 0.8),
        st.just(OMEGA_S),
        st.sampled_from(sorted(LAW_CODES.values())),
        st.floats(SIZES[kind][0], SIZES[kind][-1]),
    )
    for kind in (LAG, BRISTLE)
}
cases_of_both = st.one_of(*(st.tuples(st.just(kind), cases[kind]) for kind in (LAG, BRISTLE)))


@settings(max_examples=150, deadline=None)
@given(cases_of_both, st.floats(1e-3, 0.5))
def test_two_intervals_under_one_drive_are_one(at: tuple[int, Case], duration: float) -> None:
    """The flow is a semigroup: over h as over h/2 twice, speed and memory, to the tolerance of its steps."""
    kind, case = at
    middle = run(kind, case, 0.5 * duration)
    twice = run(kind, case._replace(omega=middle[0], memory=middle[1]), 0.5 * duration)
    once = run(kind, case, duration)
    if kind == LAG and 0.0 in (once[0], twice[0]) and abs(case.drive) <= case.s:
        # Holding is a jump of the memory: the two may differ on which side of the interval's end it falls.
        assert abs(twice[0] - once[0]) < 1e-6
        return
    assert twice[0] == pytest.approx(once[0], rel=1e-9, abs=2e-5)
    assert twice[1] == pytest.approx(once[1], abs=1e-3)


@settings(max_examples=150, deadline=None)
@given(cases_of_both, st.floats(1e-4, 1.0))
def test_a_mirrored_wheel_does_the_mirrored_thing(at: tuple[int, Case], duration: float) -> None:
    """The models know no direction, to the last bit; friction is never stronger than it was or static friction is."""
    kind, case = at
    omega, memory = run(kind, case, duration)
    mirrored = case._replace(omega=-case.omega, memory=-case.memory, drive=-case.drive)
    assert run(kind, mirrored, duration) == (-omega, -memory)
    assert abs(memory) <= max(abs(case.memory), case.c, case.s) * (1.0 + 1e-4)


@settings(max_examples=150, deadline=None)
@given(cases[LAG], cases[BRISTLE], st.floats(1e-3, 1.0))
def test_without_drive_no_energy_appears(lagging: Case, on_bristle: Case, duration: float) -> None:
    """An undriven wheel under lagging friction only slows down; on a bristle motion and spring together only lose."""
    settled = lagging._replace(drive=0.0, memory=math.copysign(lagging.c, lagging.omega))
    omega, _ = run(LAG, settled, duration)
    assert abs(omega) <= abs(settled.omega)
    assert omega * settled.omega >= 0.0

    case = on_bristle._replace(drive=0.0, s=on_bristle.c, memory=min(max(on_bristle.memory, -0.4), 0.4))
    stiffness = case.s / case.size
    omega, memory = run(BRISTLE, case, duration)
    before = 0.5 * case.omega**2 + 0.5 * case.memory**2 / stiffness
    after = 0.5 * omega**2 + 0.5 * memory**2 / stiffness
    assert after <= before * (1.0 + 1e-9) + 1e-6 * OMEGA_S**2


@pytest.mark.parametrize("effect", KINDS)
def test_small_changes_make_small_differences(effect: str) -> None:
    """No argument moved by a millionth makes the result jump: the filter differentiates by differences.

    Lagging friction that may hold is left out: whether it holds is a jump of the model itself.
    """
    rng = np.random.default_rng([23, KINDS[effect]])
    compared = 0
    for _ in range(70):
        case = draw(rng, KINDS[effect], True, int(rng.integers(3)))
        if KINDS[effect] == LAG and abs(case.drive) <= 1.001 * case.s:
            continue
        duration = float(rng.choice([0.01, 0.1, 1.0]))
        j = int(rng.choice([0, 1, 2, 3, 4, 5, 8]))
        ends = []
        for i in range(40):
            moved = list(case)
            moved[j] += 1e-6 * i * max(abs(moved[j]), 1e-2)
            ends.append(run(KINDS[effect], Case(*moved), duration))  # type: ignore[arg-type]
        steps = np.diff(np.array(ends), axis=0)
        jumps = np.abs(steps - np.median(steps, axis=0)).max(axis=0)
        assert jumps[0] < 1e-6, (case, duration, j)
        assert jumps[1] < 1e-4, (case, duration, j)
        compared += 1
    assert compared > 20


def test_one_step_is_of_order_four() -> None:
    """Halving the step divides the memory's error over a fixed time by sixteen, for either memory."""
    for kind, rate, kappa in ((LAG, 10.0, 0.0), (BRISTLE, 12.0, 0.1)):
        wheel: Wheel = (B, C, 0.9, OMEGA_S, GAUSS, kind, rate, kappa)

        def after(count: int, wheel: Wheel = wheel) -> float:
            v, f = 0.2, 0.1
            for _ in range(count):
                v, f, _, _ = memory_flow._step(v, f, *memory_flow._memory_rate(v, f, wheel), 1.2, 0.8 / count, wheel)
            return f

        fine = after(1024)
        assert (after(32) - fine) / (after(64) - fine) == pytest.approx(16.0, rel=0.15)


def test_parameters_gone_wild_end_soon_in_finite_numbers() -> None:
    """Negative, huge or absurd arguments neither raise, nor overflow, nor iterate for long."""
    rng = np.random.default_rng(29)
    values = np.array([0.0, 1e-12, -1e-3, 0.6, -0.6, 5.0, -5.0, 100.0, -100.0, 1e4, -1e4, 1e8, -1e8])
    starts = np.array([0.0, 1e-300, 0.01, -0.3, 2.5, -30.0, 400.0, -1e4])
    sizes = np.array([-1.0, 0.0, 1e-300, 1e-12, 1e-6, 1e-3, 0.1, 10.0, 1e6, 1e300])
    for i in range(1500):
        omega, law = float(rng.choice(starts)), int(rng.integers(3))
        memory, drive, b, c, s = (float(v) for v in rng.choice(values, 5))
        case = Case(omega, memory, drive, b, c, s, OMEGA_S, law, float(rng.choice(sizes)))
        duration_s = float(rng.choice([1e-6, 1e-3, 0.1, 1.0, 3600.0]))
        assert all(math.isfinite(v) for v in run(i % 2, case, duration_s)), case
        if i % 3 == 0:  # to count takes ten times as long as to compute
            assert lines_of(lambda: run(i % 2, case, duration_s)) < MOST_LINES, case  # noqa: B023


@pytest.mark.slow
@pytest.mark.parametrize(("plain", "kind"), [(lag_flow, LAG), (bristle_flow, BRISTLE)])
def test_compiled_and_plain_agree(plain: Callable[..., Any], kind: int) -> None:
    """The functions are compiled as they are, and give the same numbers to the last bit."""
    modules = [model_friction, propagation, memory_coast, memory_flow]
    nothing = [0.0, 0.0, 0.0, FrictionCurve(0.0, 0.0, 0.0, 1.0, 0), *([0.0] if kind == LAG else [0.0, 0.0]), 0.0]
    compiled = Kernel(plain, modules, lambda: nothing, result=(0.0, 0.0))
    rng = np.random.default_rng([41, kind])
    for _ in range(200):
        case = draw(rng, kind, True, int(rng.integers(3)))
        sizes = [case.size] if kind == LAG else [case.size, DAMPING]
        arguments = [case.omega, case.memory, case.drive, case.curve, *sizes, 0.1]
        assert compiled(*arguments) == plain(*arguments)
