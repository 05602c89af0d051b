"""A lagging current: one of next to nothing ends, and a wheel that goes evenly is led in one step where many lead."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from rw_ekf.model.friction import GAUSS, Stribeck
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, SPEED, STATIC, VISCOUS
from rw_ekf.wheel import pieces as home
from rw_ekf.wheel.dispatch import lagged
from rw_ekf.wheel.interval import Interval, Pieces
from tests.filter.effect_replay import believed, in_use


@pytest.mark.parametrize("from_s", [0.0, 12345.678, 1.0e6])
@pytest.mark.parametrize("tau", [1.0e-9, 1.0e-12, 1.0e-16, 1.0e-20, 1.0e-300])
def test_a_lag_of_next_to_nothing_ends(tau: float, from_s: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps that rounding makes none were taken for ever: a daemon that believed such a lag hung."""
    effects = in_use("actuator_lag")
    table, belief = effects.table(), believed(effects)
    steps, ends = itertools.count(), []

    def counted(*given: Any) -> Any:
        assert next(steps) < 1000
        return lagged(*given)

    monkeypatch.setattr(home, "lagged", counted)
    for lag in (tau, 0.0):
        x, end, row = belief.mean.copy(), np.zeros(table.size), np.zeros(table.size)
        x[0], x[table.lag_at] = 10.0, lag
        pieces, interval = Pieces([from_s], [0.1], [0.05]), Interval(from_s, from_s + 0.1, 20.0, 0.0, 0, 0, 1)
        home.effect_interval(x, table, Stribeck(0.4, GAUSS), pieces, interval, False, row, end)
        ends.append(end[0])
    assert ends[0] == pytest.approx(ends[1], abs=1.0e-6)


@pytest.mark.parametrize("tau", [0.003, 0.02, 0.1, 1.0])
@pytest.mark.parametrize("viscous", [0.0, 0.05, 0.18, 0.5])
@pytest.mark.parametrize("speed", [0.3, 2.0, 40.0, -40.0])
def test_under_a_lagging_current_a_wheel_is_led_where_an_adaptive_integrator_leads_it(
    tau: float, viscous: float, speed: float
) -> None:
    """Evenly or not: within a hundredth of what the lag moves, of readings' noise at 1 rpm a fiftieth at most."""
    effects = in_use("actuator_lag")
    table, belief = effects.table(), believed(effects)
    x, end, row = belief.mean.copy(), np.zeros(table.size), np.zeros(table.size)
    began_A, commanded_A = -0.05, 0.1
    x[SPEED], x[VISCOUS], x[table.lag_at], x[table.lag_state_at] = speed, viscous, tau, began_A
    pieces, interval = Pieces([0.0], [0.1], [commanded_A]), Interval(0.0, 0.1, 20.0, 0.0, 0, 0, 1)
    home.effect_interval(x, table, Stribeck(0.4, GAUSS), pieces, interval, False, row, end)

    def slope(time_s: float, omega: Any) -> Any:
        current_A = commanded_A + (began_A - commanded_A) * np.exp(-time_s / tau)
        dry = x[COULOMB] + (x[STATIC] - x[COULOMB]) * np.exp(-((omega / 0.4) ** 2))
        return x[MOTOR_GAIN] * current_A - viscous * omega - np.sign(omega) * dry

    truth = solve_ivp(slope, (0.0, 0.1), [speed], method="DOP853", rtol=1e-11, atol=1e-12).y[0, -1]
    moved = x[MOTOR_GAIN] * (commanded_A - began_A) * min(tau, 0.1)
    assert end[SPEED] == pytest.approx(truth, abs=min(0.01 * moved, 0.002))
