"""The one function that decides what current may be written, over all it may be asked (docs/contract.md#safety)."""

from __future__ import annotations

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from rw_ekf.live.guard import SafetyLimits, allowed_current

LIMITS = st.builds(
    SafetyLimits,
    current_A=st.floats(1e-3, 1e3),
    slew_A_per_s=st.floats(1e-3, 1e6),
    speed_rad_s=st.floats(1e-2, 1e5),
    temperature_degC=st.floats(-99.0, 500.0),
    silence_s=st.just(0.5),
)
ANYTHING = st.floats(allow_nan=True, allow_infinity=True)
MAYBE = st.none() | ANYTHING
USUAL = SafetyLimits(0.6, 5.0, 440.0, 60.0, 0.5)


@settings(max_examples=500, deadline=None)
@given(ANYTHING, st.floats(-2.0, 2.0), st.floats(-1.0, 1e6), MAYBE, MAYBE, LIMITS)
def test_nothing_ever_leaves_that_is_not_allowed(
    requested: float, share: float, elapsed: float, speed: float | None, heat: float | None, limits: SafetyLimits
) -> None:
    """Whatever is asked, the answer is finite, within the limit and the slew, brakes when too fast, is zero when hot.

    The current before may lie beyond the limit by a factor of two: a wheel says what it carries, and is brought back.
    """
    previous = share * limits.current_A
    current, _ = allowed_current(requested, previous, elapsed, speed, heat, limits)
    assert math.isfinite(current)
    assert abs(current) <= limits.current_A
    if current != 0.0 and abs(previous) <= limits.current_A:
        step = limits.slew_A_per_s * max(elapsed, 0.0)
        assert abs(current - previous) <= step + 1e-12 * (1.0 + abs(previous))
    if speed is not None and not abs(speed) <= limits.speed_rad_s and current != 0.0:
        assert not math.isnan(speed)
        assert math.copysign(1.0, current) != math.copysign(1.0, speed)
    if heat is not None and not heat <= limits.temperature_degC:
        assert current == 0.0
    if not math.isfinite(requested):
        assert current == 0.0


@settings(max_examples=300, deadline=None)
@given(ANYTHING, st.floats(-1.0, 1.0), st.floats(0.0, 10.0), MAYBE, MAYBE, LIMITS)
def test_what_differs_from_the_request_has_a_reason(
    requested: float, share: float, elapsed: float, speed: float | None, heat: float | None, limits: SafetyLimits
) -> None:
    """A current that is not what was asked for names why; one that is has no reason."""
    current, reason = allowed_current(requested, share * limits.current_A, elapsed, speed, heat, limits)
    assert (reason is None) == (current == requested)


@settings(max_examples=300, deadline=None)
@given(st.floats(-0.6, 0.6), st.floats(0.0, 1.0), LIMITS)
def test_a_refused_request_is_never_the_old_current(previous: float, elapsed: float, limits: SafetyLimits) -> None:
    """Too fast, too hot, or not a number: the answer is zero, whatever flowed before."""
    fast, hot = 1.01 * limits.speed_rad_s, limits.temperature_degC + 1.0
    for requested, speed, heat in ((0.1, fast, None), (-0.1, -fast, None), (0.1, 0.0, hot), (math.nan, 0.0, None)):
        assert allowed_current(requested, previous, elapsed, speed, heat, limits)[0] == 0.0


@settings(max_examples=200, deadline=None)
@given(st.floats(-0.6, 0.6), st.floats(-1.0, 10.0), MAYBE, MAYBE, LIMITS)
def test_zero_is_always_granted_at_once(
    previous: float, elapsed: float, speed: float | None, heat: float | None, limits: SafetyLimits
) -> None:
    """A request of zero is exempt from slew and from everything else, and counts as granted."""
    assert allowed_current(0.0, previous, elapsed, speed, heat, limits) == (0.0, None)


def test_a_step_is_climbed_at_the_slew_rate_and_arrives() -> None:
    """From -0.5 A to +0.5 A at 5 A/s takes two steps of 0.1 s, none above 0.5 A, and ends exactly there."""
    currents = [-0.5]
    for _ in range(4):
        currents.append(allowed_current(0.5, currents[-1], 0.1, 0.0, 20.0, USUAL)[0])
    assert currents == [-0.5, 0.0, 0.5, 0.5, 0.5]


def test_above_the_speed_limit_a_braking_current_passes() -> None:
    """Braking is granted in both directions, also exactly at the limit of current."""
    for sign in (1.0, -1.0):
        assert allowed_current(-0.6 * sign, -0.4 * sign, 0.1, 500.0 * sign, 20.0, USUAL) == (-0.6 * sign, None)


def test_a_braking_request_whose_ramp_begins_at_an_accelerating_current_gives_zero() -> None:
    """Slewing down from an accelerating current would still accelerate: above the speed limit that becomes zero."""
    assert allowed_current(-0.6, 0.5, 0.01, 500.0, 20.0, USUAL) == (0.0, "slew")


def test_a_current_beyond_the_limit_that_a_wheel_reports_is_brought_back_at_once() -> None:
    """A wheel left by someone else at 2 A is not ramped down from there: the limit holds from the first write."""
    assert allowed_current(0.1, 2.0, 0.1, 0.0, 20.0, USUAL)[0] == 0.6
