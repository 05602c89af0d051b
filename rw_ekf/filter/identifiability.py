"""What a run taught of each parameter: its sigma against the prior's."""

from __future__ import annotations

from dataclasses import dataclass

from rw_ekf.filter.belief import Belief
from rw_ekf.model.state import PARAMETER_NAMES, STATE_UNITS
from rw_ekf.numbers import plus_minus

_LEARNED = 0.5  # posterior sigma below this share of the prior's: the data spoke
_KNOWN_BEFORE = 0.1  # a prior this sharp is knowledge, whatever the run says
_KNOWN = 0.5  # and below this share of the value itself: a number worth printing


@dataclass(frozen=True)
class ParameterReport:
    """One parameter after a run."""

    name: str
    value: float
    std: float
    prior_std: float
    identifiable: bool

    @property
    def unit(self) -> str:
        """Unit of value and std."""
        return STATE_UNITS[self.name]

    def text(self) -> str:
        """`15.21 +- 0.02 rad/s^2/A`, or that this run does not tell."""
        if not self.identifiable and self.prior_std <= _KNOWN_BEFORE * abs(self.value):
            return f"{plus_minus(self.value, self.std)} {self.unit}, known before; this run adds little"
        if not self.identifiable:
            return f"not identifiable from this run (sigma {self.std:.2g} {self.unit}, {self.prior_std:.2g} before it)"
        return f"{plus_minus(self.value, self.std)} {self.unit}"


def report(belief: Belief, prior: Belief) -> list[ParameterReport]:
    """The four parameters, in state order, judged against the prior the run started from."""
    found = []
    numbers = zip(PARAMETER_NAMES, belief.parameters, belief.parameter_std, prior.parameter_std, strict=True)
    for name, value, std, before in numbers:
        learned = std <= _LEARNED * before and std <= _KNOWN * abs(value)
        found.append(ParameterReport(name, value, std, before, learned))
    return found
