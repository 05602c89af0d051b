"""Effects by a user's own formulas in a simulated wheel: the tree is walked as it was read, with Python's functions.

Nothing is shared with the estimator but the tree: no program, no tangent, no derivative. A formula's torque is held
over a step of a few milliseconds at what it is in the step's middle, which a half step finds; the plant does the rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from rw_ekf.checking.effect_file import OwnFormula
from rw_ekf.checking.formula import Node
from rw_ekf.drivers.sim.plant_parameters import PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import Advance
from rw_ekf.errors import BadInputError

_FAST_RAD_S = 2.0  # above it no step comes to rest: a drag is a torque against the motion there, and dry friction below
_COARSE_STEP_S, _FINE_STEP_S = 5.0e-3, 1.0e-3

_FUNCTIONS: dict[str, Callable[..., float]] = {
    **{name: getattr(math, name) for name in ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh",
                                              "exp", "expm1", "log", "log1p", "sqrt", "atan2")},
    "abs": abs, "min": min, "max": max, "neg": lambda x: -x,
    "sgn": lambda x: float((x > 0.0) - (x < 0.0)),
    "+": lambda x, y: x + y, "-": lambda x, y: x - y, "*": lambda x, y: x * y, "/": lambda x, y: x / y,
    "**": math.pow,
}  # fmt: skip


@dataclass(frozen=True)
class PlantFormula:
    """One formula with its numbers by name."""

    formula: OwnFormula
    numbers: dict[str, float]

    def value(self, state: PlantState, current_A: float) -> float:
        """What it is at a moment, in its own unit; 0 where it has no value. A drag is evaluated along the motion."""
        speed, along = state.speed_rad_s, 1.0
        if self.formula.kind in {"drag", "viscous"}:
            along = math.copysign(1.0, speed if speed != 0.0 else current_A)
            speed = max(abs(speed), 1.0e-6)
        names = self.numbers | {
            "omega": speed, "current": along * current_A, "temperature": state.temperature_degC,
            "angle": state.angle_rad, "time": state.time_s,
        }  # fmt: skip
        try:
            found = _walked(self.formula.tree, names)
        except (ArithmeticError, ValueError):
            return 0.0
        if not math.isfinite(found):
            return 0.0
        return found * speed if self.formula.kind == "viscous" else found


def _walked(node: Node, names: dict[str, float]) -> float:
    if node.op == "number":
        return node.value
    if node.op == "name":
        return names[node.name]
    return float(_FUNCTIONS[node.op](*(_walked(part, names) for part in node.parts)))


def with_formulas(law: Advance, formulas: Sequence[PlantFormula]) -> Advance:
    """The law by which a wheel with these formulas goes from one state to the next, made of the one without."""

    def forced(
        p: PlantParameters, state: PlantState, at: PlantState, current_A: float, step_s: float, fine_step_s: float
    ) -> PlantState:
        """A step under what the formulas are `at` a state."""
        torque, dry, gain = 0.0, 0.0, 1.0
        for item in formulas:
            value = item.value(at, current_A)
            if item.formula.kind == "motor_gain":
                gain += value
            elif item.formula.kind == "torque":
                torque += value
            elif abs(at.speed_rad_s) > _FAST_RAD_S:
                torque += math.copysign(value, value * at.speed_rad_s)
            else:
                dry += value
        forced_p = p._replace(offset_rad_s2=p.offset_rad_s2 + torque, motor_gain=p.motor_gain * gain)
        level = state.coulomb_wander_rad_s2
        end = law(forced_p, state._replace(coulomb_wander_rad_s2=level + dry), current_A, step_s, fine_step_s)
        return end._replace(coulomb_wander_rad_s2=level)

    def advance(
        p: PlantParameters, state: PlantState, current_A: float, duration_s: float, fine_step_s: float
    ) -> PlantState:
        end_s = state.time_s + duration_s
        while end_s - state.time_s > 1.0e-10:
            fast = abs(state.speed_rad_s) > 2.0 * _FAST_RAD_S
            step_s = min(_COARSE_STEP_S if fast else _FINE_STEP_S, end_s - state.time_s)
            middle = forced(p, state, state, current_A, 0.5 * step_s, fine_step_s)
            state = forced(p, state, middle, current_A, step_s, fine_step_s)
        return state

    return advance


def split_formulas(texts: Sequence[str], formulas: Sequence[OwnFormula]) -> tuple[list[str], list[PlantFormula]]:
    """Effects as a user writes them: those that have no formula here, and those that do, with their numbers.

    `eddy:a=0.01,w0=50`; a constant that is left out is as it starts. Raises BadInputError.
    """
    known = {formula.id: formula for formula in formulas}
    rest: list[str] = []
    found: dict[str, PlantFormula] = {}
    for text in texts:
        name = text.partition(":")[0].strip()
        if name not in known:
            rest.append(text)
        elif name in found:
            raise BadInputError(f"effect {name} is given twice; give it once")
        else:
            found[name] = PlantFormula(known[name], _numbers(known[name], text))
    return rest, [*found.values()]


def _numbers(formula: OwnFormula, text: str) -> dict[str, float]:
    parameters = {item.name: item for item in (formula.coefficient, *formula.constants)}
    numbers = {item.name: item.start for item in formula.constants if item.start is not None}
    given: set[str] = set()
    for setting in filter(None, (part.strip() for part in text.partition(":")[2].split(","))):
        key, _, value = (part.strip() for part in setting.partition("="))
        if key not in parameters or key in given:
            what = "is given twice" if key in given else "is no parameter of it"
            known = ", ".join(f"{item.name} [{item.unit}]" for item in parameters.values())
            raise BadInputError(f"effect {formula.id}: {key!r} {what} in {text!r}; it has: {known}")
        given.add(key)
        try:
            numbers[key] = float(value)
        except ValueError:
            numbers[key] = math.nan
        if not math.isfinite(numbers[key]):
            raise BadInputError(f"effect {formula.id}: {key} must be a number, not {value!r}")
    name = formula.coefficient.name
    if name not in numbers:
        raise BadInputError(
            f"effect {formula.id}: it needs {name} [{formula.coefficient.unit}]; write {formula.id}:{name}=NUMBER"
        )
    return numbers
