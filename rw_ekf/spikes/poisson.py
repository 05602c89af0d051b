"""Events that come at random: their rate with an exact interval, and whether it changes with time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

_TAIL = 0.5 * (1.0 - 0.95)  # of the interval, on either side
_EXACT_UP_TO = 12  # events; beyond, the sum of as many uniform numbers is normal to 1e-3 of a probability


@dataclass(frozen=True)
class Rate:
    """A rate per unit of exposure."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Trend:
    """Laplace's test of a homogeneous Poisson process: whether its events come early or late in what was watched."""

    statistic: float  # standard normal where nothing changes; above zero they become more frequent
    p_value: float  # two-sided
    early: int  # events in the first half of what was watched
    late: int


def poisson_rate(count: int, exposure: float) -> Rate:
    """Rate of a Poisson process with Garwood's exact interval of 95 %. Raises ValueError for no exposure."""
    from scipy.special import gammaincinv

    if not exposure > 0.0:
        raise ValueError("a rate needs an exposure above zero")
    low = 0.0 if count == 0 else float(gammaincinv(count, _TAIL))
    return Rate(count / exposure, low / exposure, float(gammaincinv(count + 1, 1.0 - _TAIL)) / exposure)


def laplace_test(times: Sequence[float], exposure: float) -> Trend | None:
    """Test whether the incidence changes; times (n,) within 0 to exposure. None for fewer than three events.

    Given their number, the times of a homogeneous process are uniform: U = (mean t - T/2)/(T sqrt(1/12n)) [Cox & Lewis
    1966], its probability exact for few events. It is the best test there is of a rate exp(a + b t).
    """
    if len(times) < 3:
        return None
    count = len(times)
    total = sum(time / exposure for time in times)
    statistic = (total - 0.5 * count) / math.sqrt(count / 12.0)
    if count <= _EXACT_UP_TO:
        below = _irwin_hall(min(total, count - total), count)
        p_value = min(2.0 * below, 1.0)
    else:
        p_value = math.erfc(abs(statistic) / math.sqrt(2.0))
    early = sum(1 for time in times if time < 0.5 * exposure)
    return Trend(statistic, p_value, early, count - early)


def _irwin_hall(total: float, count: int) -> float:
    """Probability that so many uniform numbers sum to no more than `total`, at most half their number."""
    terms = [(-1) ** k * math.comb(count, k) * (total - k) ** count for k in range(math.floor(total) + 1)]
    return math.fsum(terms) / math.factorial(count)
