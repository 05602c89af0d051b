"""Torque periodic in time: a structure that vibrates, a pump, a controller that hunts."""

from __future__ import annotations

import math
from typing import ClassVar

from rw_ekf.effects.measures import SOUGHT_SHARE, dry_scale, largest_torque, of_coulomb
from rw_ekf.effects.periodic import PeriodicEffect
from rw_ekf.model.averages import sinc
from rw_ekf.model.effect import Candidate, Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution
from rw_ekf.model.moment import Moment

_DENSE = 1200  # frequencies half a line's width apart: none between them is missed
_SPARSE = 300  # above these, evenly in their logarithm: a speed hardly follows a torque that fast anyhow
_LEAST_SAMPLES = 20.0


class ExternalTorque(PeriodicEffect):
    """f = a sin(2 pi frequency (t - reference) + phase), averaged over the piece.

    t is the log's time, which may count from 1970: without a reference near the record, frequency and phase could not
    be distinguished.
    """

    id = "external_torque"
    equation = "f = a sin(2 pi frequency (t - reference) + phase)"
    source = "vibration of the structure, a pump, a controller that hunts"
    coefficient = Coefficient("amplitude_rad_s2", "rad/s^2", -1.0e6, 1.0e6, "amplitude of the sine")
    constants = (
        Coefficient("frequency_Hz", "Hz", 0.0, 1.0e6, "periods per second", step_share=1.0e-4, reach_share=0.02),
        Coefficient("phase_rad", "rad", -2.0 * math.pi, 2.0 * math.pi, "phase at the reference"),
        Coefficient("reference_s", "s", -1.0e12, 1.0e12, "time of the log at which the phase counts"),
    )
    excitation = "several periods, at several speeds: `rw-ekf excite P2`"
    shown_against = "time"
    confounded: ClassVar[dict[str, str]] = {
        "torque_ripple": "several steady speeds: a ripple's frequency follows the speed"
    }

    clocked = True
    refined = (0,)

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """One percent of Coulomb friction."""
        return SOUGHT_SHARE * dry_scale(facts)

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """What the motor can just hold, or three times the friction: a wheel under more could not be driven at all."""
        return largest_torque(facts)

    @staticmethod
    def candidates(facts: RecordFacts) -> list[Candidate]:
        """From one and a half periods in the record to two readings a period, 1500 at most.

        Above, a line is an alias, and at the rate of the readings it is their own clock: neither is a torque.
        Harmonics of a current that repeats itself are among them: whether the torque says anything beside laws of the
        motion is tested for whatever has a clock.
        """
        if facts.duration_s < _LEAST_SAMPLES * max(facts.period_s, facts.reading_s):
            return []
        spacing, top = 0.5 / facts.duration_s, 0.5 / max(facts.period_s, facts.reading_s)
        count = min(_DENSE, math.floor(top / spacing) - 2)
        frequencies = [spacing * (3 + i) for i in range(count)]
        last = frequencies[-1]
        if count == _DENSE:
            ratio = top / last
            steps = min(_SPARSE, math.floor((top - last) / spacing))
            sparse = {round(last * ratio ** ((i + 1) / steps) / spacing) for i in range(steps)}
            frequencies += [spacing * multiple for multiple in sorted(sparse) if multiple > count + 2]
        return [Candidate(1.0, (frequency, 0.0, facts.first_s)) for frequency in frequencies]

    @classmethod
    def untestable(cls, facts: RecordFacts) -> str | None:
        """In a record of a few samples."""
        if facts.duration_s < _LEAST_SAMPLES * max(facts.period_s, facts.reading_s):
            return f"needs a record of {_LEAST_SAMPLES:g} samples or more"
        return super().untestable(facts)

    @staticmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """External -f: the sine in the middle of the piece times sinc of half the phase passed."""
        half = math.pi * q[0] * at.duration
        return 0.0, -a * sinc(half) * math.sin(2.0 * math.pi * q[0] * (at.time - q[2]) + q[1]), 0.0, 0.0, 0.0, 0.0

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """As a share of Coulomb friction, with frequency and period."""
        period = f", every {1.0 / shape[0]:.3g} s" if shape[0] > 0.0 else ""
        return f"A torque of {of_coulomb(abs(value), std, facts)} acts at {shape[0]:.4g} Hz{period}, whatever the speed"
