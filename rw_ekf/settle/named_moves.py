"""Motions made of a few moves that a person can name, and the current of each tick that makes them.

Currents come from the model's own inverse, so that a speed is turned to and held, and are kept within current and slew
as they are made. The speed in here is that of the four parameters alone, ticks apart; `predicted.py` predicts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.model.state import FrictionParameters
from rw_ekf.numbers import number_text
from rw_ekf.units import rpm_from_rad_s

Kind = Literal["turn", "push", "dither", "creep", "coast"]


@dataclass(frozen=True)
class Move:
    """One move: `turn` to a speed and hold it, `push` with a current, `dither` about a speed, `creep`, or `coast`."""

    kind: Kind
    seconds: float
    speed_rad_s: float = 0.0  # turn: held at the end
    current_A: float = 0.0  # turn: beyond what friction takes; push: itself; dither: amplitude; creep: from - to +
    period_s: float = 0.0  # dither

    def text(self) -> str:
        """What it does, for a person."""
        milliamperes = number_text(1e3 * self.current_A)
        if self.kind == "turn":
            speed = number_text(rpm_from_rad_s(self.speed_rad_s))
            return f"turn to {speed} rpm with {milliamperes} mA beyond friction, hold"
        if self.kind == "push":
            return f"{milliamperes} mA"
        if self.kind == "dither":
            return f"hold the speed, +-{milliamperes} mA at {number_text(1.0 / self.period_s)} Hz"
        if self.kind == "creep":
            return f"ramp from {number_text(-1e3 * self.current_A)} to {milliamperes} mA"
        return "coast, no current"


class Bounds(NamedTuple):
    """What every current of a motion keeps to."""

    current_A: float
    step_A: float  # from tick to tick
    speed_rad_s: float  # that a motion may aim at
    period_s: float
    ticks: int

    @property
    def seconds(self) -> float:
        """How long the motion is."""
        return self.ticks * self.period_s


def currents(moves: Sequence[Move], base: FrictionParameters, bounds: Bounds) -> Float64Array:
    """Current of each tick [A], (ticks,), of moves from rest; what they leave of the time is zero."""
    found = np.zeros(bounds.ticks)
    last, speed, at = 0.0, 0.0, 0
    for move in moves:
        began = speed
        for tick in range(max(round(move.seconds / bounds.period_s), 1)):
            if at >= bounds.ticks:
                return found
            wanted = _wanted(move, tick * bounds.period_s, speed, began, base, bounds)
            current = min(max(wanted, -bounds.current_A), bounds.current_A)
            current = min(max(current, last - bounds.step_A), last + bounds.step_A)
            found[at] = last = current
            speed = _next(speed, current, base, bounds.period_s)
            at += 1
    return found


def _wanted(
    move: Move, elapsed_s: float, speed: float, began: float, base: FrictionParameters, bounds: Bounds
) -> float:
    """Current that a move requests, at a time since it began [s] and a speed [rad/s]."""
    if move.kind == "coast":
        return 0.0
    if move.kind == "creep":
        return move.current_A * (2.0 * elapsed_s / move.seconds - 1.0)
    if move.kind == "push":
        outward = abs(speed) >= bounds.speed_rad_s and move.current_A * speed > 0.0
        return _friction_A(speed, base) if outward else move.current_A
    if move.kind == "dither":
        side = 1.0 if elapsed_s % move.period_s < 0.5 * move.period_s else -1.0
        return _friction_A(began, base) + side * move.current_A
    aim = min(max(move.speed_rad_s, -bounds.speed_rad_s), bounds.speed_rad_s)
    missing = aim - speed
    reached = abs(base.motor_gain * move.current_A) * bounds.period_s
    if abs(missing) <= reached:
        return _friction_A(aim, base) + missing / (max(base.motor_gain, 1.0e-9) * bounds.period_s)
    return _friction_A(speed if speed != 0.0 else missing, base) + math.copysign(move.current_A, missing)


def _friction_A(speed: float, base: FrictionParameters) -> float:
    """Current that holds a speed."""
    dry = math.copysign(base.coulomb, speed) if speed != 0.0 else 0.0
    return (base.viscous * speed + dry) / max(base.motor_gain, 1.0e-9)


def _next(speed: float, current_A: float, base: FrictionParameters, period_s: float) -> float:
    """Speed a tick later; a wheel that comes to rest stays there for the rest of the tick."""
    drive = base.motor_gain * current_A
    if speed == 0.0:
        if abs(drive) <= base.static:
            return 0.0
        return (drive - math.copysign(base.coulomb, drive)) * period_s
    following = speed + (drive - base.viscous * speed - math.copysign(base.coulomb, speed)) * period_s
    return 0.0 if following * speed < 0.0 and abs(drive) <= base.static else following


def draw_move(draws: np.random.Generator, base: FrictionParameters, bounds: Bounds) -> Move:
    """A move at random: speeds and currents spread over decades."""
    kind: Kind = draws.choice(np.array(["turn", "push", "dither", "creep", "coast"]), p=[0.4, 0.22, 0.13, 0.1, 0.15])
    side = 1.0 if draws.random() < 0.5 else -1.0
    friction_A = min(base.coulomb / max(base.motor_gain, 1.0e-9), bounds.current_A)
    if kind == "turn":
        speed = side * _spread(draws, 0.002 * bounds.speed_rad_s, bounds.speed_rad_s)
        return Move("turn", _spread(draws, 2.0, 30.0), speed, _spread(draws, 0.1 * friction_A, bounds.current_A))
    if kind == "push":
        return Move("push", _spread(draws, 0.3, 10.0), 0.0, side * _spread(draws, 0.3 * friction_A, bounds.current_A))
    if kind == "dither":
        ticks = 2.0 * round(_spread(draws, 1.0, 20.0))
        amplitude = _spread(draws, 0.2 * friction_A, bounds.current_A)
        return Move("dither", _spread(draws, 3.0, 15.0), 0.0, amplitude, ticks * bounds.period_s)
    if kind == "creep":
        return Move("creep", _spread(draws, 6.0, 40.0), 0.0, side * friction_A * draws.uniform(1.0, 2.0))
    return Move("coast", _spread(draws, 2.0, 30.0))


def _spread(draws: np.random.Generator, low: float, high: float) -> float:
    """A number between two, evenly in its logarithm."""
    return float(math.exp(draws.uniform(math.log(low), math.log(max(high, low)))))
