"""One sample of the filter: predict, seed, gate, update, reset. The daemon's filter and the compiled pass both call it.

Scalars and indexed arrays only, so that what runs online in plain Python is compiled for a log as it stands. A belief
is x (n,) and P (n, n); `table` is None where the model has no effects (n = 5): compiled code then leaves that branch
out, for which each test of `table` stands alone. The equations are docs/filter.md eq. 4 to 10.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array, by_identity
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.covariance import (
    cap_variance,
    drop_settled,
    predict_covariance,
    predict_covariance_full,
    seed_speed,
    set_ceiling,
    update_joseph,
)
from rw_ekf.filter.gating import (
    FIRST,
    MEMORY_SIZE,
    MISSING,
    RESEEDED,
    UPDATED,
    doubt,
    elapse,
    forget,
    gating,
)
from rw_ekf.filter.health import (
    HEALTH_SIZE,
    NOTHING,
    WELL,
    Grounds,
    examine,
    lay_grounds,
    learns,
    mend,
    notice,
    start_health,
)
from rw_ekf.filter.stillness import (
    STILLNESS_SIZE,
    away_from_reference,
    dead_band,
    follow,
    start_following,
    unlearn_shift,
)
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, SPEED, STATE_SIZE, STATIC, VISCOUS
from rw_ekf.wheel.effect_table import EffectTable
from rw_ekf.wheel.effect_transition import effect_transition, seed_hidden
from rw_ekf.wheel.interval import Interval, Pieces
from rw_ekf.wheel.transition import transition

# Places in `Memory.now`.
SEEDED = 0  # 1 while the speed is known
EVER_SEEDED = 1  # 1 once it was
CONTINUOUS = 2  # 1 where the last sample was predicted from the one before
LEARNS = 3  # 1 where there are parameters to be learned, and so to be reset
BAND = 4  # half the dead band of stillness [rad/s]
RESET = 5  # what was reset at the last sample (`health`)
_NOW_SIZE = 6


class Sample(NamedTuple):
    """A reading, and what is known at its time."""

    dt_s: float  # since the sample before
    speed_rad_s: float  # NaN where there is none
    new_segment: bool  # another clock, whose time says nothing about the old one's
    current_A: float  # in force when it was read: hidden states begin there


@by_identity
class Memory(NamedTuple):
    """What a filter remembers from sample to sample beside its belief; arrays or lists, changed in place."""

    now: Any
    gate: Any
    stillness: Any
    health: Any
    grounds: Grounds
    noise: Float64Array  # (n,) diagonal of Q of the last prediction
    F: Float64Array  # (n, n) of the last prediction: the identity but for the rows of what moves
    factor: Float64Array  # (n + 2, n), with effects (3 n + 6, n): scratch
    product: Float64Array  # (n, n): scratch; its first row is the gain after an update


def memory_of(x: Any, P: Any, constants: FilterConstants, table: EffectTable | None, *, mends: bool) -> Memory:
    """What a filter that has seen no sample remembers. mends: whether one that breaks is reset."""
    n = x.size
    ceiling = np.zeros(n)
    set_ceiling(ceiling, P, constants, np.zeros(0) if table is None else table.drift)
    memory = Memory(
        np.zeros(_NOW_SIZE),
        np.zeros(MEMORY_SIZE),
        np.zeros(STILLNESS_SIZE),
        np.zeros(HEALTH_SIZE),
        lay_grounds(x, P, ceiling),
        np.zeros(n),
        np.eye(n),
        np.zeros((n + 2 if table is None else 3 * n + 6, n)),
        np.zeros((n, n)),
    )
    memory.now[LEARNS] = 1.0 if mends and learns(P) else 0.0
    memory.now[BAND] = dead_band(P, constants.speed_variance, constants.acceleration_density)
    start_following(memory.stillness, memory.now[BAND])
    start_health(memory.health)
    return memory


def is_continuous(memory: Memory, constants: FilterConstants, sample: Sample) -> bool:
    """Whether the belief can be predicted over the interval before a sample; else the speed starts afresh."""
    return memory.now[SEEDED] == 1.0 and not sample.new_segment and sample.dt_s <= constants.max_gap_s


def _grow(memory: Memory, constants: FilterConstants, table: EffectTable | None, dt: float) -> None:
    """Q of dt [s] for everything but the speed (docs/filter.md eq. 4)."""
    noise = memory.noise
    noise[MOTOR_GAIN] = constants.motor_gain_drift * dt
    noise[VISCOUS] = constants.viscous_drift * dt
    noise[COULOMB] = (constants.coulomb_drift + constants.dry_walk) * dt
    noise[STATIC] = (constants.static_drift + constants.dry_walk) * dt
    if table is not None:
        for j in range(table.drift.size):
            noise[STATE_SIZE + j] = table.drift[j] * dt


def _walk(P: Any, variance: float) -> None:
    """Coulomb and break-away friction walk as one: what Q has beside its diagonal."""
    P[COULOMB, STATIC] += variance
    P[STATIC, COULOMB] += variance


def predict(
    x: Any, P: Any, memory: Memory, constants: FilterConstants, table: EffectTable | None,
    sample: Sample, pieces: Pieces, interval: Interval,
) -> None:  # fmt: skip
    """Bring the belief over an interval under pieces of current (eq. 5 to 8)."""
    F, noise = memory.F, memory.noise
    row = F[SPEED]
    dt = sample.dt_s
    memory.now[CONTINUOUS] = 0.0
    _grow(memory, constants, table, dt)
    away = away_from_reference(memory.stillness, x[SPEED], memory.now[BAND], constants.stribeck.omega_s)
    x[SPEED] -= away
    hidden = 0
    if table is not None:
        hidden = table.hidden
        curvature = effect_transition(x, P, table, constants.stribeck, pieces, interval, F, memory.factor)
    else:
        x[SPEED], curvature = transition(
            x, P, constants.stribeck, pieces, interval.start, interval.stop, row, memory.factor
        )
    if away != 0.0:
        for j in range(x.size):
            x[j] += F[j, SPEED] * away
    noise[SPEED] = constants.acceleration_density * dt + curvature
    for m in range(hidden):
        noise[x.size - hidden + m] = memory.factor[x.size + 1, 1 + m]
    if x[SPEED] == 0.0:
        noise[SPEED] += constants.stuck_variance
    if hidden > 0:
        predict_covariance_full(P, F, noise, memory.product)
        drop_settled(P, hidden)
    else:
        predict_covariance(P, row, noise, memory.product[0], table)
    _walk(P, constants.dry_walk * dt)
    elapse(memory.gate, dt, pieces.current_A, interval.start, interval.stop)
    memory.now[CONTINUOUS] = 1.0


def interrupt(
    x: Any, P: Any, memory: Memory, constants: FilterConstants, table: EffectTable | None, sample: Sample
) -> None:
    """The speed is not followed up to a sample: the parameters wander on, and the speed waits for a reading."""
    has_speed = not math.isnan(sample.speed_rad_s)
    row = memory.F[SPEED]
    dt = 0.0 if sample.new_segment else sample.dt_s
    _grow(memory, constants, table, dt)
    for j in range(x.size):
        row[j] = 0.0
    row[SPEED] = 0.0 if has_speed else 1.0
    memory.noise[SPEED] = constants.speed_variance if has_speed else 0.0
    predict_covariance(P, row, memory.noise, memory.product[0], table)
    _walk(P, constants.dry_walk * dt)
    memory.now[SEEDED] = 0.0
    memory.now[CONTINUOUS] = 0.0


def seed(x: Any, P: Any, memory: Memory, constants: FilterConstants, table: EffectTable | None, sample: Sample) -> int:
    """Start speed and hidden states from a reading, or wait for one; the parameters and their covariance stay.

    FIRST, RESEEDED or MISSING.
    """
    has_speed = not math.isnan(sample.speed_rad_s)
    speed = sample.speed_rad_s if has_speed else 0.0
    again = memory.now[EVER_SEEDED] == 1.0
    seed_speed(x, P, speed, constants.speed_variance)
    if table is not None and table.hidden > 0:
        seed_hidden(x, P, table, sample.current_A, constants.stribeck.omega_s)
    forget(memory.gate)
    memory.now[SEEDED] = 0.0
    if not has_speed:
        return MISSING
    memory.now[SEEDED] = memory.now[EVER_SEEDED] = 1.0
    follow(memory.stillness, speed, memory.now[BAND], 0.0)
    return RESEEDED if again else FIRST


def advance(
    x: Any, P: Any, memory: Memory, constants: FilterConstants, table: EffectTable | None,
    sample: Sample, pieces: Pieces, interval: Interval,
) -> int:  # fmt: skip
    """Bring the belief to a sample's time, or start it there; UPDATED where a reading is then to be weighed."""
    if is_continuous(memory, constants, sample):
        predict(x, P, memory, constants, table, sample, pieces, interval)
        return MISSING if math.isnan(sample.speed_rad_s) else UPDATED
    interrupt(x, P, memory, constants, table, sample)
    return MISSING if math.isnan(sample.speed_rad_s) else seed(x, P, memory, constants, table, sample)


def innovation_of(x: Any, P: Any, constants: FilterConstants, sample: Sample) -> tuple[float, float]:
    """A reading less its prediction [rad/s], and the variance of that [rad^2/s^2] (eq. 9)."""
    return sample.speed_rad_s - x[SPEED], P[SPEED, SPEED] + constants.speed_variance


def weigh(x: Any, P: Any, memory: Memory, constants: FilterConstants, table: EffectTable | None, sample: Sample) -> int:
    """Update by a reading (eq. 10), refuse it, or start the speed from it: UPDATED, GATED or RESEEDED."""
    residual, S = innovation_of(x, P, constants, sample)
    R = constants.speed_variance
    what = gating(residual, S, sample.speed_rad_s, x, P, R, constants.gate, constants.reseed_after, memory.gate)
    if what == UPDATED:
        update_joseph(x, P, residual, S, R, memory.product[0], table)
    elif what == RESEEDED:
        seed(x, P, memory, constants, table, sample)
        doubt(memory.gate)
    return what


def look_after(
    x: Any, P: Any, memory: Memory, constants: FilterConstants, table: EffectTable | None, sample: Sample,
    what: int, innovation: tuple[float, float],
) -> int:  # fmt: skip
    """Examine the belief after a sample of outcome `what`, and reset what is broken: WELL, or what was (`health`).

    innovation: with its variance, or (0, 1) where there was none. A belief that was reset starts from the sample.
    """
    memory.now[RESET] = NOTHING
    residual, S = innovation
    elapsed = 0.0 if sample.new_segment else sample.dt_s
    verdict = WELL
    if memory.now[LEARNS] == 1.0 and notice(memory.health, x, P, what, residual, S, constants.gate, elapsed):
        cap_variance(P, memory.grounds.ceiling)
        verdict = examine(memory.health, x, P, memory.grounds, what)
    if verdict != WELL:
        memory.now[RESET] = mend(memory.health, verdict, x, P, memory.grounds)
        seed(x, P, memory, constants, table, sample)
    elif memory.now[CONTINUOUS] == 1.0:
        shift = follow(memory.stillness, x[SPEED], memory.now[BAND], elapsed)
        if shift != 0.0:
            unlearn_shift(P, shift)
    return verdict
