"""The wheel of a model in memory of a fixed size: what moves it, without a filter, for simulations.

Scalars, named tuples and indexed arrays only, so that it is printed as C with the functions that it calls
(`flight.plant_files`): the propagation that the estimator predicts with, and nothing else.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, by_identity
from rw_ekf.model.friction import Stribeck
from rw_ekf.model.moment import Columns, Moment
from rw_ekf.model.state import SPEED
from rw_ekf.wheel.effect_table import ABSENT, EffectTable
from rw_ekf.wheel.interval import Interval, Pieces
from rw_ekf.wheel.momentary_friction import friction_of
from rw_ekf.wheel.pieces import effect_interval
from rw_ekf.wheel.window import lateness

PAST_MOST = 4096  # currents that a delay or a window looks back at: 4 s at 1 kHz; 100 kB of memory

# Places in `Plant.now`.
TIME_S = 0
ANGLE_RAD = 1
_NOW = 2


@by_identity
class Plant(NamedTuple):
    """All that the wheel remembers."""

    x: Float64Array  # (n,) speed, motor gain, viscous, Coulomb, static friction, coefficients, hidden states
    end: Float64Array  # (n,) the same where a step ends
    now: Any  # (2,) time [s] and angle [rad]
    count: Any  # (1,) pieces of current that are remembered
    pieces: Pieces  # of the past, the last one in force


class Surroundings(NamedTuple):
    """What acts on the wheel over a step."""

    current_A: float  # commanded
    temperature_degC: float
    columns: Columns  # that laws of the model are functions of


def plant_of(x: Float64Array, table: EffectTable) -> Plant:
    """A wheel of a state x (n,), at time and angle 0."""
    looks_back = table.delay_at != ABSENT or table.window_at != ABSENT
    room = PAST_MOST if looks_back else 1
    state = np.array(x, dtype=np.float64)
    pieces = Pieces(np.zeros(room), np.zeros(room), np.zeros(room))
    return Plant(state, np.zeros(state.size), np.zeros(_NOW), np.zeros(1, dtype=np.int64), pieces)


def reach_s(x: Any, table: EffectTable) -> float:
    """How far back the currents matter [s]."""
    reach = lateness(x, table)
    if table.window_at >= 0:
        reach += max(x[table.window_at], 0.0)
    return reach


def begin(held: Plant, table: EffectTable, time_s: float) -> None:
    """Set the clock. Until now there was no current: what a delay or a window looks back at is 0."""
    reach = reach_s(held.x, table) + 1.0
    held.now[TIME_S] = time_s
    held.pieces.begin_s[0] = time_s - reach
    held.pieces.duration_s[0] = reach
    held.pieces.current_A[0] = 0.0
    held.count[0] = 1


def _forget(held: Plant, table: EffectTable, time_s: float) -> bool:
    """Make room for a piece of current. False where all of them still matter."""
    begins, durations, currents = held.pieces
    room = begins.shape[0]
    count = held.count[0]
    if count < room:
        return True
    horizon = time_s - reach_s(held.x, table)
    gone = 0
    for i in range(room):
        if begins[i] <= horizon:
            gone = i
    if room == 1:
        gone = 1
    if gone == 0:
        return False
    for i in range(room):
        if i + gone < count:
            begins[i] = begins[i + gone]
            durations[i] = durations[i + gone]
            currents[i] = currents[i + gone]
    held.count[0] = count - gone
    return True


def turn(held: Plant, table: EffectTable, stribeck: Stribeck, around: Surroundings, duration_s: float) -> bool:
    """Move the wheel on by `duration_s` [s] under one current.

    False, and nothing moves, where a delay or a window would have to remember more than `PAST_MOST` currents.
    """
    from_s = held.now[TIME_S]
    to_s = from_s + duration_s
    begins, durations, currents = held.pieces
    last = held.count[0] - 1
    if currents[last] == around.current_A:
        durations[last] = to_s - begins[last]
    else:
        if not _forget(held, table, from_s):
            return False
        last = held.count[0]
        begins[last] = from_s
        durations[last] = duration_s
        currents[last] = around.current_A
        held.count[0] = last + 1
    interval = Interval(from_s, to_s, around.temperature_degC, held.now[ANGLE_RAD], 0, last, last + 1, around.columns)
    before = held.x[SPEED]
    effect_interval(held.x, table, stribeck, held.pieces, interval, False, held.end, held.end)
    for i in range(table.size):
        held.x[i] = held.end[i]
    held.now[ANGLE_RAD] += 0.5 * (before + held.x[SPEED]) * duration_s
    held.now[TIME_S] = to_s
    return True


def friction_now(held: Plant, table: EffectTable, stribeck: Stribeck, around: Surroundings) -> float:
    """Friction per unit inertia [rad/s^2], all effects included; above zero it slows a wheel that turns forward.

    The current is the one in force: what is commanded, unless an effect has it late.
    """
    time_s = held.now[TIME_S]
    current = around.current_A
    late = lateness(held.x, table)
    if late > 0.0:
        begins, _, currents = held.pieces
        for i in range(begins.shape[0]):
            if i < held.count[0] and (i == 0 or begins[i] <= time_s - late):
                current = currents[i]
    moment = Moment(held.x[SPEED], current, around.temperature_degC, held.now[ANGLE_RAD], time_s, 0.0, around.columns)
    return friction_of(held.x, table, stribeck, moment)
