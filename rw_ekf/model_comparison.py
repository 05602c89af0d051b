"""Two models of a wheel held against each other: number by number, and by what a third log says of both."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rw_ekf.course.conditions import with_conditions
from rw_ekf.errors import BadInputError
from rw_ekf.filter import gating
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.filter.second_pass import log_density
from rw_ekf.logs.sampling import without_repeats
from rw_ekf.numbers import plus_minus
from rw_ekf.result_display import Shown
from rw_ekf.starting_point import course_for, setup_of_record

if TYPE_CHECKING:
    from rw_ekf.logs.wheel_log import WheelLog
    from rw_ekf.wheel.model_file import WheelModel

COMPARE_SCHEMA = "rw_ekf.compare/1"


class Difference(NamedTuple):
    """One number of both; sigmas: their difference over what both leave open together, as if they were independent."""

    name: str
    unit: str
    first: tuple[float, float]
    second: tuple[float, float]
    sigmas: float


@dataclass(eq=False, frozen=True, repr=False)
class Comparison(Shown):
    """What two models have in common, and what one alone has."""

    differences: tuple[Difference, ...]
    only: tuple[tuple[str, ...], tuple[str, ...]]  # effects of the first alone, of the second alone
    log: str | None = None
    log_likelihoods: tuple[float, float] | None = None  # of one-step predictions of the third log

    def document(self) -> dict[str, Any]:
        """A JSON document."""
        return {
            "schema": COMPARE_SCHEMA,
            "numbers": [
                {
                    "name": item.name,
                    "unit": item.unit,
                    "first": dict(zip(("value", "std"), item.first, strict=True)),
                    "second": dict(zip(("value", "std"), item.second, strict=True)),
                    "sigmas": item.sigmas,
                }
                for item in self.differences
            ],
            "only_first": list(self.only[0]),
            "only_second": list(self.only[1]),
            "log": self.log,
            "log_likelihoods": None if self.log_likelihoods is None else list(self.log_likelihoods),
        }

    def text(self) -> str:
        """The same for people."""
        lines = [
            f"  {item.name}: {plus_minus(*item.first)}, {plus_minus(*item.second)} {item.unit}: "
            f"{abs(item.sigmas):.1f} sigmas apart"
            for item in self.differences
        ]
        for which, names in zip(("first", "second"), self.only, strict=True):
            lines += [f"  only in the {which}: {', '.join(names)}"] if names else []
        if self.log_likelihoods is not None:
            first, second = self.log_likelihoods
            apart = f"{abs(first - second):.1f}"
            better = f"the {'first' if first > second else 'second'} is likelier, by {apart} in the logarithm"
            lines.append(f"  {self.log}: {better if float(apart) else 'both are as likely'}")
        return "\n".join(lines)

    def __repr__(self) -> str:
        return f"Comparison({', '.join(f'{item.name} {item.sigmas:+.1f} sigmas' for item in self.differences)})"


def compared(first: WheelModel, second: WheelModel, log: WheelLog | None = None) -> Comparison:
    """Compare two models. Raises LogError for a log without a speed."""
    numbers = [model.numbers for model in (first, second)]
    both = [name for name in numbers[0] if name in numbers[1]]
    differences = []
    for name in both:
        (value, std, unit), (other, other_std, _) = numbers[0][name], numbers[1][name]
        together = math.hypot(std, other_std)
        sigmas = (value - other) / together if together > 0.0 else 0.0
        differences.append(Difference(name, unit, (value, std), (other, other_std), sigmas))
    only = tuple(tuple(name for name in mine if name not in both) for mine in numbers)
    if log is None:
        return Comparison(tuple(differences), (only[0], only[1]))
    found = log_likelihood(first, log), log_likelihood(second, log)
    return Comparison(tuple(differences), (only[0], only[1]), log.name, found)


def log_likelihood(model: WheelModel, log: WheelLog) -> float:
    """Of a log's readings, each given those before it (the prediction error decomposition); one refused as at the gate.

    Raises BadInputError for a log of which the filter uses nothing.
    """
    course = course_for(without_repeats(log)[0], model)
    unusable = BadInputError(f"{log.name}: the filter uses none of its readings: it can judge no model")
    if not np.isfinite(course.speed_rad_s).any():
        raise unusable
    setup = setup_of_record(course, None, model)
    run = filter_log(
        with_conditions(course), setup.constants, setup.prior.mean, setup.prior.covariance, setup.effects,
        setup.effect_drift,
    )  # fmt: skip
    if not (run.outcome == gating.UPDATED).any():
        raise unusable
    return log_density(run, setup.constants.gate)
