"""Friction that jumps up and decays: lubricant thrown into the race, an "oil jog"."""

from __future__ import annotations

import math
from typing import ClassVar

from rw_ekf.effects.measures import SOUGHT_SHARE, dry_scale, moment, of_coulomb
from rw_ekf.model.averages import phi_1
from rw_ekf.model.effect import Candidate, Coefficient, RecordFacts, Shape
from rw_ekf.model.effect_kinds import Contribution, StaticEffect
from rw_ekf.model.moment import Moment

_DECAYS_S = (10.0, 60.0, 300.0, 3600.0)
_LEAST_SAMPLES = 10.0
_MOST_ONSETS, _LEAST_ONSETS = 300, 30
_NOTHING_LEFT = 300.0  # of an exponent: with less than 1e-308 a processor takes thirty times as long


class DragSpike(StaticEffect):
    """f = sgn(omega) a exp(-(t - onset)/decay) from the onset on, a mean over the piece; s by as much as c."""

    id = "drag_spike"
    equation = "f = sgn(omega) a exp(-(t - onset)/decay), t >= onset"
    source = "[L17 IV]"
    coefficient = Coefficient("amplitude_rad_s2", "rad/s^2", 0.0, 1.0e6, "dry friction added at the onset")
    constants = (
        Coefficient("onset_s", "s", -1.0e12, 1.0e12, "time of the log at which it begins", step=0.5, reach=5.0),
        Coefficient("decay_s", "s", 1.0e-3, 1.0e9, "time in which it falls to 37 %"),
    )
    excitation = "nothing but its own time: the record must go on, turning, before and after"
    shown_against = "time"
    acts_as = "drag"
    confounded: ClassVar[dict[str, str]] = {
        "coulomb_drift": "a record well beyond both sides of the onset",
        "coulomb_temperature": "a temperature that is cycled up and down within the record",
    }
    local_in_time = True
    refined = (0, 1)
    of_one_record = True

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """One percent of Coulomb friction."""
        return SOUGHT_SHARE * dry_scale(facts)

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """Five times dry friction: Cassini's jumped by 0.2 to 7 mNm [L17 IV], on wheels whose drag was a few mNm."""
        return 5.0 * dry_scale(facts)

    @staticmethod
    def candidates(facts: RecordFacts) -> list[Candidate]:
        """Onsets a tenth of the decay apart, 30 to 300 of them, for decays that the record can show."""
        finest, coarsest = max(2.0, facts.duration_s / _MOST_ONSETS), facts.duration_s / _LEAST_ONSETS
        decays = [decay for decay in _DECAYS_S if 0.5 * finest <= decay <= 10.0 * facts.duration_s] or [finest]
        found = []
        for decay in decays:
            step = min(max(finest, 0.1 * decay), max(coarsest, finest))
            count = math.ceil(facts.duration_s / step) - 1
            found += [Candidate(1.0, (facts.first_s + step * (i + 1), decay, 0.0)) for i in range(count)]
        return found

    @classmethod
    def places(cls, facts: RecordFacts) -> float:
        """Onsets a decay apart are independent; four decays or so are."""
        apart = [min(facts.duration_s / max(decay, 2.0), 300.0) for _, (_, decay, _) in cls.candidates(facts)]
        return 4.0 * max(sum(apart) / max(len(apart), 1), 1.0)

    @staticmethod
    def lasts(shape: Shape) -> tuple[float, float]:
        """Onset and decay."""
        return shape[0], shape[1]

    @staticmethod
    def shape_is_possible(shape: Shape, facts: RecordFacts) -> bool:
        """A decay of ten samples at least: [L17 IV] has minutes to hours, and in less there is no decay to be seen."""
        return shape[1] >= _LEAST_SAMPLES * facts.period_s

    @staticmethod
    def nearby(candidate: Candidate, turn: int, facts: RecordFacts) -> list[Candidate]:
        """Onsets and decays on either side: as far as the bank's next ones at first, 0.6 of that with every turn."""
        _, (onset, decay, _) = candidate
        share = 0.6**turn
        step = max(share * max(0.1 * decay, facts.duration_s / _LEAST_ONSETS), 0.25 * facts.period_s)
        factor = 1.0 + 1.4 * share
        return [
            Candidate(1.0, (onset + way * step, decay * factor**power, 0.0))
            for way in (-1.0, 0.0, 1.0)
            for power in (-1.0, 0.0, 1.0)
            if facts.first_s < onset + way * step < facts.last_s
        ]

    @classmethod
    def untestable(cls, facts: RecordFacts) -> str | None:
        """In a record that has no room for an onset."""
        return super().untestable(facts) or (None if cls.candidates(facts) else "needs a record longer than 2 s")

    @staticmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """Dry friction a times the mean of the decay over that part of the piece which is after the onset."""
        passed = at.time + 0.5 * at.duration - q[0]  # at the piece's end, since the onset
        if passed < 0.0:
            return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if at.duration <= 0.0:
            return 0.0, 0.0, 0.0, 0.0, 0.0, a * math.exp(-passed / q[1])
        inside = min(passed, at.duration)
        mean = phi_1(inside / q[1]) * inside / at.duration * math.exp(-min((passed - inside) / q[1], _NOTHING_LEFT))
        return 0.0, 0.0, 0.0, 0.0, 0.0, a * mean

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """As a share of Coulomb friction, with onset and decay."""
        return (
            f"Friction jumps up by {of_coulomb(value, std, facts)} at {moment(shape[0], facts)}"
            f" and decays with a time constant of {shape[1]:.3g} s"
        )
