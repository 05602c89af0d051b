"""Effects in use, as the filter's state knows them, and the flat table that the compiled propagation reads.

The state is (omega, k, b, c, s, coefficients in the order of use, hidden states): this module alone knows where a
coefficient or a hidden state stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.model.effect import (
    NO_SHAPE,
    CurrentEffect,
    DelayEffect,
    Effect,
    FrictionMemoryEffect,
    ReadingEffect,
    Shape,
    StaticEffect,
    StribeckEffect,
)
from rw_ekf.model.state import STATE_SIZE

ABSENT = -1


class EffectTable(NamedTuple):
    """What the compiled propagation reads. Positions are indices into the state; ABSENT where there is none."""

    size: int  # of the state
    hidden: int  # number of hidden states, the last of the state
    static_at: Int64Array  # (m,)
    static_code: Int64Array  # (m,)
    static_shape: Float64Array  # (m, 3)
    delay_at: int
    lag_at: int
    lag_code: int
    lag_shape: Float64Array  # (3,)
    lag_state_at: int
    memory_at: int
    memory_code: int
    memory_shape: Float64Array  # (3,)
    memory_state_at: int
    memory_holds: bool
    stribeck_at: int
    stribeck_law: int
    drift: Float64Array  # (coefficients,) variance rate of each coefficient [unit^2 per s]


@dataclass(frozen=True)
class Column:
    """One coefficient in use: an effect, or one of the two quadratures of a periodic one."""

    effect: type[Effect]
    value: float
    std: float
    shape: Shape = NO_SHAPE
    in_state: bool = True  # False: a reading effect, which no filter can learn sample by sample
    settled: bool = False  # shape constants that were fitted elsewhere stay as they are

    @property
    def id(self) -> str:
        """The catalogue's id."""
        return self.effect.id

    def same_line(self, other: Column) -> bool:
        """Whether both are quadratures of one periodic effect: the same id, order or frequency."""
        return self.effect is other.effect and self.effect.quadrature and self.shape[0] == other.shape[0]


@dataclass(frozen=True)
class EffectSet:
    """Every effect of a model, in order of use."""

    columns: tuple[Column, ...] = ()

    @property
    def state_columns(self) -> tuple[Column, ...]:
        """Those whose coefficient is a state of the filter."""
        return tuple(column for column in self.columns if column.in_state)

    @property
    def ids(self) -> tuple[str, ...]:
        """The ids, each once, in order of use."""
        return tuple(dict.fromkeys(column.id for column in self.columns))

    @property
    def state_names(self) -> tuple[str, ...]:
        """A name for every coefficient of the state, as a column of a table: the id, numbered where it repeats."""
        names: list[str] = []
        for column in self.state_columns:
            count = sum(name == column.id or name.startswith(f"{column.id}_") for name in names)
            names.append(column.id if count == 0 else f"{column.id}_{count + 1}")
        return tuple(names)

    @property
    def values(self) -> Float64Array:
        """Coefficients of the state, (m,)."""
        return np.array([column.value for column in self.state_columns], dtype=np.float64)

    @property
    def reading_variance(self) -> float:
        """What the effects add to the variance of a reading [rad^2/s^2]."""
        return float(sum(c.effect.variance(c.value) for c in self.columns if issubclass(c.effect, ReadingEffect)))

    def table(self, drift: Sequence[float] | Float64Array | None = None) -> EffectTable:
        """The compiled propagation's table; drift: variance rates of the coefficients [unit^2/s], default none."""
        from rw_ekf.wheel.dispatch import CURRENT_EFFECTS, MEMORY_EFFECTS, STATIC_EFFECTS

        columns = self.state_columns
        places: dict[str, int] = dict.fromkeys(("delay", "lag", "memory", "stribeck"), ABSENT)
        shapes: dict[str, Shape] = dict.fromkeys(("lag", "memory"), NO_SHAPE)
        codes: dict[str, int] = dict.fromkeys(("lag", "memory", "law"), ABSENT)
        static: list[tuple[int, int, Shape]] = []
        for at, column in enumerate(columns, start=STATE_SIZE):
            kind = column.effect
            if issubclass(kind, StaticEffect):
                static.append((at, STATIC_EFFECTS.index(kind), column.shape))
            elif issubclass(kind, DelayEffect):
                places["delay"] = at
            elif issubclass(kind, CurrentEffect):
                places["lag"], codes["lag"], shapes["lag"] = at, CURRENT_EFFECTS.index(kind), column.shape
            elif issubclass(kind, FrictionMemoryEffect):
                places["memory"], codes["memory"], shapes["memory"] = at, MEMORY_EFFECTS.index(kind), column.shape
            elif issubclass(kind, StribeckEffect):
                places["stribeck"], codes["law"] = at, int(column.shape[0])
        holds = any(c.effect.holds for c in columns if issubclass(c.effect, FrictionMemoryEffect))
        size = STATE_SIZE + len(columns)
        lag_state = memory_state = ABSENT
        if places["lag"] != ABSENT:
            lag_state, size = size, size + 1
        if places["memory"] != ABSENT:
            memory_state, size = size, size + 1
        return EffectTable(
            size,
            size - STATE_SIZE - len(columns),
            np.array([at for at, _, _ in static], dtype=np.int64),
            np.array([code for _, code, _ in static], dtype=np.int64),
            np.array([shape for _, _, shape in static], dtype=np.float64).reshape(-1, 3),
            places["delay"],
            places["lag"],
            codes["lag"],
            np.array(shapes["lag"]),
            lag_state,
            places["memory"],
            codes["memory"],
            np.array(shapes["memory"]),
            memory_state,
            holds,
            places["stribeck"],
            codes["law"],
            np.zeros(len(columns)) if drift is None else np.array(drift, dtype=np.float64),
        )

    def with_values(self, values: Sequence[float] | Float64Array, stds: Sequence[float] | Float64Array) -> EffectSet:
        """The same effects with other coefficients (m,) of the state and their standard deviations."""
        updated = iter(zip(values, stds, strict=True))
        columns = []
        for column in self.columns:
            if column.in_state:
                value, std = next(updated)
                columns.append(replace(column, value=float(value), std=float(std)))
            else:
                columns.append(column)
        return EffectSet(tuple(columns))


def columns_of(effect_id: str, value: float, std: float, shape: Shape) -> Column:
    """A column by id. Raises KeyError for an id that the catalogue does not have."""
    effect = CATALOGUE[effect_id]
    return Column(effect, value, std, shape, effect.in_state)


NO_EFFECTS = EffectSet()
