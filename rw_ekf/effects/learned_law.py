"""A law without a formula, of one quantity: found in the residual, proven like any other effect, read afterwards."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rw_ekf.effects.measures import STEADY_SHARE, dry_scale, largest_torque, top_drive, top_speed
from rw_ekf.model.effect import Candidate, Coefficient, RecordFacts, Shape, Term
from rw_ekf.model.effect_kinds import LawEffect
from rw_ekf.model.law import OF_SPEED, ActsAs, Law
from rw_ekf.numbers import plus_minus
from rw_ekf.units import rpm_from_rad_s

if TYPE_CHECKING:
    from rw_ekf.model.effect import Matrix


_SEEN = 3.0  # times the usual sigma: where a record hardly was, nothing is reported
WORDS: dict[ActsAs, str] = {
    "drag": "Drag",
    "torque": "A torque, whichever way the wheel turns,",
    "viscous_drag": "Viscous friction",
    "windage": "Drag by the square of the speed",
    "motor_gain": "The motor gain",
    "current_loss": "A loss of current",
}
QUANTITY_WORDS = {
    "speed": "the speed, either way round by itself",
    "speed_size": "the speed",
    "angle": "the angle",
    "current_along_motion": "the current along the motion",
    "current_size": "the size of the current",
    "temperature": "the temperature",
    "time": "the time",
}


def torque_per_unit(law: Law, facts: RecordFacts) -> float:
    """The torque per inertia [rad/s^2] that 1 of a law makes at the record's top speed or current."""
    if law.acts_as == "viscous_drag":
        return top_speed(facts)
    if law.acts_as == "windage":
        return top_speed(facts) ** 2
    if law.acts_as == "motor_gain":
        return top_drive(facts)
    if law.acts_as == "current_loss":
        return abs(facts.friction.motor_gain)
    return 1.0


def _plain(value: Any, unit: str | None = None) -> dict[str, Any]:
    return {"value": value, "std": None, "unit": unit}


def size_text(law: Law, value: float, std: float, facts: RecordFacts) -> str:
    """A value of a law as a share of what it adds to: +5.0 +- 0.1 % of Coulomb friction."""
    sign = "+" if value >= 0.0 else "-"
    if law.acts_as == "motor_gain":
        return f"{sign}{plus_minus(100.0 * abs(value), 100.0 * std)} %"
    if law.acts_as in {"drag", "torque"} and facts.friction.coulomb >= dry_scale(facts):
        share = 100.0 / facts.friction.coulomb
        return f"{sign}{plus_minus(share * abs(value), share * std)} % of Coulomb friction"
    return f"{sign}{plus_minus(abs(value), std)} {law.own_unit}"


def place_text(law: Law, knot: int) -> str:
    """Where a law has a knot."""
    at = float(law.knots[knot])
    if law.quantity in OF_SPEED:
        return f"at {at:.3g} rad/s ({rpm_from_rad_s(at):.3g} rpm)"
    return f"at {math.degrees(at):.0f} deg" if law.quantity == "angle" else f"at {at:.4g} {law.unit}".rstrip()


class LearnedLaw(LawEffect):
    """f(z) of one quantity z by its values on knots: a drag, a torque, a viscous drag or a change of the motor gain."""

    id = "learned_law"
    equation = "f = a g(z), g by its values on knots, straight between them and level beyond"
    source = "Gaussian-process regression: Rasmussen & Williams 2006, ch. 2 and 5.4.1"
    coefficient = Coefficient("amplitude", "1", -1.0e6, 1.0e6, "factor of the law as it was found")
    shown_against = "speed"  # where the quantity of a term's law is not queried
    excitation = "all values of the quantity, each at several speeds, both ways round: `rw-ekf excite identification`"

    @classmethod
    def torque(cls, term: Term, facts: RecordFacts) -> float:
        """Root of a law's mean square over its knots, as a torque per inertia [rad/s^2]."""
        assert term.law is not None
        values = term.law.values(term.values)
        return torque_per_unit(term.law, facts) * math.sqrt(float(values @ values) / values.size)

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """Half a percent of Coulomb friction."""
        return STEADY_SHARE * dry_scale(facts)

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """What the motor can just hold, or three times the friction."""
        return largest_torque(facts)

    @classmethod
    def matters(cls, terms: Sequence[Term], facts: RecordFacts) -> bool:
        """Whether one of them is large enough."""
        return any(cls.torque(term, facts) >= cls.smallest(facts) for term in terms)

    @classmethod
    def possible(cls, terms: Sequence[Term], facts: RecordFacts, coulomb: float) -> bool:
        """Whether none is larger than what a machine can have."""
        return all(cls.torque(term, facts) <= cls.largest(facts) for term in terms)

    @staticmethod
    def candidates(facts: RecordFacts) -> list[Candidate]:
        """None: laws are sought where no formula explains a record (`diagnosis/hypotheses/learned_laws`)."""
        return []

    @classmethod
    def untestable(cls, facts: RecordFacts) -> str | None:
        """Not among the effects that have a formula."""
        return "sought where no effect with a formula explains the record"

    @classmethod
    def parameters_of(cls, term: Term, covariance: Matrix) -> dict[str, dict[str, Any]]:
        """Quantity, kind, range, knots, values and their sigmas; of one that is carried its amplitude too."""
        assert term.law is not None
        law, std = term.law, term.law.std(covariance)
        known = law.spread or std
        own = {} if law.prior_std else super().parameters_of(term, covariance)
        return own | {
            "quantity": _plain(law.name), "kind": _plain(law.acts_as),
            "range": _plain([law.first, law.last], law.unit),
            "knots": _plain(law.knots.tolist(), law.unit),
            "values": {"value": law.values(term.values).tolist(), "std": list(map(float, known)), "unit": law.own_unit},
            "std": _plain(list(map(float, known)), law.own_unit),
        }  # fmt: skip

    @classmethod
    def sentence_of(cls, term: Term, covariance: Matrix, facts: RecordFacts) -> str:
        """What follows what, from its lowest to its highest."""
        assert term.law is not None
        law = term.law
        values, stds = law.values(term.values).tolist(), list(law.spread) or law.std(covariance).tolist()
        usual = sorted(stds)[len(stds) // 2]
        seen = [i for i, std in enumerate(stds) if std <= _SEEN * usual]
        low, high = min(seen, key=lambda i: float(values[i])), max(seen, key=lambda i: float(values[i]))
        ends = [f"{size_text(law, values[i], stds[i], facts)} {place_text(law, i)}" for i in (low, high)]
        return f"{WORDS[law.acts_as]} follows {QUANTITY_WORDS.get(law.quantity, law.column)}: {ends[0]}, {ends[1]}"

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """Of a law that is not at hand."""
        return "A law without a formula"
