"""The tests of the residual: how often they cry wolf, and that they cry when they should."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.filter.consistency import FALSE_ALARM, consistency_of, skewed_tail
from rw_ekf.filter.tails import chi_square_tail


def verdict(z: Float64Array) -> bool | None:
    return consistency_of(z, np.ones(z.size), np.ones(z.size, dtype=bool)).is_noise


def test_white_noise_is_called_noise() -> None:
    """Of 2000 honest residuals at most 8 are accused (2 expected at one in a thousand)."""
    rng = np.random.default_rng(1)
    assert pytest.approx(1e-3) == FALSE_ALARM
    assert sum(verdict(rng.standard_normal(600)) is False for _ in range(2000)) <= 8


def test_the_scale_of_the_noise_alone_accuses_nobody() -> None:
    """Residuals three times too large are still noise; the ratio is reported for what it is."""
    z = 3.0 * np.random.default_rng(2).standard_normal(2000)
    found = consistency_of(z, np.ones(2000), np.ones(2000, dtype=bool))
    assert found.is_noise
    assert found.noise_ratio == pytest.approx(3.0, rel=0.05)
    assert any("larger" in sentence for sentence in found.warnings())


def test_a_mean_is_seen() -> None:
    """A bias of a fifth of a sigma over 2000 samples is structure, and the sentence says so."""
    z = 0.2 + np.random.default_rng(3).standard_normal(2000)
    found = consistency_of(z, np.ones(2000), np.ones(2000, dtype=bool))
    assert found.is_noise is False
    assert "mean" in found.warnings()[0]


def test_correlation_is_seen() -> None:
    """A first-order correlation of 0.15 over 2000 samples is structure, and its lag is named."""
    white = np.random.default_rng(4).standard_normal(2001)
    found = consistency_of(white[1:] + 0.15 * white[:-1], np.ones(2000), np.ones(2000, dtype=bool))
    assert found.is_noise is False
    assert found.largest_lag == 1
    assert "lag 1" in found.warnings()[0]


def test_too_few_samples_are_not_judged() -> None:
    """Under a hundred samples there is no verdict, and no warning either."""
    found = consistency_of(np.zeros(50), np.ones(50), np.ones(50, dtype=bool))
    assert found.is_noise is None
    assert found.warnings() == []


def test_samples_that_were_not_used_are_not_judged() -> None:
    """Gated and missing samples do not count."""
    z = np.random.default_rng(5).standard_normal(2000)
    used = np.ones(2000, dtype=bool)
    used[::7] = False
    z[::7] = 100.0
    z[1::70] = np.nan
    found = consistency_of(z, np.ones(2000), used)
    assert found.is_noise
    assert found.samples < 1715


def test_the_tail_of_chi_square_is_that_of_the_tables() -> None:
    """Against printed quantiles: 3.841 (1), 31.410 (20), 45.315 (20)."""
    assert chi_square_tail(3.841, 1) == pytest.approx(0.05, rel=1e-3)
    assert chi_square_tail(31.410, 20) == pytest.approx(0.05, rel=1e-3)
    assert chi_square_tail(45.315, 20) == pytest.approx(0.001, rel=1e-3)


def test_draws_that_are_all_alike_have_no_tail() -> None:
    """0 for what is more than they are, else 1, without a warning: for draws of 0, too."""
    for draw in (0.0, 1.0e-200, 0.1, 1.0):
        tail, of_draws = skewed_tail(np.array([draw]), np.full((50, 1), draw))
        assert (tail[0], of_draws.min()) == (1.0, 1.0)
        assert skewed_tail(np.array([draw + 1.0]), np.full((50, 1), draw))[0][0] == 0.0
