"""An hour of faults drawn at random, through the real serial driver, with the wheel as the witness."""

from __future__ import annotations

from pathlib import Path

import pytest
from tqdm import tqdm

from tools.measure.soak import Plan, allowed_rpm, soak


@pytest.mark.slow
def test_an_hour_of_random_faults(tmp_path: Path) -> None:
    """No stale reply used, no change of state without a fault, TRACKING in a second, the limit held, truth found."""
    with tqdm(disable=True) as bar:
        soaked = soak(Plan(hours=1.0, seed=3, gap_s=30.0), tmp_path, bar)
    seen, outcome, events = soaked.seen, soaked.outcome, soaked.reported.events
    assert len(seen.faults) > 80
    assert seen.used > 25_000
    assert seen.stale_used == 0
    assert seen.unexplained == []
    assert len(seen.back_s) > 5
    assert max(seen.back_s) <= 1.0
    assert max(seen.excess_rpm["told"], seen.excess_rpm["blind"]) <= allowed_rpm()
    assert outcome.unwritten.failed_sinks == {}
    assert events["sink_failed"] == events["not_written"] == 0
    truth = seen.server.plant.parameters
    for name in ("motor_gain", "coulomb"):
        error = getattr(outcome.belief.parameters, name) - getattr(truth, name)
        assert abs(error) < 4.0 * getattr(outcome.belief.parameter_std, name)
