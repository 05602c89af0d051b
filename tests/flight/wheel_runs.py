"""A wheel's motion by the propagation itself, without what is exported: the reference for every export of a wheel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.flight.plant_model import PlantModel, plant_model
from rw_ekf.model.effect import Term
from rw_ekf.model.law import Law
from rw_ekf.starting_point import FilterSetup
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet
from rw_ekf.wheel.interval import Interval, Pieces
from rw_ekf.wheel.momentary_friction import friction_of
from rw_ekf.wheel.pieces import Moment, effect_interval
from rw_ekf.wheel.window import lateness
from tests.filter.effect_replay import believed
from tools.measure.runs import constants_for

STEP_S = 0.1
COLUMN = (-1.0, 5.0, 2.5)  # of three columns; only the first is asked for, by `column_law`
_BEFORE_S = 10.0  # without a current, before the first one


@dataclass(frozen=True)
class Drive:
    """Currents (n,) and temperatures (n,), each over one step."""

    current_A: Float64Array
    temperature_degC: Float64Array


@dataclass(frozen=True)
class Motion:
    """What follows each step, (n,)."""

    speed_rad_s: Float64Array
    angle_rad: Float64Array
    friction_rad_s2: Float64Array


def wheel_model(effects: EffectSet = NO_EFFECTS, inertia_kg_m2: float | None = None) -> PlantModel:
    """The wheel of [CK13] with effects."""
    setup = FilterSetup(constants_for(), believed(effects), inertia_kg_m2, effects=effects, inertia_from="model")
    return plant_model(setup, "model.yaml", STEP_S)


def column_law() -> EffectSet:
    """A drag that is a function of a column of the log."""
    law = Law("column", "drag", -2.0, 2.0, ((0.01, 0.05, 0.02, 0.08, 0.03),), column="bus_voltage_V", slot=0)
    return EffectSet((Term(CATALOGUE["learned_law"], (1.0,), (0.3,), law=law),))


def rough_drive(n: int = 400, seed: int = 3) -> Drive:
    """Spin up, reversals, rest below break-away, break-away, coasting down to rest; held for one to nine steps."""
    rng = np.random.default_rng(seed)
    levels = np.array([0.12, -0.12, 0.0, 0.06, -0.06, 0.03, -0.03, 0.041, -0.041])  # break-away: 0.0397 A
    current = np.repeat(rng.choice(levels, n), rng.integers(1, 10, n))[:n]
    current[: n // 8] = 0.15
    current[n // 8 : n // 4] = -0.15
    return Drive(current, 20.0 + 5.0 * np.sin(0.011 * np.arange(n)))


def followed(model: PlantModel, drive: Drive, speed_rad_s: float = 0.0) -> Motion:
    """The motion, by `effect_interval` over all currents since the start."""
    n, table, stribeck = drive.current_A.size, model.table, model.stribeck
    time_s = STEP_S * np.arange(n)
    begins, durations, currents, piece_of = [-_BEFORE_S], [_BEFORE_S], [0.0], []
    for at, current in zip(time_s.tolist(), drive.current_A.tolist(), strict=True):
        if current != currents[-1]:
            begins.append(at)
            durations.append(0.0)
            currents.append(current)
        durations[-1] = at + STEP_S - begins[-1]
        piece_of.append(len(begins) - 1)
    pieces = Pieces(begins, durations, currents)
    x = model.x.tolist()
    x[0] = speed_rad_s
    angle, found = 0.0, np.zeros((n, 3))
    for i in range(n):
        begin, warm = float(time_s[i]), float(drive.temperature_degC[i])
        interval = Interval(begin, begin + STEP_S, warm, angle, 0, piece_of[i], piece_of[i] + 1, COLUMN)
        end = np.zeros(len(x))
        effect_interval(x, table, stribeck, pieces, interval, False, end, end)
        angle += 0.5 * (x[0] + float(end[0])) * STEP_S
        x = end.tolist()
        late = lateness(x, table)
        in_force = max(j for j in range(piece_of[i] + 1) if j == 0 or begins[j] <= begin + STEP_S - late)
        moment = Moment(x[0], currents[in_force], warm, angle, begin + STEP_S, 0.0, COLUMN)
        found[i] = x[0], angle, friction_of(x, table, stribeck, moment)
    return Motion(*found.T)
