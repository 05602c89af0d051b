"""Rates and trends of random events: intervals that cover, a test that keeps its level and sees what there is."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.spikes.poisson import _irwin_hall, laplace_test, poisson_rate


@pytest.mark.parametrize(
    ("count", "low", "high"), [(0, 0.0, 3.689), (1, 0.0253, 5.572), (10, 4.795, 18.39), (100, 81.36, 121.6)]
)
def test_the_interval_is_garwood_s(count: int, low: float, high: float) -> None:
    """The exact 95 % interval of a Poisson mean, as printed in tables."""
    rate = poisson_rate(count, 2.0)
    assert (2 * rate.low, 2 * rate.high) == pytest.approx((low, high), rel=1e-3)
    assert rate.value == count / 2.0


def test_the_interval_covers() -> None:
    """Over 4000 counts of a mean of 6 the truth is inside in 95 % or more."""
    counts = np.random.default_rng(1).poisson(6.0, 4000)
    inside = [poisson_rate(int(count), 1.0).low <= 6.0 <= poisson_rate(int(count), 1.0).high for count in counts]
    assert np.mean(inside) >= 0.95


def test_nothing_watched_has_no_rate() -> None:
    """No exposure is a ValueError."""
    with pytest.raises(ValueError, match="exposure"):
        poisson_rate(0, 0.0)


@pytest.mark.parametrize("count", [3, 5, 12, 13, 40])
def test_a_homogeneous_process_is_called_a_trend_at_the_level_alone(count: int) -> None:
    """Of 4000 homogeneous processes 5 % are significant at 5 %, with few events (exact) and with many (normal)."""
    rng = np.random.default_rng(count)
    p = [laplace_test(sorted(rng.uniform(0.0, 1000.0, count)), 1000.0) for _ in range(4000)]
    share = np.mean([found is not None and found.p_value < 0.05 for found in p])
    assert share == pytest.approx(0.05, abs=4.0 * np.sqrt(0.05 * 0.95 / 4000))


@pytest.mark.parametrize("falls", [False, True])
def test_an_incidence_that_changes_is_seen(falls: bool) -> None:
    """A rate that rises (or falls) tenfold over the time watched: 40 events show it in nine of ten records."""
    rng = np.random.default_rng(2)
    seen = 0
    for _ in range(300):
        times = 1000.0 * np.log1p(9.0 * rng.uniform(size=40)) / np.log(10.0)  # density exp(t ln 10)
        found = laplace_test((1000.0 - times if falls else times).tolist(), 1000.0)
        assert found is not None
        seen += found.p_value < 0.05 and (found.statistic < 0.0) == falls
    assert seen > 270


def test_few_events_tell_nothing() -> None:
    """Two events are no evidence, and none is given."""
    assert laplace_test([1.0, 2.0], 10.0) is None


def test_the_exact_probability_meets_the_normal_one() -> None:
    """Of three uniform numbers the sum is below 1 with probability 1/6; of twelve, the normal value is near."""
    assert _irwin_hall(1.0, 3) == pytest.approx(1.0 / 6.0)
    assert _irwin_hall(4.0, 12) == pytest.approx(0.0228, abs=1e-3)
