"""Which of two parts of a record is fitted for the held-out figures: the one whose knowledge carries further."""

from __future__ import annotations

import math

import numpy as np

from rw_ekf.diagnosis.checks.confirmation import for_want_of_knowledge
from rw_ekf.diagnosis.checks.heldout import by_fit_part
from rw_ekf.diagnosis.hypotheses.excitation import information
from rw_ekf.diagnosis.log_diagnosis import richer_part
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_effect_text import parse_effects
from rw_ekf.drivers.sim.plant_parameters import PlantNoise
from rw_ekf.model.state import CK13_STATISTICAL, PARAMETER_NAMES
from rw_ekf.units import RAD_S_PER_RPM
from tests.diagnosis.simulated import log_of

_BLOCK_S = 40.0


def test_a_part_without_a_break_away_is_not_the_one_that_is_fitted() -> None:
    """A wheel departs in every other block and speeds up and down in the rest, which can say more of most effects."""
    time_s = np.arange(4010) / 10.0
    within = time_s % _BLOCK_S
    held_A = CK13_STATISTICAL.coulomb / CK13_STATISTICAL.motor_gain
    departing = np.interp(
        within, [0.0, 13.0, 13.1, 17.0, 25.0, 25.1, _BLOCK_S], [-0.035, -0.035, 0.0, 0.0, 0.05, 0.1, 0.1]
    )
    turning = 1.05 * held_A + 0.1 * np.sin(2.0 * math.pi * within / 20.0) + 0.1 * np.sin(2.0 * math.pi * within / 5.0)
    current_A = np.where((time_s // _BLOCK_S) % 2 == 0, departing, turning)
    run = simulate_run(parse_effects([]), current_A, time_s, PlantNoise(RAD_S_PER_RPM, 0.0), seed=0)
    made = prepare(source_of([log_of(run)]), None, None, "blocks")
    assert made.split.fit[0], "the departures are in the part that is fitted at first"
    here, there = (information(made.base, part, made.facts) for part in (made.fit_part, made.heldout))
    assert sum(math.log(there[name] / here[name]) for name in here) > 0.0, "the other part says more of effects"

    chosen = richer_part(made)
    assert chosen.split.fit[0], "and yet it is not fitted"
    parts = (chosen, chosen.exchanged())
    static = PARAMETER_NAMES.index("static")
    sigmas = [by_fit_part(way, made.base).std[static] for way in parts]
    assert sigmas[0] < 0.2 * sigmas[1], "of the break-away friction"
    assert for_want_of_knowledge(parts[0], made.base) < 0.2 * for_want_of_knowledge(parts[1], made.base)
