"""The filter's state as a named structure. This module alone knows the order."""

from __future__ import annotations

from typing import NamedTuple

from rw_ekf.records import WheelState

# Places in the state vector and its covariance; plain ints, which become constants of what is compiled.
SPEED = 0  # omega [rad/s]
MOTOR_GAIN = 1  # k = k_m/J [rad/s^2/A]
VISCOUS = 2  # b/J [1/s]
COULOMB = 3  # c/J [rad/s^2]
STATIC = 4  # T_s/J [rad/s^2]

STATE_NAMES = WheelState._fields
PARAMETER_NAMES = STATE_NAMES[1:]
STATE_UNITS = {
    "speed_rad_s": "rad/s",
    "motor_gain": "rad/s^2/A",
    "viscous": "1/s",
    "coulomb": "rad/s^2",
    "static": "rad/s^2",
}
STATE_SIZE = len(STATE_NAMES)
PARAMETER_COUNT = len(PARAMETER_NAMES)
PARAMETERS = slice(MOTOR_GAIN, STATE_SIZE)  # where the four stand


class FrictionParameters(NamedTuple):
    """The four parameters per unit inertia, in state order."""

    motor_gain: float  # rad/s^2/A
    viscous: float  # 1/s
    coulomb: float  # rad/s^2
    static: float  # rad/s^2


# [CK13] (12), the statistical estimate; the middle of the default prior.
CK13_STATISTICAL = FrictionParameters(15.205, 0.00322, 0.5863, 0.6037)
# [CK13] (11), the deterministic one; its static friction was not known.
CK13_DETERMINISTIC = FrictionParameters(18.0, 0.00344, 0.5863, 0.5863)
