"""The kinds of effects, by how they enter one piece of constant current.

An effect changes the terms of the drift within one piece (docs/effects.md eq. 1):

    drive = k (I + current) + external
    b -> b (1 + viscous_factor) + viscous
    c -> c + dry,  s -> s + dry,  with dry = c dry_factor + dry          so that s - c stays

Six contributions, linear or not in the effect's one coefficient (the filter's state); up to three shape constants stay
fixed in the filter. f > 0 slows a wheel that turns forward: external = -f. What is not linear in omega is linearised at
the piece's start, f(omega_0) + f'(omega_0) (omega - omega_0): over a sample the speed moves little.

The others enter otherwise, and derive from the classes below: another current (a lag), another time (a delay), readings
that are means over a window, friction with a memory, another Stribeck curve, another reading.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

from rw_ekf.model.effect import Effect, RecordFacts, Shape, Term
from rw_ekf.model.friction import FrictionCurve
from rw_ekf.model.law import ActsAs
from rw_ekf.model.moment import Moment

if TYPE_CHECKING:
    from rw_ekf.checking.effect_file import OwnFormula

# current [A], external [rad/s^2], viscous [1/s], viscous_factor [-], dry_factor [-], dry [rad/s^2]
Contribution = tuple[float, float, float, float, float, float]


class StaticEffect(Effect):
    """An effect that needs no memory: six contributions to a piece, and their slopes by the coefficient.

    a: coefficient; q: shape constants; at: speed and angle where the piece begins, the log's time in its middle, and
    how long it is. Scalar functions that import only `math`: they are compiled as they are.
    """

    @staticmethod
    @abstractmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """The six contributions."""

    @classmethod
    def slope(cls, a: float, q: Shape, at: Moment) -> Contribution:
        """Their derivatives by the coefficient; the contributions of a = 1 where they are proportional to it."""
        return cls.contribution(1.0, q, at)

    @classmethod
    def is_proportional(cls) -> bool:
        """Whether the contributions are proportional to the coefficient, so that `slope` is none of its own."""
        return "slope" not in {name for kind in cls.__mro__[: cls.__mro__.index(StaticEffect)] for name in vars(kind)}


class WanderingEffect(StaticEffect):
    """A friction that may follow a broken line in time, one use of the effect for each piece."""

    @staticmethod
    @abstractmethod
    def piece(from_s: float, to_s: float) -> Shape:
        """Shape constants of a slope from one time to another, level afterwards."""

    @staticmethod
    @abstractmethod
    def sentence_of_pieces(terms: Sequence[Term], rate: float, facts: RecordFacts) -> str:
        """What was found where pieces (m,) follow each other in time, drawn at a rate; without the final stop."""


class CurrentEffect(Effect):
    """The motor's current has a memory of its own: one hidden state [A]."""

    linear = False
    analytic = False
    shown_against = "current"

    @staticmethod
    @abstractmethod
    def lagged(a: float, q: Shape, state: float, current: float, duration: float) -> tuple[float, float]:
        """(mean current over the piece, state at its end) from the state at its start and the commanded current."""


class DelayEffect(Effect):
    """Commands act later than the log says, by the coefficient [s]: the pieces are read elsewhere in time."""

    linear = False
    analytic = False
    shown_against = "current"


class WindowEffect(Effect):
    """Readings are means of the speed over the coefficient [s] before their time, and so is the filter's speed."""

    linear = False
    analytic = False
    shown_against = "current"


class FrictionMemoryEffect(Effect):
    """Dry friction has a memory: one hidden state, the friction acceleration itself [rad/s^2], signed as omega is."""

    linear = False
    flow_kind = True
    shown_against = "low speed"
    acts_as = "drag"
    holds: ClassVar[bool] = False  # at rest the wheel is held and its friction is what holds it

    @staticmethod
    @abstractmethod
    def flow(
        omega: float, memory: float, drive: float, curve: FrictionCurve, a: float, q: Shape, duration: float
    ) -> tuple[float, float]:
        """(speed, friction) after `duration` under a constant drive; stands in for rw_ekf.model.flow.flow."""


class StribeckEffect(Effect):
    """Another Stribeck speed [rad/s], the coefficient, or another law, its first shape constant (a law code)."""

    linear = False
    analytic = False
    shown_against = "low speed"
    acts_as = "drag"

    @classmethod
    def admits(cls, found: float) -> bool:
        """A regression finds how far towards the speed tried the curve should go."""
        return found > 0.0


class ReadingEffect(Effect):
    """The reading, not the wheel: nothing enters the drift; the filter's speed variance grows by `variance`."""

    linear = False
    in_state = False

    @staticmethod
    @abstractmethod
    def variance(a: float) -> float:
        """Added variance of one reading [rad^2/s^2]."""


class FormulaEffect(StaticEffect):
    """An effect that a user wrote down: it enters by a program, as a learned law does, and is none of the compiled."""

    formula: ClassVar[OwnFormula]
    acts_by: ClassVar[ActsAs]  # drag, torque or motor_gain

    @classmethod
    @abstractmethod
    def program(cls, shape: Shape) -> tuple[float, ...]:
        """Its formula for a coefficient of 1, as `rw_ekf.model.formula_program` runs it."""


class LawEffect(Effect):
    """A law without a formula: every term has its own `law`, and enters as a static effect does."""

    repeats = True

    @classmethod
    def has_a_kind(cls, term: Term, facts: RecordFacts) -> bool:
        """Whether a record can show what it acts on: of what is over at once none can."""
        return True
