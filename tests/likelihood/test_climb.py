"""The search for the ratio of noises: it comes to the top, wherever that is, and asks few times on the way."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rw_ekf.likelihood.profile import LEAST_RATIO, MOST_RATIO, climb

LOW, HIGH = math.log(LEAST_RATIO), math.log(MOST_RATIO)


def asked(begin: float, top: float, rise: float, fall: float) -> dict[float, float]:
    """What is asked on the way up a hill that is as steep on its two sides as a likelihood may be; by place."""
    seen: dict[float, float] = {}

    def at(x: float) -> float:
        away = x - top
        seen[x] = -(rise if away < 0.0 else fall) * (math.sqrt(1.0 + away * away) - 1.0) * (1.0 + 0.1 * abs(away))
        return seen[x]

    climb(at, begin, LOW, HIGH)
    return seen


@given(st.floats(-3.0, 3.0), st.floats(LOW + 3.0, HIGH - 3.0), st.floats(1.0, 300.0), st.floats(0.5, 2.0))
def test_the_top_is_found_from_either_side(away: float, top: float, rise: float, skew: float) -> None:
    """To half a unit of log-likelihood, or a factor of two, in thirteen evaluations at most."""
    seen = asked(top + away, top, rise, skew * rise)
    best = max(seen, key=lambda x: seen[x])
    assert seen[best] > -0.5 or abs(best - top) < math.log(2.0)
    assert len(seen) <= 13


@given(st.floats(LOW, HIGH), st.floats(LOW, HIGH), st.floats(1.0, 300.0))
def test_nothing_is_asked_beyond_the_bounds(begin: float, top: float, rise: float) -> None:
    """Wherever the search begins and the top is."""
    seen = asked(begin, top, rise, rise)
    assert min(seen) >= LOW
    assert max(seen) <= HIGH


def test_from_the_top_three_evaluations_show_that_it_is_the_top() -> None:
    """As in every turn of a fit but the first."""
    assert len(asked(-5.0, -5.0, 20.0, 20.0)) == 3


@pytest.mark.parametrize("top", [-9.0, -1.0])
def test_a_step_away_eight_do(top: float) -> None:
    """As from the ratio that every fit of a record begins with, 1e-2, to that of most wheels."""
    assert len(asked(math.log(1e-2), top, 20.0, 20.0)) <= 8


def test_numbers_that_blow_up_are_left_behind() -> None:
    """Where there is no likelihood on one side of the start, the top on the other is found."""

    seen: dict[float, float] = {}

    def at(x: float) -> float:
        seen[x] = -math.inf if x > -4.7 else -((x + 8.0) ** 2)
        return seen[x]

    climb(at, -4.6, LOW, HIGH)
    assert max(seen.values()) > -0.1
