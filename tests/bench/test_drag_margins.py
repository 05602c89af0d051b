"""The margins that are computed with a drag estimator in the loop are those that the loop has."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from rw_ekf.attitude_bench.margins import margin_of
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.control.compensation.pi_drag import CASSINI_RAD_S
from tests.bench.drag_margins import drag_margins

DAMPING = 0.707


def growth_per_cycle(scenario: Scenario, bandwidth: float, gain: float, further_delay_s: float = 0.0) -> float:
    """Spectral radius of a cycle of body, controller, estimator and late torque, each basis vector stepped in time.

    gain: by how much the torque is stronger than the estimator believes; the further delay it does not know of.
    """
    period, inertia = 1.0 / scenario.cycle.rate_hz, scenario.body.inertia_kg_m2
    delay = scenario.cycle.command_delay_s + further_delay_s
    late = int(delay / period)
    early = delay - late * period
    control = scenario.control
    motion = np.array([[-2.0 * DAMPING * bandwidth, -(bandwidth**2), 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    step = expm(motion * period)

    def cycle(state: np.ndarray) -> np.ndarray:
        """From just before a command to just before the next; torque per inertia of the body."""
        attitude, rate, held, error, integral, *sent = state
        held += control.integral_Nm_rad_s * attitude * period
        wanted = -(control.proportional_Nm_rad * attitude + scenario.derivative_Nms_rad * rate + held) / inertia
        wanted += 2.0 * DAMPING * bandwidth * error + bandwidth**2 * integral
        sent, began = [wanted, *sent], rate
        for torque, lasts in ((sent[late + 1], early), (sent[late], period - early)):
            attitude += rate * lasts + 0.5 * gain * torque * lasts**2
            rate += gain * torque * lasts
        drag = wanted - (rate - began) / period
        error, integral, _ = step @ np.array([error, integral, drag])
        return np.array([attitude, rate, held, error, integral, *sent[:-1]])

    return float(np.abs(np.linalg.eigvals(np.column_stack([cycle(unit) for unit in np.eye(6 + late)]))).max())


@pytest.mark.parametrize("share_of_cassini", [1.0, 2.0, 20.0, 60.0])
def test_the_loop_grows_where_its_margins_are_used_up(share_of_cassini: float) -> None:
    """A stronger motor, a weaker one: stable two percent inside each margin, unstable two percent outside."""
    scenario, bandwidth = Scenario(), share_of_cassini * CASSINI_RAD_S
    margins = drag_margins(scenario, bandwidth)
    for dB in (margins.gain_dB, -margins.reduction_dB):
        gain = 10.0 ** (dB / 20.0)
        inwards = math.copysign(0.02, -dB)
        assert growth_per_cycle(scenario, bandwidth, gain * (1.0 + inwards)) < 1.0
        assert growth_per_cycle(scenario, bandwidth, gain * (1.0 - inwards)) > 1.0


@pytest.mark.parametrize("share_of_cassini", [1.0, 10.0])
def test_the_phase_margin_is_a_delay_of_the_motor_that_the_loop_bears(share_of_cassini: float) -> None:
    """Phase over crossover is the delay, which the estimator is not told of."""
    scenario, bandwidth = Scenario(), share_of_cassini * CASSINI_RAD_S
    margins = drag_margins(scenario, bandwidth)
    spare_s = math.radians(margins.phase_deg) / margins.crossover_rad_s
    assert growth_per_cycle(scenario, bandwidth, 1.0, 0.98 * spare_s) < 1.0
    assert growth_per_cycle(scenario, bandwidth, 1.0, 1.02 * spare_s) > 1.0


def test_a_doubled_bandwidth_costs_some_margin_and_a_vanishing_one_nothing() -> None:
    """70 degrees and 29 dB with Cassini's 0.01 Hz, 68 and 29 with 0.02 Hz; its own loop has 56 and 35 [L17] V.1."""
    scenario = Scenario()
    once, twice = (drag_margins(scenario, share * CASSINI_RAD_S) for share in (1.0, 2.0))
    assert (once.phase_deg, once.gain_dB, once.reduction_dB) == pytest.approx((70.2, 29.4, 19.4), abs=0.05)
    assert (twice.phase_deg, twice.gain_dB, twice.reduction_dB) == pytest.approx((67.6, 28.6, 15.1), abs=0.05)
    assert drag_margins(scenario, 1e-6).phase_deg == pytest.approx(margin_of(scenario).phase_deg, abs=0.01)
