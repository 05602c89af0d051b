"""What is believed of a wheel before and after data: a mean and a covariance over the named state, and the noises."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.model.friction import LAW_CODES, Stribeck
from rw_ekf.model.state import (
    CK13_STATISTICAL,
    PARAMETERS,
    SPEED,
    STATE_NAMES,
    STATE_SIZE,
    FrictionParameters,
)
from rw_ekf.units import RAD_S_PER_RPM

SECONDS_PER_HOUR = 3600.0
# Without any process noise the speed's variance shrinks for ever, and after some 10^5 samples rounding makes it
# negative. This much, in speed noises per sqrt(s), is far below what any wheel has.
_LEAST_ACCELERATION_NOISE = 1.0e-4

# Standard deviations of the default prior, relative to [CK13]'s estimate: k 30 %, b 100 %, c 50 % (decision 0004).
_RELATIVE_STD = (0.30, 1.00, 0.50)
# Break-away friction is Coulomb friction plus an excess; the prior is on the excess, so that s follows c.
_EXCESS_STD_IN_COULOMB = 0.5


@dataclass(frozen=True)
class Belief:
    """Gaussian over the state: mean (n,), covariance (n, n), the named state, then effects' coefficients.

    n is 5 without effects; hidden states come last.
    """

    mean: Float64Array
    covariance: Float64Array

    @classmethod
    def of_known(
        cls,
        values: Sequence[float] | Float64Array,
        covariance: Float64Array,
        size: int = 0,
        speed_variance: float = 1.0,
    ) -> Belief:
        """A belief over what stands behind the speed: values (m,), covariance (m, m), the parameters first.

        The speed is left to the first reading, and so are hidden states, up to `size`.
        """
        known = SPEED + 1 + len(values)
        mean = np.zeros(max(size, known))
        mean[SPEED + 1 : known] = values
        whole = np.zeros((mean.size, mean.size))
        whole[SPEED, SPEED] = speed_variance
        whole[SPEED + 1 : known, SPEED + 1 : known] = covariance
        return cls(mean, whole)

    @property
    def std(self) -> Float64Array:
        """Standard deviations, (n,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def parameters(self) -> FrictionParameters:
        """The four parameters of the mean."""
        return FrictionParameters(*(float(v) for v in self.mean[PARAMETERS]))

    @property
    def parameter_std(self) -> FrictionParameters:
        """Their standard deviations."""
        return FrictionParameters(*(float(v) for v in self.std[PARAMETERS]))

    @property
    def parameter_covariance(self) -> Float64Array:
        """Their covariance, (4, 4)."""
        return self.covariance[PARAMETERS, PARAMETERS]

    @property
    def core(self) -> Belief:
        """Speed and the four parameters alone."""
        return Belief(self.mean[:STATE_SIZE], self.covariance[:STATE_SIZE, :STATE_SIZE])


@dataclass(frozen=True)
class NoiseModel:
    """Noises, in units with a meaning.

    speed_noise_rad_s: standard deviation of one speed reading.
    acceleration_noise: standard deviation that the true speed gains by unmodelled torque in one second
        [rad/s per sqrt(s)]; it grows with the square root of time.
    parameter_drift: what a parameter may wander in one hour, as a fraction of `scale` [per sqrt(h)]: age, temperature.
    scale: the parameter values to which that fraction refers.
    """

    speed_noise_rad_s: float
    acceleration_noise: float
    parameter_drift: float = 0.001
    scale: FrictionParameters = CK13_STATISTICAL


DEFAULT_NOISE = NoiseModel(1.0 * RAD_S_PER_RPM, 0.03 * RAD_S_PER_RPM)


def prior_around(parameters: FrictionParameters, relative_std: tuple[float, float, float] = _RELATIVE_STD) -> Belief:
    """Wide prior around `parameters`; the speed is left to the first reading.

    s is correlated with c: s = c + excess, the excess of standard deviation c/2.
    """
    k, b, c = ((share * value) ** 2 for share, value in zip(relative_std, parameters, strict=False))
    s = c + (_EXCESS_STD_IN_COULOMB * parameters.coulomb) ** 2
    return Belief.of_known(
        parameters, np.array([[k, 0.0, 0.0, 0.0], [0.0, b, 0.0, 0.0], [0.0, 0.0, c, c], [0.0, 0.0, c, s]])
    )


DEFAULT_PRIOR = prior_around(CK13_STATISTICAL)


def with_prior_table(belief: Belief, table: dict[str, tuple[float, float]]) -> Belief:
    """Replace the prior of the named parameters by independent (value, std); unknown names raise KeyError."""
    mean = belief.mean.copy()
    covariance = belief.covariance.copy()
    for name, (value, std) in table.items():
        i = STATE_NAMES.index(name)
        mean[i] = value
        covariance[i, :] = covariance[:, i] = 0.0
        covariance[i, i] = std**2
    return Belief(mean, covariance)


def filter_constants(
    noise: NoiseModel,
    stribeck_speed_rad_s: float,
    stribeck_law: str = "gauss",
    *,
    gate_probability: float = 0.9999,
    max_gap_s: float = 2.0,
    nominal_period_s: float = 0.1,
) -> FilterConstants:
    """Collect what the filter needs, in SI.

    gate_probability: of accepting a good reading; the gate is that quantile of chi-square with one degree of freedom.
    max_gap_s: a longer interval re-seeds the speed; never below five periods.
    """
    per_second = noise.parameter_drift**2 / SECONDS_PER_HOUR
    drift = [(value * value) * per_second for value in noise.scale]
    return FilterConstants(
        stribeck=Stribeck(stribeck_speed_rad_s, LAW_CODES[stribeck_law]),
        speed_variance=noise.speed_noise_rad_s**2,
        acceleration_noise=max(noise.acceleration_noise, _LEAST_ACCELERATION_NOISE * noise.speed_noise_rad_s) ** 2,
        motor_gain_drift=drift[0],
        viscous_drift=drift[1],
        coulomb_drift=drift[2],
        static_drift=drift[3],
        gate=chi_square_1_quantile(gate_probability),
        stuck_variance=(0.1 * noise.speed_noise_rad_s) ** 2,
        max_gap_s=max(max_gap_s, 5.0 * nominal_period_s),
        reseed_after=5,
    )


def chi_square_1_quantile(probability: float) -> float:
    """Quantile of chi-square with one degree of freedom: the square of the normal one (statistics.NormalDist)."""
    from statistics import NormalDist

    return NormalDist().inv_cdf(0.5 * (1.0 + probability)) ** 2
