"""Torque periodic in the wheel's angle: cogging, torque ripple of the commutation, imbalance under gravity."""

from __future__ import annotations

import math
from typing import ClassVar

from rw_ekf.effects.measures import SOUGHT_SHARE, dry_scale, largest_torque, of_coulomb, top_speed
from rw_ekf.effects.periodic import PeriodicEffect
from rw_ekf.model.averages import sinc
from rw_ekf.model.effect import Candidate, Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution
from rw_ekf.model.moment import Moment

# Orders of motors: every one up to 12, then slots, poles and their common multiples.
_ORDERS = (*range(1, 13), 14, 15, 18, 20, 21, 24, 27, 28, 30, 36, 42, 48, 54, 60, 72, 84, 96, 108, 120, 144, 168)
# A ripple is averaged away where it turns by pi within a sample. A record that passes through all speeds up to its
# top is slow enough for this share of its time at the least.
_SLOW_SHARE = 0.002
_LOST = 0.5  # rad in one sample: no ripple is followed whose phase an integrated angle loses so fast


class TorqueRipple(PeriodicEffect):
    """f = a sin(order angle + phase), averaged over the angle turned within the piece."""

    id = "torque_ripple"
    equation = "f = a sin(order angle + phase)"
    source = "cogging at the slots, commutation, imbalance under gravity"
    coefficient = Coefficient("amplitude_rad_s2", "rad/s^2", -1.0e6, 1.0e6, "amplitude of the sine")
    constants = (
        Coefficient("order", "-", 1.0e-3, 1.0e4, "periods per turn"),
        Coefficient("phase_rad", "rad", -2.0 * math.pi, 2.0 * math.pi, "phase at angle 0"),
    )
    excitation = "slow turning, less than half a ripple per sample, at several speeds: `rw-ekf excite identification`"
    shown_against = "angle"
    angular = True
    confounded: ClassVar[dict[str, str]] = {
        "external_torque": "several steady speeds: a ripple's frequency follows the speed"
    }

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """One percent of Coulomb friction."""
        return SOUGHT_SHARE * dry_scale(facts)

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """Ten times what may act steadily: cogging turns no wheel away, it may well be above friction and drive."""
        return 10.0 * largest_torque(facts)

    @staticmethod
    def candidates(facts: RecordFacts) -> list[Candidate]:
        """Every order that a sample does not average away for nearly the whole record."""
        turned = top_speed(facts) * facts.period_s * _SLOW_SHARE / math.pi
        if "angle_rad" not in facts.channels:
            turned = max(turned, facts.speed_noise_rad_s * facts.period_s / _LOST)
        return [Candidate(1.0, (float(order), 0.0, 0.0)) for order in _ORDERS if order * turned < 1.0]

    @classmethod
    def places(cls, facts: RecordFacts) -> float:
        """Every order: no two are neighbours."""
        return float(max(len(cls.candidates(facts)), 1))

    @staticmethod
    def may_leave(shape: Shape, facts: RecordFacts) -> tuple[str, ...]:
        """An angle that is integrated loses the phase whenever the wheel is fast or at rest."""
        return () if "angle_rad" in facts.channels else ("time", "temperature", "angle", "low speed")

    @classmethod
    def untestable(cls, facts: RecordFacts) -> str | None:
        """Without an angle, or always too fast for the sampling rate."""
        if not facts.angle:
            return "needs angle_rad, or sampling fast enough for the angle to be integrated"
        if not cls.candidates(facts):
            return "needs slower turning or faster sampling; a ripple is averaged away within a sample"
        return super().untestable(facts)

    @staticmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """External -f: the sine at the middle angle of the piece times sinc of half the phase turned."""
        half = 0.5 * q[0] * at.omega * at.duration
        return 0.0, -a * sinc(half) * math.sin(q[0] * at.angle + half + q[1]), 0.0, 0.0, 0.0, 0.0

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """As a share of Coulomb friction."""
        turn = "once per turn" if shape[0] == 1.0 else f"{shape[0]:g} times per turn"
        return f"A torque ripple of {of_coulomb(abs(value), std, facts)} repeats {turn}"
