"""What a speed loop, observers and a sliding mode make of the reversal of [CK13] 4, as ratios to its current mode."""

from __future__ import annotations

import pytest

from rw_ekf.attitude_bench.contest import Entry, run_entry
from rw_ekf.attitude_bench.metrics import metrics_of
from rw_ekf.attitude_bench.scenario import Scenario

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("scheme", "at_most"),
    [
        ("pid_tuned", 0.47),
        ("speed_mode", 0.006),
        ("disturbance_observer", 0.07),
        ("adrc", 0.065),
        ("adrc_model", 0.01),
        ("sliding_mode", 0.01),
    ],
)
def test_the_peak_at_the_reversal_as_a_ratio_to_the_current_mode(scheme: str, at_most: float) -> None:
    """1.458 deg without compensation; readings of 5 rpm of noise."""
    peak_deg = metrics_of(run_entry(Entry(scheme, 5.0, 1), Scenario(), {})).peak_deg
    assert peak_deg < at_most * 1.458
