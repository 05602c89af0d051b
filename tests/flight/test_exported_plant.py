"""The wheel in memory of a fixed size: past currents are forgotten when none needs them, and not before."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.flight import exported_plant
from rw_ekf.flight.exported_plant import Surroundings, begin, plant_of, turn
from rw_ekf.model.effect import Term
from rw_ekf.wheel.effect_table import EffectSet
from tests.flight.c_library import same_bits
from tests.flight.wheel_runs import COLUMN, STEP_S, followed, rough_drive, wheel_model


@pytest.mark.parametrize(("name", "value", "room"), [("transport_delay", 0.35, 6), ("speed_averaging", 0.43, 9)])
def test_a_past_that_is_full_is_used_anew(name: str, value: float, room: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """With room for a few currents alone, 200 changes of the current: the same bits as with all of them kept."""
    monkeypatch.setattr(exported_plant, "PAST_MOST", room)
    model = wheel_model(EffectSet((Term.of(CATALOGUE[name], value=value, std=value),)))
    drive = rough_drive(200)
    drive.current_A[:] += 1.0e-4 * np.arange(200)  # no two are the same
    held, speeds = plant_of(model.x, model.table), []
    begin(held, model.table, 0.0)
    for i, current in enumerate(drive.current_A.tolist()):
        held.now[exported_plant.TIME_S] = STEP_S * i
        assert turn(held, model.table, model.stribeck, Surroundings(current, 20.0, COLUMN), STEP_S)
        speeds.append(float(held.x[0]))
    assert same_bits(np.array(speeds), followed(model, drive).speed_rad_s)


def test_a_current_that_is_still_needed_is_not_forgotten(monkeypatch: pytest.MonkeyPatch) -> None:
    """One place too few: the step is refused, and nothing has moved."""
    monkeypatch.setattr(exported_plant, "PAST_MOST", 4)
    model = wheel_model(EffectSet((Term.of(CATALOGUE["transport_delay"], value=0.35, std=0.1),)))
    held = plant_of(model.x, model.table)
    begin(held, model.table, 0.0)
    done = []
    for i in range(5):
        before = held.x.copy(), held.now.copy()
        done.append(turn(held, model.table, model.stribeck, Surroundings(0.1 + 0.01 * i, 20.0, COLUMN), STEP_S))
        if not done[-1]:
            assert same_bits(held.x, before[0])
            assert same_bits(held.now, before[1])
    assert done == [True, True, True, False, False]
