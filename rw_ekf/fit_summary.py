"""What a fit is worth, in the figures that identification people know.

The residual is that of one-step predictions by the filter with its parameters held at the fit; their likelihood is that
of the readings (prediction error decomposition). AIC and BIC follow [Ljung, System Identification, 2nd ed., 7.4, 16.4].
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.filter import gating
from rw_ekf.filter.consistency import autocorrelation, ljung_box_p
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.filter.parameters_held import frozen, without_drift
from rw_ekf.filter.second_pass import log_density
from rw_ekf.identify.free_run_loss import FreeRunLoss
from rw_ekf.identify.orthogonal import linearised
from rw_ekf.model.state import PARAMETER_COUNT
from rw_ekf.numbers import plus_minus
from rw_ekf.result_display import Shown

if TYPE_CHECKING:
    from rw_ekf.course.course import Course
    from rw_ekf.filter.belief import Belief
    from rw_ekf.filter.identifiability import ParameterReport
    from rw_ekf.likelihood.noise_posterior import NoisePosterior
    from rw_ekf.starting_point import FilterSetup
    from rw_ekf.wheel.model_file import WheelModel

SUMMARY_SCHEMA = "rw_ekf.fit_summary/1"
_LAGS = 20
_WHITE = 1.96  # of 1 / sqrt(n): 95 % of the autocorrelations of noise lie within
_ENTANGLED = 0.95  # a correlation from which on only a combination of two numbers is known
_NO_READING = 1.0e-9  # of a reading's weight: the least that is known of a stretch's first speed
_NOISES = 2  # of readings and of torque: numbers that were fitted beside the parameters
_SHOWN_BY = {
    "motor_gain": "a current that changes while the wheel turns, up and down",
    "viscous": "a coast-down, or steady turning, over a wide range of speeds",
    "coulomb": "reversals, or coast-downs through low speeds, in both directions",
    "static": "starts from rest by a current that rises slowly until the wheel breaks away",
}


@dataclass(eq=False, frozen=True)
class Residual:
    """A fit put to its own log; arrays (n,), NaN where a number does not exist."""

    time_s: Float64Array
    measured_rad_s: Float64Array
    free_run_rad_s: Float64Array  # each stretch from one first speed, no reading looked at after it
    one_step_rad_s: Float64Array  # reading minus what the filter foretold
    standardised: Float64Array  # (used,) of the readings that the gate let pass
    log_likelihood: float


@dataclass(eq=False, frozen=True, repr=False)
class FitSummary(Shown):
    """Parameters with sigma and correlation, how much of the motion they explain, and whether what is left is noise."""

    log: str
    numbers: dict[str, tuple[float, float, str]]  # value, standard deviation, unit, by name
    correlation: Float64Array  # (m, m)
    residual: Residual
    unknown: tuple[str, ...]  # what this motion does not show, and which would, in sentences

    @property
    def readings(self) -> int:
        """How many the likelihood is of."""
        return int(self.residual.standardised.size)

    @property
    def fitted(self) -> int:
        """How many numbers were fitted, the two noises among them."""
        return len(self.numbers) + _NOISES

    @property
    def aic(self) -> float:
        """Akaike's criterion, 2 k - 2 ln L."""
        return 2.0 * self.fitted - 2.0 * self.residual.log_likelihood

    @property
    def bic(self) -> float:
        """Schwarz's criterion, k ln n - 2 ln L."""
        return self.fitted * math.log(self.readings) - 2.0 * self.residual.log_likelihood

    @property
    def free_run_percent(self) -> float:
        """Share of the motion that a free run explains, 100 (1 - |y - y_run| / |y - mean y|); NaN if there is none."""
        return _percent(self.residual.measured_rad_s, self.residual.measured_rad_s - self.residual.free_run_rad_s)

    @property
    def one_step_percent(self) -> float:
        """The same of one-step predictions."""
        return _percent(self.residual.measured_rad_s, self.residual.one_step_rad_s)

    @property
    def autocorrelation(self) -> Float64Array:
        """Of the standardised one-step residual at lags 1, 2, ..., (lags,)."""
        return autocorrelation(self.residual.standardised, min(_LAGS, self.readings // 5))

    @property
    def white_band(self) -> float:
        """Half width of the band that holds 95 % of the autocorrelations of noise."""
        return _WHITE / math.sqrt(self.readings)

    def document(self) -> dict[str, Any]:
        """A JSON document."""
        return {
            "schema": SUMMARY_SCHEMA,
            "log": self.log,
            "readings": self.readings,
            "parameters": {
                name: {"value": value, "std": std, "unit": unit} for name, (value, std, unit) in self.numbers.items()
            },
            "correlation": self.correlation.tolist(),
            "fit_percent": {"free_run": self.free_run_percent, "one_step": self.one_step_percent},
            "log_likelihood": self.residual.log_likelihood,
            "fitted_numbers": self.fitted,
            "aic": self.aic,
            "bic": self.bic,
            "autocorrelation": self.autocorrelation.tolist(),
            "white_band": self.white_band,
            "ljung_box_p": ljung_box_p(self.autocorrelation, self.readings),
            "not_identifiable": list(self.unknown),
        }

    def text(self) -> str:
        """The same for people."""
        width = max(map(len, self.numbers))
        lines = [f"{self.log}: {self.readings} readings, {self.fitted} numbers fitted"]
        for i, (name, (value, std, unit)) in enumerate(self.numbers.items()):
            reported = f"{plus_minus(value, std)} {unit}"
            relative = f"{100.0 * std / abs(value):.2g} %" if value else "-"
            with_others = "  ".join(f"{self.correlation[i, j]:+.2f}" for j in range(i + 1))
            lines.append(f"  {name:<{width}}  {reported:<32}  {relative:>7}  {with_others}")
        free_run, one_step = map(_or_dash, (self.free_run_percent, self.one_step_percent))
        lines.append(f"  fit: free run {free_run} %, one step ahead {one_step} %")
        lines.append(f"  ln L {self.residual.log_likelihood:.1f}, AIC {self.aic:.1f}, BIC {self.bic:.1f}")
        outside = int(np.sum(np.abs(self.autocorrelation) > self.white_band))
        p = ljung_box_p(self.autocorrelation, self.readings)
        lines.append(
            f"  residual: {outside} of {self.autocorrelation.size} autocorrelations outside +-{self.white_band:.3f}, "
            f"Ljung-Box p = {_or_dash(p, '.2g')}"
        )
        for i, j in combinations(range(len(self.numbers)), 2):
            if abs(self.correlation[i, j]) > _ENTANGLED:
                one, other = list(self.numbers)[i], list(self.numbers)[j]
                lines.append(f"  {one} and {other} are entangled ({self.correlation[i, j]:+.3f}): only together known")
        return "\n".join([*lines, *(f"  {text}" for text in self.unknown)])

    def __str__(self) -> str:
        return self.text()

    def __repr__(self) -> str:
        return f"FitSummary({self.log!r}, free run {_or_dash(self.free_run_percent)} %, AIC {self.aic:.1f})"


def summary_of(log: str, model: WheelModel, reports: Sequence[ParameterReport], residual: Residual) -> FitSummary:
    """What a fit of this log comes to."""
    covariance = np.array(model.covariance)
    std = np.sqrt(np.diag(covariance))
    unknown = tuple(
        f"{item.name} is not told by this motion: {_SHOWN_BY[item.name]} would show it"
        for item in reports
        if not item.identifiable
    )
    return FitSummary(log, model.numbers, covariance / np.outer(std, std), residual, unknown)


def residual_of(course: Course, setup: FilterSetup, belief: Belief, noises: NoisePosterior) -> Residual:
    """Put a belief's parameters and coefficients to a course, held as they are. Raises FilterError."""
    used = np.isfinite(course.speed_rad_s)
    values, _ = belief.known(setup.effects.size)
    loss = FreeRunLoss(course, setup.constants, setup.prior, setup.effects, used)
    constants = setup.constants.with_speed_noise(noises.speed_noise_rad_s)
    constants = without_drift(constants.with_acceleration_noise(noises.acceleration_noise))
    effects = setup.effects.with_values(values[PARAMETER_COUNT:], np.zeros(values.size - PARAMETER_COUNT))
    run = filter_log(course, constants, *frozen(belief.parameters, belief.mean), effects)
    passed = run.outcome == gating.UPDATED
    standardised = run.innovation_rad_s[passed] / np.sqrt(run.innovation_variance[passed])
    return Residual(
        course.time_s, course.speed_rad_s, _free_run(loss, values), run.innovation_rad_s, standardised,
        log_density(run, constants.gate),
    )  # fmt: skip


def _free_run(loss: FreeRunLoss, values: Float64Array) -> Float64Array:
    """Every stretch from the first speed that suits all of its readings best, (n,) [rad/s]."""
    from_readings = loss.at(values)
    stretches = linearised(loss, from_readings).stretches
    held = np.zeros(values.size)
    steps = [stretch.first_speed_step(held, _NO_READING * loss.weight) for stretch in stretches]
    return loss.at(values, from_readings.omega_0 + np.array(steps)).simulated


def _or_dash(value: float, form: str = ".2f") -> str:
    """A number of a log in which something moves."""
    return "-" if math.isnan(value) else format(value, form)


def _percent(measured: Float64Array, missed: Float64Array) -> float:
    both = np.isfinite(measured) & np.isfinite(missed)
    moved = float(np.linalg.norm(measured[both] - measured[both].mean()))
    return 100.0 * (1.0 - float(np.linalg.norm(missed[both])) / moved) if moved > 0.0 else math.nan
