"""Laws that are in no catalogue: found, worth what on the next log of the same wheel, and with a band that holds.

    python -m tools.measure.laws --seeds 11 12 --jobs 2

For each wheel of tools/proof/uncatalogued_laws.py one log is diagnosed, and its model run free, from the true speed at
the begin of every 40 s, over a second one; beside it the base model fitted to the first log, and what the readings'
noise alone is. The band is held against the truth at all that was seen, what the parameters follow taken off.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.conditions import with_conditions
from rw_ekf.course.course import Course
from rw_ekf.course.free_run import free_run
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.likelihood.one_step import state_vector
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.effect import Term
from rw_ekf.model.friction import LAW_CODES, Stribeck
from rw_ekf.model.state import CK13_STATISTICAL, FrictionParameters
from rw_ekf.second_record import with_times_of_record
from rw_ekf.starting_point import setup_of_record
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet
from tools.proof.uncatalogued_laws import ALL, FAMILIES, LAWS, Met, Nameless

_BLOCK_S = 40.0
_KINDS = {"drag": "drag", "torque": "torque", "motor_gain": "gain", "viscous_drag": "drag", "windage": "drag"}
_MET = {
    "speed_size": "omega", "speed": "omega", "current_along_motion": "current", "current_size": "current",
    "angle": "angle", "bus_voltage_V": "voltage", "pressure_Pa": "pressure",
}  # fmt: skip


class FreeRun(NamedTuple):
    """What a free run misses, root mean squares."""

    readings_rpm: float
    truth_rpm: float


class Measured(NamedTuple):
    """What one wheel gave."""

    name: str
    seed: int
    kind: str
    effects: list[str]
    what: str
    before: FreeRun  # over the next log, base model
    after: FreeRun  # with the model that was found; the base model where none was
    noise_rpm: float
    covered: float | None  # share of knots whose band holds the truth


def free_run_over(course: Course, truth: Float64Array, parameters: FrictionParameters, effects: EffectSet,
                  stribeck: Stribeck) -> FreeRun:  # fmt: skip
    """What is missed of readings and of the truth, from the true speed at the begin of every block."""
    first = np.arange(0, course.samples - 1, round(_BLOCK_S / course.period_s))
    last = np.append(first[1:] - 1, course.samples - 1)
    start = np.tile(state_vector(np.array([*parameters, *effects.values]), effects), (first.size, 1))
    start[:, 0] = truth[first]
    path = free_run(course, effects, stribeck, start, first, last, keep_path=True).path_rad_s
    missed = (path - known for known in (course.speed_rad_s, truth))
    return FreeRun(*(float(np.sqrt(np.nanmean(each**2))) / RAD_S_PER_RPM for each in missed))


def covered_share(term: Term, motor_gain: float, case: Nameless, log: WheelLog) -> float | None:
    """Share of a law's knots whose band of two sigma holds the truth, over what was seen."""
    law = term.law
    if law is None or len(law.spread) < 2:
        return None
    kind = _KINDS.get(law.acts_as)
    met = _MET.get(law.column or law.quantity)
    if kind is None or met is None:
        return None
    usual = Met(60.0, 0.2, 0.0, 20.0, 28.0, 400.0, 0.0)
    scale = {"viscous_drag": 60.0, "windage": 3600.0}.get(law.acts_as, 1.0)
    truth = np.array([getattr(case.law(usual._replace(**{met: at})), kind) for at in law.knots]) / scale
    if not truth.any():
        return None  # another way to say the same
    if kind == "gain":
        truth = CK13_STATISTICAL.motor_gain * (1.0 + truth) / motor_gain - 1.0
    speed, current = log.speed_rad_s, log.current_A
    along = current * np.sign(speed) if law.quantity == "current_along_motion" else np.abs(current)
    seen = {
        "omega": np.abs(speed) if law.quantity == "speed_size" else speed,
        "current": along,
        "voltage": log.channels["bus_voltage_V"],
        "pressure": log.channels["pressure_Pa"],
        "angle": np.mod(log.channels["angle_rad"], 2.0 * np.pi),
    }[met]
    edges = np.concatenate(([-np.inf], 0.5 * (law.knots[1:] + law.knots[:-1]), [np.inf]))
    weights = np.histogram(seen, edges)[0].astype(np.float64)
    at = np.abs(law.knots) if law.quantity == "speed" else law.knots
    F = np.column_stack([at**power for power in ((0, 1) if met in {"omega", "current"} else (0,))])
    off = law.values(term.values) - truth
    off = off - F @ np.linalg.lstsq(F * np.sqrt(weights)[:, None], off * np.sqrt(weights), rcond=None)[0]
    spread = np.maximum(np.array(law.spread), 1.0e-12)
    return float(np.mean(np.abs(off[weights > 0]) < 1.96 * spread[weights > 0]))


def measured(case: Nameless) -> Measured:
    """Diagnose one log, and judge by the next."""
    return judged(case, diagnose_log(case.log()))


def judged(case: Nameless, diagnosis: Diagnosis) -> Measured:
    """Judge what was found in the log of a wheel by its next."""
    log = case.log()
    following, truth = replace(case, seed=case.seed + 1000).run()
    document = diagnosis.document()
    base = FrictionParameters(*(item["value"] for item in document["parameters"]["before"].values()))
    usual = Stribeck(4.0 * RAD_S_PER_RPM, LAW_CODES["gauss"])
    noise = float(np.sqrt(np.mean((following.speed_rad_s - truth) ** 2))) / RAD_S_PER_RPM
    model = diagnosis.model
    course = with_conditions(Course.of_log(following))
    before = free_run_over(course, truth, base, NO_EFFECTS, usual)
    after, covered, what = before, None, ""
    if model is not None:
        course = with_conditions(Course.of_log(following, model.effects.columns))
        there = with_times_of_record(course, setup_of_record(course, None, model))
        after = free_run_over(course, truth, model.parameters, there.effects, there.constants.stribeck)
        laws = [term for term in model.effects.terms if term.law is not None]
        what = ", ".join(f"{term.law.acts_as} over {term.law.name}" for term in laws if term.law is not None)
        shares = [covered_share(term, model.parameters.motor_gain, case, log) for term in laws]
        known = [share for share in shares if share is not None]
        covered = float(np.mean(known)) if known else None
    verdict = document["verdict"]
    return Measured(case.name, case.seed, verdict["kind"], verdict["effects"], what, before, after, noise, covered)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line a wheel, and the shares that the marks ask for."""
    parser = argparse.ArgumentParser(description="laws that are in no catalogue")
    parser.add_argument("--seeds", type=int, nargs="+", default=[11, 12])
    parser.add_argument("--only", nargs="*", default=[], help="names that begin so")
    parser.add_argument("--jobs", type=int, default=1)
    options = parser.parse_args(arguments)
    names = [name for name in ALL if not options.only or any(name.startswith(begin) for begin in options.only)]
    cases = [Nameless(name, seed) for name in names for seed in options.seeds]
    found: list[Measured] = []
    with ProcessPoolExecutor(options.jobs) as pool:
        for item in pool.map(measured, cases):
            found.append(item)
            band = "" if item.covered is None else f" band {item.covered:.2f}"
            readings = f"{item.before.readings_rpm:6.2f} -> {item.after.readings_rpm:5.2f}"
            of_truth = f"{item.before.truth_rpm:6.2f} -> {item.after.truth_rpm:5.2f}"
            figures = f"{readings} rpm (noise {item.noise_rpm:.2f}), of the truth {of_truth}"
            reported = f"{item.name:20} {item.seed:4d} {item.kind:11} {'+'.join(item.effects):28} {item.what:34}"
            print(f"{reported} next log: {figures}{band}", flush=True)
    families = [item for item in found if item.name in FAMILIES]
    laws = [item for item in found if item.name in LAWS]
    if families:
        for what in FreeRun._fields:
            won = sum(getattr(item.after, what) <= 0.35 * getattr(item.before, what) for item in families)
            print(
                f"free run <= .35 of the base model's: {won} of {len(families)} (families, {what.removesuffix('_rpm')})"
            )
    if laws:
        near = sum(item.after.readings_rpm <= 1.15 * item.noise_rpm for item in laws)
        print(f"free run <= 1.15 of the noise: {near} of {len(laws)} (laws)")
    bands = [item.covered for item in found if item.covered is not None]
    if bands:
        print(f"the band holds the truth at {np.mean(bands):.3f} of the knots seen, {len(bands)} laws")


if __name__ == "__main__":
    main()
