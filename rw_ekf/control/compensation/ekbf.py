"""Kalman-Bucy filter with the friction as a Gauss-Markov state, [L17] V.4: no friction model, but a known wheel."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rw_ekf.control.compensation.drag_reading import Readings
from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.tick_intervals import Timeline
from rw_ekf.model.averages import phi_1
from rw_ekf.records import Tick

_FIRST_STD_RAD_S2 = 1.0  # of the friction, before anything was read
_LARGEST_RAD_S = 1.0e6  # of an innovation: no wheel; keeps the estimate finite


TUNABLE = {"walk_rad_s2_per_sqrt_s": (0.01, 10.0)}


@dataclass(frozen=True)
class GaussMarkov:
    """The friction: df/dt = -f / time_constant + white noise. Tuned: the noise."""

    walk_rad_s2_per_sqrt_s: float = 3.0
    time_constant_s: float = 1000.0  # long: what of a constant friction is forgotten between readings is negligible


class FrictionKalman:
    """State (omega, f): d omega/dt = k I - f, df/dt = -f/tau + w; readings of omega. Continuous-discrete, linear.

    Exact for a current held over the interval, whatever its length.
    """

    def __init__(self, process: GaussMarkov) -> None:
        self._process = process
        self._speed: float | None = None
        self._speed_variance = 0.0
        self._covariance = 0.0  # of speed and friction
        self._friction_variance = _FIRST_STD_RAD_S2**2
        self.friction_rad_s2 = 0.0

    def seed(self, speed_rad_s: float | None, noise_rad_s: float) -> None:
        """Begin at a reading, or at the next one (None); the friction is kept."""
        self._speed = speed_rad_s
        self._speed_variance, self._covariance = noise_rad_s**2, 0.0

    def predict(self, dt_s: float, drive_rad_s2: float) -> None:
        """Over an interval [s] under a drive k I [rad/s^2]."""
        if self._speed is None:
            return
        rate = 1.0 / self._process.time_constant_s
        power = self._process.walk_rad_s2_per_sqrt_s**2
        stays = math.exp(-rate * dt_s)
        slows = dt_s * phi_1(rate * dt_s)  # what a unit of friction takes from the speed
        spent = dt_s * phi_1(2.0 * rate * dt_s)  # integral of stays^2
        if rate * dt_s < 0.01:  # the integral of slows^2 below is then a difference of nearly equal numbers
            taken = dt_s**3 * (1.0 / 3.0 - rate * dt_s / 4.0 + 7.0 * (rate * dt_s) ** 2 / 60.0)
        else:
            taken = (dt_s - 2.0 * slows + spent) / rate**2
        self._speed += drive_rad_s2 * dt_s - slows * self.friction_rad_s2
        self.friction_rad_s2 *= stays
        both, friction = self._covariance, self._friction_variance
        self._speed_variance += slows * (slows * friction - 2.0 * both) + power * taken
        self._covariance = stays * (both - slows * friction) - 0.5 * power * slows * slows
        self._friction_variance = stays * stays * friction + power * spent

    def update(self, speed_rad_s: float, noise_rad_s: float) -> None:
        """By a reading [rad/s] with the standard deviation noise_rad_s; the first one is where it begins."""
        if self._speed is None:
            self.seed(speed_rad_s, noise_rad_s)
            return
        variance = self._speed_variance + noise_rad_s**2
        innovation = min(max(speed_rad_s - self._speed, -_LARGEST_RAD_S), _LARGEST_RAD_S)
        gain, friction_gain = self._speed_variance / variance, self._covariance / variance
        self._speed = speed_rad_s - (1.0 - gain) * innovation if abs(innovation) < _LARGEST_RAD_S else speed_rad_s
        self.friction_rad_s2 += friction_gain * innovation
        self._friction_variance -= friction_gain * self._covariance
        self._covariance *= 1.0 - gain
        self._speed_variance *= 1.0 - gain


class KalmanBucyCompensation:
    """I = (a + f) / k, with f of the filter and the motor gain of the data sheet, which must be right: [L17] V.4.

    An error of the gain, or of the inertia in it, is read as friction as far as it is one at a steady current.
    """

    def __init__(self, motor_gain: float, process: GaussMarkov, speed_noise_rad_s: float | None = None) -> None:
        """motor_gain: [rad/s^2/A]. speed_noise_rad_s: of a reading; None: as much as the estimator expects of one."""
        self._gain = motor_gain
        self._noise = speed_noise_rad_s
        self._timeline = Timeline()
        self._readings = Readings()
        self.filter = FrictionKalman(process)

    def current_A(self, tick: Tick, request_rad_s2: float, known: WheelKnown) -> float:
        """The current [A] for an acceleration [rad/s^2]."""
        step, noise = self._timeline.step(tick), self._noise_of(tick)
        read = self._readings.usable(tick)
        if step is None:
            self.filter.seed(read, noise)
        else:
            self.filter.predict(step[0], self._gain * step[1])
            if read is not None:
                self.filter.update(read, noise)
        return self._timeline.wanted((request_rad_s2 + self.filter.friction_rad_s2) / self._gain)

    def _noise_of(self, tick: Tick) -> float:
        if self._noise is not None:
            return self._noise
        expected = tick.estimate.innovation
        return tick.estimate.std.speed_rad_s if expected is None else expected.std_rad_s
