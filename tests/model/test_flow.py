"""The flow map: against an adaptive integrator with events, closed forms, differences and physical laws."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from rw_ekf.model.flow import flow, slip
from rw_ekf.model.friction import GAUSS, LAW_CODES, FrictionCurve
from rw_ekf.wheel.interval import Pieces
from rw_ekf.wheel.transition import interval
from tests.counting import lines_of
from tests.truth import fine_flow
from tools.measure.runs import OMEGA_S

B, C, S = 0.00322, 0.5863, 0.6037
DRAWS = 60
MOST_LINES = 300_000  # twice the most that was counted

speeds = st.one_of(st.just(0.0), st.floats(-3.0, 3.0), st.floats(-300.0, 300.0))
drives = st.floats(-6.0, 6.0)
parameters = st.tuples(st.floats(0.0, 0.01), st.floats(0.3, 0.9), st.floats(-0.1, 0.1)).map(
    lambda p: (p[0], p[1], p[1] + p[2])
)
signs = st.sampled_from((1.0, -1.0))
laws = st.sampled_from(sorted(LAW_CODES.values()))


def run(at: Sequence[float], law: int, duration: float) -> tuple[float, ...]:
    """The flow from (omega, drive, b, c, s) and its five sensitivities."""
    omega, drive, b, c, s = at
    return flow(omega, drive, FrictionCurve(b, c, s, OMEGA_S, law), duration)


def exact(at: Sequence[float], law: str, duration: float) -> float:
    """scipy's adaptive integration of the printed equation, stopped by an event at zero speed and decided there."""
    omega, drive, b, c, s = at

    def stribeck(u: float) -> float:
        return {"gauss": math.exp(-u * u), "tustin": math.exp(-abs(u)), "lorentz": 1.0 / (1.0 + u * u)}[law]

    def at_rest(_t: float, y: Sequence[float]) -> float:
        return y[0]

    at_rest.terminal = True  # type: ignore[attr-defined]
    left = duration
    for _ in range(3):
        if omega == 0.0 and abs(drive) <= s:
            return 0.0
        sign = math.copysign(1.0, omega if omega != 0.0 else drive)
        at_rest.direction = -sign  # type: ignore[attr-defined]

        def slope(_t: float, y: Sequence[float], sign: float = sign) -> list[float]:
            return [drive - b * y[0] - sign * (c + (s - c) * stribeck(y[0] / OMEGA_S))]

        solved = solve_ivp(slope, (0.0, left), [omega], method="DOP853", rtol=1e-12, atol=1e-14, events=at_rest)
        if solved.status == 0:
            return float(solved.y[0, -1])
        left -= float(solved.t[-1])
        omega = 0.0
    raise AssertionError("more than two events under a constant drive")


def draw_cases(law: str, duration: float, wide: bool) -> list[tuple[float, ...]]:
    """Random (omega, drive, b, c, s) that stick, break away, stop, go through zero, or never come near it."""
    rng = np.random.default_rng([LAW_CODES[law], round(10 * duration), wide])
    cases: list[tuple[float, ...]] = []
    for _ in range(DRAWS):
        c = C * math.exp(0.5 * rng.standard_normal()) if wide else C
        s = max(0.01, c + 0.1 * rng.standard_normal()) if wide else S
        b = B * rng.uniform(0.0, 3.0) if wide else B
        omega = rng.choice([0.0, 0.1, 1.0, 5.0, 100.0]) * rng.standard_normal()
        drive = 15.205 * rng.choice([0.04, 0.1, 0.4]) * rng.standard_normal()
        cases.append((float(omega), float(drive), b, c, s))
    return cases


@pytest.mark.parametrize("law", LAW_CODES)
@pytest.mark.parametrize(("duration", "wide", "error"), [(0.1, False, 2.5e-7), (0.1, True, 5e-6), (1.0, True, 3e-5)])
def test_the_flow_is_that_of_an_adaptive_integrator(law: str, duration: float, wide: bool, error: float) -> None:
    """Sticking, breaking away, stopping and crossing, the speed agrees with scipy's: 3e-6 rpm at the default wheel."""
    for case in draw_cases(law, duration, wide):
        found = run(case, LAW_CODES[law], duration)[0]
        assert found == pytest.approx(exact(case, law, duration), rel=1e-9, abs=error), case


@given(omega=st.floats(20.0, 600.0), drive=drives, at=parameters, law=laws, duration=st.floats(1e-3, 2.0), way=signs)
def test_far_from_zero_the_flow_is_that_of_a_slipping_wheel_to_the_last_bit(
    omega: float, drive: float, at: tuple[float, float, float], law: int, duration: float, way: float
) -> None:
    """The one step that most of a wheel's time takes is the first of the steps that lead anywhere else."""
    curve = FrictionCurve(*at, OMEGA_S, law)
    end, left, *slopes = slip(omega, way * drive, curve, duration)
    if left > 0.0:
        return
    to_omega, to_push, to_b, to_c, to_s = slopes
    assert flow(way * omega, drive, curve, duration) == (
        way * end, to_omega, to_push, way * to_b, way * to_c, way * to_s,
    )  # fmt: skip


@pytest.mark.parametrize("law", LAW_CODES)
def test_the_fine_step_truth_is_that_of_an_adaptive_integrator(law: str) -> None:
    """The reference that other tests rely on is right to 1e-6 rad/s, so that it may be called the truth."""
    for case in draw_cases(law, 1.0, True)[:25]:
        omega, drive, b, c, s = case
        found = fine_flow(omega, drive, (b, c, s), law, 1.0)
        assert found == pytest.approx(exact(case, law, 1.0), rel=1e-8, abs=1e-6), case


@pytest.mark.parametrize("law", LAW_CODES)
@pytest.mark.parametrize(("duration", "error"), [(0.1, 3e-4), (1.0, 1e-3)])
def test_sensitivities_are_central_differences_on_a_grid_across_zero_speed(
    law: str, duration: float, error: float
) -> None:
    """Every sensitivity is the derivative of the flow, through stops and crossings; kinks themselves are left out."""
    code, h, compared = LAW_CODES[law], 1e-5, 0
    for omega in (-3.0, -1.0, -0.3, -0.05, 0.004, 0.02, 0.1, 0.5, 2.0, 40.0):
        for drive in (-3.0, -1.2, -0.61, -0.3, 0.0, 0.4, 0.59, 0.65, 0.9, 2.5):
            for b, c, s in ((B, C, S), (0.008, 0.4, 0.5), (0.001, 0.6, 0.5)):
                at = [omega, drive, b, c, s]
                end, *found = run(at, code, duration)
                for j, value in enumerate(found):
                    ends = []
                    for way in (h, -h):
                        moved = list(at)
                        moved[j] += way
                        ends.append(run(moved, code, duration)[0])
                    forward, backward = (ends[0] - end) / h, (end - ends[1]) / h
                    if abs(forward - backward) > 1e-3 * max(1.0, abs(value)):
                        continue  # a kink: stick and slip meet here
                    compared += 1
                    numeric = 0.5 * (forward + backward)
                    assert value == pytest.approx(numeric, rel=10.0 * error, abs=error), (at, j)
    assert compared > 1400


@pytest.mark.parametrize("initial", [5.0, 60.0, 400.0])
def test_a_coast_down_follows_its_closed_form_to_the_very_stop(initial: float) -> None:
    """With s = c and no current, omega = (omega_0 + c/b) exp(-b t) - c/b until it stands at ln(1 + b omega_0/c)/b."""
    stop = math.log1p(B * initial / C) / B
    omega, t = initial, 0.0
    while t < stop + 2.0:
        omega = flow(omega, 0.0, FrictionCurve(B, C, C, OMEGA_S, GAUSS), 0.5)[0]
        t += 0.5
        expected = max((initial + C / B) * math.exp(-B * t) - C / B, 0.0) if t < stop else 0.0
        assert omega == pytest.approx(expected, abs=1e-8)
    assert omega == 0.0


@settings(max_examples=200, deadline=None)
@given(speeds, parameters, laws, st.floats(0.001, 1.0))
def test_without_drive_the_energy_never_grows(
    omega: float, p: tuple[float, float, float], law: int, duration: float
) -> None:
    """An undriven wheel only slows down, and never turns round."""
    end = flow(omega, 0.0, FrictionCurve(*p, OMEGA_S, law), duration)[0]
    assert abs(end) <= abs(omega)
    assert end * omega >= 0.0


@settings(max_examples=300, deadline=None)
@given(speeds, drives, parameters, laws, st.floats(0.001, 0.5), st.floats(0.001, 0.5))
def test_two_intervals_under_one_drive_are_one(
    omega: float, drive: float, p: tuple[float, float, float], law: int, first: float, second: float
) -> None:
    """The flow is a semigroup: flow(t1 + t2) = flow(t2) after flow(t1), across every event."""
    middle = flow(omega, drive, FrictionCurve(*p, OMEGA_S, law), first)[0]
    twice = flow(middle, drive, FrictionCurve(*p, OMEGA_S, law), second)[0]
    once = flow(omega, drive, FrictionCurve(*p, OMEGA_S, law), first + second)[0]
    assert twice == pytest.approx(once, rel=1e-9, abs=4e-5)


@settings(max_examples=300, deadline=None)
@given(speeds, drives, parameters, laws, st.floats(1e-6, 1.0))
def test_a_mirrored_wheel_does_the_mirrored_thing(
    omega: float, drive: float, p: tuple[float, float, float], law: int, duration: float
) -> None:
    """The model knows no direction: flow(-omega, -drive) = -flow(omega, drive) to the last bit, slopes included."""
    end, to_omega, to_drive, *to_friction = flow(omega, drive, FrictionCurve(*p, OMEGA_S, law), duration)
    other, other_omega, other_drive, *other_friction = flow(-omega, -drive, FrictionCurve(*p, OMEGA_S, law), duration)
    assert (other, other_omega, other_drive) == (-end, to_omega, to_drive)
    assert other_friction == [-value for value in to_friction]


@settings(max_examples=200, deadline=None)
@given(speeds, drives, parameters, laws, st.floats(1e-3, 1.0))
def test_a_faster_wheel_stays_faster(
    omega: float, drive: float, p: tuple[float, float, float], law: int, duration: float
) -> None:
    """Trajectories of one equation never cross, so that the end speed is monotone in the start speed."""
    slow = flow(omega, drive, FrictionCurve(*p, OMEGA_S, law), duration)[0]
    fast = flow(omega + 0.01, drive, FrictionCurve(*p, OMEGA_S, law), duration)[0]
    assert fast >= slow - 1e-5


@pytest.mark.parametrize("law", LAW_CODES.values())
@pytest.mark.parametrize("omega", [-20.0, -0.5, 0.3, 7.0])
def test_over_a_short_time_the_flow_is_one_euler_step(law: int, omega: float) -> None:
    """For small dt the transition's row is that of I + J dt, J the Jacobian of the papers."""
    k, current, dt = 15.205, 0.06, 1e-5
    _, *row = interval(omega, k, FrictionCurve(B, C, S, OMEGA_S, law), Pieces([0.0], [dt], [current]), 0, 1)
    h = 1e-6

    def drift(w: float, b: float, c: float, s: float) -> float:
        u, sign = abs(w) / OMEGA_S, math.copysign(1.0, w)
        g = (math.exp(-u * u), math.exp(-u), 1.0 / (1.0 + u * u))[law]
        return k * current - b * w - sign * (c + (s - c) * g)

    slope = (drift(omega + h, B, C, S) - drift(omega - h, B, C, S)) / (2.0 * h)
    of_c = (drift(omega, B, C + h, S) - drift(omega, B, C - h, S)) / (2.0 * h)
    of_s = (drift(omega, B, C, S + h) - drift(omega, B, C, S - h)) / (2.0 * h)
    assert (row[0] - 1.0) / dt == pytest.approx(slope, rel=1e-3, abs=1e-5)
    assert [v / dt for v in row[1:]] == pytest.approx([current, -omega, of_c, of_s], rel=1e-3, abs=1e-5)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_at_a_crossing_the_sensitivity_is_multiplied_by_the_saltation_factor(way: float) -> None:
    """With b = 0 and s = c the flow through zero is two straight lines: its exact derivatives come out."""
    omega, drive, c, duration = 0.4, -2.0, 0.6, 0.5
    crossing, curve = omega / (2.0 + c), FrictionCurve(0.0, c, c, OMEGA_S, GAUSS)
    end, to_omega, to_drive, _, to_c, to_s = flow(way * omega, way * drive, curve, duration)
    after = duration - crossing
    assert end == pytest.approx(way * (drive + c) * after, rel=1e-9)
    assert to_omega == pytest.approx((2.0 - c) / (2.0 + c), rel=1e-9)
    assert to_drive == pytest.approx(after - (drive + c) * omega / (drive - c) ** 2, rel=1e-6)
    # c and s move together here, because s = c; the two derivatives add up to that of the closed form.
    assert to_c + to_s == pytest.approx(way * (after + (drive + c) * omega / (drive - c) ** 2), rel=1e-6)


def test_a_wheel_that_ends_stuck_has_no_sensitivity() -> None:
    """Where the wheel comes to rest and is held, no small change of anything moves it."""
    assert flow(0.05, 0.3, FrictionCurve(B, C, S, OMEGA_S, GAUSS), 1.0) == (0.0,) * 6
    assert flow(0.0, 0.6, FrictionCurve(B, C, S, OMEGA_S, GAUSS), 1.0) == (0.0,) * 6


@pytest.mark.parametrize("drive", [0.0, 0.7, -3.0])
@pytest.mark.parametrize("omega", [0.0, 1e-300, -5e-324, 1e-9])
def test_speeds_of_almost_nothing_are_like_zero(omega: float, drive: float) -> None:
    """A subnormal speed is no trap: the result is that of a wheel at rest."""
    rest = flow(0.0, drive, FrictionCurve(B, C, S, OMEGA_S, GAUSS), 0.1)[0]
    assert flow(omega, drive, FrictionCurve(B, C, S, OMEGA_S, GAUSS), 0.1)[0] == pytest.approx(rest, abs=1e-8)


def test_a_push_that_exceeds_break_away_by_rounding_is_harmless() -> None:
    """At one unit in the last place above s the net push may round to zero; the wheel then just stays."""
    rng = np.random.default_rng(7)
    for c, excess in rng.uniform((0.1, -0.1), (2.0, 0.1), (3000, 2)):
        s = float(c + excess)
        end = flow(0.0, math.nextafter(s, 9.0), FrictionCurve(B, float(c), s, OMEGA_S, GAUSS), 0.1)[0]
        assert 0.0 <= end < 1e-9


def test_parameters_gone_wild_end_soon_in_finite_numbers() -> None:
    """Negative, huge or absurd parameters neither raise, nor overflow, nor iterate for long."""
    rng = np.random.default_rng(11)
    values = np.array([0.0, 1e-12, -1e-3, 0.6, -0.6, 5.0, -5.0, 100.0, -100.0, 1e4, -1e4, 1e8, -1e8])
    starts = np.array([0.0, 1e-300, 0.01, -0.3, 2.5, -30.0, 400.0, -1e4])
    for i in range(1500):
        omega, law = float(rng.choice(starts)), int(rng.integers(3))
        drive, b, c, s = (float(v) for v in rng.choice(values, 4))
        duration_s = float(rng.choice([1e-6, 1e-3, 0.1, 1.0, 3600.0]))
        case = (omega, drive, FrictionCurve(b, c, s, OMEGA_S, law), duration_s)
        assert all(math.isfinite(v) for v in flow(*case)), case
        if i % 3 == 0:  # to count takes ten times as long as to compute
            assert lines_of(lambda: flow(*case)) < MOST_LINES, case  # noqa: B023


@pytest.mark.parametrize("duration", [1e-9, 1e-6, 5e-4, 0.1, 1.0])
def test_pieces_of_current_chain_by_the_chain_rule(duration: float) -> None:
    """An interval of two pieces has the derivatives of the composed map, also where a piece is a microsecond long."""
    k, current, at = 15.205, (0.08, -0.12), [0.5, 15.205, B, C, S]
    durations = [duration, 0.1]

    def end(x: list[float]) -> float:
        middle = run((x[0], x[1] * current[0], *x[2:]), GAUSS, durations[0])[0]
        return run((middle, x[1] * current[1], *x[2:]), GAUSS, durations[1])[0]

    found, *row = interval(
        at[0], k, FrictionCurve(B, C, S, OMEGA_S, GAUSS), Pieces([0.0, duration], durations, current), 0, 2
    )
    assert found == end(at)
    for j, value in enumerate(row):
        up, down = list(at), list(at)
        up[j] += 1e-5
        down[j] -= 1e-5
        assert value == pytest.approx((end(up) - end(down)) / 2e-5, rel=1e-3, abs=2e-4)
