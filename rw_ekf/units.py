"""Units: SI inside; rpm and mA exist only at an edge, and always in the name."""

from __future__ import annotations

import math
import re

RAD_S_PER_RPM = 2.0 * math.pi / 60.0
A_PER_MA = 1.0e-3
_DURATION = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)(ms|s|m|min|h|d)?")
_COMPOUND = re.compile(r"(?:(?P<d>\d+)d)?(?:(?P<h>\d+)h)?(?:(?P<m>\d+)m(?:in)?)?(?:(?P<s>\d+\.?\d*)s)?")
_SECONDS = {"ms": 1e-3, "s": 1.0, "m": 60.0, "min": 60.0, "h": 3600.0, "d": 86400.0, None: 1.0}


def seconds_from(text: str) -> float | None:
    """Time [s] from `90`, `90s`, `10m`, `2h`, `1d`, `1h30m`, `16ms`; None where it is none."""
    match = _DURATION.fullmatch(text)
    if match is not None:
        return float(match[1]) * _SECONDS[match[2]]
    parts = _COMPOUND.fullmatch(text) if text else None
    return None if parts is None else sum(float(value) * _SECONDS[unit] for unit, value in parts.groupdict("0").items())


def rad_s_from_rpm(speed_rpm: float) -> float:
    """Speed [rad/s] from speed [rpm]."""
    return speed_rpm * RAD_S_PER_RPM


def rpm_from_rad_s(speed_rad_s: float) -> float:
    """Speed [rpm] from speed [rad/s]."""
    return speed_rad_s / RAD_S_PER_RPM
