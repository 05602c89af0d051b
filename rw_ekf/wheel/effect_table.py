"""Effects in use, as the filter's state knows them, and the flat table that the compiled propagation reads.

The state is (omega, k, b, c, s, coefficients in the order of use, hidden states): this module alone knows where a
coefficient or a hidden state stands.
"""

from __future__ import annotations

import functools
import itertools
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array, by_identity
from rw_ekf.model.considered import Direction, Off
from rw_ekf.model.effect import NO_SHAPE, Effect, Shape, Term
from rw_ekf.model.effect_kinds import (
    CurrentEffect,
    DelayEffect,
    FormulaEffect,
    FrictionMemoryEffect,
    ReadingEffect,
    StaticEffect,
    StribeckEffect,
    WindowEffect,
)
from rw_ekf.model.law import FORMULA, KINDS, ActsAs, Law, sums_of
from rw_ekf.model.state import PARAMETER_COUNT, STATE_SIZE

ABSENT = -1


@by_identity
class EffectTable(NamedTuple):
    """What the compiled propagation reads. Positions are indices into the state; ABSENT where there is none."""

    size: int  # of the state
    hidden: int  # number of hidden states, the last of the state
    static_at: Int64Array  # (m,)
    static_code: Int64Array  # (m,)
    static_shape: Float64Array  # (m, 3)
    delay_at: int
    window_at: int
    lag_at: int
    lag_code: int
    lag_shape: Shape
    lag_state_at: int
    memory_at: int
    memory_code: int
    memory_shape: Shape
    memory_state_at: int
    memory_holds: bool
    stribeck_at: int
    stribeck_law: int
    drift: Float64Array  # (coefficients,) variance rate of each coefficient [unit^2 per s]
    law_at: Int64Array  # (l,) learned laws, by the first coefficient of each, and formulas
    law_functions: Int64Array  # (l,) how many each has, one for each coefficient; 1 of a formula
    law_kind: Int64Array  # (l,)
    law_over: Int64Array  # (l,)
    law_start: Int64Array  # (l,) where its first knots, or its program, begin in the values; its other functions follow
    law_count: Int64Array  # (l,) knots of one function
    law_first: Float64Array  # (l,)
    law_per: Float64Array  # (l,) knots per unit of the quantity
    law_values: Float64Array  # all knots of all functions, and all programs
    law_sums: Float64Array


class _Use(NamedTuple):
    """An effect in use but for the values of its coefficients."""

    effect: type[Effect]
    shape: Shape
    coefficients: int
    law: Law | None


class _LawRow(NamedTuple):
    """A learned law, or a formula, as a table has it."""

    at: int  # in the state, of its first coefficient
    acts_as: ActsAs
    over: int
    first: float
    last: float
    functions: tuple[tuple[float, ...], ...]  # on its knots, or a program


@dataclass(frozen=True)
class EffectSet:
    """Every effect of a model, in order of use."""

    terms: tuple[Term, ...] = ()
    considered: tuple[Direction, ...] = ()  # what a fit left open of shapes and curves; () where nobody knows

    @property
    def state_terms(self) -> tuple[Term, ...]:
        """Those whose coefficients are states of the filter."""
        return tuple(term for term in self.terms if term.effect.in_state)

    @property
    def size(self) -> int:
        """Number of coefficients in the state, m."""
        return sum(len(term.values) for term in self.state_terms)

    @property
    def ids(self) -> tuple[str, ...]:
        """The ids, each once, in order of use."""
        return tuple(dict.fromkeys(term.id for term in self.terms))

    def of(self, effect_id: str) -> list[Term]:
        """The terms of one effect: those that were found, where the model given has one of that id too.

        A second law without a formula beside one that was given, or another order of a ripple, is looked at, and left
        out, by itself.
        """
        own = [term for term in self.terms if term.id == effect_id]
        return [term for term in own if not term.given] or own

    def beyond(self, other: EffectSet) -> tuple[str, ...]:
        """The ids of which more was found here than in another set, in order of use; none of what was given counts."""
        here, there = (Counter(term.id for term in effects.terms if not term.given) for effects in (self, other))
        return tuple(name for name in here if here[name] > there[name])

    @property
    def laws(self) -> list[Law]:
        """Those without a formula that its terms follow."""
        return [term.law for term in self.terms if term.law is not None]

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the log that learned laws are functions of, by their slots."""
        named = {term.law.slot: term.law.column for term in self.terms if term.law is not None and term.law.column}
        return tuple(named.get(slot, "") for slot in range(max(named, default=-1) + 1))

    @property
    def coefficient_ids(self) -> tuple[str, ...]:
        """The effect's id of every coefficient of the state, (m,)."""
        return tuple(term.id for term in self.state_terms for _ in term.values)

    @property
    def state_names(self) -> tuple[str, ...]:
        """A name for every coefficient of the state, as a column of a table: the id, numbered where it repeats."""
        names: list[str] = []
        for effect_id in self.coefficient_ids:
            count = sum(name == effect_id or name.startswith(f"{effect_id}_") for name in names)
            names.append(effect_id if count == 0 else f"{effect_id}_{count + 1}")
        return tuple(names)

    @property
    def values(self) -> Float64Array:
        """Coefficients of the state, (m,)."""
        return np.array([value for term in self.state_terms for value in term.values], dtype=np.float64)

    @property
    def reading_variance(self) -> float:
        """What the effects add to the variance of a reading [rad^2/s^2]."""
        return float(sum(t.effect.variance(t.values[0]) for t in self.terms if issubclass(t.effect, ReadingEffect)))

    def with_laws_as_curves(self) -> EffectSet:
        """The same effects, a law of several functions as the one curve that it is: for a pass that learns nothing."""
        return EffectSet(tuple(_with_laws_as_curves(term) for term in self.terms))

    def table(self, drift: Sequence[float] | Float64Array | None = None) -> EffectTable:
        """The compiled propagation's table; drift: variance rates of the coefficients [unit^2/s], default none.

        Nobody writes into it: sets of the same effects have the same one, whatever their coefficients are.
        """
        table = _table_of(tuple(_Use(term.effect, term.shape, len(term.values), term.law) for term in self.state_terms))
        return table if drift is None else table._replace(drift=np.array(drift, dtype=np.float64))

    def with_values(self, values: Sequence[float] | Float64Array, stds: Sequence[float] | Float64Array) -> EffectSet:
        """The same effects with other coefficients (m,) of the state and their standard deviations."""
        left = iter(zip(values, stds, strict=True))
        terms = []
        for term in self.terms:
            if term.effect.in_state:
                pairs = [next(left) for _ in term.values]
                updated, widths = (tuple(float(number) for number in numbers) for numbers in zip(*pairs, strict=True))
                terms.append(replace(term, values=updated, stds=widths))
            else:
                terms.append(term)
        return replace(self, terms=tuple(terms))

    def with_term(self, term: Term) -> EffectSet:
        """The same effects and one more that is no state."""
        considered = tuple(way._replace(terms=(*way.terms, Off())) for way in self.considered)
        return EffectSet((*self.terms, term), considered)

    def only(self, kept: Callable[[Term], bool]) -> EffectSet:
        """The effects whose terms are kept, with what is considered of them."""
        stays = [kept(term) for term in self.terms]
        coefficients = [stay for term, stay in zip(self.terms, stays, strict=True)
                        if term.effect.in_state for _ in term.values]  # fmt: skip
        learned = [True] * PARAMETER_COUNT + coefficients
        return EffectSet(
            tuple(itertools.compress(self.terms, stays)),
            tuple(
                Direction(tuple(itertools.compress(way.numbers, learned)), tuple(itertools.compress(way.terms, stays)))
                for way in self.considered
            ),
        )

    def going_on_from(self, given: EffectSet) -> EffectSet:
        """The same, with what was considered of effects it was begun with and still has, first and unchanged."""
        count = len(given.terms)
        if not given.considered or [(t.effect, t.shape, t.law) for t in given.terms] != [
            (t.effect, t.shape, t.law) for t in self.terms[:count]
        ]:
            return self
        nothing, more = (0.0,) * (self.size - given.size), (Off(),) * (len(self.terms) - count)
        before = (Direction((*way.numbers, *nothing), (*way.terms, *more)) for way in given.considered)
        return replace(self, considered=(*before, *self.considered))

    def off_by(self, direction: Direction, times: float) -> EffectSet:
        """The same effects, shapes and curves off by so many of a direction."""
        return EffectSet(tuple(_off(term, off, times) for term, off in zip(self.terms, direction.terms, strict=True)))


@functools.lru_cache(maxsize=128)
def _table_of(uses: tuple[_Use, ...]) -> EffectTable:
    """Of effects in order of use."""
    from rw_ekf.wheel.dispatch import CURRENT_EFFECTS, MEMORY_EFFECTS, STATIC_EFFECTS

    places: dict[str, int] = dict.fromkeys(("delay", "window", "lag", "memory", "stribeck"), ABSENT)
    shapes: dict[str, Shape] = dict.fromkeys(("lag", "memory"), NO_SHAPE)
    codes: dict[str, int] = dict.fromkeys(("lag", "memory", "law"), ABSENT)
    static: list[tuple[int, int, Shape]] = []
    laws: list[_LawRow] = []
    size = STATE_SIZE
    for kind, shape, count, law in uses:
        at = size
        size += count
        if law is not None:
            laws.append(_LawRow(at, law.acts_as, law.over, law.first, law.last, law.functions))
        elif issubclass(kind, FormulaEffect):
            laws.append(_LawRow(at, kind.acts_by, FORMULA, 0.0, 1.0, (kind.program(shape),)))
        elif issubclass(kind, StaticEffect):
            code = STATIC_EFFECTS.index(kind)
            static += [(at + i, code, kind.component_shape(shape, i)) for i in range(count)]
        elif issubclass(kind, DelayEffect):
            places["delay"] = at
        elif issubclass(kind, WindowEffect):
            places["window"] = at
        elif issubclass(kind, CurrentEffect):
            places["lag"], codes["lag"], shapes["lag"] = at, CURRENT_EFFECTS.index(kind), shape
        elif issubclass(kind, FrictionMemoryEffect):
            places["memory"], codes["memory"], shapes["memory"] = at, MEMORY_EFFECTS.index(kind), shape
        elif issubclass(kind, StribeckEffect):
            places["stribeck"], codes["law"] = at, int(shape[0])
    holds = any(use.effect.holds for use in uses if issubclass(use.effect, FrictionMemoryEffect))
    hidden = size
    lag_state = memory_state = ABSENT
    if places["lag"] != ABSENT:
        lag_state, size = size, size + 1
    if places["memory"] != ABSENT:
        memory_state, size = size, size + 1
    return EffectTable(
        size=size,
        hidden=size - hidden,
        static_at=np.array([at for at, _, _ in static], dtype=np.int64),
        static_code=np.array([code for _, code, _ in static], dtype=np.int64),
        static_shape=np.array([shape for _, _, shape in static], dtype=np.float64).reshape(-1, 3),
        delay_at=places["delay"],
        window_at=places["window"],
        lag_at=places["lag"],
        lag_code=codes["lag"],
        lag_shape=shapes["lag"],
        lag_state_at=lag_state,
        memory_at=places["memory"],
        memory_code=codes["memory"],
        memory_shape=shapes["memory"],
        memory_state_at=memory_state,
        memory_holds=holds,
        stribeck_at=places["stribeck"],
        stribeck_law=codes["law"],
        drift=np.zeros(hidden - STATE_SIZE),
        **_law_columns(laws),
    )


def _with_laws_as_curves(term: Term) -> Term:
    if term.law is None or len(term.law.functions) == 1:
        return term
    curve = tuple(float(value) for value in term.law.values(term.values))
    return replace(term, values=(1.0,), stds=(0.0,), law=replace(term.law, functions=(curve,), prior_std=()))


def _off(term: Term, off: Off, times: float) -> Term:
    shape = tuple(value + times * by for value, by in zip(term.shape, off.shape, strict=True))
    term = replace(term, shape=(shape[0], shape[1], shape[2]))
    if term.law is None or not off.curve:
        return term
    law = term.law
    by = times * np.interp(law.knots, np.linspace(law.first, law.last, len(off.curve)), off.curve)
    first = tuple((np.array(law.functions[0]) + by).tolist())
    return replace(term, law=replace(law, functions=(first, *law.functions[1:])))


def _law_columns(laws: list[_LawRow]) -> dict[str, Any]:
    """The table's part of learned laws and formulas."""
    values = [np.array(law.functions, dtype=np.float64) for law in laws]
    counts = np.array([numbers.shape[1] for numbers in values], dtype=np.int64)
    sizes = np.array([numbers.size for numbers in values], dtype=np.int64)
    nothing = np.zeros(0)
    return {
        "law_at": np.array([law.at for law in laws], dtype=np.int64),
        "law_functions": np.array([len(law.functions) for law in laws], dtype=np.int64),
        "law_kind": np.array([KINDS.index(law.acts_as) for law in laws], dtype=np.int64),
        "law_over": np.array([law.over for law in laws], dtype=np.int64),
        "law_start": np.cumsum(sizes) - sizes,
        "law_count": counts,
        "law_first": np.array([law.first for law in laws], dtype=np.float64),
        "law_per": np.array([(len(law.functions[0]) - 1) / (law.last - law.first) for law in laws], dtype=np.float64),
        "law_values": np.concatenate([nothing, *(numbers.ravel() for numbers in values)]),
        "law_sums": np.concatenate([nothing, *(sums_of(row) for numbers in values for row in numbers)]),
    }


NO_EFFECTS = EffectSet()
