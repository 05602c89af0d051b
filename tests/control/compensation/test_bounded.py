"""What compensation may add: never more than its limit, no step on the way in, nothing where a wheel shall rest."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from rw_ekf.control.compensation.on_wheel import BoundedCurrent, moving_share

ANY = st.floats(allow_nan=True, allow_infinity=True)
STEPS = st.lists(st.tuples(ANY, st.floats(0.0, 5.0), st.booleans()), min_size=1, max_size=60)


@given(STEPS, st.floats(1e-3, 1.0), st.floats(0.01, 100.0))
def test_never_more_than_the_limit_and_never_a_jump(
    steps: list[tuple[float, float, bool]], limit_A: float, fade_s: float
) -> None:
    """Whatever a scheme wants, NaN included: within the limit, and no more than a second's fade more than before."""
    bounded = BoundedCurrent(limit_A, fade_s)
    share = 0.0
    for wanted_A, elapsed_s, off in steps:
        if off:
            bounded.off()
            share = 0.0
        added_A = bounded.step(wanted_A, elapsed_s)
        assert math.isfinite(added_A)
        assert abs(added_A) <= bounded.share * limit_A <= limit_A
        assert bounded.share <= share + min(elapsed_s, 1.0) / fade_s + 1e-12
        share = bounded.share


@given(st.floats(-0.05, 0.05), st.floats(0.5, 10.0))
def test_all_of_it_acts_when_it_is_faded_in(wanted_A: float, fade_s: float) -> None:
    """After fade_s of turns a current within the limit passes as it is."""
    bounded = BoundedCurrent(0.05, fade_s)
    for _ in range(math.ceil(fade_s / 0.1) + 1):
        added_A = bounded.step(wanted_A, 0.1)
    assert added_A == wanted_A


def test_off_takes_everything_at_once() -> None:
    """One call, and the next turn begins from nothing."""
    bounded = BoundedCurrent(0.05, 1.0)
    for _ in range(20):
        bounded.step(0.05, 0.1)
    bounded.off()
    assert bounded.step(0.05, 0.0) == 0.0
    assert abs(bounded.step(0.05, 0.1) - 0.005) < 1e-12


@given(st.floats(-1e3, 1e3), st.floats(-10.0, 10.0), st.floats(1e-3, 10.0))
def test_the_share_of_a_slow_wheel_is_a_share(speed: float, request_A: float, breakaway_A: float) -> None:
    """Between 0 and 1 everywhere, 1 for a wheel that turns, and the same in both directions."""
    share = moving_share(speed, 0.4, request_A, breakaway_A)
    assert 0.0 <= share <= 1.0
    assert share == moving_share(-speed, 0.4, -request_A, breakaway_A)
    if abs(speed) >= 0.8 or abs(request_A) >= 0.05 * breakaway_A:
        assert share == 1.0


@given(st.floats(-0.4, 0.4))
def test_a_slow_wheel_that_nothing_is_asked_of_is_left_alone(speed: float) -> None:
    """Below the Stribeck speed a request of zero gets no compensation at all, also where the break-away is zero."""
    assert moving_share(speed, 0.4, 0.0, 0.04) == 0.0
    assert moving_share(speed, 0.4, 0.0, 0.0) == 0.0


@given(st.floats(-2.0, 2.0), st.floats(-0.01, 0.01), st.floats(0.0, 1e-3))
def test_the_share_has_no_steps(speed: float, request_A: float, less: float) -> None:
    """A little more speed or request changes it a little: no threshold that noise could switch to and fro."""
    there = moving_share(speed, 0.4, request_A, 0.04)
    assert abs(moving_share(speed + less, 0.4, request_A, 0.04) - there) <= less / 0.4 + 1e-9
    more = less * 1e-3
    assert abs(moving_share(speed, 0.4, request_A + more, 0.04) - there) <= more / (0.05 * 0.04) + 1e-9
