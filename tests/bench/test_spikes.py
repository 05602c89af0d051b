"""What a drag spike does is told as it is known in closed form, and the monitor's threshold is Cassini's."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from scipy.integrate import solve_ivp

from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.attitude_bench.spike_answer import Spike, answer_to_spike, rate_error_threshold_rpm, steady_scenario
from rw_ekf.control.compensation.pi_drag import CASSINI_DAMPING, PiDragParameters
from rw_ekf.control.compensation.schemes import SCHEMES

RPM = math.pi / 30.0
SPIKE = Spike(watched_s=120.0)


def test_84_rpm_are_42_percent_of_cassinis_threshold() -> None:
    """[L17] IV.1; and a wheel that turns twice as fast may be off by twice as much."""
    assert 84.0 / rate_error_threshold_rpm(2000.0) == pytest.approx(0.42)
    assert rate_error_threshold_rpm(4000.0) == 2.0 * rate_error_threshold_rpm(2000.0)


def test_the_wheel_keeps_its_speed_but_for_the_spike() -> None:
    """No disturbance, no reversal."""
    steady = steady_scenario(Scenario(), SPIKE)
    assert steady.first_speed_rad_s == pytest.approx(SPIKE.speed_rpm * RPM)
    assert steady.reversal_s is None


@pytest.mark.slow
def test_what_is_not_compensated_has_to_be_asked_for_whole() -> None:
    """Without compensation the rate error is the spike's impulse, a decay (1 - exp(-t/decay)): the monitor trips."""
    answer = answer_to_spike(SCHEMES["pid_current"], Scenario(), 1.0, 1, SPIKE)
    impulse_rad_s = SPIKE.of_coulomb * Scenario().wheel.coulomb * SPIKE.decay_s * -math.expm1(-120.0 / SPIKE.decay_s)
    assert answer.rate_error_rpm == pytest.approx(impulse_rad_s / RPM, rel=0.01)
    assert answer.of_threshold == pytest.approx(answer.rate_error_rpm / 420.0)
    assert math.isnan(answer.recover_s)


@pytest.mark.slow
def test_the_rate_error_of_the_drag_estimator_is_the_error_in_its_own_loop() -> None:
    """de/dt = T_phy - T_est integrated by another method, for a bandwidth at which the loop's rate does not matter."""
    w = 0.3
    entry = replace(SCHEMES["pi_drag"], make=lambda sheet: SCHEMES["pi_drag"].make(sheet, bandwidth_rad_s=w))
    answer = answer_to_spike(entry, Scenario(), 1.0, 1, SPIKE)
    height = SPIKE.of_coulomb * Scenario().wheel.coulomb

    def motion(t: float, x: list[float]) -> list[float]:
        error, integral = x
        return [height * math.exp(-t / SPIKE.decay_s) - 2.0 * CASSINI_DAMPING * w * error - w * w * integral, error]

    error = solve_ivp(motion, (0.0, 60.0), [0.0, 0.0], max_step=0.1).y[0]
    assert answer.rate_error_rpm == pytest.approx(abs(error).max() / RPM, rel=0.1)
    assert answer.recover_s < 30.0


@pytest.mark.slow
def test_a_limiter_below_the_spike_is_what_lets_the_rate_error_grow() -> None:
    """As on Cassini on 2004-DOY-212 [L17] IV.1: drag that the limiter cuts off has to be asked for."""
    spike = replace(SPIKE, of_coulomb=2.0)
    errors = []
    for limit in (PiDragParameters().limit_of_static, 1.5):
        entry = replace(
            SCHEMES["pi_drag"],
            make=lambda sheet, limit=limit: SCHEMES["pi_drag"].make(sheet, bandwidth_rad_s=0.3, limit_of_static=limit),
        )
        errors.append(answer_to_spike(entry, Scenario(), 1.0, 1, spike).rate_error_rpm)
    assert errors[1] > 10.0 * errors[0]


@pytest.mark.slow
def test_a_filter_that_a_spike_leads_astray_does_not_lead_the_wheel_astray() -> None:
    """Attitude control holds the speed while friction decays, which looks as if current did nothing: k falls to zero.

    A scheme that divided by it drove this wheel at full current, two turns round; it goes on with the last good set.
    """
    assert answer_to_spike(SCHEMES["adrc_model"], Scenario(), 1.0, 1).peak_deg < 0.6
