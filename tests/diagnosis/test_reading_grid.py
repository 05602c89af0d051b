"""A lattice of readings is found, sized and weighed; a register's own resolution and a noisy reading are none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.course.grid import grid_of
from rw_ekf.diagnosis.checks.reading_grid import Lattice, _log_cell, find_lattice, rounding_error
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.units import RAD_S_PER_RPM
from tests.diagnosis.simulated import log_of, simulated

NOISE = RAD_S_PER_RPM
TRACKED = 0.3 * NOISE  # of the predictions


def readings(seed: int, grid: float, noise: float = NOISE, n: int = 3000) -> tuple[Float64Array, Float64Array]:
    """(rounded readings, predictions of the speed) of a wheel that swings, (n,) each."""
    rng = np.random.default_rng(seed)
    speed = 100.0 * np.sin(0.003 * np.arange(n)) + 20.0 * np.sin(0.031 * np.arange(n))
    read = speed + noise * rng.standard_normal(n)
    return np.round(read / grid) * grid if grid > 0.0 else read, speed + TRACKED * rng.standard_normal(n)


def lattice_of(seed: int, grid: float, noise: float = NOISE, least: float = 0.0) -> Lattice | None:
    """What is found when the noise that a diagnosis would find, rounding included, is known."""
    read, predicted = readings(seed, grid, noise)
    heldout = (np.arange(read.size) // 300) % 2 == 1
    variance = noise**2 + grid**2 / 12.0
    return find_lattice(read, predicted, np.full(read.size, TRACKED), variance, heldout, least)


@pytest.mark.parametrize("grid_rpm", [0.5, 1.0, 2.0, 5.0, 10.0, 60.0 / 7.0])
def test_the_grid_is_found_to_the_digit(grid_rpm: float) -> None:
    """Whatever the grid, also one that no decimal number hits, a few missing readings, and a text with six decimals."""
    grid = grid_rpm * RAD_S_PER_RPM
    read, _ = readings(1, grid)
    read[::17] = np.nan
    assert grid_of(read) == pytest.approx(grid, rel=1e-9)
    assert grid_of(np.round(read, 6)) == pytest.approx(grid, rel=1e-5)


def test_a_coarse_grid_shows_even_where_neighbours_are_never_read() -> None:
    """Readings two and three steps apart have the step as their common divisor."""
    grid = 0.3
    assert grid_of(grid * np.array([-8.0, -4.0, 0.0, 2.0, 4.0, 7.0, 13.0])) == pytest.approx(grid, rel=1e-9)


def test_noise_has_no_grid() -> None:
    """Free numbers, too few different ones, none at all, and a wheel at rest: no grid."""
    rng = np.random.default_rng(2)
    assert grid_of(rng.normal(size=3000)) is None
    assert grid_of(np.repeat([1.0, 2.0, 3.0], 500)) is None
    assert grid_of(np.full(50, np.nan)) is None
    assert grid_of(np.zeros(500)) is None


@pytest.mark.parametrize("grid_rpm", [5.0, 10.0])
def test_a_grid_coarser_than_the_noise_is_evidence(grid_rpm: float) -> None:
    """The likelihood of rounded readings beats that of so much noise on both parts, and the noise under it is found."""
    found = lattice_of(3, grid_rpm * RAD_S_PER_RPM)
    assert found is not None
    assert found.grid_rad_s == pytest.approx(grid_rpm * RAD_S_PER_RPM, rel=1e-9)
    assert found.statistic > 10.0
    assert found.heldout_statistic > 10.0
    assert found.noise_rad_s == pytest.approx(NOISE, rel=0.25)


@pytest.mark.parametrize("grid_rpm", [0.0, 0.5, 1.0])
def test_a_grid_lost_in_the_noise_is_none(grid_rpm: float) -> None:
    """What is finer than one and a half sigma harms nobody."""
    assert lattice_of(4, grid_rpm * RAD_S_PER_RPM) is None


def test_a_registers_resolution_is_no_effect() -> None:
    """A quiet wheel behind the wire's 0.5 rpm is healthy; without such an excuse the same lattice is one."""
    grid = 0.5 * RAD_S_PER_RPM
    assert lattice_of(5, grid, 0.02 * RAD_S_PER_RPM, least=0.6 * RAD_S_PER_RPM) is None
    assert lattice_of(5, grid, 0.02 * RAD_S_PER_RPM) is not None


def test_outliers_and_gaps_do_not_hide_a_grid() -> None:
    """Missing predictions are left out, a reading that nothing predicts counts for no more than an outlier does."""
    grid = 5.0 * RAD_S_PER_RPM
    read, predicted = readings(6, grid)
    read[::13] = np.nan
    predicted[5::29] = np.nan
    predicted[7::500] += 50.0
    variance = NOISE**2 + grid**2 / 12.0
    heldout = np.arange(read.size) >= read.size // 2
    found = find_lattice(read, predicted, np.full(read.size, TRACKED), variance, heldout, 0.0)
    assert found is not None
    assert math.isfinite(found.statistic)
    assert min(found.statistic, found.heldout_statistic) > 10.0


def test_the_cells_of_a_grid_share_all_probability() -> None:
    """Over all readings the probabilities add up to one, and each is the share of draws that are rounded to it."""
    grid, spread, centre = 0.7, 0.4, 0.23
    cells = grid * np.arange(-20.0, 21.0)
    share = np.exp(_log_cell(cells - centre, np.full(cells.size, spread), grid))
    assert share.sum() == pytest.approx(1.0, abs=1e-6)
    drawn = np.random.default_rng(8).normal(centre, spread, 200_000)
    counted = np.array([np.mean(np.round(drawn / grid) == k) for k in (-1, 0, 1)])
    assert np.allclose(share[19:22], counted, atol=0.005)


@pytest.mark.parametrize("noise", [0.05, 0.2, 0.6])
def test_the_error_of_a_rounded_reading_is_the_mean_over_many(noise: float) -> None:
    """At any place in a cell, whatever the noise before the rounding, the reading's or the speed's."""
    grid, rng = 0.7, np.random.default_rng(9)
    speed = np.linspace(-1.1, 1.1, 23) * grid
    drawn = speed + noise * grid * rng.standard_normal((40_000, speed.size))
    counted = (np.round(drawn / grid) * grid).mean(axis=0) - speed
    alike = noise * grid * math.sqrt(0.5)  # half of the variance is the reading's, half the speed's
    expected = rounding_error(speed, np.full(speed.size, alike), Lattice(grid, alike, 0.0, 0.0))
    assert np.allclose(counted, expected, atol=0.012 * grid)


@pytest.mark.parametrize("effect", ["none", "offset_torque:torque_rad_s2=0.06"])
def test_a_grid_of_ten_rpm_hides_nothing_and_makes_nothing_up(effect: str) -> None:
    """Under 1 rpm of noise the grid is named with what the wheel has, and the readings predicted are rounded."""
    effects = [f"speed_quantisation:grid_rad_s={10.0 * RAD_S_PER_RPM}", *([] if effect == "none" else [effect])]
    document = diagnose_log(log_of(simulated(effects, seed=21, samples=4000))).document()
    assert sorted(document["verdict"]["effects"]) == sorted(text.split(":")[0] for text in effects)
    assert document["after"]["free_run_rms_rpm"] < 0.9 * document["before"]["free_run_rms_rpm"]
