"""The search that tunes compensations finds a minimum in its box, within its budget, the same every time."""

from __future__ import annotations

import math
from collections.abc import Mapping

import pytest

from tools.measure.tune_schemes import searched

BOX = {"gain": (0.01, 100.0), "time_s": (0.1, 10.0), "share": (1.0, 4.0)}
LEAST = {"gain": 3.0, "time_s": 0.7, "share": 2.0}


def bowl(trial: Mapping[str, float], tried: list[Mapping[str, float]]) -> float:
    """A bowl in the logarithms, least at LEAST."""
    tried.append(trial)
    return sum(math.log(trial[name] / LEAST[name]) ** 2 for name in trial)


@pytest.mark.parametrize("names", [("gain",), ("gain", "time_s"), ("gain", "time_s", "share")])
def test_the_minimum_is_found_within_the_budget(names: tuple[str, ...]) -> None:
    """To a fifth of a factor of e in each parameter, with values of two digits, all of them in the box."""
    box, tried = {name: BOX[name] for name in names}, list[Mapping[str, float]]()
    best = searched(lambda trial: bowl(trial, tried), box, 60)
    assert len(tried) <= 62
    for name, (low, high) in box.items():
        assert best[name] == pytest.approx(LEAST[name], rel=0.2)
        assert best[name] == float(f"{best[name]:.2g}")
        assert all(0.99 * low <= trial[name] <= 1.01 * high for trial in tried)
    assert best == searched(lambda trial: bowl(trial, []), box, 60)
