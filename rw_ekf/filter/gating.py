"""What becomes of a sample: the rules that the online estimator and the compiled pass share (math only, scalars).

A reading beyond the gate teaches nothing. The speed starts afresh from such readings only where they agree with each
other and with what a wheel can do in that time (docs/filter.md, "Gate and re-seeding"); what is needed to know that
stands in a short vector, the gate's memory, that both paths hand from sample to sample.
"""

import math
from typing import Any

from rw_ekf.model.state import COULOMB, MOTOR_GAIN, SPEED, STATIC, VISCOUS

FIRST = 0
UPDATED = 1
MISSING = 2
GATED = 3
REPEATED = 4
BACKWARD = 5
RESEEDED = 6

# Places in the gate's memory.
_SINCE_USED_S = 0  # since the last reading that was used, or seeded from
_CONFIRMED = 1  # 1 where the speed was confirmed since it was seeded; below zero: so many readings short of it
_STRONGEST_A = 2  # largest current so far
_AGREEING = 3  # how many of the last gated readings follow one from the other
_AGREEING_S = 4  # from the first to the last of them
_SINCE_GATED_S = 5  # since the last gated one
_LAST_GATED = 6  # [rad/s]
_VARIED = 7  # 1 where the agreeing ones are not all the very same number
_REACHABLE = 8  # 1 where a wheel can have come from the filter's speed to the first of them
MEMORY_SIZE = 9

_GENEROUS = 5.0  # times the acceleration that the model can give: a drag spike, a lurch, a gain that is far off
_PARAMETER_SIGMAS = 3.0
_TWITCH_S = 0.1  # at high rates the noise, not the wheel, decides how far apart two readings are
_CONFIRMATION = 20.0  # readings that confirm a speed that gated ones gave; of any other seed it takes one
_FAR_LONGER = 20  # times as many readings must agree after a step that no wheel can take, ...
_FAR_LONGER_S = 10.0  # ... and for so long


def timing(dt: float, new_segment: bool) -> int:
    """UPDATED where a sample dt [s] after the last is one to predict to; else REPEATED or BACKWARD, and left alone.

    dt is not finite where a time is none.
    """
    if not math.isfinite(dt):
        return BACKWARD
    if new_segment or dt > 0.0:
        return UPDATED
    return REPEATED if dt == 0.0 else BACKWARD


def forget(memory: Any) -> None:
    """Begin the gate's memory anew: the speed has just been seeded. The largest current stays known."""
    strongest = memory[_STRONGEST_A]
    for i in range(MEMORY_SIZE):
        memory[i] = 0.0
    memory[_STRONGEST_A] = strongest


def doubt(memory: Any) -> None:
    """The speed has been seeded by readings that were gated: they may have been the wild ones."""
    forget(memory)
    memory[_CONFIRMED] = 1.0 - _CONFIRMATION


def elapse(memory: Any, dt: float, currents: Any, start: int, stop: int) -> None:
    """Note an interval of `dt` [s] that the filter predicted over, under the currents [A] from start to stop."""
    memory[_SINCE_USED_S] += dt
    memory[_SINCE_GATED_S] += dt
    for i in range(start, stop):
        memory[_STRONGEST_A] = max(memory[_STRONGEST_A], abs(currents[i]))


def most_acceleration(x: Any, P: Any, strongest_A: float, speed: float) -> float:
    """Largest acceleration [rad/s^2] that a wheel with the belief x (n,), P (n, n) can have up to `speed` [rad/s].

    Drive and friction at three sigma of their parameters, both ways, times a generous factor.
    """
    gain = abs(x[MOTOR_GAIN]) + _PARAMETER_SIGMAS * math.sqrt(P[MOTOR_GAIN, MOTOR_GAIN])
    viscous = abs(x[VISCOUS]) + _PARAMETER_SIGMAS * math.sqrt(P[VISCOUS, VISCOUS])
    coulomb = abs(x[COULOMB]) + _PARAMETER_SIGMAS * math.sqrt(P[COULOMB, COULOMB])
    static = abs(x[STATIC]) + _PARAMETER_SIGMAS * math.sqrt(P[STATIC, STATIC])
    return float(_GENEROUS * (gain * strongest_A + viscous * abs(speed) + max(coulomb, static)))


def within_reach(change: float, variance: float, gate: float, acceleration: float, dt: float) -> bool:
    """Whether a speed can change so much in dt [s]; variance [rad^2/s^2] of the difference by noise alone."""
    return abs(change) <= math.sqrt(gate * variance) + acceleration * max(dt, _TWITCH_S)


def gating(
    innovation: float,
    variance: float,
    reading: float,
    x: Any,
    P: Any,
    speed_variance: float,
    gate: float,
    reseed_after: int,
    memory: Any,
) -> int:
    """UPDATED within the gate; GATED beyond it; or RESEEDED where the gated readings show that the filter is wrong.

    They do where `reseed_after` running, this the last, follow one from the other as a wheel's speeds can, the first
    of them can be reached from the filter's own speed, and they are not one number repeated (a wheel at rest may
    repeat itself). After a step that no wheel can take it needs twenty times as many, over ten seconds.
    """
    if innovation * innovation <= gate * variance:
        confirmed = memory[_CONFIRMED]
        forget(memory)
        memory[_CONFIRMED] = min(confirmed, 0.0) + 1.0
        return UPDATED
    acceleration = most_acceleration(x, P, memory[_STRONGEST_A], max(abs(x[SPEED]), abs(reading)))
    change = reading - memory[_LAST_GATED]
    if memory[_AGREEING] > 0.0 and within_reach(
        change, 2.0 * speed_variance, gate, acceleration, memory[_SINCE_GATED_S]
    ):
        memory[_AGREEING] += 1.0
        memory[_AGREEING_S] += memory[_SINCE_GATED_S]
        if change != 0.0:
            memory[_VARIED] = 1.0
    else:
        memory[_AGREEING] = 1.0
        memory[_AGREEING_S] = 0.0
        memory[_VARIED] = 0.0
        # A speed that nothing has confirmed since it was seeded may itself have been the wild one.
        reached = within_reach(innovation, variance, gate, acceleration, memory[_SINCE_USED_S])
        memory[_REACHABLE] = 1.0 if reached or memory[_CONFIRMED] <= 0.0 else 0.0
    memory[_SINCE_GATED_S] = 0.0
    memory[_LAST_GATED] = reading
    at_rest = reading * reading <= gate * speed_variance
    if memory[_VARIED] == 0.0 and not at_rest:
        return GATED
    if memory[_REACHABLE] == 1.0:
        return RESEEDED if memory[_AGREEING] >= reseed_after else GATED
    enough = memory[_AGREEING] >= _FAR_LONGER * reseed_after and memory[_AGREEING_S] >= _FAR_LONGER_S
    return RESEEDED if enough else GATED
