"""What is believed of a wheel before and after data: a mean and a covariance over the named state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.model.state import (
    CK13_STATISTICAL,
    PARAMETERS,
    SPEED,
    STATE_NAMES,
    STATE_SIZE,
    FrictionParameters,
)

# Standard deviations of the default prior, relative to [CK13]'s estimate: k 30 %, b 100 %, c 50 % (decision 0004).
_RELATIVE_STD = (0.30, 1.00, 0.50)
# Break-away friction is Coulomb friction plus an excess; the prior is on the excess, so that s follows c.
_EXCESS_STD_IN_COULOMB = 0.5


@dataclass(eq=False, frozen=True)
class Belief:
    """Gaussian over the state: mean (n,), covariance (n, n), the named state, then effects' coefficients.

    n is 5 without effects; hidden states come last. An a priori names the effect of each coefficient it knows.
    """

    mean: Float64Array
    covariance: Float64Array
    effect_ids: tuple[str, ...] = ()

    @classmethod
    def of_known(
        cls,
        values: Sequence[float] | Float64Array,
        covariance: Float64Array,
        size: int = 0,
        speed_variance: float = 1.0,
        effect_ids: tuple[str, ...] = (),
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
        return cls(mean, whole, effect_ids)

    def known(self, coefficients: int = 0) -> tuple[Float64Array, Float64Array]:
        """Mean (4 + m,) and covariance (4 + m, 4 + m) of the parameters and the first m coefficients."""
        here = slice(PARAMETERS.start, PARAMETERS.stop + coefficients)
        return self.mean[here].copy(), self.covariance[here, here]

    def with_coefficient(self, effect_id: str, value: float, std: float) -> Belief:
        """The same, without hidden states, and a coefficient more that is independent of all others."""
        values, covariance = self.known(len(self.effect_ids))
        wider = np.zeros((values.size + 1, values.size + 1))
        wider[:-1, :-1], wider[-1, -1] = covariance, std**2
        return Belief.of_known(np.append(values, value), wider, effect_ids=(*self.effect_ids, effect_id))

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
    return Belief(mean, covariance, belief.effect_ids)
