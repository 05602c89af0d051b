"""Coulomb friction that settles or wanders with running time: run-in, lubricant that finds its place."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate
from typing import ClassVar

from rw_ekf.effects.measures import STEADY_SHARE, dry_scale, moment, moves, of_coulomb
from rw_ekf.model.averages import phi_1
from rw_ekf.model.effect import Candidate, Coefficient, RecordFacts, Shape, Term
from rw_ekf.model.effect_kinds import Contribution, WanderingEffect
from rw_ekf.model.moment import Moment

_REPORTED_S = 100.0  # over which its walk is reported


class CoulombDrift(WanderingEffect):
    """f = sgn(omega) a tau [1 - exp(-(t - start)/tau)], for tau = 0 a straight line a (t - start); s by as much as c.

    A friction that wanders in no particular shape is a broken line: one column for each piece of it, a slope `a` from
    the start of the piece to its end, and nothing more after that.
    """

    id = "coulomb_drift"
    equation = "f = sgn(omega) a tau [1 - exp(-(t - start)/tau)]; a (t - start) for tau = 0, or for one piece of a line"
    source = "run-in of the race, lubricant that finds its place or starves"
    coefficient = Coefficient("rate_rad_s3", "rad/s^3", -1.0e6, 1.0e6, "rise of dry friction per second at the start")
    constants = (
        Coefficient("time_constant_s", "s", 0.0, 1.0e9, "tau, in which it settles; 0 for a straight line"),
        Coefficient("start_s", "s", -1.0e12, 1.0e12, "time of the log from which it counts; before it there is none"),
        Coefficient("piece_s", "s", 0.0, 1.0e9, "length of a piece of a broken line; 0 where it goes on"),
    )
    excitation = "the same motion early and late, for long enough: `rw-ekf excite P1`, repeated"
    shown_against = "time"
    acts_as = "drag"
    confounded: ClassVar[dict[str, str]] = {
        "coulomb_temperature": "a temperature that is cycled up and down within the record",
        "drag_spike": "a record well beyond both sides of the onset",
    }

    of_one_record = True
    refined = (0,)

    @staticmethod
    def smallest(facts: RecordFacts) -> float:
        """Half a percent of Coulomb friction over the record, as a straight line."""
        return STEADY_SHARE * dry_scale(facts) / max(facts.duration_s, 1.0e-9)

    @staticmethod
    def largest(facts: RecordFacts) -> float:
        """Three times dry friction within the record, as a straight line: run-in and lubricant halve or double it."""
        return 3.0 * dry_scale(facts) / max(facts.duration_s, 1.0e-9)

    @staticmethod
    def candidates(facts: RecordFacts) -> list[Candidate]:
        """A straight line, and settling within a tenth to the whole of the record; from the start of any log of it."""
        duration = facts.duration_s
        return [
            Candidate(1.0, (ratio * duration, start, 0.0))
            for start in (facts.first_s, *facts.log_starts_s)
            for ratio in (0.0, 0.1, 0.3, 1.0)
        ]

    @staticmethod
    def contribution(a: float, q: Shape, at: Moment) -> Contribution:
        """Dry friction in the middle of the piece; none before the start."""
        if q[2] > 0.0:
            return 0.0, 0.0, 0.0, 0.0, 0.0, a * min(max(at.time - q[1], 0.0), q[2])
        passed = max(at.time - q[1], 0.0)
        if q[0] <= 0.0:
            return 0.0, 0.0, 0.0, 0.0, 0.0, a * passed
        return 0.0, 0.0, 0.0, 0.0, 0.0, a * passed * phi_1(passed / q[0])

    @staticmethod
    def piece(from_s: float, to_s: float) -> Shape:
        """A slope from one time to another, level afterwards."""
        return 0.0, from_s, to_s - from_s

    @staticmethod
    def may_leave(shape: Shape, facts: RecordFacts) -> tuple[str, ...]:
        """A friction that wanders is followed only so far: whatever goes with time."""
        return ("time", "temperature") if shape[2] > 0.0 else ()

    @classmethod
    def matters(cls, terms: Sequence[Term], facts: RecordFacts) -> bool:
        """The largest change that they make within the record, whatever its shape."""
        changes = [term.values[0] * (term.shape[2] or facts.duration_s) for term in terms]
        return max(map(abs, accumulate(changes))) >= cls.smallest(facts) * facts.duration_s

    @classmethod
    def possible(cls, terms: Sequence[Term], facts: RecordFacts, coulomb: float) -> bool:
        """A change that run-in or lubricant can make; friction that falls never drives."""
        changes = list(accumulate(cls.change(term.values[0], term.shape, facts.last_s) for term in terms))
        return max(map(abs, changes)) <= cls.largest(facts) * facts.duration_s and min(changes) >= -coulomb

    @staticmethod
    def change(value: float, shape: Shape, until_s: float) -> float:
        """Change of dry friction up to a time [rad/s^2]."""
        tau, start, piece = shape
        passed = max(until_s - start, 0.0)
        if piece > 0.0:
            return value * min(passed, piece)
        return value * passed * (1.0 if tau <= 0.0 else phi_1(passed / tau))

    @staticmethod
    def sentence_of_pieces(terms: Sequence[Term], rate: float, facts: RecordFacts) -> str:
        """How fast it walks [rad/s^2 per sqrt(s)], its highest and its lowest, and when."""
        levels = [0.0, *accumulate(term.values[0] * term.shape[2] for term in terms)]
        times = [terms[0].shape[1], *(term.shape[1] + term.shape[2] for term in terms)]
        ends = [
            f"{of_coulomb(levels[i], 0.0, facts)} at {moment(times[i], facts)}"
            for i in map(levels.index, (min(levels), max(levels)))
        ]
        walked = of_coulomb(rate * math.sqrt(_REPORTED_S), 0.0, facts)
        return (
            f"Dry friction wanders with time, in no particular shape, by {walked} in {_REPORTED_S:.0f} s: in this "
            f"record to {ends[0]} and {ends[1]}, from where it began; the model holds that rate as process noise, by "
            "which a filter follows what nobody foretells"
        )

    @staticmethod
    def sentence(value: float, std: float, shape: Shape, facts: RecordFacts) -> str:
        """As the change over the record."""
        tau, start, piece = shape
        if piece > 0.0:
            change = of_coulomb(piece * abs(value), piece * std, facts)
            return f"Dry friction {moves(value)} by {change} from {start:.4g} to {start + piece:.4g} s"
        total = CoulombDrift.change(1.0, shape, facts.last_s)
        how = "steadily" if tau <= 0.0 else f"settling with a time constant of {tau:.3g} s"
        change = of_coulomb(total * abs(value), total * std, facts)
        return f"Dry friction {moves(value)} over the record by {change}, {how}"
