"""`rw-ekf fit`: parameters (and noises) of a wheel from a whole log."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.commands.first_use import make_ready
from rw_ekf.commands.inputs import (
    add_log_options,
    read_configuration,
    read_logs,
    read_wheel_model,
    refuse_to_overwrite,
    wheel_of_logs,
)

if TYPE_CHECKING:
    from rw_ekf.course.course import Course
    from rw_ekf.filter.belief import Belief
    from rw_ekf.likelihood.noise_posterior import NoisePosterior
    from rw_ekf.logs.wheel_log import WheelLog
    from rw_ekf.starting_point import FilterSetup
    from rw_ekf.wheel.model_file import WheelModel

HELP = "fit the parameters to a whole log by least squares, or by dedicated experiments"
EXAMPLE = """example:
  rw-ekf fit runs/2026-11-21.csv --noise --out wheel.model.yaml
  rw-ekf replay runs/2026-11-22.csv --model wheel.model.yaml"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", metavar="LOG", help="CSV, Parquet or MATLAB file")
    add_log_options(parser)
    parser.add_argument(
        "--prior", metavar="F", help="model YAML that serves as the a priori; its effects are fitted too"
    )
    parser.add_argument(
        "--method",
        choices=("least-squares", "deterministic"),
        default="least-squares",
        help="least squares over everything (default), or coast-downs and driven stretches one by one",
    )
    parser.add_argument("--noise", action="store_true", help="tune speed and acceleration noise by maximum likelihood")
    parser.add_argument("--out", metavar="FILE", help="write the result as a model YAML")


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    import numpy as np

    from rw_ekf import compile_ahead
    from rw_ekf.console import progress
    from rw_ekf.course.conditions import with_conditions
    from rw_ekf.course.course import Course
    from rw_ekf.documents import FIT_SCHEMA, effects_document, inertia_document, physical, torques_text
    from rw_ekf.errors import LogError
    from rw_ekf.filter.identifiability import report
    from rw_ekf.filter.operating_points import OperatingPoints
    from rw_ekf.hindsight import with_stribeck_speeds
    from rw_ekf.identify.misread import misreadings, questions, warnings_of
    from rw_ekf.identify.noise_colour import independent_readings
    from rw_ekf.json_output import print_json
    from rw_ekf.logs.atomic import write_text
    from rw_ekf.logs.record_print import made_of, print_of
    from rw_ekf.logs.sampling import without_repeats
    from rw_ekf.replay import refuse_runaway_model
    from rw_ekf.second_record import as_of_another_record
    from rw_ekf.starting_point import model_of, setup_of_record, without_effects

    refuse_to_overwrite([args.out], [args.log, args.columns, args.config])
    configuration = read_configuration(args.config)
    prior_model = read_wheel_model(args.prior, configuration)
    ignored: list[str] = []
    if prior_model is not None and prior_model.effects.terms and args.method == "deterministic":
        named = ", ".join(prior_model.effects.ids)
        ignored += [f"the effects of the prior ({named}) are left out: the deterministic method knows none"]
        prior_model = without_effects(prior_model)
    (log,) = read_logs([args.log], args.columns)
    if prior_model is not None:
        again = made_of(prior_model.source, log)
        ignored += [*prior_model.remarks, *([] if again is None else [again])]
    record = print_of(log)
    log, sampling = without_repeats(log)
    course = Course.of_log(log)
    readings = int(np.count_nonzero(np.isfinite(course.speed_rad_s)))
    if readings < 10:
        raise LogError(f"{log.name}: {readings} speed readings are too few to fit four parameters; ten are the least")
    augmented = prior_model if prior_model is not None and prior_model.effects.terms else None
    make_ready(compile_ahead.FIT if augmented is None else compile_ahead.DIAGNOSIS)
    described = configuration is not None or prior_model is not None
    odd = misreadings(log, described=described)
    asked = () if described else questions(log)
    course, colour = independent_readings(course)
    setup = with_stribeck_speeds(course, setup_of_record(course, configuration, prior_model))
    if augmented is not None:
        refuse_runaway_model(log.name, course, setup, augmented)
        course = with_conditions(course)
    if prior_model is not None and configuration is None and args.method == "least-squares":
        setup = as_of_another_record(course, setup)
    with progress("fit", None, " evaluations") as bar:
        belief, found, quality, warnings = _fit(args.method, course, log, setup, bar.update)
    noise = found if args.noise else None
    points = OperatingPoints.of_course(
        course, setup.prior.parameters, setup.constants.stribeck.omega_s, np.isfinite(course.speed_rad_s)
    )
    reports = report(belief, setup.prior, points)
    document: dict[str, Any] = {
        "schema": FIT_SCHEMA,
        "log": log.name,
        "method": args.method,
        "samples": len(log),
        "parameters": {
            item.name: {
                "value": item.value,
                "std": item.std,
                "unit": item.unit,
                "prior_std": item.prior_std,
                "identifiable": item.identifiable,
            }
            for item in reports
        },
        "covariance": belief.known(setup.effects.size)[1].tolist(),
        **({} if augmented is None else {"effects": effects_document(setup.effects, belief)}),
        "physical": physical(belief.parameters, setup.inertia_kg_m2),
        **inertia_document(setup),
        **quality,
        "noise": _noise_document(noise),
        "warnings": [
            *warnings_of(odd, asked),
            *sampling.remarks(),
            *log.warnings,
            *([] if colour is None else [colour.sentence]),
            *setup.notes,
            *warnings,
            *ignored,
        ],
    }
    refusal = None
    if args.out is not None:
        source = {"method": args.method, "log": Path(log.name).name, "samples": len(log), "record": record}
        model = model_of(belief, setup, source, noise, wheel_of_logs([args.log]))
        refusal = _refusal(model, odd)
        if refusal is None:
            write_text(Path(args.out), model.to_text())
        else:
            document["warnings"].append(f"{args.out} was not written, because {refusal}")
    if args.json:
        print_json(document)
    else:
        torques = None
        if setup.inertia_kg_m2 is not None:
            torques = torques_text(belief.parameters, belief.parameter_std, setup.inertia_kg_m2, setup.inertia_from)
        _print(document, reports, noise, torques)
    return 0 if refusal is None else 1


def _refusal(model: WheelModel, misread: tuple[str, ...]) -> str | None:
    """Why this model is not written for others to start from; None if it is."""
    from rw_ekf.wheel.model_file import refusal_of

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
    method: str, course: Course, log: WheelLog, setup: FilterSetup, advance: Callable[[], object]
) -> tuple[Any, NoisePosterior, dict[str, Any], list[str]]:
    """Belief, noises, what is worth knowing of how it was reached, warnings."""
    from rw_ekf.likelihood.log_fit import fit_log

    if method == "deterministic":
        belief, quality, said = _deterministic(course, log, setup)
        noises = fit_log(course, setup.constants, setup.prior.core, belief.parameters, advance=advance).noises
        return belief, noises, quality, said
    return _least_squares(course, log, setup, advance)


def _deterministic(course: Course, log: WheelLog, setup: FilterSetup) -> tuple[Belief, dict[str, Any], list[str]]:
    import numpy as np

    from rw_ekf.filter.belief import Belief
    from rw_ekf.identify.deterministic import deterministic

    noise = math.sqrt(setup.constants.speed_variance)
    found = deterministic(course, log.current_A, setup.constants.stribeck.omega_s, noise, setup.prior)
    quality = {"coast_down_s": found.coast_down_s, "driven_s": found.driven_s, "break_aways": found.break_aways}
    said = [] if found.break_aways else ["no start from rest in this log: static friction keeps its prior"]
    if found.driven_s == 0.0:
        said.append("no stretch of this log is driven: the motor gain keeps its prior")
    belief = Belief.of_known(
        found.parameters, np.diag(np.square(found.std)), speed_variance=setup.constants.speed_variance
    )
    return belief, quality, said


def _least_squares(
    course: Course, log: WheelLog, setup: FilterSetup, advance: Callable[[], object]
) -> tuple[Belief, NoisePosterior, dict[str, Any], list[str]]:
    """Free run first [CK13], for its valley; then the same readings weighed with torque noise as well."""
    import numpy as np

    from rw_ekf.errors import FilterError
    from rw_ekf.filter.belief import Belief
    from rw_ekf.hindsight import belief_of_fit
    from rw_ekf.identify.least_squares import least_squares
    from rw_ekf.likelihood.log_fit import consistency_of_fit, fit_log
    from rw_ekf.units import rpm_from_rad_s

    free_run = least_squares(course, setup.constants, setup.prior, setup.effects, advance=advance)
    effects = setup.effects.with_values(free_run.coefficients, free_run.std[len(free_run.parameters) :])
    found = fit_log(
        course, setup.constants, setup.prior, free_run.parameters, effects,
        stribeck_speed_std=setup.stribeck_speed_std, until_still=True, advance=advance,
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
    said = [] if found.converged else ["the iteration did not converge: believe the values with care"]
    judged = consistency_of_fit(found, setup.constants)
    if judged.is_noise is False:
        said += judged.warnings()
    size = setup.effects.table().size
    belief = Belief.of_known(
        (*found.parameters, *found.effects.values), covariance, size, speed_variance=setup.constants.speed_variance
    )
    noises = _without_reading_effects(found.noises, setup)
    told = replace(setup, constants=setup.constants.with_speed_noise(noises.speed_noise_rad_s))
    belief = belief_of_fit(course, told, belief, noises.acceleration_noise_quantiles.tolist())
    return belief, noises, quality, said


def _without_reading_effects(noises: NoisePosterior, setup: FilterSetup) -> NoisePosterior:
    """The readings' noise beside what effects add to it."""
    added = setup.effects.reading_variance
    if added == 0.0:
        return noises
    variance = noises.speed_noise_rad_s**2
    return replace(noises, speed_noise_rad_s=math.sqrt(max(variance - added, 1.0e-3 * variance)))


def _noise_document(noise: NoisePosterior | None) -> dict[str, Any] | None:
    from rw_ekf.units import rpm_from_rad_s

    if noise is None:
        return None
    return {
        "speed_noise_rpm": rpm_from_rad_s(noise.speed_noise_rad_s),
        "speed_noise_std_rpm": rpm_from_rad_s(noise.speed_noise_std),
        "acceleration_noise_rpm_per_sqrt_s": rpm_from_rad_s(noise.acceleration_noise),
        "acceleration_noise_std_rpm_per_sqrt_s": rpm_from_rad_s(noise.acceleration_noise_std),
        "acceleration_noise_limit_rpm_per_sqrt_s": rpm_from_rad_s(noise.acceleration_noise_limit),
        "acceleration_noise_seen": noise.acceleration_noise_seen,
    }


def _print(document: dict[str, Any], reports: list[Any], noise: NoisePosterior | None, torques: str | None) -> None:
    from rw_ekf.documents import effects_text
    from rw_ekf.numbers import plus_minus

    lines = [f"{document['log']}: {document['samples']} samples, {document['method']}"]
    lines += [f"  {item.name:<10}  {item.text()}" for item in reports]
    lines += effects_text(document["effects"]) if "effects" in document else []
    lines += [f"  {torques}"] if torques is not None else []
    if "residual_rms_rpm" in document:
        state = "converged" if document["converged"] else "NOT converged"
        lines.append(
            f"  free run misses the readings by {document['residual_rms_rpm']:.3g} rpm rms; {state} after "
            f"{document['iterations']} iterations, best of {document['starts']} starts, {document['outliers']} outliers"
        )
    if noise is not None:
        shown = document["noise"]
        q = plus_minus(shown["acceleration_noise_rpm_per_sqrt_s"], shown["acceleration_noise_std_rpm_per_sqrt_s"])
        limit = f"below {shown['acceleration_noise_limit_rpm_per_sqrt_s']:.2g} with 95 %"
        lines.append(f"  speed noise {plus_minus(shown['speed_noise_rpm'], shown['speed_noise_std_rpm'])} rpm")
        unsure = "" if noise.acceleration_noise_seen else "; the log could do without any, this much allows for it"
        lines.append(f"  acceleration noise {q} rpm/sqrt(s), {limit}{unsure}")
    lines += [f"  warning: {text}" for text in document["warnings"]]
    sys.stdout.write("\n".join(lines) + "\n")
