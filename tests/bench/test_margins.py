"""The phase margin that is computed is the one that the loop has; the tuned baseline uses it up and no more."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.attitude_bench.margins import SMALLEST_MARGIN_DEG, margin_of, scenario_for, with_largest_integral
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.control.compensation.schemes import SCHEMES


def growth_per_cycle(scenario: Scenario, further_delay_s: float) -> float:
    """Spectral radius of one cycle of body, controller and late commands, each basis vector stepped in time."""
    period, inertia = 1.0 / scenario.cycle.rate_hz, scenario.body.inertia_kg_m2
    delay = scenario.cycle.command_delay_s + further_delay_s
    late = int(delay / period)
    switch = delay - late * period

    def cycle(state: np.ndarray) -> np.ndarray:
        attitude, rate, held, *wanted = state
        held += scenario.control.integral_Nm_rad_s * attitude * period
        torque = -(scenario.control.proportional_Nm_rad * attitude + scenario.derivative_Nms_rad * rate + held)
        wanted = [torque, *wanted]
        for acting, lasts in ((wanted[late + 1], switch), (wanted[late], period - switch)):
            attitude += rate * lasts + 0.5 * acting / inertia * lasts**2
            rate += acting / inertia * lasts
        return np.array([attitude, rate, held, *wanted[:-1]])

    size = 3 + late + 1
    return float(np.abs(np.linalg.eigvals(np.column_stack([cycle(unit) for unit in np.eye(size)]))).max())


@pytest.mark.parametrize("integral", [4.24e-4, 0.006, 0.02])
@pytest.mark.parametrize(("rate_hz", "delay_s"), [(10.0, 0.01), (5.0, 0.33)])
def test_a_further_delay_of_the_margin_is_what_makes_the_loop_unstable(
    integral: float, rate_hz: float, delay_s: float
) -> None:
    """Margin over crossover is the delay at which the slowest eigenvalue of the sampled loop reaches the circle."""
    scenario = Scenario.model_validate(
        {"control": {"integral_Nm_rad_s": integral}, "cycle": {"rate_hz": rate_hz, "command_delay_s": delay_s}}
    )
    margin = margin_of(scenario)
    spare_s = np.radians(margin.phase_deg) / margin.crossover_rad_s
    assert growth_per_cycle(scenario, 0.98 * spare_s) < 1.0 < growth_per_cycle(scenario, 1.02 * spare_s)


def test_the_tuned_baseline_uses_up_the_margin_by_its_integral_gain_alone() -> None:
    """The rest of the scenario is as it was; a hundredth more of the gain would leave less than 45 degrees."""
    given = Scenario()
    tuned = scenario_for(SCHEMES["pid_tuned"], given)
    assert scenario_for(SCHEMES["pid_current"], given) is given
    assert margin_of(tuned).phase_deg == pytest.approx(SMALLEST_MARGIN_DEG, abs=1e-6)
    assert tuned.control.integral_Nm_rad_s > 50.0 * given.control.integral_Nm_rad_s
    more = {"integral_Nm_rad_s": 1.01 * tuned.control.integral_Nm_rad_s}
    beyond = tuned.model_copy(update={"control": tuned.control.model_copy(update=more)})
    assert margin_of(beyond).phase_deg < SMALLEST_MARGIN_DEG - 1.0
    assert tuned.control.settling_integral_Nm_rad_s >= tuned.control.integral_Nm_rad_s
    assert tuned.model_copy(update={"control": given.control}) == given


def test_a_loop_that_has_no_margin_to_spare_is_left_as_it_is() -> None:
    """A delay of a second leaves [CK13]'s gains below 45 degrees: no integral gain is found for it."""
    slow = Scenario.model_validate({"cycle": {"command_delay_s": 1.0}})
    assert margin_of(slow).phase_deg < SMALLEST_MARGIN_DEG
    assert with_largest_integral(slow) is slow
