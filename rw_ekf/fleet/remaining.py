"""How long until a parameter reaches a limit: the first passage of a line with a walk, over what is not known of it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rw_ekf.errors import BadInputError
from rw_ekf.fleet.course_fit import CourseFit
from rw_ekf.model.state import PARAMETER_NAMES

_DRAWS = 4000  # the 5 % quantile is known to a tenth of itself
_SEED = 20_260_101  # the same fleet has the same numbers
_LIMIT = re.compile(r"(\w+)=([+-]?)([0-9.eE+-]+)(%?)")


@dataclass(frozen=True)
class Limit:
    """Of one parameter: a value, or a share of where it began."""

    parameter: str
    value: float | None
    share: float | None = None  # +0.5: half as much again

    def of(self, began: float) -> float:
        """The value for a wheel that began there."""
        return self.value if self.value is not None else began * (1.0 + (self.share or 0.0))


@dataclass(frozen=True)
class Remaining:
    """Years until the limit, as quantiles; infinity where it is not reached at all."""

    limit: float
    years_05: float
    years_50: float
    years_95: float
    towards: float  # probability that the rate is not away from it


def limits_of(texts: Sequence[str]) -> dict[str, Limit]:
    """Limits as they are typed: coulomb=0.9, coulomb=+50%. Raises BadInputError naming what was found."""
    found = {}
    for text in texts:
        match = _LIMIT.fullmatch(text)
        try:
            if match is None or match[1] not in PARAMETER_NAMES or (match[2] == "+" and not match[4]):
                raise ValueError  # +50 without its % would be a value
            number = float(match[3])
        except ValueError:
            raise BadInputError(
                f"--limit {text}: write NAME=VALUE or NAME=+50%, NAME one of {', '.join(PARAMETER_NAMES)}"
            ) from None
        signed = -number if match[2] == "-" else number
        found[match[1]] = Limit(match[1], None, 0.01 * signed) if match[4] else Limit(match[1], signed)
    return found


def remaining(fit: CourseFit, limit: float) -> Remaining:
    """Time from the last day on. fit: of the course; the walk continues as it was.

    The first passage of a Brownian motion of rate m and size q over a distance d has an inverse Gaussian distribution,
    of mean d / |m| and shape d^2 / q^2; where it drifts away it gets there at all with exp(2 m d / q^2) (Cox and Miller
    1965, section 5.7).
    """
    rng = np.random.default_rng(_SEED)
    level = fit.level + fit.level_std * rng.standard_normal(_DRAWS)
    towards = 1.0 if limit >= fit.began else -1.0
    rate = towards * (fit.rate + fit.rate_std * rng.standard_normal(_DRAWS))
    distance = towards * (limit - level)
    walk = max(fit.walk, 1e-12 * abs(limit))
    size = np.maximum(np.abs(rate), 1e-9 * abs(limit))
    ahead = np.maximum(distance, 1e-12 * abs(limit))
    years = rng.wald(ahead / size, (ahead / walk) ** 2)
    away = rate < 0.0
    arrives = np.exp(np.maximum(2.0 * np.minimum(rate, 0.0) * ahead / walk**2, -700.0))
    years = np.where(away & (rng.random(_DRAWS) > arrives), np.inf, years)
    years = np.where(distance <= 0.0, 0.0, years)
    low, middle, high = (float(np.sort(years)[int(share * _DRAWS)]) for share in (0.05, 0.5, 0.95))
    return Remaining(limit, low, middle, high, float(np.mean(rate > 0.0)))
