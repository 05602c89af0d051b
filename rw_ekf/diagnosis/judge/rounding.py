"""Readings on a coarse grid: the grid is told, and the record is looked at again without what it did to the readings.

What rounding does to a reading is no noise: a slow wheel stays in one cell for many samples, and its error goes with
the speed. So the residual shows it as a dependence on speed or angle, and effects that look like that are hidden by it
or made up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.judge.heldout import performance
from rw_ekf.diagnosis.judge.investigation import Found, investigate
from rw_ekf.diagnosis.judge.lattice import Lattice, find_lattice, rounding_error
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.effects.catalogue import GRID
from rw_ekf.likelihood.fitting import fit_model
from rw_ekf.likelihood.gauss_newton import Start
from rw_ekf.likelihood.one_step import Record
from rw_ekf.units import RAD_S_PER_RPM

_REGISTER_RPM = 0.6  # a finer grid than this is the wire's own register (0.5 rpm), which is no effect


def without_rounding(found: Found, advance: Callable[[str], object]) -> Found:
    """What is found where the readings' grid is coarser than their noise and known to be; else the same.

    Figures stay those of the readings as they were read.
    """
    lattice = lattice_of(found)
    if lattice is None:
        return found
    advance("once more without what rounding did to the readings")
    trajectory = found.fit.trajectory
    error = rounding_error(trajectory.speed, trajectory.spread, lattice)
    again = investigate(_prepared_without(found.prepared, error, lattice), advance)
    return replace(again, prepared=found.prepared, lattice=lattice)


def lattice_of(found: Found) -> Lattice | None:
    """The grid of the readings, if it is coarser than their noise and shows on both parts together."""
    prepared, fit = found.prepared, found.fit
    if GRID.id in prepared.base.model.effects.ids:
        return None
    performed = performance(prepared, fit)
    innovation = performed.trace.one_step_error_rad_s
    speed = prepared.course.speed_rad_s
    lattice = find_lattice(
        speed, speed - innovation, performed.predicted_std_rad_s, fit.noise.variance, prepared.split.heldout,
        0.0 if prepared.setup.inertia_kg_m2 is None else _REGISTER_RPM * RAD_S_PER_RPM,
    )  # fmt: skip
    if lattice is None or lattice.statistic + lattice.heldout_statistic < 0.0:
        return None
    return lattice


def _prepared_without(prepared: Prepared, error_rad_s: Float64Array, lattice: Lattice) -> Prepared:
    """The same with errors of the readings (n,) taken off them, and the base model fitted anew."""

    def corrected(record: Record) -> Record:
        course = record.course
        return replace(
            record,
            course=course._replace(speed_rad_s=course.speed_rad_s - error_rad_s),
            least_variance=0.5 * lattice.noise_rad_s**2,
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
