"""The online estimator in memory of a fixed size: what `Estimator` does with samples and commands, and no more.

Scalars, named tuples and indexed arrays only, so that it is printed as C with the functions that it calls
(`printed_program`). Bit by bit the same as the estimator (tests/flight), but for a speed that is infinite, which is a
missing one here, and for arithmetic errors of Python, which are NaN here as in compiled code.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, by_identity
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.gating import MISSING, RESEEDED, UPDATED, timing
from rw_ekf.filter.health import (
    NOT_FINITE,
    NOTHING,
    WELL,
    is_beyond_mending,
    is_recovering,
    still_wrong,
)
from rw_ekf.filter.step import (
    CONTINUOUS,
    LEARNS,
    RESET,
    Memory,
    Sample,
    advance,
    innovation_of,
    look_after,
    memory_of,
    weigh,
)
from rw_ekf.model.moment import Columns
from rw_ekf.model.state import SPEED
from rw_ekf.wheel.effect_table import EffectTable
from rw_ekf.wheel.interval import UNREAD, Body, Interval, Pieces, last_known, warmed

Clock = float  # a time [s] that is kept in double precision whatever the rest is

PENDING_MOST = 8  # commands that wait to take force
PIECES_MOST = PENDING_MOST + 1  # of constant current in one interval
_LONGEST_S = 2.0  # between samples that follow one another

# Places in `Onboard.counts`.
SEEN = 0  # 1 once there was a sample
KNOWS = 1  # 1 once a command was issued
PENDING = 2  # commands that wait to take force
TROUBLE = 3  # what is wrong with the filter: 0, or a code of `health`
WAS_RESET = 4  # what was reset for that
HOPELESS = 5  # 1 where resetting does not help any more
BROKEN = 6  # 1 where the last sample did not follow the one before it: a compensation that remembers begins anew
_COUNTS = 7

# Places in `Onboard.now`.
IN_FORCE_A = 0  # current in force
DELAY_S = 1  # of the last command
TEMPERATURE_DEGC = 2
ANGLE_RAD = 3
COLUMN = 4  # and the two behind it: columns that learned laws are functions of
PREDICTED_RAD_S = 7  # speed before the last reading was weighed
READ_DEGC = 8  # temperature that was read last, which the one that acts follows
ACTED_DEGC = 9  # what acted then
SINCE_S = 10  # and how long ago that is
_NOW = 11

# Places in `Onboard.last_s`.
USED = 0  # time of the last sample that was used
REPORTED = 1  # and of the last that came


@by_identity
class Onboard(NamedTuple):
    """All that the estimator remembers."""

    x: Float64Array  # (n,) speed, motor gain, viscous, Coulomb, static friction, coefficients of effects
    P: Float64Array  # (n, n) their covariance
    memory: Memory
    last_s: Any  # (2,) time of the last sample that was used, and of the last that came
    now: Any  # (11,)
    counts: Any  # (7,)
    acts_s: Any  # (8,) when pending commands take force, in order of time
    pending_A: Any  # (8,)
    pieces: Pieces  # of the last interval


class Reading(NamedTuple):
    """What the wheel reports at a time; NaN for what is not known."""

    time_s: Clock
    speed_rad_s: float
    new_segment: bool  # another clock, whose time says nothing about the old one's
    temperature_degC: float
    angle_rad: float
    columns: Columns  # that laws of the model are functions of


class Taken(NamedTuple):
    """What became of a reading."""

    outcome: int  # 0 first, 1 updated, 2 missing, 3 gated, 4 repeated, 5 backward, 6 re-seeded
    trouble: int  # 0 well, 1 not finite, 2 not positive, 3 ran away, 4 diverged, 5 locked out, 6 unphysical
    was_reset: int  # 0 nothing, 1 speed, 2 parameters widened, 3 all afresh
    hopeless: bool  # resetting does not help any more
    predicted_rad_s: float  # speed before the reading was weighed
    innovation_rad_s: float  # reading less prediction; 0 where none was weighed
    innovation_variance: float  # [rad^2/s^2]; 1 where none was weighed


def onboard_of(
    mean: Float64Array, covariance: Float64Array, constants: FilterConstants, table: EffectTable | None
) -> Onboard:
    """What an estimator that starts from a belief x (n,), P (n, n) remembers."""
    x, P = np.array(mean, dtype=np.float64), np.array(covariance, dtype=np.float64)
    now = np.zeros(_NOW)
    now[COLUMN : PREDICTED_RAD_S + 1] = math.nan
    now[TEMPERATURE_DEGC], now[READ_DEGC], now[ACTED_DEGC], now[SINCE_S] = UNREAD
    return Onboard(
        x,
        P,
        memory_of(x, P, constants, table, mends=True),
        np.zeros(2),
        now,
        np.zeros(_COUNTS, dtype=np.int64),
        np.zeros(PENDING_MOST),
        np.zeros(PENDING_MOST),
        Pieces(np.zeros(PIECES_MOST), np.zeros(PIECES_MOST), np.zeros(PIECES_MOST)),
    )


def take_command(held: Onboard, current_A: float, delay_s: float) -> bool:
    """Note the current [A] that goes into force delay_s [s] after the last sample; without a call the old one holds.

    False, and nothing is noted, where one is no finite number, or where eight commands wait to take force already.
    """
    if not (math.isfinite(current_A) and math.isfinite(delay_s)):
        return False
    if held.counts[SEEN] == 0:
        return True
    late = max(delay_s, 0.0)
    acts = held.last_s[USED] + late
    count = held.counts[PENDING]
    for i in range(PENDING_MOST):
        if i < count and held.acts_s[i] >= acts:
            count = i
    if count >= PENDING_MOST:
        return False
    if held.counts[KNOWS] == 0:
        held.counts[KNOWS] = 1
        held.now[IN_FORCE_A] = current_A
    held.now[DELAY_S] = late
    held.acts_s[count] = acts
    held.pending_A[count] = current_A
    held.counts[PENDING] = count + 1
    return True


def lay_pieces(held: Onboard, pieces: Pieces, to_s: Clock, epoch_s: Clock) -> tuple[int, int]:
    """The pieces of current from the last sample to `to_s`: how many, and how many pending commands act until then.

    epoch_s: what the begins of pieces count from.
    """
    at = held.last_s[USED]
    begin = at
    current = held.now[IN_FORCE_A]
    waiting = held.counts[PENDING]
    used = 0
    found = 0
    for i in range(PENDING_MOST):
        if i >= waiting or held.acts_s[i] >= to_s:
            break
        acts = held.acts_s[i]
        if acts > at:
            pieces.begin_s[found] = begin - epoch_s
            pieces.duration_s[found] = acts - at
            pieces.current_A[found] = current
            begin += pieces.duration_s[found]
            at = acts
            found += 1
        current = held.pending_A[i]
        used += 1
    pieces.begin_s[found] = begin - epoch_s
    pieces.duration_s[found] = to_s - at
    pieces.current_A[found] = current
    return found + 1, used


def _gather(held: Onboard, to_s: Clock, epoch_s: Clock) -> int:
    """The pieces of current from the last sample to `to_s`, and how many; uses up the commands that acted."""
    found, used = lay_pieces(held, held.pieces, to_s, epoch_s)
    left = held.counts[PENDING] - used
    for i in range(PENDING_MOST):
        if i < left:
            held.acts_s[i] = held.acts_s[i + used]
            held.pending_A[i] = held.pending_A[i + used]
    held.counts[PENDING] = left
    held.counts[KNOWS] = 1  # none, where none was issued
    held.now[IN_FORCE_A] = held.pieces.current_A[found - 1]
    return found


def _note(held: Onboard, reading: Reading, mean_speed: float, dt: float, temperature_lag_s: float) -> None:
    """Note the conditions at a reading: as they are given, or the angle from the mean speed since the one before."""
    now = held.now
    turned = mean_speed * dt
    if math.isfinite(turned):
        now[ANGLE_RAD] += turned
    if math.isfinite(reading.angle_rad):
        now[ANGLE_RAD] = reading.angle_rad
    body = Body(now[TEMPERATURE_DEGC], now[READ_DEGC], now[ACTED_DEGC], now[SINCE_S])
    body = warmed(body, reading.temperature_degC, dt, temperature_lag_s)
    now[TEMPERATURE_DEGC] = body.acts
    now[READ_DEGC] = body.read
    now[ACTED_DEGC] = body.acted
    now[SINCE_S] = body.since_s
    columns = last_known((now[COLUMN], now[COLUMN + 1], now[COLUMN + 2]), reading.columns)
    now[COLUMN] = columns[0]
    now[COLUMN + 1] = columns[1]
    now[COLUMN + 2] = columns[2]


def _judge(held: Onboard, verdict: int) -> None:
    """Note how well the filter is: what was reset now, or what is wrong and stays."""
    memory, counts = held.memory, held.counts
    if memory.now[LEARNS] == 0.0:  # it holds everything for known: there is nothing to reset it to
        counts[TROUBLE] = WELL if math.isfinite(held.x[SPEED] + held.P[SPEED, SPEED]) else NOT_FINITE
        return
    trouble = verdict
    if verdict == WELL:
        if is_recovering(memory.health):
            return
        trouble = still_wrong(memory.health, held.x, held.P)
        if trouble == counts[TROUBLE]:
            return
    counts[TROUBLE] = trouble
    counts[WAS_RESET] = NOTHING
    if verdict != WELL:
        counts[WAS_RESET] = int(memory.now[RESET])
    counts[HOPELESS] = 1 if trouble != WELL and is_beyond_mending(memory.health) else 0


def _taken(held: Onboard, outcome: int, predicted: float, innovation: tuple[float, float]) -> Taken:
    counts = held.counts
    return Taken(
        outcome, counts[TROUBLE], counts[WAS_RESET], counts[HOPELESS] == 1, predicted, innovation[0], innovation[1]
    )


def take_reading(
    held: Onboard, constants: FilterConstants, table: EffectTable | None, reading: Reading, relative: bool
) -> Taken:
    """Bring the belief to a reading's time and weigh its speed; `Estimator.step`."""
    speed = math.nan if math.isinf(reading.speed_rad_s) else reading.speed_rad_s
    begins = held.counts[SEEN] == 0 or reading.new_segment
    last = reading.time_s - 1.0 if held.counts[SEEN] == 0 else held.last_s[USED]
    dt = float(reading.time_s - last)
    span = float(reading.time_s - held.last_s[REPORTED])
    held.counts[BROKEN] = 1 if begins or not 0.0 < span <= _LONGEST_S else 0
    held.last_s[REPORTED] = reading.time_s
    held.now[PREDICTED_RAD_S] = math.nan
    what = timing(dt, begins)
    if what != UPDATED:
        return _taken(held, what, math.nan, (0.0, 1.0))
    now = held.now
    from_s = 0.0
    to_s = 0.0
    count = 0
    if begins:
        held.counts[KNOWS] = 0
        held.counts[PENDING] = 0
        now[IN_FORCE_A] = 0.0
    else:
        # In single precision times within an interval count from its begin, else from where the clock does.
        epoch = last if relative else 0.0
        count = _gather(held, reading.time_s, epoch)
        from_s = float(last - epoch)
        to_s = float(reading.time_s - epoch)
    columns = (now[COLUMN], now[COLUMN + 1], now[COLUMN + 2])
    interval = Interval(from_s, to_s, now[TEMPERATURE_DEGC], now[ANGLE_RAD], 0, 0, count, columns)
    sample = Sample(dt, speed, begins, now[IN_FORCE_A])
    before = held.x[SPEED]
    what = advance(held.x, held.P, held.memory, constants, table, sample, held.pieces, interval)
    predicted = held.x[SPEED]
    now[PREDICTED_RAD_S] = predicted
    judged = (0.0, 1.0)
    if what == UPDATED:
        judged = innovation_of(held.x, held.P, constants, sample)
        what = weigh(held.x, held.P, held.memory, constants, table, sample)
    moved = 0.5 * (before + predicted) if held.memory.now[CONTINUOUS] == 1.0 else 0.0
    _note(held, reading, moved, dt, constants.temperature_lag_s)
    held.last_s[USED] = reading.time_s
    held.counts[SEEN] = 1
    verdict = look_after(held.x, held.P, held.memory, constants, table, sample, what, judged)
    if verdict != WELL:
        what = MISSING if math.isnan(speed) else RESEEDED
    _judge(held, verdict)
    return _taken(held, what, predicted, judged)


def sigma(held: Onboard, which: int) -> float:
    """Standard deviation of one of the states, by its place."""
    return math.sqrt(max(held.P[which, which], 0.0))
