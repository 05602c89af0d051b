"""The lag is that of (7), and is learned from the wheel."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rw_ekf.control.compensation.walrath import LaggedFriction, LagLearning, Walrath
from rw_ekf.records import Estimate, Innovation, Outcome, Tick
from tests.control.compensation.bare_wheel import BareWheel, coulomb

C, LAG_S, STEP_S = 0.6, 0.12, 1e-3
NOISE = 2e-3


@pytest.mark.parametrize("period_s", [0.01, 0.1, 0.7])
def test_the_friction_follows_a_reversal_as_equation_7_says_at_any_rate(period_s: float) -> None:
    """From +c towards -c: -c + 2 c exp(-t/tau); the mean over an interval is that of the exponential."""
    tau = 0.4
    lag = LaggedFriction(tau)
    lag.friction_rad_s2 = C
    for i in range(10):
        t = np.linspace(i * period_s, (i + 1) * period_s, 20001)
        exact = -C + 2.0 * C * np.exp(-t / tau)
        assert lag.mean(period_s, -C)[0] == pytest.approx(float(np.trapezoid(exact, t)) / period_s, abs=1e-7)
        lag.step(period_s, -C)
        assert lag.friction_rad_s2 == pytest.approx(exact[-1], abs=1e-12)


def test_the_sensitivity_is_the_derivative_with_respect_to_the_logarithm_of_tau() -> None:
    """Against differences, through two reversals."""

    def mean(tau: float) -> tuple[float, float]:
        lag = LaggedFriction(tau)
        for towards in (C, C, -C, -C, C):
            lag.step(0.1, towards)
        return lag.mean(0.13, C)

    step = 1e-5
    slope = (mean(0.2 * math.exp(step))[0] - mean(0.2 * math.exp(-step))[0]) / (2.0 * step)
    assert mean(0.2)[1] == pytest.approx(slope, rel=1e-6)


class Noted:
    """The scheme with an estimator that expects a noise of its readings."""

    def __init__(self, scheme: Walrath) -> None:
        self.scheme = scheme

    def current_A(self, tick, request, known):  # type: ignore[no-untyped-def]
        """What the scheme says to a tick with an innovation in it."""
        innovation = Innovation(tick.sample.time_s, 0.0, NOISE, 0.0, 9.0, True)
        estimate = Estimate(
            tick.sample.time_s, Outcome.UPDATED, tick.estimate.state, tick.estimate.std, innovation=innovation
        )
        return self.scheme.current_A(Tick(tick.sample, estimate), request, known)


@pytest.mark.parametrize("first_s", [0.03, 0.5])
def test_the_lag_of_a_wheel_is_learned_from_below_and_above(first_s: float) -> None:
    """A wheel with a lag of 0.12 s that reverses to and fro for five minutes, its readings noisy."""
    scheme = Walrath(0.02, LagLearning(first_s, spread=1.0))
    draw = np.random.default_rng(1)
    wheel = BareWheel(coulomb(0.0), speed=0.2, noise=lambda: draw.normal(0.0, NOISE), period_s=0.02)
    dry = C

    def drag(time_s: float) -> float:
        """The lagged friction, a step on; the wheel has no other."""
        nonlocal dry
        dry += STEP_S / LAG_S * (math.copysign(C, wheel.speed) - dry)
        return -dry

    wheel.disturbance = drag
    wheel.run(Noted(scheme), lambda t: 1.5 * math.cos(1.2 * t), 300.0)
    assert scheme.time_constant_s == pytest.approx(LAG_S, rel=0.15)
