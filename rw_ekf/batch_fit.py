"""A whole log fitted at once: the four parameters, and the effects and noises where they are requested."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from rw_ekf.checking.choices import FitMethod, chosen
from rw_ekf.course.conditions import of_lost_temperature, with_conditions
from rw_ekf.course.course import Course
from rw_ekf.documents import FIT_SCHEMA, effects_document, effects_text, inertia_document, physical, torques_text
from rw_ekf.errors import BadInputError, FilterError, LogError
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.identifiability import report
from rw_ekf.filter.operating_points import OperatingPoints
from rw_ekf.hindsight import belief_of_fit, with_stribeck_speeds
from rw_ekf.identify.deterministic import deterministic
from rw_ekf.identify.least_squares import least_squares
from rw_ekf.identify.misread import misreadings_and_questions, warnings_of
from rw_ekf.identify.noise_colour import independent_readings
from rw_ekf.likelihood.log_fit import consistency_of_fit, fit_log
from rw_ekf.log_replay import refuse_runaway_model
from rw_ekf.logs.record_print import made_of, print_of
from rw_ekf.logs.sampling import without_repeats
from rw_ekf.numbers import plus_minus
from rw_ekf.result_display import Shown
from rw_ekf.second_record import as_of_another_record, with_warmth_of_record
from rw_ekf.starting_point import course_for, model_of, setup_of_record, without_effects
from rw_ekf.units import rpm_from_rad_s
from rw_ekf.wheel.model_file import refusal_of

if TYPE_CHECKING:
    import pyarrow as pa
    from matplotlib.figure import Figure

    from rw_ekf.filter.identifiability import ParameterReport
    from rw_ekf.fit_summary import FitSummary
    from rw_ekf.likelihood.noise_posterior import NoisePosterior
    from rw_ekf.logs.wheel_log import WheelLog
    from rw_ekf.settings.schema import Configuration
    from rw_ekf.starting_point import FilterSetup
    from rw_ekf.wheel.model_file import WheelModel
    from rw_ekf.wheel.wheel_tag import WheelTag

_LEAST_READINGS = 10


@dataclass(eq=False, frozen=True, repr=False)
class Fit(Shown):
    """A fit of one log: what it says of the wheel, and the model that others start from."""

    log: str  # path it was read from
    samples: int
    method: FitMethod
    belief: Belief
    setup: FilterSetup
    reports: tuple[ParameterReport, ...]
    quality: dict[str, Any]  # of the method: how well, by how many steps
    noises: NoisePosterior
    with_noise: bool  # whether `noises` are reported, and go into the model
    warnings: tuple[str, ...]
    model: WheelModel
    refusal: str | None  # why this model is none to start from; None: it is one
    course: Course  # what it was fitted to

    def document(self) -> dict[str, Any]:
        """The document of `fit --json`."""
        setup, belief = self.setup, self.belief
        return {
            "schema": FIT_SCHEMA,
            "log": self.log,
            "method": self.method,
            "samples": self.samples,
            "parameters": {
                item.name: {
                    "value": item.value,
                    "std": item.std,
                    "unit": item.unit,
                    "prior_std": item.prior_std,
                    "identifiable": item.identifiable,
                }
                for item in self.reports
            },
            "covariance": belief.known(setup.effects.size)[1].tolist(),
            **({"effects": effects_document(setup.effects, belief)} if setup.effects.terms else {}),
            "physical": physical(belief.parameters, setup.inertia_kg_m2),
            **inertia_document(setup),
            **self.quality,
            "noise": _noise_document(self.noises) if self.with_noise else None,
            "warnings": list(self.warnings),
        }

    def text(self) -> str:
        """What `fit` prints."""
        return "\n".join([f"{self.log}: {self.samples} samples, {self.method}", *self._lines()])

    def summary(self) -> FitSummary:
        """What it is worth: correlations, share explained, likelihood, AIC, BIC, residual. Raises FilterError."""
        from rw_ekf.fit_summary import residual_of, summary_of

        return summary_of(
            self.log, self.model, self.reports, residual_of(self.course, self.setup, self.belief, self.noises)
        )

    @property
    def table(self) -> pa.Table:
        """A row a parameter and coefficient: name, value, std, unit."""
        from rw_ekf.logs.tables import table_of

        values, stds, units = map(list, zip(*self.model.numbers.values(), strict=True))
        return table_of({"name": list(self.model.numbers), "value": values, "std": stds, "unit": units})

    def plot(self) -> Figure:
        """Measured speed and free run, what the free run misses, and the residual's autocorrelation, as a figure."""
        from rw_ekf.pictures import fit_figure

        return fit_figure(self.summary(), wheel_units=self.setup.inertia_kg_m2 is not None)

    def save(self, path: str | Path) -> None:
        """Write the model. Raises BadInputError where it is none to start from, or the place cannot be written."""
        if self.refusal is not None:
            raise BadInputError(f"{path} was not written, because {self.refusal}")
        self.model.save(path)

    def __repr__(self) -> str:
        return f"Fit({self.log!r}, {', '.join(f'{item.name} {item.text()}' for item in self.reports)})"

    def _lines(self) -> list[str]:
        setup = self.setup
        lines = [f"  {item.name:<10}  {item.text()}" for item in self.reports]
        lines += effects_text(effects_document(setup.effects, self.belief))
        if setup.inertia_kg_m2 is not None:
            lines.append("  " + torques_text(self.belief.core, setup.inertia_kg_m2, setup))
        if "residual_rms_rpm" in self.quality:
            of = self.quality
            lines.append(
                f"  free run misses the readings by {of['residual_rms_rpm']:.3g} rpm rms; "
                f"{'converged' if of['converged'] else 'NOT converged'} after {of['iterations']} iterations, best of "
                f"{of['starts']} starts, {of['outliers']} outliers"
            )
        lines += _noise_text(self.noises) if self.with_noise else []
        return [*lines, *(f"  warning: {text}" for text in self.warnings)]


def fit_record(
    log: WheelLog,
    configuration: Configuration | None = None,
    prior: WheelModel | None = None,
    *,
    method: FitMethod = "least-squares",
    with_noise: bool = False,
    wheel: WheelTag | None = None,
    advance: Callable[[], object] = lambda: None,
) -> Fit:
    """Fit a log. prior: the a priori, its effects are fitted too; wheel: whose log it is; advance: called at each step.

    Raises LogError for a log with too few speeds, BadInputError for a prior with which the filter runs away and for a
    method that there is not, FilterError where nothing can be fitted.
    """
    chosen("method", method, get_args(FitMethod))
    ignored: list[str] = []
    if prior is not None and prior.effects.terms and method == "deterministic":
        named = ", ".join(prior.effects.ids)
        ignored += [f"the effects of the prior ({named}) are left out: the deterministic method knows none"]
        prior = without_effects(prior)
    if prior is not None:
        again = made_of(prior.source, log)
        ignored += [*prior.remarks, *([] if again is None else [again])]
    record = print_of(log)
    log, sampling = without_repeats(log)
    course = course_for(log, prior)
    readings = int(np.count_nonzero(np.isfinite(course.speed_rad_s)))
    if readings < _LEAST_READINGS:
        raise LogError(f"{log.name}: {readings} speed readings are too few to fit four parameters; ten are the least")
    described = configuration is not None or prior is not None
    odd, wanted = misreadings_and_questions(log, described=described)
    course, colour = independent_readings(course)
    setup = with_stribeck_speeds(course, setup_of_record(course, configuration, prior))
    if prior is not None and prior.effects.terms:
        refuse_runaway_model(log.name, course, setup, prior)
        course = with_conditions(with_warmth_of_record(log, course, setup))
    if prior is not None and configuration is None and method == "least-squares":
        setup = as_of_another_record(course, setup)
    belief, noises, quality, stated = _fit(method, course, log, setup, advance)
    points = OperatingPoints.of_course(
        course, setup.prior.parameters, setup.constants.stribeck.omega_s, np.isfinite(course.speed_rad_s)
    )
    warnings = [
        *warnings_of(odd, wanted),
        *sampling.remarks(),
        *log.warnings,
        *([] if colour is None else [colour.sentence]),
        *of_lost_temperature(log.time_s, log.channels.get("temperature_degC"), setup.effects),
        *setup.notes,
        *stated,
        *ignored,
    ]
    source = {"method": method, "log": Path(log.name).name, "samples": len(log), "record": record}
    model = model_of(belief, setup, source, noises if with_noise else None, wheel)
    return Fit(
        log.name, len(log), method, belief, setup, tuple(report(belief, setup.prior, points)), quality, noises,
        with_noise, tuple(dict.fromkeys(warnings)), model, _refusal(model, odd), course,
    )  # fmt: skip


def _refusal(model: WheelModel, misread: tuple[str, ...]) -> str | None:
    """Why this model is not written for others to start from; None if it is."""
    if misread:
        return "the log is misread, and the model would be no machine's"
    if model.parameters.motor_gain <= 0.0:
        return (
            f"its motor gain is {model.parameters.motor_gain:.3g}: no machine is driven against its command; "
            "turn the current's sign in the column map (`scale: -1`)"
        )
    unreadable = refusal_of(model)
    return None if unreadable is None else f"nothing could read it: {unreadable}"


def _fit(
    method: FitMethod, course: Course, log: WheelLog, setup: FilterSetup, advance: Callable[[], object]
) -> tuple[Any, NoisePosterior, dict[str, Any], list[str]]:
    """Belief, noises, what is worth knowing of how it was reached, warnings."""
    if method == "deterministic":
        belief, quality, stated = _deterministic(course, log, setup)
        noises = fit_log(course, setup.constants, setup.prior.core, belief.parameters, advance=advance).noises
        return belief, noises, quality, stated
    return _least_squares(course, log, setup, advance)


def _deterministic(course: Course, log: WheelLog, setup: FilterSetup) -> tuple[Belief, dict[str, Any], list[str]]:
    noise = math.sqrt(setup.constants.speed_variance)
    found = deterministic(course, log.current_A, setup.constants.stribeck.omega_s, noise, setup.prior)
    quality = {"coast_down_s": found.coast_down_s, "driven_s": found.driven_s, "break_aways": found.break_aways}
    stated = [] if found.break_aways else ["no start from rest in this log: static friction keeps its prior"]
    if found.driven_s == 0.0:
        stated.append("no stretch of this log is driven: the motor gain keeps its prior")
    belief = Belief.of_known(
        found.parameters, np.diag(np.square(found.std)), speed_variance=setup.constants.speed_variance
    )
    return belief, quality, stated


def _least_squares(
    course: Course, log: WheelLog, setup: FilterSetup, advance: Callable[[], object]
) -> tuple[Belief, NoisePosterior, dict[str, Any], list[str]]:
    """Free run first [CK13], for its valley; then the same readings weighed with torque noise as well."""
    free_run = least_squares(course, setup.constants, setup.prior, setup.effects, advance=advance)
    effects = setup.effects.with_values(free_run.coefficients, free_run.std[len(free_run.parameters) :])
    found = fit_log(
        course, setup.constants, setup.prior, free_run.parameters, effects,
        stribeck_speed_std=setup.stribeck_speed_std, effort="most", advance=advance,
    )  # fmt: skip
    covariance = 0.5 * (found.covariance + found.covariance.T)
    if not np.isfinite(covariance).all() or np.linalg.eigvalsh(covariance).min() <= 0.0:
        raise FilterError(
            f"{log.name}: the fit leaves nothing that is a covariance: this log does not tell the parameters apart (is "
            "its speed constant, or free of noise?). Take one with reversals, or the filter's word (`rw-ekf replay`)"
        )
    quality = {
        "residual_rms_rpm": rpm_from_rad_s(free_run.residual_rms_rad_s),
        "converged": found.converged,
        "iterations": free_run.iterations,
        "starts": free_run.starts,
        "outliers": max(free_run.outliers, found.left_out),
    }
    stated = [] if found.converged else ["the iteration did not converge: believe the values with care"]
    judged = consistency_of_fit(found, setup.constants)
    if judged.is_noise is False:
        stated += judged.warnings()
    size = setup.effects.table().size
    belief = Belief.of_known(
        (*found.parameters, *found.effects.values), covariance, size, speed_variance=setup.constants.speed_variance
    )
    noises = _without_reading_effects(found.noises, setup)
    reported = replace(setup, constants=setup.constants.with_speed_noise(noises.speed_noise_rad_s))
    belief = belief_of_fit(course, reported, belief, noises.acceleration_noise_quantiles.tolist())
    return belief, noises, quality, stated


def _without_reading_effects(noises: NoisePosterior, setup: FilterSetup) -> NoisePosterior:
    """The readings' noise beside what effects add to it."""
    added = setup.effects.reading_variance
    if added == 0.0:
        return noises
    variance = noises.speed_noise_rad_s**2
    return replace(noises, speed_noise_rad_s=math.sqrt(max(variance - added, 1.0e-3 * variance)))


def _noise_document(noise: NoisePosterior) -> dict[str, Any]:
    return {
        "speed_noise_rpm": rpm_from_rad_s(noise.speed_noise_rad_s),
        "speed_noise_std_rpm": rpm_from_rad_s(noise.speed_noise_std),
        "acceleration_noise_rpm_per_sqrt_s": rpm_from_rad_s(noise.acceleration_noise),
        "acceleration_noise_std_rpm_per_sqrt_s": rpm_from_rad_s(noise.acceleration_noise_std),
        "acceleration_noise_limit_rpm_per_sqrt_s": rpm_from_rad_s(noise.acceleration_noise_limit),
        "acceleration_noise_seen": noise.acceleration_noise_seen,
    }


def _noise_text(noise: NoisePosterior) -> list[str]:
    shown = _noise_document(noise)
    q = plus_minus(shown["acceleration_noise_rpm_per_sqrt_s"], shown["acceleration_noise_std_rpm_per_sqrt_s"])
    limit = f"below {shown['acceleration_noise_limit_rpm_per_sqrt_s']:.2g} with 95 %"
    unsure = "" if noise.acceleration_noise_seen else "; the log could do without any, this much allows for it"
    return [
        f"  speed noise {plus_minus(shown['speed_noise_rpm'], shown['speed_noise_std_rpm'])} rpm",
        f"  acceleration noise {q} rpm/sqrt(s), {limit}{unsure}",
    ]
