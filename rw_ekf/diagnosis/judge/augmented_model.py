"""The model that a diagnosis leaves: fitted to the whole record, as a file carries it on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rw_ekf.diagnosis.judge.investigation import Found
from rw_ekf.diagnosis.judge.lattice import Lattice
from rw_ekf.effects.catalogue import GRID
from rw_ekf.model.effect import Term
from rw_ekf.wheel.table import EffectSet

if TYPE_CHECKING:
    from rw_ekf.wheel.model_file import WheelModel


def augmented_model(found: Found, lattice: Lattice | None) -> WheelModel:
    """The final model, fitted to the whole record, as a file carries it on."""
    from rw_ekf import __version__
    from rw_ekf.model.friction import LAW_CODES
    from rw_ekf.wheel.model_file import WheelModel

    fit, prepared = found.whole, found.prepared
    known = fit.model.known
    covariance = fit.likelihood.covariance[:known, :known]
    covariance = 0.5 * (covariance + covariance.T)
    effects = fit.model.effects.with_values(fit.model.effects.values, fit.std[4:known])
    variance = fit.noise.variance
    if lattice is not None:
        effects = EffectSet((*effects.terms, Term.of(GRID, value=lattice.grid_rad_s)))
        variance = max(variance - GRID.variance(lattice.grid_rad_s), (0.02 * lattice.grid_rad_s) ** 2)
    names = {code: name for name, code in LAW_CODES.items()}
    return WheelModel(
        fit.model.parameters,
        tuple(tuple(float(v) for v in row) for row in covariance),
        fit.model.omega_s,
        names[fit.model.law],
        float(np.sqrt(variance)),
        float(np.sqrt(fit.noise.ratio * fit.noise.variance / prepared.course.period_s)),
        prepared.setup.inertia_kg_m2,
        {"method": "diagnose, fitted to the whole record", "log": prepared.log.name, "rw_ekf": __version__},
        effects,
    )
