"""From what was found to a diagnosis: figures, probabilities, the verdict, and the model that follows from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array
from rw_ekf.diagnosis.checks.confirmation import worsened
from rw_ekf.diagnosis.checks.excess_noise import NOTHING, noises_of
from rw_ekf.diagnosis.checks.heldout import (
    Performance,
    percent_better,
    performance,
    performance_by_turns,
    performance_read,
)
from rw_ekf.diagnosis.checks.reading_grid import Lattice
from rw_ekf.diagnosis.checks.residual_tests import failed_tests, left_over, residual_tests
from rw_ekf.diagnosis.investigate.found import Found, augmented_model
from rw_ekf.diagnosis.outcome import ModelTrace
from rw_ekf.diagnosis.prepare.preparation import Advance
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.diagnosis.standing import Decision, Reason
from rw_ekf.diagnosis.thresholds import GRID_GAINS, WORSE, WORST, WORST_NIS
from rw_ekf.diagnosis.verdict.document import document_of
from rw_ekf.diagnosis.verdict.explanations import weighed_explanations
from rw_ekf.diagnosis.verdict.judged import Judged
from rw_ekf.diagnosis.verdict.posterior import SOMETHING_ELSE, posterior_of, unlikely
from rw_ekf.diagnosis.verdict.verdict import Evidence, verdict_on
from rw_ekf.effects.catalogue import GRID
from rw_ekf.filter.noise_evenness import unevenness
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.model_file import refusal_of


def conclude(found: Found, advance: Advance) -> Diagnosis:
    """Judge, and write the document and the model."""
    judged = judgement(found, advance)
    prepared = judged.found.prepared
    kept, course = prepared.kept, prepared.record.course
    heldout = np.zeros(kept.size, dtype=bool)
    heldout[kept] = prepared.split.heldout
    return Diagnosis(
        log=prepared.source.log,
        content=document_of(judged),
        heldout=heldout,
        before=_trace_over_log(judged.before.trace, kept),
        after=_trace_over_log(judged.after.trace, kept) if judged.is_better else None,
        temperature_degC=_over_log(course.temperature_degC, kept) if prepared.temperature_is_logged else None,
        angle_rad=_over_log(course.angle_rad, kept) if prepared.facts.angle else None,
        angle_is_logged=prepared.angle_is_logged,
        model=judged.model,
        inertia_kg_m2=prepared.setup.inertia_kg_m2,
        inertia_from=prepared.setup.inertia_from,
        in_rpm=prepared.in_rpm,
    )


def judgement(found: Found, advance: Advance) -> Judged:
    """Weigh what was found, hold it against the held-out part and the tests of the residual, and name it."""
    prepared, selection = found.prepared, found.selection
    before, after, by_turns = _figures(found)
    lattice, rounded_off = (None, None) if found.is_unexplained else named_grid(found)
    after = after if rounded_off is None else rounded_off
    heldout_s = _duration(prepared.split.time_s, prepared.course.segment, prepared.split.heldout)
    advance("weighing explanations")
    weighed = weighed_explanations(found)
    rounded = lattice is not None or GRID.id in selection.base.model.effects.ids
    # Rounded readings are noisier where the wheel moves through cell after cell than where it stays: no torque does it.
    noise = NOTHING if rounded else noises_of(found.fit, prepared.facts, in_rpm=prepared.in_rpm)
    is_better = not found.is_unexplained and (bool(found.new_ids) or lattice is not None)
    stands = found.fit if is_better else selection.base
    white = left_over(stands)
    tests = residual_tests(white, rounded=rounded)
    failed = failed_tests(tests)
    gained = 0.01 * max(percent_better(before.figures, after.figures) or 0.0, 0.0)
    foretold = 0.0 if found.described else 1.0 - (1.0 - gained) ** 2
    posterior = posterior_of(found, weighed, lattice, noise, min(failed.values(), default=1.0), foretold)
    if found.described:
        doubted = found.new_ids
    else:
        doubted = [] if found.is_unexplained or lattice is not None else unlikely(found, posterior)
    reason = Reason.NOT_LIKELY if doubted else Reason.PARTIAL if found.is_unexplained else Reason.ADDED
    for name in found.new_ids:
        selection = selection.decided(name, Decision(reason))
    found = replace(found, selection=selection)
    describes = bool(doubted) and posterior[SOMETHING_ELSE] > 0.5 and gained > WORSE
    verdict = verdict_on(
        Evidence(
            found, lattice, posterior, before, after, heldout_s, by_turns, failed, noise.sentence, doubted, describes
        )
    )
    advance("writing the model")
    model = augmented_model(found, lattice) if is_better and (describes or not doubted) else None
    refusal = None if model is None else refusal_of(model)
    uneven = None if rounded else unevenness(white, stands.trajectory.speed)
    kept = None if refusal is not None else model
    return Judged(found, before, after, lattice, weighed, noise, tests, uneven, verdict, kept, refusal)


def _duration(time_s: Float64Array, segment: Int64Array, part: BoolArray) -> float:
    """How long a part (n,) of a record lasts [s], pauses between segments left out."""
    inside = part[1:] & part[:-1] & (np.diff(segment) == 0)
    return float(np.diff(time_s)[inside].sum())


def _figures(found: Found) -> tuple[Performance, Performance, bool]:
    """How well the base model and what was found foretell the held-out part; and whether by turns.

    So where what was found, which no held-out figure refuses, foretells worse by the numbers of half of the record: its
    free run is further off, or, where that has hardly any torque noise left to hide what they are off by, any figure.
    """
    prepared, base, more = found.prepared, found.selection.base, found.figured
    before = performance(prepared, base)
    if not found.new_ids:
        return before, before, False
    after = performance(prepared, more)
    poor = (percent_better(before.figures, after.figures) or 0.0) < 0.0
    poor = poor or worsened(before.figures, after.figures, WORST, WORST_NIS) is not None
    if found.lattice is not None or more.simulated or not poor:
        return before, after, False
    return performance_by_turns(prepared, base), performance_by_turns(prepared, more), True


def _over_log(values: Float64Array, kept: BoolArray) -> Float64Array:
    """An array over the samples looked at as one over the whole log (kept (n,)), NaN elsewhere."""
    if kept.all():
        return values
    out = np.full(kept.size, np.nan)
    out[kept] = values
    return out


def _trace_over_log(trace: ModelTrace, kept: BoolArray) -> ModelTrace:
    return ModelTrace(**{name: _over_log(values, kept) for name, values in vars(trace).items()})


def named_grid(found: Found) -> tuple[Lattice, Performance] | tuple[None, None]:
    """The readings' grid, and the figures with it, where it is coarser than what held-out readings are missed by.

    One-step errors may be small where noise persists from reading to reading: a grid that is lost in what a free run
    misses is nothing to anybody, unless errors are smaller for knowing it.
    """
    lattice = found.lattice
    if lattice is None or found.corrected is None:
        return None, None
    less = performance(found.prepared, found.selection.final).figures
    after = performance_read(found.prepared, found.corrected, found.selection.final, lattice)
    missed_rpm = less["free_run_rms_rpm"] or less["horizon_20s_rms_rpm"] or less["one_step_rms_rpm"] or 0.0
    coarse = lattice.is_coarser_than((missed_rpm * RAD_S_PER_RPM) ** 2)
    return (lattice, after) if coarse or (percent_better(less, after.figures) or 0.0) >= GRID_GAINS else (None, None)
