"""What laws and effects are functions of: the wheel and its surroundings at one moment."""

from __future__ import annotations

from typing import NamedTuple

Columns = tuple[float, float, float]
NO_COLUMNS: Columns = (0.0, 0.0, 0.0)


class Moment(NamedTuple):
    """What an effect is evaluated at: the speed where a step begins, the rest in its middle."""

    omega: float  # rad/s
    current: float  # A, commanded
    temperature: float  # degC
    angle: float  # rad, where the step begins
    time: float  # s, of the log
    duration: float  # s, of the step
    columns: Columns = NO_COLUMNS  # of the log
