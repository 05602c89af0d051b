"""Tails of chi-square and gamma distributions against scipy's, over all that a diagnosis asks for and far beyond."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import gammaincc
from scipy.stats import binom

from rw_ekf.filter.tails import binomial_tail, chi_square_tail, gamma_tail


@pytest.mark.parametrize("freedom", [1, 2, 3, 4, 7, 12, 20, 31, 100, 999, 6000])
def test_tail_of_chi_square(freedom: int) -> None:
    """From far below the mean to a hundred sigma above it, to twelve digits."""
    spread = np.sqrt(2.0 * freedom)
    for value in [
        0.0,
        1e-9,
        0.01 * freedom,
        *np.linspace(0.3, 1.0, 5) * freedom,
        *(freedom + spread * np.geomspace(0.5, 100, 14)),
    ]:
        expected = float(gammaincc(0.5 * freedom, 0.5 * value))
        assert chi_square_tail(float(value), freedom) == pytest.approx(expected, rel=1e-11, abs=1e-290)


def test_a_negative_statistic_is_no_evidence_and_an_endless_one_is_all() -> None:
    """A search that ended a little below where it began; a residual that ran away."""
    assert chi_square_tail(-0.3, 2) == 1.0
    assert chi_square_tail(np.inf, 20) == 0.0


def test_tail_of_gamma_over_shapes_and_places() -> None:
    """Shapes as skewness gives them, from 0.1 to 1600: by the series, by the fraction, and where the two meet."""
    shape = np.geomspace(0.1, 1600.0, 23)[:, None]
    at = np.concatenate(([0.0, 1e-8, 0.5, 0.9, 1.0, 1.1, 1.5], 1.0 + np.geomspace(0.01, 30.0, 25)))
    x = shape * at
    assert gamma_tail(shape, x) == pytest.approx(gammaincc(shape, x), rel=1e-10, abs=1e-13)
    meeting = shape + 1.0 + np.array([-1e-9, 0.0, 1e-9])
    assert gamma_tail(shape, meeting) == pytest.approx(gammaincc(shape, meeting), rel=1e-11)


def test_one_number_is_one_number() -> None:
    """Without axes in, without axes out."""
    found = gamma_tail(np.array(2.5), np.array(3.0))
    assert found.shape == ()
    assert float(found) == pytest.approx(float(gammaincc(2.5, 3.0)), rel=1e-13)


@pytest.mark.parametrize("of", [1, 10, 1000, 1_000_000])
@pytest.mark.parametrize("chance", [1e-4, 0.01, 0.5])
def test_tail_of_binomial(of: int, chance: float) -> None:
    """From five sigma below the mean to all of the draws; from none where no draw is likely enough to be a number."""
    mean, spread = of * chance, np.sqrt(of * chance * (1.0 - chance))
    counts = {of, *(min(max(round(mean + sigmas * spread), 0), of) for sigmas in range(-5, 31, 5))}
    for count in counts | ({0, 1} if mean < 500.0 else set()):
        expected = float(binom.sf(count - 1, of, chance))
        assert binomial_tail(count, of, chance) == pytest.approx(expected, rel=1e-8, abs=1e-290)
