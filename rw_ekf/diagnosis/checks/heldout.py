"""How well a model predicts what it was not fitted to, parameters frozen.

The figures are those of docs/contract.md#diagnosis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array
from rw_ekf.course.free_run import free_run
from rw_ekf.diagnosis.checks.reading_grid import Lattice, rounding_error
from rw_ekf.diagnosis.hypotheses.random_walk import walk_of, without_walk
from rw_ekf.diagnosis.outcome import ModelTrace
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.effects.catalogue import GRID, WANDERING
from rw_ekf.likelihood.by_simulation import by_simulation
from rw_ekf.likelihood.filter_over_record import run_frozen
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.gauss_newton import smoothed_trajectory
from rw_ekf.likelihood.linearisation import Noise, linearise
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import Record
from rw_ekf.model.state import COULOMB, SPEED
from rw_ekf.units import rpm_from_rad_s

# The errors of a prediction, as sentences call them.
ERRORS = {
    "one_step_rms_rpm": "one-step error",
    "horizon_1s_rms_rpm": "error 1 s ahead",
    "horizon_20s_rms_rpm": "error 20 s ahead",
    "free_run_rms_rpm": "free-run error",
}
FIGURES = (*ERRORS, "nis_mean", "torque_rms_mNm")
_TURNS = 6  # in which held-out stretches are left out: each takes a fit of its own
_STARTS = 400  # of a horizon: more would add nothing but time
_FEWEST = 30  # of a horizon: the root mean square of fewer is uncertain by an eighth, and refuses an effect by chance
_OBSERVER_RATIO = 0.05  # q dt / R of the disturbance observer: it follows a torque within a second at 10 Hz
_STEPS_AT_MOST = 4_000_000
_SETTLE_SAMPLES = 20


@dataclass(eq=False, frozen=True)
class Performance:
    """A model's figures on the held-out part, and its traces over the whole record."""

    figures: dict[str, Any]
    trace: ModelTrace
    predicted_std_rad_s: Float64Array  # of the speed before each reading, (n,)


def performance(prepared: Prepared, fit: Fit) -> Performance:
    """Figures of the model of a fit of the whole record, from the held-out samples alone; worked out once a fit.

    The model is fitted to the other part anew and run, frozen, over the record; but for a dry friction that walks,
    which the filter follows at the rate found.
    """
    return prepared.remembered("figures", fit, lambda: _figures(prepared, fit))


def _figures(prepared: Prepared, fit: Fit) -> Performance:
    found = _performance(prepared, by_fit_part(prepared, fit), None)
    if walk_of(fit) is None:
        return found
    # Nobody foretells a walk. Far ahead the friction that was usual may be nearer than where it is now, and is at hand.
    alone = fit.model.effects.ids == (*prepared.base.model.effects.ids, WANDERING.id)
    less = performance(prepared, prepared.base if alone else without_walk(fit))
    figures = found.figures | {"free_run_rms_rpm": less.figures["free_run_rms_rpm"]}
    followed, usual = found.figures["horizon_20s_rms_rpm"], less.figures["horizon_20s_rms_rpm"]
    figures["horizon_20s_rms_rpm"] = min(followed, usual) if followed and usual else usual
    trace = replace(found.trace, free_run_rad_s=less.trace.free_run_rad_s)
    return replace(found, figures=figures, trace=trace)


def performance_by_turns(prepared: Prepared, fit: Fit) -> Performance:
    """The same, each held-out stretch foretold by numbers from all the rest of the record; worked out once a fit.

    For where half of a record does not know a model's numbers well enough to say anything of the other half
    (cross-validation: Stone 1974, J. R. Stat. Soc. B 36, 111; of a time series by blocks: Burman, Chow & Nolan 1994).
    Of a record cut into halves there is but one stretch.
    """
    if prepared.split.kind == "halves":
        return performance(prepared, fit)
    return prepared.remembered("turns", fit, lambda: _by_turns(prepared, fit))


def _by_turns(prepared: Prepared, fit: Fit) -> Performance:
    split, usual = prepared.split, performance(prepared, fit)
    turn = np.searchsorted(np.unique(split.block[split.heldout]), split.block) % _TURNS
    found: list[tuple[BoolArray, Performance]] = []
    for number in np.unique(turn[split.heldout]):
        left_out = split.heldout & (turn == number)
        rest = split.looked_at & ~left_out
        parts = replace(
            prepared, split=replace(split, fit=rest, heldout=left_out), fit_part=prepared.record.within(rest),
            _of_fit={},
        )  # fmt: skip
        found.append((left_out, performance(parts, fit)))
    figures = {key: _pooled(key, [(int(part.sum()), one.figures[key]) for part, one in found]) for key in usual.figures}
    parts_of = [part for part, _ in found]
    traces = {
        name: np.select(parts_of, [vars(one.trace)[name] for _, one in found], whole)
        for name, whole in vars(usual.trace).items()
    }
    stds = np.select(parts_of, [one.predicted_std_rad_s for _, one in found], usual.predicted_std_rad_s)
    return Performance(figures, ModelTrace(**traces), stds)


def _pooled(key: str, parts: list[tuple[int, float | None]]) -> float | None:
    """A figure of several parts, of so many samples each: the mean of NIS, of errors the root of the mean square."""
    there = [(count, value) for count, value in parts if value is not None]
    if not there:
        return None
    power = 1.0 if key == "nis_mean" else 2.0
    mean = sum(count * value**power for count, value in there) / sum(count for count, _ in there)
    return float(mean ** (1.0 / power))


def foretold_better(prepared: Prepared, fit: Fit) -> float:
    """Log of how much likelier a filter that follows the walk of a fit makes the held-out readings.

    Each from those before it, beside the model without the walk at its own noises, which may take dry friction to be as
    uncertain where the record begins: one knows no more of it than the other.
    """
    part, less = by_fit_part(prepared, fit), by_fit_part(prepared, without_walk(fit))
    walk = walk_of(part)
    assert walk is not None

    def value(way: Fit, model: Model, rate: float) -> float:
        record = prepared.record.along(way.trajectory)
        course = record.course.only(~prepared.base.omit)
        run = run_frozen(course, model.with_laws_as_curves, way.noise, record.constants, walk=(rate, walk.spread))
        held = prepared.split.heldout & np.isfinite(run.innovation_rad_s)
        return -0.5 * float(np.sum(run.nis[held] + np.log(run.innovation_variance[held])))

    return value(part, walk.model, walk.rate) - value(less, less.model, 0.0)


def by_fit_part(prepared: Prepared, fit: Fit) -> Fit:
    """The model of a fit of the whole record fitted to the part that is not held out; worked out once a fit."""

    def fitted() -> Fit:
        part = fit.on_part(prepared.fit_part)
        return by_simulation(part) if fit.simulated else part

    return prepared.remembered("fit", fit, fitted)


def performance_read(prepared: Prepared, corrected: Prepared, fit: Fit, lattice: Lattice) -> Performance:
    """The same, the readings predicted being those that a grid makes of the speed.

    corrected: the record without what the grid did to its readings; the numbers come from its other part.
    """
    return _performance(prepared, by_fit_part(corrected, fit), lattice)


def _performance(prepared: Prepared, fit: Fit, lattice: Lattice | None) -> Performance:
    record, split, noise, walk = prepared.record, prepared.split, fit.noise, walk_of(fit)
    followed = fit.model if walk is None else walk.model  # a walk is followed, and what lies ahead is as it last was
    model = followed.with_laws_as_curves
    if lattice is not None:  # of the readings as they were read, as given to a filter with this model
        variance = lattice.noise_rad_s**2 + GRID.variance(lattice.grid_rad_s)
        noise = Noise(variance, noise.ratio * noise.variance / variance)
    inertia_kg_m2 = prepared.setup.inertia_kg_m2
    record = record.along(fit.trajectory)
    course = record.course.only(~prepared.base.omit)
    follows = None if walk is None else (walk.rate, walk.spread)
    run = run_frozen(course, model, noise, record.constants, walk=follows)
    free = _free_run(record, model, run.states, split.block)
    observed = _observed_acceleration(record, model, noise, prepared.base)
    if walk is not None:
        observed += np.sign(run.states[:, SPEED]) * (run.states[:, COULOMB] - model.parameters.coulomb)
    heldout = split.heldout
    torque = None if inertia_kg_m2 is None else _rms(observed[heldout])
    variance = np.maximum(run.innovation_variance - noise.variance, 0.0)
    innovation = run.innovation_rad_s
    innovation = _missed(course.speed_rad_s, course.speed_rad_s - innovation, np.sqrt(variance), lattice)
    errors = {seconds: _horizon(record, model, run.states, heldout, seconds, lattice) for seconds in (1.0, 20.0)}
    ran = _missed(course.speed_rad_s, free, np.zeros(free.size), lattice)
    figures = {
        "one_step_rms_rpm": _rms_rpm(innovation[heldout]),
        "horizon_1s_rms_rpm": _rms_rpm(errors[1.0]),
        "horizon_20s_rms_rpm": _rms_rpm(errors[20.0]),
        "free_run_rms_rpm": _rms_rpm(ran[heldout]),
        "nis_mean": _mean(run.nis[heldout]),
        "torque_rms_mNm": None if inertia_kg_m2 is None or torque is None else 1e3 * inertia_kg_m2 * torque,
    }
    trace = ModelTrace(run.innovation_rad_s, free, observed, run.innovation_rad_s / np.sqrt(run.innovation_variance))
    return Performance(figures, trace, np.sqrt(variance))


def _missed(read: Float64Array, predicted: Float64Array, spread: Float64Array, lattice: Lattice | None) -> Float64Array:
    """Readings (n,) less those that predicted speeds, known to standard deviations, let expect [rad/s]."""
    error = read - predicted
    return error if lattice is None else error - rounding_error(predicted, spread, lattice)


def _free_run(record: Record, model: Model, states: Float64Array, block: Int64Array) -> Float64Array:
    """Each stretch of the split simulated from its first filtered speed, (n,)."""
    continues = record.follows & (np.diff(block, prepend=block[:1]) == 0)
    first = np.flatnonzero(~continues)
    last = np.append(first[1:], block.size) - 1
    # The filter itself begins with one reading: where a stretch opens the record, let it settle for some samples.
    settle = np.minimum(np.where(record.follows[first], first, first + _SETTLE_SAMPLES), last)
    run = free_run(record.course, model.effects, model.stribeck, states[settle], settle, last, keep_path=True)
    return run.path_rad_s


def _horizon(
    record: Record, model: Model, states: Float64Array, heldout: BoolArray, seconds: float, lattice: Lattice | None
) -> Float64Array:
    """Errors of predictions `seconds` ahead that end, and stay, within one held-out stretch [rad/s]; none of a few."""
    period = record.period_s
    steps = max(1, round(seconds / period))
    inside = record.follows & heldout & np.roll(heldout, 1)
    index = np.arange(heldout.size)
    # How many intervals in a row lead here within the held-out part.
    run = index - np.maximum.accumulate(np.where(inside, 0, index))
    ends = np.flatnonzero((run >= steps) & np.isfinite(record.course.speed_rad_s))
    most = max(10, min(_STARTS, _STEPS_AT_MOST // steps))
    if ends.size > most:
        ends = ends[np.linspace(0, ends.size - 1, most).astype(int)]
    if ends.size < _FEWEST:
        return np.zeros(0)
    first = ends - steps
    predicted = free_run(record.course, model.effects, model.stribeck, states[first], first, ends).ends_rad_s
    return _missed(record.course.speed_rad_s[ends], predicted, np.zeros(ends.size), lattice)


def _observed_acceleration(record: Record, model: Model, noise: Noise, base: Fit) -> Float64Array:
    """What the smoothed speed requires beyond the model [rad/s^2], (n,), by an observer the same for every model.

    NaN where the base model has the wheel at rest: what does not move it is not seen, whatever the model.
    """
    observer = Noise(noise.variance, max(noise.ratio, _OBSERVER_RATIO))
    trajectory = base.trajectory
    for _ in range(2):
        linearised = linearise(record, model, trajectory, observer, base.omit, with_jacobian=False)
        smoothed = smoothed_trajectory(linearised, np.zeros(0), observer)
        delta = smoothed.speed - trajectory.speed
        kept = linearised.chain.slopes[:, 0] * np.concatenate(([0.0], delta[:-1]))
        # A bristle that is bent otherwise has its own word in the speed.
        bent = np.nan_to_num(smoothed.memory - linearised.trajectory.memory)  # NaN of models without a memory
        kept += linearised.chain.slopes[:, 1] * np.concatenate(([0.0], bent[:-1]))
        lacking = delta - kept - linearised.chain.defect
        trajectory = smoothed
    step = np.where(record.follows, linearised.chain.step_s, np.nan)
    moves = record.follows & (base.linearised.chain.noisy_s > 0.0)
    return np.where(moves, lacking / step, np.nan)


def _rms(values: Float64Array) -> float | None:
    found = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(found**2))) if found.size else None


def _mean(values: Float64Array) -> float | None:
    found = values[np.isfinite(values)]
    return float(np.mean(found)) if found.size else None


def _rms_rpm(values: Float64Array) -> float | None:
    found = _rms(values)
    return None if found is None else rpm_from_rad_s(found)


def gain_over(prepared: Prepared, less: Fit, more: Fit) -> float | None:
    """Percent by which the free-run error (20 s ahead where there is none) on the held-out part is smaller.

    Of models fitted to the whole record, their numbers to the other part.
    """
    return percent_better(performance(prepared, less).figures, performance(prepared, more).figures)


def percent_better(before: dict[str, Any], after: dict[str, Any]) -> float | None:
    """Percent by which the error of `telling_figure` is smaller; None where no figure decides."""
    key = telling_figure(before, after)
    if key is None or not before[key]:
        return None
    return float(100.0 * (1.0 - after[key] / before[key]))


def telling_figure(before: dict[str, Any], after: dict[str, Any]) -> str | None:
    """Which figure is compared: the free run; 20 s ahead where there is none, or a walk leaves it as it was."""
    free = before.get("free_run_rms_rpm")
    is_left = before is not after and free == after.get("free_run_rms_rpm")
    key = "horizon_20s_rms_rpm" if free is None or is_left else "free_run_rms_rpm"
    return None if before.get(key) is None or after.get(key) is None else key
