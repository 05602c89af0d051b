"""With exact parameters, dynamic model compensation leaves a linear plant: the body answers as its closed form says."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.attitude_bench.bench_run import BenchRun, run_bench
from rw_ekf.attitude_bench.bench_start import start_of
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.scheme import Knowledge
from rw_ekf.control.compensation.schemes import SCHEMES

SCENARIO = Scenario.model_validate(
    {
        "gyro": {"rate_noise_deg_s": 0.0, "walk_deg_per_sqrt_h": 0.0},
        "control": {"settling_s": 0.0},
        "cycle": {"rate_hz": 50.0, "command_delay_s": 0.0005},
    }
)


def closed_form_rad(scenario: Scenario, times_s: np.ndarray) -> np.ndarray:
    """The attitude (n,) from rest under the constant torque, of J theta'' + Kd theta' + Kp theta + Ki integral = T_d.

    By partial fractions: theta(s) = T_d / (J s^3 + Kd s^2 + Kp s + Ki), one exponential for each root.
    """
    body, control = scenario.body, scenario.control
    denominator = [
        body.inertia_kg_m2,
        scenario.derivative_Nms_rad,
        control.proportional_Nm_rad,
        control.integral_Nm_rad_s,
    ]
    roots = np.roots(denominator).astype(complex)
    residues = body.disturbance_Nm / np.polyval(np.polyder(denominator), roots)
    return np.real(np.exp(np.outer(times_s, roots)) @ residues)


def run_of(scheme: str, scenario: Scenario = SCENARIO) -> BenchRun:
    """One run on readings all but without noise; the parameters known are the true ones."""
    entry = SCHEMES[scheme]
    start = start_of(replace(entry, parameters_from="none"), scenario, 1e-3, 1)
    known: Knowledge = lambda tick: WheelKnown.of_parameters(  # noqa: E731
        tick.sample.speed_rad_s or 0.0, start.sheet.parameters, start.sheet.stribeck
    )
    return run_bench(scenario, start.plant, 1e-3, 1, start.estimator, entry.make(start.sheet), known)


@pytest.mark.slow
def test_the_attitude_under_exact_compensation_is_that_of_the_linear_closed_loop() -> None:
    """To a hundredth of the largest attitude error, the cycle in which the friction changes its sign included.

    Without compensation the same response is missed by hundreds of times as much.
    """
    errors = {}
    for scheme in ("dmc", "pid_current"):
        run = run_of(scheme)
        assert run.reversal_s is not None
        linear = closed_form_rad(SCENARIO, run.time_s)
        errors[scheme] = math.degrees(np.abs(run.attitude_rad - linear).max())
        largest_deg = math.degrees(np.abs(linear).max())
    assert largest_deg > 0.3  # the response is there to be met
    assert errors["dmc"] < 0.01 * largest_deg
    assert errors["pid_current"] > 200.0 * errors["dmc"]
