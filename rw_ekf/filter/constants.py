"""The numbers that steer the filter, in SI, as one flat named tuple that plain and compiled code both read."""

from __future__ import annotations

import math
from typing import NamedTuple

from rw_ekf.model.friction import LAW_CODES, Stribeck
from rw_ekf.model.state import CK13_STATISTICAL, FrictionParameters
from rw_ekf.units import RAD_S_PER_RPM

DEFAULT_SPEED_NOISE_RAD_S = 1.0 * RAD_S_PER_RPM
DEFAULT_ACCELERATION_NOISE = 0.03 * RAD_S_PER_RPM  # rad/s per sqrt(s)
_SECONDS_PER_HOUR = 3600.0
# Without any process noise the speed's variance shrinks for ever, and after some 10^5 samples rounding makes it
# negative. This much, in speed noises per sqrt(s), is far below what any wheel has.
_LEAST_ACCELERATION_NOISE = 1.0e-4


class FilterConstants(NamedTuple):
    """Everything a step needs besides the state and the sample: it alone holds what a filter takes its noises to be.

    Process noise: the speed takes white acceleration noise of `acceleration_density` (its variance grows by this much
    a second); each parameter is a random walk of variance rate `*_drift`. docs/filter.md eq. 4.
    """

    stribeck: Stribeck
    speed_variance: float  # R [rad^2/s^2]
    acceleration_density: float  # q [rad^2/s^2 per s]
    motor_gain_drift: float  # [(rad/s^2/A)^2 per s]
    viscous_drift: float  # [1/s^2 per s]
    coulomb_drift: float  # [(rad/s^2)^2 per s]
    static_drift: float  # [(rad/s^2)^2 per s]
    dry_walk: float  # variance that Coulomb and break-away friction gain together [(rad/s^2)^2 per s]
    relative_drift: float  # of a coefficient that wanders as the parameters do, in squares of its size [1/s]
    gate: float  # accepted while NIS <= gate [-]
    stuck_variance: float  # speed variance kept while the wheel is believed stuck [rad^2/s^2]
    max_gap_s: float  # a longer interval re-seeds the speed
    reseed_after: int  # this many gated samples in a row re-seed the speed
    temperature_lag_s: float  # by which the temperature that acts follows what is read; a course has it in it [s]

    @property
    def speed_noise_rad_s(self) -> float:
        """Standard deviation of one speed reading."""
        return math.sqrt(self.speed_variance)

    @property
    def acceleration_noise(self) -> float:
        """Standard deviation that the true speed gains by unmodelled torque in one second [rad/s per sqrt(s)]."""
        return math.sqrt(self.acceleration_density)

    @property
    def wanders(self) -> bool:
        """Whether parameters are taken to wander."""
        drifts = (self.motor_gain_drift, self.viscous_drift, self.coulomb_drift, self.static_drift)
        return max(*drifts, self.dry_walk) > 0.0

    def with_speed_noise(self, noise_rad_s: float) -> FilterConstants:
        """The same with another standard deviation of a reading."""
        share = (noise_rad_s / self.speed_noise_rad_s) ** 2
        return self._replace(speed_variance=noise_rad_s**2, stuck_variance=share * self.stuck_variance)

    def with_acceleration_noise(self, noise: float) -> FilterConstants:
        """The same with another acceleration noise [rad/s per sqrt(s)], never none."""
        least = _LEAST_ACCELERATION_NOISE * self.speed_noise_rad_s
        return self._replace(acceleration_density=max(noise, least) ** 2)

    def with_stribeck_speed(self, omega_s: float) -> FilterConstants:
        """The same beside another Stribeck speed [rad/s]."""
        return self._replace(stribeck=self.stribeck._replace(omega_s=omega_s))


def filter_constants(
    stribeck_speed_rad_s: float,
    stribeck_law: str = "gauss",
    *,
    speed_noise_rad_s: float = DEFAULT_SPEED_NOISE_RAD_S,
    acceleration_noise: float = DEFAULT_ACCELERATION_NOISE,
    parameter_drift: float = 0.001,
    dry_walk: float = 0.0,
    scale: FrictionParameters = CK13_STATISTICAL,
    gate_probability: float = 0.9999,
    max_gap_s: float = 2.0,
    nominal_period_s: float = 0.1,
    temperature_lag_s: float = 0.0,
) -> FilterConstants:
    """Collect what the filter needs, from units with a meaning.

    acceleration_noise: see FilterConstants; never below a ten thousandth of the speed noise.
    parameter_drift: what a parameter may wander in one hour, as a fraction of `scale` [per sqrt(h)]: age, temperature.
    dry_walk: by how much dry friction walks at random besides [rad/s^2 per sqrt(s)].
    gate_probability: of accepting a good reading; the gate is that quantile of chi-square with one degree of freedom.
    max_gap_s: a longer interval re-seeds the speed; never below five periods.
    temperature_lag_s: of a bearing behind its thermometer.
    """
    per_second = parameter_drift**2 / _SECONDS_PER_HOUR
    drift = FrictionParameters(*((value * value) * per_second for value in scale))
    return FilterConstants(
        stribeck=Stribeck(stribeck_speed_rad_s, LAW_CODES[stribeck_law]),
        speed_variance=speed_noise_rad_s**2,
        acceleration_density=max(acceleration_noise, _LEAST_ACCELERATION_NOISE * speed_noise_rad_s) ** 2,
        motor_gain_drift=drift.motor_gain,
        viscous_drift=drift.viscous,
        coulomb_drift=drift.coulomb,
        static_drift=drift.static,
        dry_walk=dry_walk**2,
        relative_drift=per_second,
        gate=chi_square_1_quantile(gate_probability),
        stuck_variance=(0.1 * speed_noise_rad_s) ** 2,
        max_gap_s=max(max_gap_s, 5.0 * nominal_period_s),
        reseed_after=5,
        temperature_lag_s=temperature_lag_s,
    )


def chi_square_1_quantile(probability: float) -> float:
    """Quantile of chi-square with one degree of freedom: the square of the normal one (statistics.NormalDist)."""
    from statistics import NormalDist

    return NormalDist().inv_cdf(0.5 * (1.0 + probability)) ** 2
