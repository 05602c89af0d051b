"""Effects that a user wrote down: an id, one formula, its parameters with their units (docs/own-effects.md)."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

from rw_ekf.checking.formula import RESERVED, FormulaError, Node, parsed, require_proportional
from rw_ekf.checking.wording import shown, suggestion
from rw_ekf.checking.yaml_loader import PathTuple, load_yaml
from rw_ekf.errors import ConfigError

Kind = Literal["drag", "torque", "viscous", "motor_gain"]
KINDS: tuple[Kind, ...] = get_args(Kind)
MOST_CONSTANTS, MOST_EFFECTS = 3, 20

_KEYS = ("unit", "start", "range")
_ID = re.compile(r"[a-z][a-z0-9_]{0,39}")
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,19}")
_NUMBERED = re.compile(r"_[0-9]+$")  # a second coefficient's column is named so
_LONGEST_UNIT = 20
# Names of columns and of what a posterior has beside effects.
_TAKEN = frozenset({
    "none", "something_else", "motor_gain", "viscous", "coulomb", "static", "log", "reason", "nis", "accepted",
    "time_s", "speed_rad_s", "innovation_rad_s", "innovation_std_rad_s",
})  # fmt: skip


class Parameter(NamedTuple):
    """A number of a formula: a coefficient has no start; a constant is sought within its range."""

    name: str
    unit: str
    start: float | None = None
    low: float | None = None
    high: float | None = None

    def document(self) -> dict[str, Any]:
        """As a file has it."""
        start = {} if self.start is None else {"start": self.start}
        return {"unit": self.unit, **start, **({} if self.low is None else {"range": [self.low, self.high]})}


@dataclass(frozen=True)
class OwnFormula:
    """An effect by its formula. Two of the same text and parameters are one."""

    id: str
    kind: Kind
    text: str
    coefficient: Parameter
    constants: tuple[Parameter, ...]  # at most three
    tree: Node = field(compare=False, repr=False)

    def document(self) -> dict[str, Any]:
        """As a file has it, below the id."""
        return {self.kind: self.text} | {item.name: item.document() for item in (self.coefficient, *self.constants)}


class Fault(NamedTuple):
    """Something wrong: a path of keys below the effect, words that follow the key, a place within a formula's text."""

    path: PathTuple
    words: str
    at: int | None = None


class FaultsError(Exception):
    """What is wrong with an effect."""

    def __init__(self, faults: list[Fault]) -> None:
        super().__init__(faults)
        self.faults = faults


def read_effect_file(path: str | Path, taken: Collection[str]) -> list[OwnFormula]:
    """Read and check a file of effects; taken: ids that they may not have.

    Raises ConfigError with file:line:column of everything that is wrong.
    """
    document = load_yaml(path)
    if not isinstance(document.data, Mapping):
        raise ConfigError(
            f"{document.where()}: a file of effects is a table, `my_drag: {{drag: FORMULA, a: {{unit: UNIT}}}}`; "
            f"found {shown(document.data)}"
        )
    if len(document.data) > MOST_EFFECTS:
        raise ConfigError(f"{document.where()}: {len(document.data)} effects; {MOST_EFFECTS} are the most in one file")
    found, findings = [], []
    for name, data in document.data.items():
        try:
            found.append(own_formula(name, data, taken))
        except FaultsError as error:
            for below, words, at in error.faults:
                full = (name, *below)
                place = document.where_key(full)
                if at is not None:
                    place = document.where_within(full, str(data[below[0]]), at)
                elif below and below[-1] in (*KINDS, *_KEYS):
                    place = document.where(full)
                findings.append(f"{place}: {'.'.join(map(str, full))} {words}")
    if findings:
        raise ConfigError(findings)
    return found


def own_formula(name: object, data: Any, taken: Collection[str] = ()) -> OwnFormula:
    """Check an effect as a file has it, below its id. Raises FaultsError."""
    faults = _id_faults(name, taken)
    if not isinstance(data, Mapping):
        words = f"must be a table of one of {', '.join(KINDS)}, and its parameters; found {shown(data)}"
        raise FaultsError([*faults, Fault((), words)])
    kinds = [kind for kind in KINDS if kind in data]
    if len(kinds) != 1:
        has = f"it has {' and '.join(kinds)}" if kinds else "it has none"
        raise FaultsError([*faults, Fault((), f"must have exactly one formula, under {', '.join(KINDS)}; {has}")])
    kind, text = kinds[0], data[kinds[0]]
    parameters: list[Parameter] = []
    for key in (key for key in data if key != kind):
        wrong = _parameter_faults(key, data[key])
        faults += wrong
        if not wrong:
            parameters.append(_parameter(key, data[key]))
    if not isinstance(text, str):
        raise FaultsError([*faults, Fault((kind,), f"must be a formula as text, found {shown(text)}")])
    free = [item for item in parameters if item.start is None]
    constants = tuple(item for item in parameters if item.start is not None)
    if not faults:
        faults += _count_faults(free, constants)
    tree = None
    try:
        tree = parsed(text, [str(key) for key in data if key != kind])
        if not faults:
            require_proportional(tree, free[0].name)
            used = set(tree.names())
            faults += [
                Fault((item.name,), f"is not in the formula {text!r}: use it, or leave it out")
                for item in constants
                if item.name not in used
            ]
    except FormulaError as error:
        faults.append(Fault((kind,), error.words, error.at))
    if faults or tree is None:
        raise FaultsError(faults)
    return OwnFormula(str(name), kind, " ".join(text.split()), free[0], constants, tree)


def _id_faults(name: object, taken: Collection[str]) -> list[Fault]:
    if not isinstance(name, str) or not _ID.fullmatch(name):
        return [Fault((), "is no id: use up to 40 small letters, digits and _, a letter first")]
    if name in taken or _NUMBERED.sub("", name) in taken:
        return [Fault((), "is an effect of the catalogue, or numbered like one: give yours another id")]
    if name in _TAKEN or name.startswith(("std_", "smoothed_")):
        return [Fault((), "means something else in tables and documents: give your effect another id")]
    return []


def _parameter_faults(key: object, data: Any) -> list[Fault]:
    """What is wrong with one parameter."""
    here: PathTuple = (key if isinstance(key, str | int) else str(key),)
    if not isinstance(key, str) or not _NAME.fullmatch(key) or key in RESERVED or key in KINDS:
        words = (
            "is no name for a parameter: use up to 20 letters, digits and _, a letter first, and no name of a quantity"
        )
        return [Fault(here, f"{words} or function")]
    if not isinstance(data, Mapping):
        return [Fault(here, f"must be a table, {{unit: 1/s}} or {{unit: rad/s, start: 50, range: [1, 500]}}; "
                            f"found {shown(data)}")]  # fmt: skip
    faults = [
        Fault((*here, other), f"is an unknown key; {suggestion(other, _KEYS)}") for other in data if other not in _KEYS
    ]
    unit = data.get("unit")
    if unit is None:
        faults.append(Fault(here, "needs a unit, as `unit: rad/s`; `unit: 1` for a plain number"))
    elif unit != 1 and not (isinstance(unit, str) and 0 < len(unit) <= _LONGEST_UNIT and unit.isprintable()):
        words = f"must be text of at most {_LONGEST_UNIT} characters, found {shown(unit)}"
        faults.append(Fault((*here, "unit"), words))
    limits, start = data.get("range"), data.get("start")
    if start is not None and limits is None:
        faults.append(Fault(here, "has a start and no range: a constant is sought within `range: [low, high]`"))
    if limits is not None and not (isinstance(limits, list) and len(limits) == 2 and all(map(_is_number, limits))):
        faults.append(Fault((*here, "range"), f"must be two numbers, [low, high]; found {shown(limits)}"))
        limits = None
    if limits is not None and not limits[0] < limits[1]:
        faults.append(Fault((*here, "range"), f"is {limits[0]:g} to {limits[1]:g}: the first must be the lower one"))
        limits = None
    if start is not None and not _is_number(start):
        faults.append(Fault((*here, "start"), f"must be a number, found {shown(start)}"))
    elif start is not None and limits is not None and not limits[0] <= start <= limits[1]:
        faults.append(Fault((*here, "start"), f"is {start:g}, outside its range {limits[0]:g} to {limits[1]:g}"))
    return faults


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1.0e100


def _parameter(name: str, data: Mapping[str, Any]) -> Parameter:
    low, high = map(float, data["range"]) if data.get("range") is not None else (None, None)
    start = None if data.get("start") is None else float(data["start"])
    return Parameter(name, str(data["unit"]), start, low, high)


def _count_faults(free: list[Parameter], constants: tuple[Parameter, ...]) -> list[Fault]:
    if not free:
        return [Fault((), "has a start for every parameter: one, to which the formula is proportional, must have none")]
    if len(free) > 1:
        names = ", ".join(item.name for item in free)
        return [Fault((free[1].name,), f"needs a start and a range: of {names} only one may have none")]
    if len(constants) > MOST_CONSTANTS:
        return [Fault((constants[MOST_CONSTANTS].name,), f"is one too many: {MOST_CONSTANTS} constants are the most")]
    return []
