"""An effect by a user's own formula, with all that a diagnosis needs of an effect of the catalogue."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Sequence
from typing import ClassVar

from rw_ekf.checking.effect_file import OwnFormula, Parameter
from rw_ekf.checking.formula import Node
from rw_ekf.effects.measures import (
    STEADY_SHARE,
    dry_scale,
    lacks_current,
    lacks_temperature,
    largest_torque,
    of_coulomb,
    temperature_range,
    top_drive,
    top_speed,
)
from rw_ekf.model.effect import REFERENCE_DEGC, ActsAs, Candidate, Coefficient, RecordFacts, Shape, Term
from rw_ekf.model.effect_kinds import Contribution, FormulaEffect
from rw_ekf.model.formula_program import AT_REST_RAD_S, formula_size, formula_value, program_of
from rw_ekf.model.law import DRAG, KINDS, law_contribution, motion
from rw_ekf.model.moment import Moment
from rw_ekf.numbers import number_text, plus_minus

_PLACES = {0: 1, 1: 12, 2: 7, 3: 5}  # tried of each constant, by how many there are
_STEP, _REACH = 0.005, 0.1  # of a range that has a zero: by which a constant is moved for a slope, and in one step
_AT_EDGE = 1.0e-3  # of a range
_POINTS = 9  # of each quantity, at which the size of a formula is evaluated
_BOUND = 1.0e9
_SHOWN = {"omega": "speed", "current": "current", "temperature": "temperature", "angle": "angle", "time": "time"}


class OwnEffect(FormulaEffect):
    """What effects by formulas share; `effect_of` makes one of each formula."""

    tree: ClassVar[Node]  # of a drag where the formula is that of a viscous friction

    @classmethod
    def program(cls, shape: Shape) -> tuple[float, ...]:
        """For a coefficient of 1."""
        return _program(cls, shape)

    @classmethod
    def torque(cls, shape: Shape, facts: RecordFacts) -> float:
        """The most that a coefficient of 1 is as a torque per inertia over the record [rad/s^2]; NaN: no value."""
        program = cls.program(shape)
        sizes = [abs(formula_value(program, 0, len(program), place)[0]) for place in _record_places(cls, facts)]
        scale = top_drive(facts) if cls.acts_by == "motor_gain" else 1.0
        return math.nan if any(map(math.isnan, sizes)) else max(scale * max(sizes), 1.0e-300)

    @classmethod
    def smallest(cls, facts: RecordFacts) -> float:
        """Half a percent of Coulomb friction where the formula says most for its size."""
        return STEADY_SHARE * dry_scale(facts) / max(_torques(cls, facts))

    @classmethod
    def largest(cls, facts: RecordFacts) -> float:
        """What the motor can just hold, or three times the friction, where it says least."""
        return largest_torque(facts) / min(_torques(cls, facts))

    @classmethod
    def matters(cls, terms: Sequence[Term], facts: RecordFacts) -> bool:
        """Half a percent of Coulomb friction somewhere in the record."""
        return any(abs(t.values[0]) * cls.torque(t.shape, facts) >= STEADY_SHARE * dry_scale(facts) for t in terms)

    @classmethod
    def possible(cls, terms: Sequence[Term], facts: RecordFacts, coulomb: float) -> bool:
        """What the motor can just hold, or three times the friction; and a value everywhere in the record."""
        return all(abs(t.values[0]) * cls.torque(t.shape, facts) <= largest_torque(facts) for t in terms)

    @classmethod
    def candidates(cls, facts: RecordFacts) -> list[Candidate]:
        """Places all over the ranges of its constants, and where they start."""
        count = _PLACES[len(cls.formula.constants)]
        grids = [_grid(item, count) for item in cls.formula.constants]
        starts = [item.start or 0.0 for item in cls.formula.constants]
        shapes = dict.fromkeys(_shape(numbers) for numbers in (starts, *itertools.product(*grids)))
        return [Candidate(1.0, shape) for shape in shapes]

    @classmethod
    def untestable(cls, facts: RecordFacts) -> str | None:
        """What is not logged or does not change; a formula that has no value somewhere in the record."""
        reason = super().untestable(facts)
        if reason is not None:
            return reason
        program = cls.program(cls.candidates(facts)[0].shape)
        for place in _record_places(cls, facts):
            if math.isnan(formula_value(program, 0, len(program), place)[0]):
                used = zip(_SHOWN, place, strict=False)
                where = ", ".join(f"{name} = {value:.3g}" for name, value in used if name in cls.formula.tree.names())
                return f"its formula has no value at {where or 'any place'}: mend it, or its start"
        return None

    @classmethod
    def contribution(cls, a: float, q: Shape, at: Moment) -> Contribution:
        """As the compiled filter has it."""
        program, kind, along = cls.program(q), KINDS.index(cls.acts_by), motion(at.omega, at.current)
        size, slope = formula_size(program, 0, len(program), along, kind == DRAG, at)
        return law_contribution(kind, a * size, a * slope, along, at.omega, at.current)

    @classmethod
    def sentence(cls, value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """The formula with its numbers, and how much it is at most."""
        formula, unit = cls.formula, cls.coefficient.unit
        numbers = [f"{formula.coefficient.name} = {plus_minus(value, std)}{'' if unit == '1' else f' {unit}'}"]
        numbers += [_constant_text(item, number) for item, number in zip(formula.constants, shape, strict=False)]
        torque = cls.torque(shape, facts)
        size = of_coulomb(abs(value) * torque, std * torque, facts)
        kind = formula.kind.replace("_", " ")
        return f"Your {formula.id} is there, {kind} = {formula.text} with {', '.join(numbers)}: up to {size}"


@functools.lru_cache(maxsize=256)
def effect_of(formula: OwnFormula) -> type[OwnEffect]:
    """The effect of a formula: one and the same class whenever it is requested."""
    tree, used = formula.tree, set(formula.tree.names())
    if formula.kind == "viscous":
        tree = Node("*", (tree, Node("name", name="omega")))
    acts: ActsAs = "torque" if formula.kind == "torque" else "motor torque" if formula.kind == "motor_gain" else "drag"
    if formula.kind == "viscous" and "omega" not in used:
        acts = "viscous drag"
    lacking: list[Callable[[RecordFacts], str | None]] = []
    lacking += [lacks_temperature] if "temperature" in used else []
    lacking += [lacks_current] if "current" in used or formula.kind == "motor_gain" else []
    limits = formula.coefficient
    bounds = (-_BOUND if limits.low is None else limits.low, _BOUND if limits.high is None else limits.high)
    return type(
        "".join(part.capitalize() for part in formula.id.split("_")),
        (OwnEffect,),
        {
            "__doc__": f"{formula.kind} = {formula.text}",
            "formula": formula,
            "tree": tree,
            "id": formula.id,
            "equation": f"{formula.kind} = {formula.text}",
            "source": "a formula of one's own",
            "coefficient": Coefficient(limits.name, limits.unit, *bounds, "to which the formula is proportional"),
            "constants": tuple(map(_constant, formula.constants)),
            "refined": tuple(range(len(formula.constants))),
            "acts_by": "drag" if formula.kind == "viscous" else formula.kind,
            "acts_as": acts,
            "shown_against": next((shown for name, shown in _SHOWN.items() if name in tree.names()), "speed"),
            "needs": (*(("temperature_degC",) if "temperature" in used else ()),
                      *(("angle_rad",) if "angle" in used else ())),
            "lacking": tuple(lacking),
            "of_one_record": "time" in used,
            "excitation": "all values of what the formula is a function of, both ways round: "
                          "`rw-ekf excite identification`",
        },
    )  # fmt: skip


def _constant(item: Parameter) -> Coefficient:
    low, high = float(item.low or 0.0), float(item.high or 0.0)
    found = Coefficient(item.name, item.unit, low, high, "a constant of the formula")
    return found if low > 0.0 else found._replace(step=_STEP * (high - low), reach=_REACH * (high - low))


def _grid(item: Parameter, count: int) -> list[float]:
    """Over its range: even in the logarithm where that is above zero; never 0 itself, which is no number to refine."""
    low, high = float(item.low or 0.0), float(item.high or 0.0)
    shares = [(i + 0.5) / count for i in range(count)]
    if low > 0.0:
        return [low * (high / low) ** share for share in shares]
    return [low + (high - low) * share or 1.0e-6 * (high - low) for share in shares]


def _shape(numbers: Sequence[float]) -> Shape:
    first, second, third = (*numbers, 0.0, 0.0, 0.0)[:3]
    return first, second, third


@functools.lru_cache(maxsize=4096)
def _program(effect: type[OwnEffect], shape: Shape) -> tuple[float, ...]:
    names = [item.name for item in effect.formula.constants]
    return program_of(effect.tree, {effect.formula.coefficient.name: 1.0, **dict(zip(names, shape, strict=False))})


@functools.lru_cache(maxsize=256)
def _torques(effect: type[OwnEffect], facts: RecordFacts) -> list[float]:
    """At every place where it is sought, as far as it has a value there."""
    found = [effect.torque(candidate.shape, facts) for candidate in effect.candidates(facts)]
    return [torque for torque in found if not math.isnan(torque)] or [1.0]


def _record_places(effect: type[OwnEffect], facts: RecordFacts) -> list[Moment]:
    """What the record has of each quantity in the formula."""
    used = set(effect.tree.names())

    def spread(name: str, low: float, high: float) -> list[float]:
        shares = [i / (_POINTS - 1) for i in range(_POINTS)]
        return [low + share * (high - low) for share in shares] if name in used else [low]

    speed, current, half = top_speed(facts), facts.top_current_A, 0.5 * temperature_range(facts)
    lowest = AT_REST_RAD_S if effect.acts_by == "drag" else -speed
    places = itertools.product(
        spread("omega", lowest, speed),
        spread("current", -current, current),
        spread("temperature", REFERENCE_DEGC - half, REFERENCE_DEGC + half),
        spread("angle", 0.0, 2.0 * math.pi),
        spread("time", facts.first_s, facts.last_s),
    )
    return [Moment(*place, 0.0) for place in places]


def _constant_text(item: Parameter, value: float) -> str:
    """A constant with its unit, and whether it lies where its range ends."""
    low, high = float(item.low or 0.0), float(item.high or 0.0)
    edge = _AT_EDGE * (high - low)
    at_edge = ", where its range ends" if value <= low + edge or value >= high - edge else ""
    return f"{item.name} = {number_text(value)}{'' if item.unit == '1' else f' {item.unit}'}{at_edge}"
