"""Every number of a model file looked up and held against what machines can be; all that is wrong is collected."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.model import bounds as model_bounds
from rw_ekf.model.effect import Coefficient, Shape, Term
from rw_ekf.model.effect_kinds import StaticEffect
from rw_ekf.model.state import PARAMETER_NAMES
from rw_ekf.wheel.table import NO_EFFECTS, EffectSet

_ANY = (-math.inf, math.inf)
_LEAST_EIGENVALUE = 1.0e-12  # of the correlations; below it the matrix has no inverse in double precision


class ModelChecker:
    """Looks values up and collects everything that is wrong."""

    def __init__(self, data: Mapping[str, Any], where: Any) -> None:
        self.data = data
        self.where = where
        self.findings: list[str] = []

    def find(self, path: tuple[str | int, ...], what: str) -> None:
        """Note what is wrong at a path of keys."""
        self.findings.append(f"{self.where(path)}: {'.'.join(str(p) for p in path)} {what}")

    def get(self, path: tuple[str | int, ...]) -> Any:
        """The value at a path of keys; None where there is none."""
        value: Any = self.data
        for key in path:
            if isinstance(value, Mapping):
                value = value.get(key)
            else:
                value = value[key] if isinstance(key, int) and isinstance(value, list) else None
        return value

    def number(self, path: tuple[str | int, ...], bounds: tuple[float, float] = _ANY) -> float:
        """A finite number within bounds, or a finding and 1."""
        value = self.get(path)
        if not _is_finite(value):
            self.find(path, f"is {value!r}; a finite number is needed" if value is not None else "is missing")
            return 1.0
        if not bounds[0] <= value <= bounds[1]:
            self.find(
                path, f"is {value:g}; no machine is like that: it must lie between {bounds[0]:g} and {bounds[1]:g}"
            )
        return float(value)

    def optional(self, path: tuple[str, ...], bounds: tuple[float, float] = _ANY) -> float | None:
        """The same, or None where nothing is given."""
        return None if self.get(path) is None else self.number(path, bounds)

    def plausible(self, parameters: list[float], effects: EffectSet, covariance: tuple[tuple[float, ...], ...]) -> None:
        """Values and sigmas of the parameters and coefficients against what machines can be (model_bounds)."""
        stds = [math.sqrt(row[i]) for i, row in enumerate(covariance)]
        known: list[float | None] = [*stds, *([None] * len(parameters))][: len(parameters)] if stds else [None] * 4
        for name, value, std in zip(PARAMETER_NAMES, parameters, known, strict=True):
            fault = model_bounds.value_fault(name, value, std)
            if fault is not None:
                self.find(("parameters", name, "value"), fault)
        least = [model_bounds.LEAST_STD] * len(parameters) + [model_bounds.LEAST_EFFECT_STD] * len(stds)
        values = [*parameters, *effects.values]
        for i, (value, std) in enumerate(zip(values, stds, strict=False)):
            if i < len(parameters) and model_bounds.value_fault(PARAMETER_NAMES[i], value, std) is not None:
                continue  # one finding a parameter: the sigma is judged by the size of the value
            fault = model_bounds.std_fault(value, std, least=least[i])
            if fault is not None:
                self.find(("covariance", i), fault)

    def effects(self) -> EffectSet:
        """The effects, each known to the catalogue, with all its constants, or findings."""
        entries = self.data.get("effects")
        if entries is None:
            return NO_EFFECTS
        if not isinstance(entries, list):
            self.find(("effects",), "must be a list of effects")
            return NO_EFFECTS
        terms: list[Term] = []
        for i in range(len(entries)):
            term = self._effect(("effects", i))
            if term is None:
                continue
            for other in terms:
                same_kind = term.effect is other.effect and not issubclass(term.effect, StaticEffect)
                if same_kind or (term.effect.flow_kind and other.effect.flow_kind):
                    self.find(("effects", i), f"is {term.id} beside {other.id}; a model holds one of the kind")
            terms.append(term)
        return _joined(terms)

    def _effect(self, path: tuple[str | int, ...]) -> Term | None:
        name = self.get((*path, "effect"))
        if not isinstance(name, str) or name not in CATALOGUE:
            self.find(path, f"names the effect {name!r}; the catalogue has: {', '.join(CATALOGUE)}")
            return None
        effect = CATALOGUE[name]
        value = self.number((*path, "coefficient", "value"))
        std = self.number((*path, "coefficient", "std"))
        unit = self.get((*path, "coefficient", "unit"))
        if unit != effect.coefficient.unit:
            self.find(
                (*path, "coefficient"), f"has the unit {unit!r}; the one of {name} is {effect.coefficient.unit!r}"
            )
        if not effect.coefficient.lower <= value <= effect.coefficient.upper:
            low, high = effect.coefficient.lower, effect.coefficient.upper
            self.find((*path, "coefficient", "value"), f"is {value:g}; {name} allows {low:g} to {high:g}")
        if std < 0.0:
            self.find((*path, "coefficient", "std"), f"is {std:g}; a standard deviation is not below zero")
        for key in self.get(path):
            if key not in {"effect", "coefficient", "constants"}:
                self.find((*path, key), "is not a key of an effect")
        known = {constant.name for constant in effect.constants}
        for key in self.get((*path, "constants")) or ():
            if key not in known:
                self.find((*path, "constants", key), f"is not a constant of {name}")
        numbers = [self._constant((*path, "constants", constant.name), constant) for constant in effect.constants]
        shape: Shape = (*numbers, 0.0, 0.0, 0.0)[:3]  # type: ignore[assignment]
        return Term(effect, (value,), (std,), shape)

    def _constant(self, path: tuple[str | int, ...], constant: Coefficient) -> float:
        """A shape constant within its bounds, or a finding."""
        value = self.number(path)
        if not constant.lower <= value <= constant.upper:
            self.find(path, f"is {value:g}; {constant.name} allows {constant.lower:g} to {constant.upper:g}")
        if constant.whole and value != round(value):
            self.find(path, f"is {value:g}; {constant.name} is the {constant.meaning}")
        return value

    def covariance(self, size: int) -> tuple[tuple[float, ...], ...]:
        """A symmetric matrix (size, size) with non-negative eigenvalues, or a finding."""
        rows: Any = self.data.get("covariance")
        try:
            matrix = np.array([[v if _is_finite(v) else math.nan for v in row] for row in rows], dtype=np.float64)
        except (TypeError, ValueError):
            matrix = np.zeros(0)
        if matrix.shape != (size, size) or not np.isfinite(matrix).all():
            self.find(
                ("covariance",), f"must be {size} rows of {size} finite numbers: four parameters, then the effects"
            )
            return ()
        if not (np.diag(matrix) > 0.0).all():
            self.find(("covariance",), "has a variance that is not above zero: nothing is known for certain")
            return ()
        scale = np.sqrt(np.diag(matrix))
        normal = matrix / scale[:, None] / scale[None, :]
        if not (np.abs(normal) <= 1.0 + 1.0e-6).all() or not np.allclose(normal, normal.T, atol=1e-6):
            self.find(("covariance",), "is not symmetric with correlations from -1 to 1: no covariance is like that")
            return ()
        least = np.linalg.eigvalsh(normal).min()
        if least < -1.0e-6:
            self.find(("covariance",), "has a negative eigenvalue: no covariance is like that")
            return ()
        if least < _LEAST_EIGENVALUE:  # rounding of a combination that is known for certain: an inverse is needed
            matrix = matrix + np.diag((_LEAST_EIGENVALUE - least) * np.diag(matrix))
        return tuple(tuple(float(v) for v in row) for row in matrix)


def _joined(terms: list[Term]) -> EffectSet:
    """Entries that follow each other and are coefficients of one term, as one."""
    found: list[Term] = []
    for term in terms:
        last = found[-1] if found else term
        count = len(last.values)
        follows = found and term.effect is last.effect and count < last.effect.components
        if follows and term.shape == last.effect.component_shape(last.shape, count):
            found[-1] = replace(last, values=(*last.values, *term.values), stds=(*last.stds, *term.stds))
        else:
            found.append(term)
    return EffectSet(tuple(found))


def _is_finite(value: object) -> bool:
    """Whether it is a number that a double holds."""
    try:
        return _is_number(value) and math.isfinite(value)  # type: ignore[arg-type]
    except OverflowError:  # an integer of three hundred digits and more
        return False


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
