"""What may stand in a model file: every number of it held against what machines can be."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, BeforeValidator, ConfigDict, ValidationInfo, field_validator, model_validator
from pydantic import Field as Key

from rw_ekf.checking.effect_file import FaultsError, own_formula
from rw_ekf.checking.section import Mistake, Section, one_of, refuse
from rw_ekf.checking.wording import suggestion
from rw_ekf.effects.catalogue import CATALOGUE, CATALOGUE_IDS
from rw_ekf.effects.own_effect import effect_of
from rw_ekf.model import bounds as model_bounds
from rw_ekf.model.bounds import ASSUMED
from rw_ekf.model.considered import CURVE_POINTS, Direction, Off
from rw_ekf.model.effect import Coefficient, Effect, Shape, Term
from rw_ekf.model.effect_kinds import LawEffect, StaticEffect
from rw_ekf.model.friction import LAW_CODES
from rw_ekf.model.law import KINDS, MOST_COLUMNS, QUANTITIES, Law
from rw_ekf.model.state import PARAMETER_NAMES
from rw_ekf.numbers import number_of
from rw_ekf.wheel.effect_table import EffectSet

Matrix = tuple[tuple[float, ...], ...]

_MOST_DIRECTIONS = 64
_TIMES = 2  # at which what changes begins and ends
_LEAST_EIGENVALUE = 1.0e-12  # of the correlations; below it the matrix has no inverse in double precision


def _possible(bounds: tuple[float, float]) -> AfterValidator:
    """A number within bounds that every machine keeps."""
    low, high = bounds

    def check(value: float) -> float:
        if not low <= value <= high:
            refuse([((), f"is {value:g}; no machine is like that: it must lie between {low:g} and {high:g}")])
        return value

    return AfterValidator(check)


def _table_or_nothing(value: Any) -> Any:
    return value if isinstance(value, Mapping) else {}


class _Loose(Section):
    """A table that may hold more for people: standard deviations, units, remarks."""

    model_config = ConfigDict(extra="ignore")


class _Parameter(_Loose):
    """One of the four; its sigma is the covariance's."""

    value: float = Key(description="a finite number in the parameter's unit")


class _Parameters(_Loose):
    """The four parameters in state order."""

    motor_gain: _Parameter = Key(description="acceleration per ampere [rad/s^2/A]")
    viscous: _Parameter = Key(description="viscous friction per inertia [1/s]")
    coulomb: _Parameter = Key(description="Coulomb friction per inertia [rad/s^2]")
    static: _Parameter = Key(description="break-away friction per inertia [rad/s^2]")


class _Stribeck(_Loose):
    """The Stribeck bump."""

    speed_rad_s: Annotated[float, _possible(model_bounds.STRIBECK_SPEED_RAD_S)] = Key(description="its speed [rad/s]")
    law: Annotated[str, one_of(LAW_CODES)] = Key(description="its shape")


class _Noise(_Loose):
    """What the source knew of the noises."""

    speed_rad_s: Annotated[float, _possible(model_bounds.SPEED_NOISE_RAD_S)] | None = None
    acceleration_rad_s_per_sqrt_s: Annotated[float, _possible(model_bounds.ACCELERATION_NOISE)] | None = None
    dry_friction_rad_s2_per_sqrt_s: Annotated[float, _possible(model_bounds.DRY_WALK)] | None = None


class _Coefficient(_Loose):
    """The coefficient of an effect."""

    value: float = Key(description="in the unit of the catalogue")
    std: float = Key(ge=0, description="standard deviation")
    unit: str = Key(description="as the catalogue has it")


_Finite = Annotated[float, Key(allow_inf_nan=False)]


class _Law(Section):
    """A law without a formula, by its values on even knots."""

    quantity: Annotated[str, one_of(QUANTITIES)] = Key(description="what it is a function of")
    column: str = Key("", description="of the log, where the quantity is `column`")
    acts_as: Annotated[str, one_of(KINDS)] = Key(description="how it acts")
    unit: str = Key("", description="of its values, for people")
    range: Annotated[list[_Finite], Key(min_length=2, max_length=2)] = Key(description="first and last knot")
    values: Annotated[list[_Finite], Key(min_length=2, max_length=2000)] = Key(description="on even knots")
    std: list[_Finite] = Key([], description="of the values, or of when it begins and ends, for people")

    @model_validator(mode="after")
    def _holds(self) -> Self:
        mistakes: list[Mistake] = []
        if not self.range[1] > self.range[0]:
            mistakes.append((("range",), f"is {self.range}; the last knot must lie beyond the first"))
        if (self.quantity == "column") != bool(self.column):
            mistakes.append((("column",), "names the log's column of a law of quantity `column`, and of no other"))
        if len(self.std) > _TIMES and len(self.std) != len(self.values):
            mistakes.append((("std",), f"has {len(self.std)} numbers, the law {len(self.values)} values"))
        refuse(mistakes)
        return self

    def law(self, slot: int) -> Law:
        """The same as a filter has it."""
        return Law(
            QUANTITIES[QUANTITIES.index(self.quantity)], KINDS[KINDS.index(self.acts_as)], self.range[0], self.range[1],
            (tuple(self.values),), (), self.column, slot, tuple(self.std),
        )  # fmt: skip


def _unknown_constants(constants: Mapping[str, float], effect: type[Effect]) -> list[Mistake]:
    """Names that no shape constant of an effect has."""
    names = [constant.name for constant in effect.constants]
    return [
        (("constants", key), f"is not a constant of {effect.id}; {suggestion(key, names)}")
        for key in constants
        if key not in names
    ]


def _shape_of(constants: Mapping[str, float], effect: type[Effect]) -> Shape:
    """Shape constants by name, in the order of the effect; 0 where there is none."""
    numbers = (*(constants.get(constant.name, 0.0) for constant in effect.constants), 0.0, 0.0, 0.0)
    return numbers[0], numbers[1], numbers[2]


class _Entry(Section):
    """One coefficient of an effect, with the shape constants that it enters with."""

    formula: dict[Any, Any] | None = Key(None, description="of an effect of a user's own, as its file had it")
    effect: str = Key(description="its id in the catalogue, or that of a user's own")
    coefficient: _Coefficient = Key(description="value, std and unit")
    constants: Annotated[dict[str, float], BeforeValidator(lambda value: value or {})] = Key({}, description="by name")
    law: _Law | None = Key(None, description="of a law without a formula: its knots and values")

    @field_validator("effect", mode="before")
    @classmethod
    def _exists(cls, name: Any, info: ValidationInfo) -> Any:
        if info.data.get("formula") is None:
            return one_of(CATALOGUE).func(name)  # type: ignore[call-arg]
        return name

    @cached_property
    def _kind(self) -> type[Effect]:
        if self.formula is None:
            return CATALOGUE[self.effect]
        return effect_of(own_formula(self.effect, self.formula, CATALOGUE_IDS))

    @model_validator(mode="after")
    def _holds(self) -> Self:
        try:
            effect, found = self._kind, self.coefficient
        except FaultsError as error:
            refuse([(("formula", *fault.path), fault.words) for fault in error.faults])
            raise
        low, high, unit = effect.coefficient.lower, effect.coefficient.upper, effect.coefficient.unit
        mistakes: list[Mistake] = []
        if issubclass(effect, LawEffect) != (self.law is not None):
            words = "is missing" if self.law is None else f"is of a learned law; {self.effect} has a formula"
            mistakes.append((("law",), words))
        if found.unit != unit:
            mistakes.append((("coefficient", "unit"), f"is {found.unit!r}; the one of {self.effect} is {unit!r}"))
        if not low <= found.value <= high:
            words = f"is {found.value:g}; {self.effect} allows {low:g} to {high:g}"
            mistakes.append((("coefficient", "value"), words))
        mistakes += _unknown_constants(self.constants, effect)
        faults = ((constant.name, self._fault(constant)) for constant in effect.constants)
        refuse([*mistakes, *((("constants", name), fault) for name, fault in faults if fault is not None)])
        return self

    def _fault(self, constant: Coefficient) -> str | None:
        value = self.constants.get(constant.name)
        if value is None:
            return None if constant.optional else "is missing"
        if not constant.lower <= value <= constant.upper:
            return f"is {value:g}; {constant.name} allows {constant.lower:g} to {constant.upper:g}"
        if constant.whole and value != round(value):
            return f"is {value:g}; {constant.name} is the {constant.meaning}"
        return None

    @property
    def term(self) -> Term:
        """The same as a filter has it."""
        effect, shape = self._kind, _shape_of(self.constants, self._kind)
        law = None if self.law is None else self.law.law(0)
        return Term(effect, (self.coefficient.value,), (self.coefficient.std,), shape, law=law)


class _Off(Section):
    """What of one term is off, by a standard deviation of a direction."""

    constants: dict[str, _Finite] = Key({}, description="by name")
    curve: list[_Finite] = Key([], description="of its law, even over its range")

    def mistakes(self, at: tuple[Any, ...], term: Term) -> list[Mistake]:
        """What of it does not go with a term."""
        found = [((*at, *place), words) for place, words in _unknown_constants(self.constants, term.effect)]
        if self.curve and (term.law is None or len(self.curve) != CURVE_POINTS):
            known = f"a law's has {CURVE_POINTS}" if term.law is not None else f"{term.id} has no law"
            found.append(((*at, "curve"), f"has {len(self.curve)} numbers; {known}"))
        return found

    def off(self, term: Term) -> Off:
        """The same in the order of the term's constants."""
        return Off(_shape_of(self.constants, term.effect), tuple(self.curve))


class _Direction(Section):
    """One way in which what no filter learns may be off together."""

    numbers: list[_Finite] = Key(description="what the four parameters, then the coefficients, do then")
    terms: list[_Off] = Key(description="what of each effect is off")


def _one_of_a_kind(entries: list[_Entry]) -> list[_Entry]:
    """A model holds one effect of some kinds, and laws of three columns of a log."""
    columns = list(dict.fromkeys(entry.law.column for entry in entries if entry.law is not None and entry.law.column))
    if len(columns) > MOST_COLUMNS:
        refuse([((), f"are of {len(columns)} columns of a log ({', '.join(columns)}); {MOST_COLUMNS} are the most")])
    terms = [entry.term for entry in entries]
    refuse(
        ((i, "formula"), f"is another than that of {term.id} before it; give one of them another id")
        for i, term in enumerate(terms)
        for other in terms[:i]
        if term.id == other.id and term.effect is not other.effect
    )
    refuse(
        ((i,), f"is {term.id} beside {other.id}; a model holds one of the kind")
        for i, term in enumerate(terms)
        for other in terms[:i]
        if (term.effect is other.effect and not issubclass(term.effect, (StaticEffect, LawEffect)))
        or (term.effect.flow_kind and other.effect.flow_kind)
    )
    return entries


_Whole = Annotated[int, Key(gt=-(2**63), lt=2**63)]


class _Wheel(Section):
    """Whose model it is: the fields of a WheelTag."""

    serial_number: _Whole | None = None
    kind: _Whole | None = None
    version: _Whole | None = None
    protocol: str | None = None
    wire_map: str | None = None
    port: str | None = None
    sign_confirmed: bool = False


class ModelFile(Section):
    """A model file but for its schema. Effects come first: the covariance's size is theirs."""

    effects: Annotated[list[_Entry], AfterValidator(_one_of_a_kind)] | None = None
    considered: Annotated[list[_Direction], Key(max_length=_MOST_DIRECTIONS)] = Key(
        [], description="what no filter learns of the effects, a standard deviation a direction"
    )
    parameters: _Parameters = Key(description="motor_gain, viscous, coulomb and static, each with a value")
    covariance: Any = Key(description="rows of the four parameters, then the effects")
    stribeck: _Stribeck = Key(description="speed_rad_s and law")
    noise: Annotated[_Noise, BeforeValidator(_table_or_nothing)] = _Noise()
    inertia_kg_m2: Annotated[float, _possible(model_bounds.INERTIA_KG_M2)] | None = None
    temperature_lag_s: float = Key(
        0.0, ge=0, le=model_bounds.LONGEST_TEMPERATURE_LAG_S, description="of what acts behind what is read"
    )
    inertia_from: Annotated[str, one_of([ASSUMED])] = Key("", description="left out where somebody gave the inertia")
    wheel: _Wheel | None = Key(None, description="serial_number, kind, version, wire_map and so on")
    source: dict[Any, Any] | None = Key(None, description="method, log and so on: for people")

    @property
    def effect_set(self) -> EffectSet:
        """The effects in order of use, with what is considered of them."""
        found = _effect_set(self.effects)
        ways = [Direction(tuple(way.numbers), tuple(map(_Off.off, way.terms, found.terms))) for way in self.considered]
        return replace(found, considered=tuple(ways))

    @property
    def values(self) -> list[float]:
        """The four parameters in state order."""
        return [getattr(self.parameters, name).value for name in PARAMETER_NAMES]

    @field_validator("considered")
    @classmethod
    def _fits(cls, ways: list[_Direction], info: ValidationInfo) -> list[_Direction]:
        if "effects" not in info.data:
            return ways
        found = _effect_set(info.data["effects"])
        sizes = {"numbers": len(PARAMETER_NAMES) + found.size, "terms": len(found.terms)}
        refuse(
            ((i, key), f"are {len(getattr(way, key))}; these effects want {size}")
            for i, way in enumerate(ways)
            for key, size in sizes.items()
            if len(getattr(way, key)) != size
        )
        refuse(
            mistake
            for i, way in enumerate(ways)
            for j, (off, term) in enumerate(zip(way.terms, found.terms, strict=True))
            for mistake in off.mistakes((i, "terms", j), term)
        )
        return ways

    @field_validator("covariance")
    @classmethod
    def _covers(cls, rows: Any, info: ValidationInfo) -> Matrix:
        if "effects" not in info.data:
            return ()  # nobody knows how large it should be
        return _covariance(rows, len(PARAMETER_NAMES) + _effect_set(info.data["effects"]).size)

    @model_validator(mode="after")
    def _plausible(self) -> Self:
        """Values and sigmas of the parameters and coefficients against what machines can be (model_bounds)."""
        stds = [math.sqrt(row[i]) for i, row in enumerate(self.covariance)]
        mistakes: list[Mistake] = []
        for i, (value, std) in enumerate(zip([*self.values, *self.effect_set.values], stds, strict=True)):
            name = PARAMETER_NAMES[i] if i < len(PARAMETER_NAMES) else None
            fault = None if name is None else model_bounds.value_fault(name, value, std)
            if fault is not None:  # one finding a parameter: the sigma is judged by the size of the value
                mistakes.append((("parameters", str(name), "value"), fault))
                continue
            least = model_bounds.LEAST_EFFECT_STD if name is None else model_bounds.LEAST_STD
            fault = model_bounds.std_fault(value, std, least=least)
            if fault is not None:
                mistakes.append((("covariance", i), fault))
        refuse(mistakes)
        return self


def _covariance(rows: Any, size: int) -> Matrix:
    """A symmetric matrix (size, size) with non-negative eigenvalues; refused otherwise."""
    try:
        matrix = np.array([[math.nan if number_of(v) is None else v for v in row] for row in rows], dtype=np.float64)
    except (TypeError, ValueError):
        matrix = np.zeros(0)
    if matrix.shape != (size, size) or not np.isfinite(matrix).all():
        refuse([((), f"must be {size} rows of {size} finite numbers: four parameters, then the effects")])
    if not (np.diag(matrix) > 0.0).all():
        refuse([((), "has a variance that is not above zero: nothing is known for certain")])
    scale = np.sqrt(np.diag(matrix))
    with np.errstate(over="ignore"):  # infinite is above 1, too
        normal = matrix / scale[:, None] / scale[None, :]
    if not (np.abs(normal) <= 1.0 + 1.0e-6).all() or not np.allclose(normal, normal.T, atol=1e-6):
        refuse([((), "is not symmetric with correlations from -1 to 1: no covariance is like that")])
    least = np.linalg.eigvalsh(normal).min()
    if least < -1.0e-6:
        refuse([((), "has a negative eigenvalue: no covariance is like that")])
    if least < _LEAST_EIGENVALUE:  # rounding of a combination that is known for certain: an inverse is needed
        matrix = matrix + np.diag((_LEAST_EIGENVALUE - least) * np.diag(matrix))
    return tuple(tuple(float(v) for v in row) for row in matrix)


def _effect_set(entries: list[_Entry] | None) -> EffectSet:
    """The effects; entries that follow each other and are coefficients of one term, as one."""
    found: list[Term] = []
    for term in (entry.term for entry in entries or ()):
        last = found[-1] if found else term
        count = len(last.values)
        follows = found and term.effect is last.effect and count < last.effect.components
        if follows and term.shape == last.effect.component_shape(last.shape, count):
            found[-1] = replace(last, values=(*last.values, *term.values), stds=(*last.stds, *term.stds))
        else:
            found.append(term)
    columns = list(dict.fromkeys(term.law.column for term in found if term.law is not None and term.law.column))
    return EffectSet(tuple(
        term if term.law is None or not term.law.column
        else replace(term, law=replace(term.law, slot=columns.index(term.law.column)))
        for term in found
    ))  # fmt: skip
