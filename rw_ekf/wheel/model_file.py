"""A model on disk: parameters with their covariance, noises, Stribeck law, effects (YAML, schema rw_ekf.model/1).

`fit --out`, `diagnose` and every `run` write one; `replay --model`, `fit --prior`, `diagnose --model` and
`filter.model` of a configuration read one.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rw_ekf.checking.paths import path_of
from rw_ekf.checking.wording import shown
from rw_ekf.checking.yaml_text import yaml_text
from rw_ekf.errors import ConfigError
from rw_ekf.logs.atomic import write_text
from rw_ekf.logs.checksums import changed
from rw_ekf.model.bounds import ASSUMED
from rw_ekf.model.effect import Term
from rw_ekf.model.effect_kinds import FormulaEffect
from rw_ekf.model.law import Law
from rw_ekf.model.state import PARAMETER_COUNT, PARAMETER_NAMES, STATE_UNITS, FrictionParameters
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet
from rw_ekf.wheel.wheel_tag import WheelTag

SCHEMA_FAMILY = "rw_ekf.model/"
SCHEMA = SCHEMA_FAMILY + "1"


@dataclass(frozen=True)
class WheelModel:
    """What is known of one wheel; noises None where the source knew none.

    Covariance is over the four parameters in state order, then the coefficients of the effects in order of use.
    """

    parameters: FrictionParameters
    covariance: tuple[tuple[float, ...], ...]
    stribeck_speed_rad_s: float
    stribeck_law: str = "gauss"
    speed_noise_rad_s: float | None = None
    acceleration_noise: float | None = None  # rad/s per sqrt(s)
    dry_walk: float | None = None  # by which dry friction walks at random, rad/s^2 per sqrt(s)
    inertia_kg_m2: float | None = None
    source: Mapping[str, Any] = field(default_factory=dict, hash=False)  # method, log, samples: for people
    effects: EffectSet = NO_EFFECTS
    wheel: WheelTag | None = None  # None: nobody knows whose it is
    remarks: tuple[str, ...] = field(default=(), compare=False)  # what is to be reported of the file it was read from
    inertia_is_assumed: bool = False  # it is the default, whatever passed it on
    temperature_lag_s: float = 0.0  # by which the temperature that acts follows the one that is read

    @property
    def own_effects(self) -> tuple[type[FormulaEffect], ...]:
        """Its effects by formulas of a user's own."""
        return tuple(t.effect for t in self.effects.terms if issubclass(t.effect, FormulaEffect))

    @property
    def numbers(self) -> dict[str, tuple[float, float, str]]:
        """Value, standard deviation and unit of each parameter and coefficient, by name, in the covariance's order."""
        named = [(name, value, STATE_UNITS[name]) for name, value in zip(PARAMETER_NAMES, self.parameters, strict=True)]
        for term in self.effects.state_terms:
            coefficient = term.effect.coefficient
            for number, value in enumerate(term.values):
                which = f" {number + 1}" if len(term.values) > 1 else ""
                named.append((f"{term.id}.{coefficient.name}{which}", float(value), coefficient.unit))
        return {name: (value, math.sqrt(self.covariance[i][i]), unit) for i, (name, value, unit) in enumerate(named)}

    def without(self, laws: Collection[Law]) -> WheelModel:
        """The same without the terms of these laws."""
        dropped = [term.law in laws for term in self.effects.state_terms for _ in term.values]
        kept = [*range(PARAMETER_COUNT), *(PARAMETER_COUNT + at for at, gone in enumerate(dropped) if not gone)]
        covariance = tuple(tuple(self.covariance[i][j] for j in kept) for i in kept)
        return replace(self, covariance=covariance, effects=self.effects.only(lambda term: term.law not in laws))

    def document(self) -> dict[str, Any]:
        """Plain data, as a file has it; `wheel` is left out where nobody knows whose it is."""
        return {
            "schema": SCHEMA,
            "source": dict(self.source),
            **({} if self.wheel is None else {"wheel": self.wheel.document()}),
            "stribeck": {"speed_rad_s": self.stribeck_speed_rad_s, "law": self.stribeck_law},
            "inertia_kg_m2": self.inertia_kg_m2,
            **({"inertia_from": ASSUMED} if self.inertia_is_assumed else {}),
            "parameters": {
                name: {"value": value, "std": math.sqrt(self.covariance[i][i]), "unit": STATE_UNITS[name]}
                for i, (name, value) in enumerate(zip(PARAMETER_NAMES, self.parameters, strict=True))
            },
            "covariance": [list(row) for row in self.covariance],
            "noise": {
                "speed_rad_s": self.speed_noise_rad_s,
                "acceleration_rad_s_per_sqrt_s": self.acceleration_noise,
                **({} if self.dry_walk is None else {"dry_friction_rad_s2_per_sqrt_s": self.dry_walk}),
            },
            **({} if self.temperature_lag_s == 0.0 else {"temperature_lag_s": self.temperature_lag_s}),
            "effects": [entry for term in self.effects.terms for entry in _effect_documents(term)],
            **_considered_documents(self.effects),
        }

    @classmethod
    def load(cls, path: str | Path) -> WheelModel:
        """Read a model file. Raises ConfigError with file:line:column of everything that is wrong."""
        return read_model(path_of(path, "a model"))

    def save(self, path: str | Path) -> None:
        """Write a model file. Raises BadInputError if the place cannot be written."""
        write_text(path, self.to_text())

    def to_text(self) -> str:
        """YAML text; floats are written so that they read back exactly."""
        return yaml_text(self.document(), default_flow_style=None, width=120)


def _effect_documents(term: Term) -> list[dict[str, Any]]:
    """An entry for each coefficient, with the shape constants that it enters with."""
    effect, named = term.effect, term.effect.coefficient
    shapes = [effect.component_shape(term.shape, i) for i in range(len(term.values))]
    return [
        {
            "effect": term.id,
            "coefficient": {"name": named.name, "value": float(value), "std": float(std), "unit": named.unit},
            "constants": {
                constant.name: float(number) for constant, number in zip(effect.constants, shape, strict=False)
            },
            **({} if term.law is None else {"law": _law_document(term.law)}),
            **({"formula": effect.formula.document()} if issubclass(effect, FormulaEffect) else {}),
        }
        for value, std, shape in zip(term.values, term.stds, shapes, strict=True)
    ]


def _considered_documents(effects: EffectSet) -> dict[str, Any]:
    """What no filter learns of the effects: each direction with what of each term is off by a standard deviation."""
    found = [
        {
            "numbers": list(way.numbers),
            "terms": [
                {
                    "constants": {c.name: by for c, by in zip(term.effect.constants, off.shape, strict=False) if by},
                    **({"curve": list(off.curve)} if off.curve else {}),
                }
                for term, off in zip(effects.terms, way.terms, strict=True)
            ],
        }
        for way in effects.considered
    ]
    return {"considered": found} if found else {}


def _law_document(law: Law) -> dict[str, Any]:
    """A law by its values on even knots, with what it is a function of and how it acts."""
    column = {"column": law.column} if law.column else {}
    spread = {"std": list(law.spread)} if law.spread else {}
    return {
        "quantity": law.quantity, **column, "acts_as": law.acts_as, "unit": law.own_unit,
        "range": [law.first, law.last], "values": list(law.functions[0]), **spread,
    }  # fmt: skip


def read_model(path: Path) -> WheelModel:
    """Read and check a model file. Raises ConfigError naming file, line and column of everything that is wrong."""
    from rw_ekf.checking.yaml_loader import load_yaml

    document = load_yaml(path)
    model, remark = model_from_data(document.data, document.where), changed(path)
    return model if remark is None else replace(model, remarks=(remark,))


def model_from_data(data: Any, where: Any) -> WheelModel:
    """Check plain data; `where` turns a path of keys into "file:line:column"."""
    from rw_ekf.checking.findings import checked
    from rw_ekf.wheel.model_check import ModelFile

    if not isinstance(data, Mapping):
        raise ConfigError(f"{where(())}: a model file is a mapping that begins with `schema: {SCHEMA}`.")
    schema = data.get("schema")
    if schema != SCHEMA:
        raise ConfigError(_schema_finding(schema, where))
    content = {key: value for key, value in data.items() if key != "schema"}
    found = checked(ModelFile, content, "a model file", where)
    return WheelModel(
        FrictionParameters(*found.values),
        found.covariance,
        stribeck_speed_rad_s=found.stribeck.speed_rad_s,
        stribeck_law=found.stribeck.law,
        speed_noise_rad_s=found.noise.speed_rad_s,
        acceleration_noise=found.noise.acceleration_rad_s_per_sqrt_s,
        dry_walk=found.noise.dry_friction_rad_s2_per_sqrt_s,
        inertia_kg_m2=found.inertia_kg_m2,
        source=found.source or {},
        effects=found.effect_set,
        wheel=None if found.wheel is None else WheelTag(**found.wheel.model_dump()),
        inertia_is_assumed=found.inertia_from == ASSUMED,
        temperature_lag_s=found.temperature_lag_s,
    )


def refusal_of(model: WheelModel) -> str | None:
    """Why the file of this model would not be read again; None if it would.

    A fit to a record that is no wheel's may end where no wheel is; then there is nothing to write.
    """
    try:
        model_from_data(model.document(), lambda path: "the model")
    except ConfigError as error:
        return "; ".join(error.findings)
    except (ArithmeticError, ValueError):  # the square root of a variance below zero
        return "its covariance has a variance below zero, or a number that is none"
    return None


def _schema_finding(schema: object, where: Any) -> str:
    if isinstance(schema, str) and schema.startswith(SCHEMA_FAMILY):
        return (
            f"{where(('schema',))}: schema is {schema!r}, this version of rw_ekf reads {SCHEMA!r}. "
            "Write the model again with this version (`rw-ekf fit LOG --out model.yaml`)."
        )
    return f"{where(('schema',))}: not a model file: schema is {shown(schema)}, expected {SCHEMA!r}."
