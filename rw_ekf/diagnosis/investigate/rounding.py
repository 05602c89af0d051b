"""Readings on a coarse grid: the grid is reported, and the record searched again without what it did to the readings.

What rounding does to a reading is no noise: a slow wheel stays in one cell for many samples, and its error goes with
the speed. So the residual shows it as a dependence on speed or angle, and effects that look like that are hidden by it
or made up.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rw_ekf.diagnosis.checks.heldout import performance
from rw_ekf.diagnosis.checks.reading_grid import Lattice, coarse_grid, explained_variance, find_lattice, rounding_error
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.investigate.investigation import investigate
from rw_ekf.diagnosis.prepare.preparation import Advance, Prepared
from rw_ekf.diagnosis.thresholds import GRID_REGISTER_RPM
from rw_ekf.effects.catalogue import GRID
from rw_ekf.likelihood.fitting import Fit, fit_model
from rw_ekf.likelihood.gauss_newton import Start
from rw_ekf.likelihood.levels import Levels
from rw_ekf.likelihood.one_step import Record, Trajectory
from rw_ekf.units import RAD_S_PER_RPM

_TURNS = 3
_OTHER_NOISE = 1.5  # times: less moves what rounding did to a reading by less than the reading's noise


def investigated(prepared: Prepared, advance: Advance) -> Found:
    """What is found where the readings' grid is coarser than their noise and known to be; else as ever.

    Most grids show beside the base model, one at times only beside what the wheel has. Beside a base model that lacks
    much the readings' own noise is lost in its torque noise: once more where it is much larger beside what was found,
    or so large that the grid does no harm. Figures stay those of the readings as they were read.
    """
    lattice = lattice_of(prepared, prepared.base)
    if lattice is None:
        found = investigate(prepared, advance)
        lattice = lattice_of(prepared, found.fit)
        if lattice is None:
            return found
        advance("once more without what rounding did to the readings")
        found = investigate(without_rounding(prepared, found.fit.trajectory, lattice), advance)
    else:
        advance("taking off what rounding did to the readings")
        found = investigate(without_rounding(prepared, prepared.base.trajectory, lattice), advance)
        again = lattice_of(prepared, found.fit) if found.new_ids else lattice
        if again is None:
            return investigate(prepared, advance)
        if again.noise_rad_s > _OTHER_NOISE * lattice.noise_rad_s:
            advance("once more with the noise that readings have before they are rounded")
            lattice = again
            found = investigate(without_rounding(prepared, found.fit.trajectory, lattice), advance)
    return replace(found, prepared=prepared, lattice=lattice, corrected=found.prepared)


def lattice_of(prepared: Prepared, fit: Fit) -> Lattice | None:
    """The grid of the readings, if it is coarser than what a fit leaves and shows on both parts together."""
    if GRID.id in prepared.base.model.effects.ids:
        return None
    least_rad_s = 0.0 if prepared.setup.inertia_kg_m2 is None else GRID_REGISTER_RPM * RAD_S_PER_RPM
    speed = prepared.course.speed_rad_s
    if coarse_grid(speed, fit.noise.variance, least_rad_s) is None:
        return None
    performed = performance(prepared, fit)
    innovation = performed.trace.one_step_error_rad_s
    lattice = find_lattice(
        speed,
        speed - innovation,
        performed.predicted_std_rad_s,
        fit.noise.variance,
        prepared.split.heldout,
        least_rad_s,
    )
    if lattice is None or lattice.statistic + lattice.heldout_statistic < 0.0:
        return None
    return lattice


def without_rounding(prepared: Prepared, trajectory: Trajectory, lattice: Lattice) -> Prepared:
    """The same without what rounding did, the base model fitted anew: by turns, since either needs the other."""
    changed = prepared
    for _ in range(_TURNS):
        changed = _corrected(prepared, trajectory, lattice)
        trajectory = changed.base.trajectory
    return changed


def _corrected(prepared: Prepared, trajectory: Trajectory, lattice: Lattice) -> Prepared:
    """The same with the errors that readings along a trajectory have taken off them, and the base model fitted anew.

    Where the wheel stays in a cell, nothing shows the error: it is left open, the same for all readings there. They
    are as good as free of noise then, and no measure of those of a wheel that moves: of these no fit may make less
    than half of what the correction leaves of them, so well as the trajectory is known.
    """
    error_rad_s = rounding_error(trajectory.speed, trajectory.spread, lattice)
    shared = float(explained_variance(np.zeros(1), lattice)[0])
    levels = Levels.of(trajectory.speed, prepared.record.follows, lattice.grid_rad_s, shared)
    moving = prepared.record.follows & (levels.of_sample < 0)
    explained = explained_variance(trajectory.spread[moving], lattice)
    left = (
        lattice.noise_rad_s**2 + lattice.grid_rad_s**2 / 12.0 - (float(explained.mean()) if explained.size else shared)
    )

    def corrected(record: Record) -> Record:
        course = record.course
        return replace(
            record,
            course=course._replace(speed_rad_s=course.speed_rad_s - error_rad_s),
            least_variance=0.5 * left,
            levels=levels,
        )

    base, record = prepared.base, corrected(prepared.record)
    return replace(
        prepared,
        record=record,
        fit_part=corrected(prepared.fit_part),
        heldout=corrected(prepared.heldout),
        base=fit_model(base.problem._replace(record=record), Start(base.model, base.trajectory, base.noise)),
        _of_fit={},
    )
