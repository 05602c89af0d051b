"""The model under diagnosis as one vector: four parameters, coefficients of effects, and shapes that are refined."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.model.effect import NO_SHAPE, Candidate, Effect, Shape
from rw_ekf.model.state import FrictionParameters
from rw_ekf.wheel.table import NO_EFFECTS, Column, EffectSet

_BASE = 4


@dataclass(frozen=True)
class Model:
    """Parameters and effects with their values; omega_s [rad/s] and law are the base's Stribeck curve."""

    parameters: FrictionParameters
    omega_s: float
    law: int
    effects: EffectSet = NO_EFFECTS

    @property
    def columns(self) -> tuple[Column, ...]:
        """The coefficients that are states."""
        return self.effects.state_columns

    @property
    def coefficients(self) -> Float64Array:
        """Parameters, then coefficients: (4 + m,)."""
        return np.array([*self.parameters, *self.effects.values])

    @property
    def refined(self) -> list[tuple[int, int]]:
        """(column, constant) of every shape constant that is fitted with the rest; quadratures share theirs."""
        found = []
        for i, column in enumerate(self.columns):
            if column.settled or any(column.same_line(earlier) for earlier in self.columns[:i]):
                continue
            found += [(i, constant) for constant in column.effect.refined if column.shape[constant] != 0.0]
        return found

    @property
    def vector(self) -> Float64Array:
        """Everything that is fitted: parameters, coefficients, refined shapes."""
        return np.concatenate((self.coefficients, [self.columns[i].shape[j] for i, j in self.refined]))

    def with_vector(self, vector: Float64Array) -> Model:
        """The same model with other numbers, each kept within its bounds."""
        columns = list(self.columns)
        m = len(columns)
        parameters = FrictionParameters(*(float(v) for v in vector[:_BASE]))
        for i, value in enumerate(vector[_BASE : _BASE + m]):
            limits = columns[i].effect.coefficient
            columns[i] = replace(columns[i], value=float(np.clip(value, limits.lower, limits.upper)))
        for (i, j), value in zip(self.refined, vector[_BASE + m :], strict=True):
            limits = columns[i].effect.constants[j]
            number = float(np.clip(value, limits.lower, limits.upper))
            line = columns[i]
            for at, column in enumerate(columns):
                if at == i or column.same_line(line):
                    columns[at] = replace(column, shape=_with(column.shape, j, number))
        rest = [column for column in self.effects.columns if not column.in_state]
        return replace(self, parameters=parameters, effects=EffectSet((*columns, *rest)))

    def limited(self, step: Float64Array) -> Float64Array:
        """A step (p,) no longer than the linearisation carries: shapes and coefficients that are not linear."""
        out = step.copy()
        for i, column in enumerate(self.columns):
            if not column.effect.linear:
                reach = 0.7 * abs(column.value)
                out[_BASE + i] = float(np.clip(out[_BASE + i], -reach, 2.0 * reach))
        for at, (i, j) in enumerate(self.refined, start=_BASE + len(self.columns)):
            reach = self.columns[i].effect.constants[j].reach_at(self.columns[i].shape[j])
            out[at] = float(np.clip(out[at], -reach, reach))
        return out

    def with_effect(self, added: list[Column]) -> Model:
        """The same model with more effects."""
        return replace(self, effects=EffectSet((*self.effects.columns, *added)))

    def without(self, effect_id: str) -> Model:
        """The same model without an effect."""
        return replace(self, effects=EffectSet(tuple(c for c in self.effects.columns if c.id != effect_id)))

    def settled(self, effect_id: str) -> Model:
        """The same model, the shapes of one effect no longer refined."""
        columns = tuple(replace(c, settled=True) if c.id == effect_id else c for c in self.effects.columns)
        return replace(self, effects=EffectSet(columns))

    @property
    def base(self) -> Model:
        """The same without any effect."""
        return replace(self, effects=NO_EFFECTS)


def _with(shape: Shape, at: int, value: float) -> Shape:
    changed = list(shape)
    changed[at] = value
    return (changed[0], changed[1], changed[2])


def columns_of_candidate(effect: type[Effect], candidate: Candidate) -> list[Column]:
    """The column, or the two quadratures, of one place to look; a linear effect starts from zero."""
    value = 0.0 if effect.linear else candidate.amplitude
    first = Column(effect, value, 0.0, candidate.shape or NO_SHAPE, effect.in_state)
    if not effect.quadrature:
        return [first]
    return [first, replace(first, shape=_with(candidate.shape, 1, candidate.shape[1] + 0.5 * np.pi))]
