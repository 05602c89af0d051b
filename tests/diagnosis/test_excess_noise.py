"""What noise swallowed is a finding: readings that are worse somewhere, that are short, and torque no wheel has."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from rw_ekf.diagnosis.checks.excess_noise import Noises, noises_of
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.filter.tails import poisson_tail
from tools.proof.uncatalogued_laws import Nameless


def found_in(name: str, seed: int) -> Noises:
    """What the noises of a record of another integrator show beside the four parameters."""
    prepared = prepare(source_of([Nameless(name, seed).log()]), None, None, "blocks")
    return noises_of(prepared.base, prepared.facts, in_rpm=True)


@pytest.mark.parametrize("seed", [41, 42, 43])
def test_a_healthy_wheel_has_noise_as_it_should_be(seed: int) -> None:
    """No window of speed, current or direction, no tails, no torque."""
    assert found_in("healthy", seed).reported == ()


@pytest.mark.parametrize("seed", [41, 42])
def test_readings_that_are_worse_when_fast_are_told_with_both_sizes(seed: int) -> None:
    """Noise of .5 rpm at rest and 3.5 rpm at top speed: larger at high speeds, and no torque noise is made of it."""
    noises = found_in("noise by speed", seed)
    assert noises.torque is None
    assert noises.readings is not None
    assert noises.readings.along == "speed"
    assert noises.readings.inside > 1.5 * noises.readings.elsewhere
    assert noises.p_value < 1.0e-12
    assert noises.readings.document(in_rpm=True)["noise_unit"] == "rpm"


@pytest.mark.parametrize("seed", [41, 42])
def test_counts_that_are_lost_lie_behind_the_motion(seed: int) -> None:
    """One reading in thirty is short by several sigma, whichever way the wheel turns."""
    noises = found_in("lost counts", seed)
    assert "behind the motion" in (noises.sentence or "")
    assert noises.p_value < 1.0e-12


@pytest.mark.parametrize("seed", [41, 42])
def test_long_tails_are_told_and_are_nothing_else(seed: int) -> None:
    """Student's noise of three degrees of freedom lies on either side: the wheel is understood all the same."""
    noises = found_in("heavy tails", seed)
    assert "on either side" in (noises.sentence or "")
    assert noises.p_value == 1.0
    assert diagnose_log(Nameless("heavy tails", seed).log()).document()["verdict"]["kind"] == "adequate"


def test_impulses_none_of_which_stands_out_alone_are_a_row_that_can_be_told() -> None:
    """One knock of an encoder off its centre is too small to be known, several at once are not: a KeyError."""
    document = diagnose_log(Nameless("eccentric encoder", 64).log()).document()
    assert document["verdict"]["posterior"]["something_else"] > 0.5
    assert {candidate["effect"] for candidate in document["candidates"]} >= set(document["verdict"]["effects"])


def test_a_torque_that_comes_and_goes_is_more_than_a_wheel_s_noise() -> None:
    """On and off at random by 6 % of Coulomb friction: its mean is named, the rest is said to be there."""
    document = diagnose_log(Nameless("switched torque", 41).log()).document()
    assert document["verdict"]["effects"] == ["offset_torque"]
    assert "times what a wheel's usually does" in document["verdict"]["statement"]
    assert document["verdict"]["posterior"]["something_else"] > 0.5
    assert document["verdict"]["posterior"]["offset_torque"] > 0.5


@pytest.mark.parametrize("name", ["noise by speed", "lost counts", "eccentric encoder"])
def test_no_model_of_the_wheel_is_adequate_where_readings_are_not(name: str) -> None:
    """Nothing is named, and the statement says what is wrong with the readings."""
    verdict = diagnose_log(Nameless(name, 44).log()).document()["verdict"]
    assert verdict["kind"] == "unexplained"
    assert "readings" in verdict["statement"]
    assert verdict["posterior"]["something_else"] > 0.5


@pytest.mark.parametrize(("count", "expected"), [(1, 0.25), (9, 0.25), (5, 4.0), (65, 0.24)])
def test_the_tail_of_rare_readings_is_poisson_s(count: int, expected: float) -> None:
    """Against scipy's."""
    assert poisson_tail(count, expected) == pytest.approx(float(stats.poisson.sf(count - 1, expected)), rel=1e-9)
    assert poisson_tail(0, expected) == 1.0
    assert math.isfinite(poisson_tail(4000, 0.1))


def test_a_reading_s_smoothed_error_is_that_of_dense_algebra() -> None:
    """The slope by one reading's variance, from the adjoint, equals the derivative of a dense Gaussian likelihood."""
    rng, n, q, R, f = np.random.default_rng(3), 12, 0.3, 0.7, 0.95
    speed = np.zeros(n)
    for i in range(1, n):
        speed[i] = f * speed[i - 1] + math.sqrt(q) * rng.standard_normal()
    read = speed + math.sqrt(R) * rng.standard_normal(n)
    # Nothing is known of the first: a prior so wide that it says nothing.
    A = np.array([[f ** (i - j) if i >= j else 0.0 for j in range(n)] for i in range(n)])
    P = A @ np.diag([1.0e6, *[q] * (n - 1)]) @ A.T + R * np.eye(n)
    u = np.linalg.solve(P, read)
    white, gains, following, own = np.zeros(n), np.zeros(n), 0.0, np.zeros(n)
    x, p = 0.0, 1.0e6
    S = np.zeros(n)
    for i in range(n):
        if i:
            x, p = f * x, f * f * p + q
        S[i] = p + R
        gains[i] = p / S[i]
        white[i] = (read[i] - x) / S[i]
        x, p = x + gains[i] * (read[i] - x), p * (1.0 - gains[i])
    adjoint = np.zeros(n)
    for i in range(n - 1, -1, -1):
        adjoint[i] = white[i] + (1.0 - gains[i]) * following
        own[i] = adjoint[i] - following
        following = f * adjoint[i]
    np.testing.assert_allclose(own, u, atol=1e-9)
