"""A constant torque, whatever the direction of turning."""

from __future__ import annotations

from typing import ClassVar

from rw_ekf.effects.measures import dry_scale, lacks_reversal, largest_torque, of_coulomb
from rw_ekf.model.effect import Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution, StaticEffect
from rw_ekf.model.moment import Moment
from rw_ekf.numbers import plus_minus

_SMALLEST_SHARE = 0.003  # of dry friction


class OffsetTorque(StaticEffect):
    """f = a. No log can separate it from Coulomb friction c + a forward and c - a backward, or a current offset."""

    id = "offset_torque"
    equation = "f = a"
    source = "offset of the current amplifier, Coulomb friction unequal by direction, a steady torque from outside"
    coefficient = Coefficient("torque_rad_s2", "rad/s^2", -1.0e6, 1.0e6, "constant torque; above 0 slows forward")
    lacking = (lacks_reversal,)  # one way only, an offset is Coulomb friction
    excitation = "turning both ways: `rw-ekf excite P2`"
    shown_against = "speed"
    confounded: ClassVar[dict[str, str]] = {"viscous_asymmetry": "several speeds, fast and slow, in both directions"}

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """0.3 % of Coulomb friction: it acts all the time, and no other effect adds up as fast."""
        return _SMALLEST_SHARE * dry_scale(facts)

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """What the motor can just hold, or three times the friction: a wheel under more could not be driven at all."""
        return largest_torque(facts)

    @staticmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """External -a."""
        return 0.0, -a, 0.0, 0.0, 0.0, 0.0

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """All three readings of it, for no log decides between them."""
        hindered, helped = ("forward", "backward") if value > 0.0 else ("backward", "forward")
        text = (
            f"A constant torque of {of_coulomb(abs(value), std, facts)} slows {hindered} and helps {helped} motion; one"
            f" and the same as Coulomb friction higher {hindered} and lower {helped} by as much"
        )
        gain = facts.friction.motor_gain
        if gain <= 0.0 or facts.top_current_A <= 0.0:
            return text
        side = "below" if value > 0.0 else "above"
        return f"{text}, and as a current {plus_minus(1e3 * abs(value) / gain, 1e3 * std / gain)} mA {side} its command"
