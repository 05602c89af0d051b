"""The wheel of a model as other programs simulate it: its numbers, what inputs it needs, what is not in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.flight.exportable import reads, refuse_names
from rw_ekf.model.bounds import ASSUMED
from rw_ekf.model.effect_kinds import ReadingEffect, WindowEffect
from rw_ekf.model.friction import Stribeck
from rw_ekf.model.state import SPEED, STATE_SIZE
from rw_ekf.starting_point import FilterSetup
from rw_ekf.wheel.effect_table import EffectSet, EffectTable

# Variables of the FMU, fields of the parameters in MATLAB, and words that are no field there.
_TAKEN = frozenset({
    "time", "angle_rad", "friction_rad_s2", "inertia_kg_m2", "state", "friction", "longest_step_s",
    "stribeck_speed_rad_s", "end", "for", "while", "if", "else", "elseif", "function", "return", "break", "continue",
    "global", "persistent", "switch", "case", "otherwise", "try", "catch", "parfor", "spmd", "classdef", "do", "until",
    *(f"law_{number}" for number in range(1, 100)),
})  # fmt: skip


@dataclass(frozen=True)
class Column:
    """A column of the log that a learned law is a function of."""

    name: str
    start: float  # the middle of what the law was learned over


@dataclass(eq=False, frozen=True)
class PlantModel:
    """What is exported of a wheel."""

    name: str  # of the model
    x: Float64Array  # (n,) at rest: speed, motor gain, viscous, Coulomb, static friction, coefficients, hidden states
    stribeck: Stribeck
    effects: EffectSet
    inertia_kg_m2: float | None  # None: nobody gave it
    period_s: float  # between the readings: over no longer step an effect is taken as straight
    temperature_lag_s: float = 0.0  # by which the temperature that is put in follows a thermometer

    @property
    def table(self) -> EffectTable:
        """Its effects, as the propagation reads them."""
        return self.effects.table()

    @property
    def state_names(self) -> tuple[str, ...]:
        """Of the four parameters and the coefficients, (m,)."""
        return ("motor_gain", "viscous", "coulomb", "static", *self.effects.state_names)

    @property
    def has_temperature(self) -> bool:
        """Whether an effect is a function of it."""
        return any(reads(term, "temperature") for term in self.effects.state_terms)

    @property
    def columns(self) -> tuple[Column, ...]:
        """By their slots."""
        laws = [term.law for term in self.effects.terms if term.law is not None and term.law.column]
        return tuple(
            Column(_printable(name), next(0.5 * (law.first + law.last) for law in laws if law.column == name))
            for name in self.effects.columns
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a user of the export must know: sentences without a stop."""
        found = ["readings have no noise: the speed is the wheel's own"]
        if self.has_temperature and self.temperature_lag_s > 0.0:
            found.append(
                "temperature_degC is that of what friction is in: T follows a thermometer by tau dT/dt = T_read - T "
                f"with tau = {self.temperature_lag_s:.4g} s, which is not in here"
            )
        for term in self.effects.terms:
            if issubclass(term.effect, ReadingEffect):
                found.append(f"{term.id} is of the readings, not of the wheel, and is not in it")
            if issubclass(term.effect, WindowEffect):
                found.append(f"the speed is what the readings show, a mean over a window ({term.id})")
        return tuple(found)


def plant_model(setup: FilterSetup, name: str, period_s: float, inertia_kg_m2: float | None = None) -> PlantModel:
    """The wheel of a filter's start. Raises BadInputError for an effect of one's own whose id the exports take.

    name: of the model, for messages. inertia_kg_m2: where it is given beside the model.
    """
    refuse_names(setup.effects, _TAKEN, name)
    size = setup.effects.table().size
    x = np.zeros(size)
    known = STATE_SIZE + setup.effects.size
    x[SPEED + 1 : known] = np.asarray(setup.prior.mean)[SPEED + 1 : known]
    inertia = inertia_kg_m2
    if inertia is None and setup.inertia_from != ASSUMED:
        inertia = setup.inertia_kg_m2
    lag_s = setup.temperature_lag_s
    return PlantModel(_printable(name), x, setup.constants.stribeck, setup.effects, inertia, period_s, lag_s)


def _printable(name: str) -> str:
    """A name from outside without what neither XML nor a line of comment can hold."""
    return "".join(letter if letter.isprintable() else "?" for letter in name)
