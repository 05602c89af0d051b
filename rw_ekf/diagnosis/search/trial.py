"""What became of each effect in a search, and whether a fitted effect is known and matters."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.effects.coulomb_drift import CoulombDrift
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model import Model
from rw_ekf.model.effect import Effect, RecordFacts, StribeckEffect
from rw_ekf.wheel.table import Column

_LEAST_SIGMAS = 2.5
IMPOSSIBLE = "of a size that no machine has"


@dataclass
class Trial:
    """What became of one effect's best candidate."""

    effect: type[Effect]
    statistic: float  # in the turn that decided about it
    p_value: float
    size: float  # coefficient, or amplitude of two quadratures
    std: float
    columns: tuple[Column, ...] = ()
    decision: str = "not significant"
    shape_std: dict[str, float] = field(default_factory=dict)  # of constants that the whole record settled, by name


@dataclass
class Selection:
    """The outcome of the search."""

    base: Fit
    final: Fit
    trials: dict[str, Trial] = field(default_factory=dict)
    rivals: dict[str, list[Fit]] = field(default_factory=dict)  # chosen id -> fits with another in its place
    whole_record: list[str] = field(default_factory=list)  # ids sought there, held-out part included
    constructed: dict[str, set[str]] = field(default_factory=dict)  # chosen id -> rivals no likelihood decides about


def lines_in(model: Model) -> set[tuple[str, float]]:
    """What is in a model: ids, each order or frequency of a periodic one for itself."""
    return {(c.id, round(c.shape[0], 6) if c.effect.quadrature else 0.0) for c in model.columns}


def determined(fit: Fit, name: str, sigmas: float = _LEAST_SIGMAS) -> bool:
    """Whether the fit knows the coefficient at all: a fit that ran away claims a gain, but no size."""
    places = [i for i, column in enumerate(fit.model.columns) if column.id == name]
    if not places:
        return False
    value = float(np.linalg.norm([fit.model.columns[i].value for i in places]))
    std = float(np.linalg.norm([fit.std[4 + i] for i in places]))
    return bool(value > sigmas * std / np.sqrt(len(places)))


def matters(model: Model, name: str, facts: RecordFacts) -> bool:
    """Whether an effect in a fitted model is large enough to matter in practice."""
    effect = CATALOGUE[name]
    values = [column.value for column in model.columns if column.id == name]
    if issubclass(effect, StribeckEffect):
        other_law = any(column.shape[0] != facts.stribeck_law for column in model.columns if column.id == name)
        return other_law or abs(values[0] - facts.stribeck_speed_rad_s) >= effect.smallest(facts)
    if name == CoulombDrift.id:  # the change that it makes within the record, whatever its shape
        changes = [c.value * (c.shape[2] or facts.duration_s) for c in model.columns if c.id == name]
        return float(np.max(np.abs(np.cumsum(changes)))) >= effect.smallest(facts) * facts.duration_s
    return float(np.linalg.norm(values)) >= effect.smallest(facts)


def possible(model: Model, name: str, facts: RecordFacts) -> bool:
    """Whether an effect in a fitted model has a size that a machine can have; friction that drifts never drives."""
    effect = CATALOGUE[name]
    columns = [column for column in model.columns if column.id == name]
    if name == CoulombDrift.id:
        changes = np.cumsum([CoulombDrift.change(c.value, c.shape, facts.last_s) for c in columns])
        largest = effect.largest(facts) * facts.duration_s
        return bool(np.max(np.abs(changes)) <= largest and np.min(changes) >= -model.parameters.coulomb)
    if not all(effect.shape_is_possible(column.shape, facts) for column in columns):
        return False
    return float(np.linalg.norm([column.value for column in columns])) <= effect.largest(facts)
