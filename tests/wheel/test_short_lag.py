"""A lag of next to nothing: the interval ends, where it leads without a lag."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from rw_ekf.model.friction import GAUSS, Stribeck
from rw_ekf.wheel import pieces as home
from rw_ekf.wheel.dispatch import lagged
from rw_ekf.wheel.interval import Interval, Pieces
from tests.filter.effect_replay import believed, in_use


@pytest.mark.parametrize("from_s", [0.0, 12345.678, 1.0e6])
@pytest.mark.parametrize("tau", [1.0e-9, 1.0e-12, 1.0e-16, 1.0e-20, 1.0e-300])
def test_a_lag_of_next_to_nothing_ends(tau: float, from_s: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps that rounding makes none were taken for ever: a daemon that believed such a lag hung."""
    effects = in_use("actuator_lag")
    table, belief = effects.table(), believed(effects)
    steps, ends = itertools.count(), []

    def counted(*given: Any) -> Any:
        assert next(steps) < 1000
        return lagged(*given)

    monkeypatch.setattr(home, "lagged", counted)
    for lag in (tau, 0.0):
        x, end, row = belief.mean.copy(), np.zeros(table.size), np.zeros(table.size)
        x[0], x[table.lag_at] = 10.0, lag
        pieces, interval = Pieces([from_s], [0.1], [0.05]), Interval(from_s, from_s + 0.1, 20.0, 0.0, 0, 0, 1)
        home.effect_interval(x, table, Stribeck(0.4, GAUSS), pieces, interval, False, row, end)
        ends.append(end[0])
    assert ends[0] == pytest.approx(ends[1], abs=1.0e-6)
