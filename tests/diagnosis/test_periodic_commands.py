"""A current that repeats itself: whatever goes with the motion is periodic then, and none of it has a clock."""

from __future__ import annotations

import pytest

from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from tests.diagnosis.simulated import log_of, simulated


@pytest.mark.slow
@pytest.mark.parametrize(
    "effect",
    [
        "quadratic_drag:coefficient_1_rad=1e-5",
        "viscous_asymmetry:difference_1_s=0.002",
        "friction_lag:time_constant_s=0.1",
        "motor_saturation:slope_1_A=0.2",
        "drag_bump:amplitude_rad_s2=0.1,speed_rad_s=10,width_rad_s=3",
    ],
)
def test_what_goes_with_the_motion_is_no_torque_with_a_clock(effect: str) -> None:
    """Friction and motor laws the model lacks repeat with the current; none of them is told as a torque of its own."""
    document = diagnose_log(log_of(simulated([effect], profile="S3", seed=6))).document()
    assert "external_torque" not in document["verdict"]["effects"]
