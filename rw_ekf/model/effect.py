"""What an effect is: its coefficients, its size, where it is sought, what is reported of it; and an effect in use."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple

from rw_ekf.model.law import Law
from rw_ekf.model.state import FrictionParameters

if TYPE_CHECKING:
    from rw_ekf.arrays import Float64Array

    Matrix = Sequence[Sequence[float]] | Float64Array

Shape = tuple[float, float, float]
NO_SHAPE: Shape = (0.0, 0.0, 0.0)
REFERENCE_DEGC = 20.0  # temperature effects are relative to this


class Coefficient(NamedTuple):
    """A number of an effect: its name, unit, bounds, what it means, and how a fit moves it where it is fitted."""

    name: str
    unit: str
    lower: float
    upper: float
    meaning: str
    step_share: float = 0.02  # of its size, by which it is moved for a slope
    reach_share: float = 0.5  # of its size, by which one step of a fit may move it
    step: float = 0.0  # in place of the share where the zero is arbitrary, as that of a time is
    reach: float = 0.0
    whole: bool = False  # a code
    optional: bool = False  # 0 where a model file lacks it

    def step_at(self, value: float) -> float:
        """By how much it is moved for a slope."""
        return self.step or self.step_share * abs(value)

    def reach_at(self, value: float) -> float:
        """As far as one step of a fit carries, where the slope still holds."""
        return self.reach or self.reach_share * abs(value)


@dataclass(frozen=True)
class RecordFacts:
    """What a log offers, for banks, bounds and practical sizes."""

    first_s: float
    last_s: float
    period_s: float
    top_speed_rad_s: float  # largest |speed|, spikes left out
    top_current_A: float
    friction: FrictionParameters  # of the base model
    stribeck_speed_rad_s: float
    stribeck_law: int
    speed_noise_rad_s: float
    reversals: int = 0
    slow_samples: int = 0  # at which the wheel turns within ten Stribeck speeds of rest
    temperature_range_K: float | None = None  # None: not logged
    angle: bool = False  # logged, or integrated where that is meaningful
    channels: frozenset[str] = field(default_factory=frozenset)
    timing_doubt_s: float = 0.0  # by which a reading may be older than its row says
    log_starts_s: tuple[float, ...] = ()  # of the second log and those after it, where several are diagnosed as one
    stribeck_is_open: bool = False  # nobody gave the base model's Stribeck speed
    reading_s: float = 0.0  # from one reading to the next, on average, where rows have none
    began_utc_s: float | None = None  # UTC of the first sample, since 1970; None: not known
    any_size: bool = False  # nothing is too small to be named: what is left without it is not noise

    @property
    def duration_s(self) -> float:
        """From the first sample to the last [s]."""
        return self.last_s - self.first_s


ActsAs = Literal["torque", "drag", "viscous drag", "motor torque"]


class Candidate(NamedTuple):
    """A place to start from: the coefficient's value and the shape constants."""

    amplitude: float
    shape: Shape = NO_SHAPE


class Effect(ABC):
    """One entry of the catalogue. Class attributes only: an effect in use is a `Term`."""

    id: ClassVar[str]
    equation: ClassVar[str]
    source: ClassVar[str]
    coefficient: ClassVar[Coefficient]
    constants: ClassVar[tuple[Coefficient, ...]] = ()  # shape constants, at most three, in the order of Shape
    needs: ClassVar[tuple[str, ...]] = ()  # channels that must be logged
    lacking: ClassVar[tuple[Callable[[RecordFacts], str | None], ...]] = ()  # what a log may lack to show it, and why
    excitation: ClassVar[str]  # what a log must contain for the effect to be seen, and the profile that has it
    confounded: ClassVar[dict[str, str]] = {}  # other ids it can be mistaken for -> what separates the two
    local_in_time: ClassVar[bool] = False  # sought on the whole record
    angular: ClassVar[bool] = False  # its first shape constant counts periods per turn: it is lost with the angle
    flow_kind: ClassVar[bool] = False  # replaces the flow itself: two of the kind cannot be in one model
    clocked: ClassVar[bool] = False  # periodic in time: its many frequencies are screened before they are scored
    refined: ClassVar[tuple[int, ...]] = ()  # shape constants that are fitted on from where the search found them
    of_one_record: ClassVar[bool] = False  # tied to the clock of the record it was found in
    linear: ClassVar[bool] = True  # contribution proportional to the coefficient where it is small: any start will do
    analytic: ClassVar[bool] = True  # the flow gives its slope
    in_state: ClassVar[bool] = True  # False: no filter can learn it sample by sample
    shown_against: ClassVar[str] = ""  # the quantity of the report's picture that it is a function of
    smooth_over_speed: ClassVar[bool] = False  # a drag that only the size of the speed decides, at all speeds
    acts_as: ClassVar[ActsAs] = "torque"  # what that function is: a torque, or a share of friction or drive
    components: ClassVar[int] = 1  # coefficients of one term
    repeats: ClassVar[bool] = False  # a model may have several terms of it, distinguished by the first shape constant

    @staticmethod
    @abstractmethod
    def smallest(facts: RecordFacts) -> float:
        """Smallest size of the coefficient that matters in practice, in its unit."""

    @staticmethod
    @abstractmethod
    def largest(facts: RecordFacts) -> float:
        """Largest size of the coefficient that is physically possible, in its unit."""

    @staticmethod
    def candidates(facts: RecordFacts) -> list[Candidate]:
        """Where to look: shape constants to try, with the coefficient's start (1.0 where the effect is linear)."""
        return [Candidate(1.0)]

    @staticmethod
    def shape_is_possible(shape: Shape, facts: RecordFacts) -> bool:
        """Whether shape constants that were fitted are ones a machine can have and the record can show."""
        return True

    @classmethod
    def matters(cls, terms: Sequence[Term], facts: RecordFacts) -> bool:
        """Whether all terms of the effect in a model are together large enough to matter in practice."""
        return size_of(terms) >= cls.smallest(facts)

    @classmethod
    def possible(cls, terms: Sequence[Term], facts: RecordFacts, coulomb: float) -> bool:
        """Whether they are of a size and shape that a machine can have; coulomb: of the model [rad/s^2]."""
        shaped = all(cls.shape_is_possible(term.shape, facts) for term in terms)
        return shaped and size_of(terms) <= cls.largest(facts)

    @staticmethod
    def component_shape(shape: Shape, component: int) -> Shape:
        """Shape constants with which a term's coefficient of this number enters."""
        return shape

    @staticmethod
    def nearby(candidate: Candidate, turn: int, facts: RecordFacts) -> list[Candidate]:
        """Places around one that was found, nearer with every turn from 0 on; of an event only."""
        return []

    @classmethod
    def starts(cls, candidate: Candidate, found: float) -> list[Candidate]:
        """Where fits of an effect that is not linear start: at the size that a regression found, and as tried."""
        return [candidate._replace(amplitude=found), candidate]

    @staticmethod
    def valleys(facts: RecordFacts) -> list[Candidate]:
        """Places to fit it from once it is chosen, of an effect whose likelihood has several valleys."""
        return []

    @classmethod
    def places(cls, facts: RecordFacts) -> float:
        """Number of independent places in which the effect is sought: neighbours go halves."""
        return max(0.5 * len(cls.candidates(facts)), 1.0)

    @classmethod
    def admits(cls, found: float) -> bool:
        """Whether the coefficient may have the sign that a regression found."""
        return cls.coefficient.lower <= found <= cls.coefficient.upper

    @staticmethod
    def lasts(shape: Shape) -> tuple[float, float]:
        """When an event begins [s] and its time constant [s]; called for what is local in time only."""
        raise NotImplementedError

    @classmethod
    def lasts_of(cls, term: Term) -> tuple[float, float]:
        """The same of a term."""
        return cls.lasts(term.shape)

    @staticmethod
    def may_leave(shape: Shape, facts: RecordFacts) -> tuple[str, ...]:
        """Quantities that the residual may still depend on, by nature of the effect, although it is in the model."""
        return ()

    @classmethod
    def untestable(cls, facts: RecordFacts) -> str | None:
        """Why this log cannot show the effect at all; None if it can."""
        missing = [name for name in cls.needs if name not in facts.channels]
        if missing:
            return f"needs {', '.join(missing)}, which is not logged"
        return next((why for lacks in cls.lacking if (why := lacks(facts)) is not None), None)

    @staticmethod
    @abstractmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """What was found, for a person, without the final stop: "Viscous friction falls 3.0 +- 0.1 % per K"."""

    @classmethod
    def amplitude(cls, values: Sequence[float], covariance: Matrix) -> tuple[float, float]:
        """What is reported of a term's coefficients: (size, std)."""
        return values[0], math.sqrt(max(float(covariance[0][0]), 0.0))

    @classmethod
    def described(cls, value: float, std: float, shape: Shape) -> dict[str, dict[str, float | str | None]]:
        """The parameters of the diagnosis document: {name: {"value", "std", "unit"}}; constants have std null."""
        found: dict[str, dict[str, float | str | None]] = {
            cls.coefficient.name: {"value": value, "std": std, "unit": cls.coefficient.unit}
        }
        for constant, number in zip(cls.constants, shape, strict=False):
            found[constant.name] = {"value": number, "std": None, "unit": constant.unit}
        return found

    @classmethod
    def parameters(
        cls, values: Sequence[float], covariance: Matrix, shape: Shape
    ) -> dict[str, dict[str, float | str | None]]:
        """`described` from all coefficients of a term and their covariance (m, m)."""
        return cls.described(*cls.amplitude(values, covariance), shape)

    @classmethod
    def parameters_of(cls, term: Term, covariance: Matrix) -> dict[str, dict[str, Any]]:
        """`parameters` of a term of this effect."""
        return cls.parameters(term.values, covariance, term.shape)

    @classmethod
    def sentence_of(cls, term: Term, covariance: Matrix, facts: RecordFacts) -> str:
        """`sentence` of a term of this effect."""
        return cls.sentence(*cls.amplitude(term.values, covariance), term.shape, facts)


@dataclass(frozen=True)
class Term:
    """An effect in use: its coefficients with their standard deviations, and its shape constants."""

    effect: type[Effect]
    values: tuple[float, ...]
    stds: tuple[float, ...]
    shape: Shape = NO_SHAPE
    settled: bool = False  # shape constants that were fitted elsewhere stay as they are
    law: Law | None = None  # of a learned law: what it is a function of, and its functions
    given: bool = field(default=False, compare=False)  # with the model a diagnosis began from, which found others

    @classmethod
    def of(cls, effect: type[Effect], shape: Shape = NO_SHAPE, value: float = 0.0, std: float = 0.0) -> Term:
        """A term with the same value and standard deviation in all its coefficients."""
        return cls(effect, (value,) * effect.components, (std,) * effect.components, shape)

    @classmethod
    def at(cls, effect: type[Effect], candidate: Candidate) -> Term:
        """One place to look, as a fit starts there: a linear effect from zero."""
        return cls.of(effect, candidate.shape, 0.0 if effect.linear else candidate.amplitude)

    @property
    def id(self) -> str:
        """The catalogue's id."""
        return self.effect.id

    @property
    def size(self) -> float:
        """Length of the coefficients: the amplitude of a sine and a cosine."""
        return math.hypot(*self.values)

    @property
    def goes_with_temperature(self) -> bool:
        """Whether it is a function of the temperature."""
        return "temperature_degC" in self.effect.needs or (self.law is not None and self.law.quantity == "temperature")

    @property
    def of_its_record(self) -> bool:
        """Whether it belongs to the clock of the record it was found in; a change may have come before another."""
        if self.law is None:
            return self.effect.of_one_record
        return self.law.quantity == "time" and (self.is_over or not self.effect.of_one_record)

    @property
    def is_over(self) -> bool:
        """Whether it has come and gone within the record it was found in: before and behind it there is nothing."""
        return self.law is not None and self.effect.of_one_record and all(f[-1] == 0.0 for f in self.law.functions)

    @property
    def refined(self) -> tuple[int, ...]:
        """Places of the shape constants that a fit moves with the rest: one that is 0, as Dahl's damping, is none."""
        return tuple(place for place in self.effect.refined if self.shape[place] != 0.0)

    def described(self, covariance: Matrix) -> dict[str, dict[str, Any]]:
        """The parameters of the diagnosis document, from the covariance (m, m) of the coefficients."""
        return self.effect.parameters_of(self, covariance)

    def sentence(self, covariance: Matrix, facts: RecordFacts) -> str:
        """What was found, for a person, without the final stop."""
        return self.effect.sentence_of(self, covariance, facts)


def size_of(terms: Sequence[Term]) -> float:
    """Length of all coefficients of terms of one effect together."""
    return math.hypot(*(value for term in terms for value in term.values))
