"""What a run taught of each parameter: its sigma against the prior's, and whether the motion shows it at all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rw_ekf.filter.belief import Belief
from rw_ekf.filter.operating_points import OperatingPoints
from rw_ekf.model.state import PARAMETER_COUNT, PARAMETER_NAMES, STATE_UNITS
from rw_ekf.numbers import plus_minus
from rw_ekf.records import ParameterFlags

_LEARNED = 0.5  # posterior sigma below this share of the prior's: the data spoke
_KNOWN_BEFORE = 0.1  # a prior this sharp is knowledge, whatever the run says
_KNOWN = 0.5  # and below this share of the value itself: a number worth printing
_LOSES = 1.4  # times each of these: what is valid stays so until it is clearly not


@dataclass(frozen=True)
class ParameterReport:
    """One parameter after a run."""

    name: str
    value: float
    std: float
    prior_std: float
    identifiable: bool
    shown: bool = True  # by the motion, whatever sigma says

    @property
    def unit(self) -> str:
        """Unit of value and std."""
        return STATE_UNITS[self.name]

    def text(self) -> str:
        """`15.21 +- 0.02 rad/s^2/A`, or that this run does not show it."""
        if not self.identifiable and self.prior_std <= _KNOWN_BEFORE * abs(self.value):
            return f"{plus_minus(self.value, self.std)} {self.unit}, known before; this run adds little"
        if not self.shown:
            return f"not identifiable: this motion does not tell it from the others (sigma {self.std:.2g} {self.unit})"
        if not self.identifiable:
            return f"not identifiable from this run (sigma {self.std:.2g} {self.unit}, {self.prior_std:.2g} before it)"
        return f"{plus_minus(self.value, self.std)} {self.unit}"


def report(belief: Belief, prior: Belief, points: OperatingPoints | None = None) -> list[ParameterReport]:
    """The four parameters, in state order, judged against the prior the run started from, and by where it has been."""
    found = []
    shown = [True] * PARAMETER_COUNT if points is None else points.shown
    numbers = zip(PARAMETER_NAMES, belief.parameters, belief.parameter_std, prior.parameter_std, shown, strict=True)
    for name, value, std, before, seen in numbers:
        learned = std <= _LEARNED * before and std <= _KNOWN * abs(value)
        found.append(ParameterReport(name, value, std, before, learned and seen, seen or not learned))
    return found


class Validity:
    """Which parameters can be relied on after each sample: by the rule of `report` or known before; with hysteresis."""

    def __init__(self, start: Belief) -> None:
        """start: what the filter began with, or was reset to."""
        self._start_std = start.parameter_std
        known = zip(start.parameters, start.parameter_std, strict=True)
        self._known = [std <= _KNOWN_BEFORE * abs(value) for value, std in known]
        self.now = ParameterFlags(*self._known)

    def step(self, values: Sequence[float], stds: Sequence[float], shown: ParameterFlags) -> ParameterFlags:
        """Judge the four parameters after a sample."""
        flags = []
        for i, (value, std, was) in enumerate(zip(values, stds, self.now, strict=True)):
            slack = _LOSES if was else 1.0
            learned = std <= slack * _LEARNED * self._start_std[i] and std <= slack * _KNOWN * abs(value)
            known = self._known[i] and std <= slack * _KNOWN_BEFORE * abs(value)
            flags.append((shown[i] and learned) or known)
        self.now = ParameterFlags(*flags)
        return self.now
