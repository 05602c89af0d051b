"""What an investigation of a record found: the fit, what it leaves, and the model that a file carries on."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from rw_ekf.diagnosis.checks.checks import Check
from rw_ekf.diagnosis.checks.reading_grid import Lattice
from rw_ekf.diagnosis.checks.residual_map import Dependence, residual_map
from rw_ekf.diagnosis.hypotheses.random_walk import followed_finely, walk_of
from rw_ekf.diagnosis.hypotheses.selection import Selection
from rw_ekf.diagnosis.ledger.ledger import Ledger, Row
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.standing import Decision, Reason
from rw_ekf.diagnosis.thresholds import EXPLAINED_SHARE, MAP_P
from rw_ekf.effects.catalogue import GRID, WANDERING
from rw_ekf.likelihood.carried_effects import carried
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import Term
from rw_ekf.model.state import COULOMB, PARAMETER_COUNT, STATIC

if TYPE_CHECKING:
    from rw_ekf.wheel.model_file import WheelModel


@dataclass(frozen=True)
class Found:
    """A search and what it left, on the whole record."""

    prepared: Prepared
    selection: Selection
    ledger: Ledger  # of all hypotheses that were fitted
    fit: Fit  # the final model on the whole record
    dependences: list[Dependence]  # of what it leaves
    left: list[Dependence]  # those that noise does not explain
    new_ids: list[str]  # effects that the record requires beyond the model it was given
    is_unexplained: bool  # structure is left that outweighs what was found
    share: float  # of all the structure there was, what the effects explain, where some is left that they may not leave
    reported: Fit  # the final model with the standard deviations that the report and the model's file give
    nearest: Fit | None = None  # with what was named, where a law without a name is likelier
    unnamed_odds: float | None = None  # log of those of a law without a name to what was named; None: not weighed
    orders: dict[float, float] = field(default_factory=dict)  # how probable each is, of a ripple without a logged angle
    laws: dict[str, dict[str, float]] = field(default_factory=dict)  # of each effect that may follow several
    weighed: tuple[Row, ...] = ()  # hypotheses with laws without a formula, where none of them stands
    lattice: Lattice | None = None  # the readings' grid, where it is coarser than their noise
    described: bool = False  # by a row that was refused: it foretells more than nothing does, and is no cause
    corrected: Prepared | None = None  # the record without what the grid did to the readings, as it was searched

    @property
    def figured(self) -> Fit:
        """The final model with the numbers that figures are of: the likeliest, or those that foretell more."""
        return self.reported if self.reported.simulated else self.selection.final


def mapped(prepared: Prepared, selection: Selection, ledger: Ledger) -> Found:
    """The selection on the whole record; structure that its effects leave by nature is no reason to doubt them."""
    whole, terms = selection.final, selection.final.model.terms
    dependences = residual_map(whole, prepared.facts, followed_finely(whole))
    left = [item for item in dependences if item.p_value < MAP_P]
    excused = {name for term in terms for name in term.effect.may_leave(term.shape, prepared.facts)}
    share = 1.0 if excused.issuperset(item.name for item in left) else _share(selection, left)
    if selection.new_ids:
        why = None if share >= EXPLAINED_SHARE else Decision(Reason.PARTIAL)
        ledger = ledger.with_checks(whole, Check("share of the structure explained", "", share, EXPLAINED_SHARE, why))
    return Found(
        prepared=prepared,
        selection=selection,
        ledger=ledger,
        fit=whole,
        dependences=dependences,
        left=left,
        new_ids=selection.new_ids,
        is_unexplained=share < EXPLAINED_SHARE,
        share=share,
        reported=whole,
    )


def _share(selection: Selection, left: list[Dependence]) -> float:
    """Of all the structure there was, what the effects explain; of what is left only what exceeds chance counts."""
    explained = 2.0 * (selection.final.likelihood.value - selection.base.likelihood.value)
    most = max(item.statistic - item.freedom for item in left)
    return explained / (explained + most) if explained > 0.0 else 0.0


def augmented_model(found: Found, lattice: Lattice | None) -> WheelModel:
    """The final model, fitted to the whole record, as a file carries it on."""
    model = model_of_fit(found.reported, found.prepared)
    if lattice is None:
        return model
    return replace(
        model,
        effects=model.effects.with_term(Term.of(GRID, value=lattice.grid_rad_s)),
        speed_noise_rad_s=lattice.noise_rad_s,
    )


def model_of_fit(fit: Fit, prepared: Prepared, of: str = "the whole record") -> WheelModel:
    """A fit as a file carries it on; of: what it was fitted to.

    Its torque noise is what a filter meets: who reads a current with a noise of its own, sigma, takes it for a torque,
    k sigma dt an interval, as q = (k sigma)^2 dt makes of it.
    """
    from rw_ekf.logs.record_print import print_of
    from rw_ekf.model.bounds import ASSUMED
    from rw_ekf.model.friction import LAW_NAMES
    from rw_ekf.version import __version__
    from rw_ekf.wheel.model_file import WheelModel

    covariance = 0.5 * (fit.likelihood.covariance + fit.likelihood.covariance.T)
    variance, noise_A = fit.noise.variance, 0.0 if prepared.levels is None else prepared.levels.noise_A
    walk = walk_of(fit)
    model = fit.model if walk is None else walk.model
    if walk is not None:
        kept = [*range(PARAMETER_COUNT)]
        kept += [i for term, at in fit.model.placed if term.id != WANDERING.id for i in range(at.start, at.stop)]
        kept += range(fit.model.known, covariance.shape[0])
        covariance = covariance[np.ix_(kept, kept)]
        covariance[COULOMB - 1 : STATIC, COULOMB - 1 : STATIC] += walk.spread**2  # the two walk as one
    effects, covariance = carried(model, covariance)
    stds = np.sqrt(np.maximum(np.diag(covariance), 0.0))[PARAMETER_COUNT:]
    return WheelModel(
        parameters=model.parameters,
        covariance=tuple(tuple(float(v) for v in row) for row in covariance),
        stribeck_speed_rad_s=fit.model.stribeck.omega_s,
        stribeck_law=LAW_NAMES[fit.model.stribeck.law],
        speed_noise_rad_s=float(np.sqrt(variance)),
        acceleration_noise=math.hypot(
            math.sqrt(fit.noise.ratio * variance / prepared.course.period_s),
            fit.model.parameters.motor_gain * noise_A * math.sqrt(prepared.course.period_s),
        ),
        dry_walk=None if walk is None else walk.rate,
        inertia_kg_m2=prepared.setup.inertia_kg_m2,
        inertia_is_assumed=prepared.setup.inertia_from == ASSUMED,
        source={
            "method": f"diagnose, fitted to {of}",
            "log": prepared.source.log.name,
            "record": print_of(prepared.source.log),
            "rw_ekf": __version__,
        },
        effects=effects.with_values(effects.values, stds).going_on_from(prepared.setup.effects),
        temperature_lag_s=0.0 if prepared.temperature_lag is None else prepared.temperature_lag.value_s,
    )
