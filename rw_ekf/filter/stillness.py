"""Where the speed hardly moves, the filter is linearised about a speed that noise does not move (math only, scalars).

An extended filter linearises about its own estimate, which follows the noise of the readings. At a constant speed
nothing else moves it, and what the filter then takes for viscous friction is the correlation of its errors with
themselves: within a day the parameters are wrong by dozens of their sigmas, and nothing in the innovations shows it
(docs/filter.md, "At a constant speed"). So where the speed has hardly moved for a minute or two, a reference that stays
where it is takes the estimate's place in the transition's derivatives, until the speed leaves the band around it.
"""

import math
from typing import Any

from rw_ekf.model.friction import CREEP_STRIBECK_SPEEDS
from rw_ekf.model.state import COULOMB, VISCOUS

# Places in the memory.
_ANCHOR = 0  # the speed is still while it stays within a band around it [rad/s]
_MOVED = 1  # how far the anchor was moved, of late [rad/s]
_REFERENCE = 2  # to linearise about [rad/s]
_IN_USE = 3  # 1 while it is
STILLNESS_SIZE = 4

_PER_LATE_S = 1.0 / 60.0  # one over the time constant of "of late"
_MEAN_S = 30.0  # and of the mean that the reference is before it is used
_NOISES = 5.0  # half the band, in noises of a reading ...
_WANDERINGS = 8.0  # ... and in what acceleration noise moves a speed in one second
_STILL = 2.0  # bands by which the anchor may have moved of late where the speed is still
_UNLEARNED = 30.0  # times the friction that a shift of the reference can hide
_MOVED_MOST = 10.0  # bands: a speed that has moved is still after ln(10/2) time constants at the latest


def dead_band(P: Any, speed_variance: float, acceleration_density: float) -> float:
    """Half the dead band [rad/s] within which neither the noise of readings nor torque noise is a motion.

    Zero where P (n, n) holds every parameter for known: nothing is learned, and there is no stillness.
    """
    spread = 0.0
    for j in range(1, P.shape[0]):
        spread += P[j, j]
    if spread == 0.0:
        return 0.0
    return _NOISES * math.sqrt(speed_variance) + _WANDERINGS * math.sqrt(acceleration_density)


def start_following(memory: Any, band: float) -> None:
    """Begin: nothing is known of how the speed moves."""
    memory[_MOVED] = _MOVED_MOST * band


def follow(memory: Any, speed: float, band: float, dt: float) -> float:
    """Note the believed speed [rad/s] of dt [s] later (of none where it was seeded from a reading).

    By how much the reference moved while it was in use [rad/s].
    """
    shift = 0.0
    moved = memory[_MOVED] * max(1.0 - dt * _PER_LATE_S, 0.0)
    off = abs(speed - memory[_ANCHOR])
    if off > band:
        if memory[_IN_USE] == 1.0:
            shift = speed - memory[_REFERENCE]
        memory[_ANCHOR] = memory[_REFERENCE] = speed
        moved += off
    elif moved >= _STILL * band:
        memory[_REFERENCE] += (speed - memory[_REFERENCE]) * dt / (dt + _MEAN_S)
    memory[_MOVED] = min(moved, _MOVED_MOST * band)
    return float(shift)


def unlearn_shift(P: Any, shift: float) -> None:
    """Let a reference that moves by `shift` [rad/s] teach nothing: Coulomb friction may have moved instead.

    What was learned about the old reference was, in the end, measured at the new one.
    """
    hidden = _UNLEARNED * shift
    P[COULOMB, COULOMB] += hidden * hidden * P[VISCOUS, VISCOUS]


def away_from_reference(memory: Any, speed: float, band: float, omega_s: float) -> float:
    """How far the believed speed is from the one to linearise about [rad/s]: zero where it is itself that one."""
    is_still = memory[_MOVED] < _STILL * band and abs(memory[_REFERENCE]) > CREEP_STRIBECK_SPEEDS * omega_s + band
    memory[_IN_USE] = 1.0 if is_still else 0.0
    return float(speed - memory[_REFERENCE]) if is_still else 0.0
