"""Units: SI inside; rpm and mA exist only at an edge, and always in the name."""

from __future__ import annotations

import math

RAD_S_PER_RPM = 2.0 * math.pi / 60.0
A_PER_MA = 1.0e-3


def rad_s_from_rpm(speed_rpm: float) -> float:
    """Speed [rad/s] from speed [rpm]."""
    return speed_rpm * RAD_S_PER_RPM


def rpm_from_rad_s(speed_rad_s: float) -> float:
    """Speed [rpm] from speed [rad/s]."""
    return speed_rad_s / RAD_S_PER_RPM
