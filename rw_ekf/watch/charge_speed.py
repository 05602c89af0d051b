"""How fast the wheel must be by the charge that was written to it: a second speedometer, which no reading owns.

The model [CK13 (1), (4)] is driven by the currents that were written, and follows the readings only as far as the
parameters may be wrong:

    d omega_q/dt = k I - sgn(omega_q) (b |omega_q| + c) + v,    |v| <= 2 sd(a) + 0.05 |k I| + 0.1 (b |omega_q| + c)  (1)

with sd(a)^2 = phi' P phi of the estimator's belief. A healthy wheel's readings stay within that, so omega_q is the
reading. A tachometer that jumps, halves its scale, hums on a dead line or lags behind moves omega_q by no more than
that, the first term of which is what the estimator itself leaves open: the guard holds both against the limit.

What the estimator believes is what the readings made it believe, so it counts only as far as a wheel can be like that:
a gain of no less than three quarters of what this run has shown, friction of neither sign's wrong side nor beyond three
times what the run began with. With 0.05, 0.1 and 0.75 moved by 30 % the largest true speed under a lying reading moves
by less than 0.05 of the limit (tools/measure/lying_telemetry.py).

[CK13]: docs/model.md.
"""

from __future__ import annotations

import math

from rw_ekf.model.state import FrictionParameters
from rw_ekf.watch.stuck_watch import ParameterBelief

_SIGMAS = 2.0
_DRIVE_SHARE = 0.05
_FRICTION_SHARE = 0.1
_LEAST_GAIN = 0.75  # of the gain that the run has shown
_MOST_FRICTION = 3.0  # times what the run began with


class ChargeSpeed:
    """One of these per run; time comes with the data."""

    def __init__(self, expected: FrictionParameters) -> None:
        """expected: of the model that the run starts from."""
        self._expected = FrictionParameters(*(abs(value) for value in expected))
        self.shown_gain = 0.0  # that a motion of this run has shown at least [rad/s^2/A]
        self.speed_rad_s: float | None = None

    def show_gain(self, gain: float) -> None:
        """Note that a motion has shown a gain of this at least [rad/s^2/A]."""
        self.shown_gain = max(self.shown_gain, gain)

    def anchor(self, reading_rad_s: float | None) -> None:
        """A new segment: what flowed in between is not known, so the reading counts."""
        self.speed_rad_s = reading_rad_s

    def step(self, dt_s: float, current_A: float, reading_rad_s: float | None, belief: ParameterBelief) -> None:
        """Take an interval of dt_s with its mean current, and the reading that ends it."""
        if self.speed_rad_s is None or not dt_s > 0.0:
            self.speed_rad_s = reading_rad_s if self.speed_rad_s is None else self.speed_rad_s
            return
        k, b, c = self._of(belief)
        speed = self.speed_rad_s
        drive, friction = k * current_A, b * abs(speed) + c
        ahead = _ahead(speed, drive, friction, dt_s)
        if reading_rad_s is None:
            self.speed_rad_s = ahead
            return
        phi = (current_A, -speed, -math.copysign(1.0, speed), 0.0)
        P = belief.covariance
        variance = sum(float(P[i, j]) * phi[i] * phi[j] for i in range(3) for j in range(3))
        u = _SIGMAS * math.sqrt(max(variance, 0.0)) + _DRIVE_SHARE * abs(drive) + _FRICTION_SHARE * friction
        self.speed_rad_s = ahead + min(max(reading_rad_s - ahead, -u * dt_s), u * dt_s)

    def _of(self, belief: ParameterBelief) -> tuple[float, float, float]:
        k, b, c, _ = belief.parameters if belief.is_physical else self._expected
        k = max(k, _LEAST_GAIN * self.shown_gain)
        b = min(max(b, 0.0), _MOST_FRICTION * self._expected.viscous)
        return k, b, min(max(c, 0.0), _MOST_FRICTION * self._expected.coulomb)


def _ahead(speed: float, drive: float, friction: float, dt_s: float) -> float:
    """The speed after dt_s [s] by eq. 1 without v: through zero only where the drive is stronger than the friction."""
    if speed == 0.0 or abs(speed) < friction * dt_s:
        if abs(drive) <= friction:
            return 0.0 if speed * drive <= 0.0 or abs(speed) < friction * dt_s else speed
        return speed + (drive - math.copysign(friction, drive)) * dt_s
    ahead = speed + (drive - math.copysign(friction, speed)) * dt_s
    return 0.0 if ahead * speed < 0.0 and abs(drive) <= friction else ahead
