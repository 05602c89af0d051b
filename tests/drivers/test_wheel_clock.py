"""The wheel's clock against the host's."""

from __future__ import annotations

import itertools

import pytest

from rw_ekf.drivers.line.wheel_clock import WheelClock


@pytest.mark.parametrize("factor", [1.0, 10.0])
def test_the_rate_of_the_wheels_clock_is_measured(factor: float) -> None:
    """A wheel whose time runs `factor` times as fast is found out within a second, to 1 %."""
    clock = WheelClock()
    for tick in range(11):
        host_s = 5.0 + 0.1 * tick
        clock.time_s(round(factor * 0.1 * tick, 3), host_s, None)
    assert clock.rate == pytest.approx(factor, rel=0.01)


def test_a_restart_begins_the_comparison_of_clocks_anew() -> None:
    """Time before the wheel restarted does not count towards the rate after it."""
    clock = WheelClock()
    for uptime_s, host_s in [(100.0, 0.0), (101.0, 1.0), (0.5, 10.0), (1.5, 11.0)]:
        clock.time_s(uptime_s, host_s, None)
    assert clock.segment == 1
    assert clock.rate == pytest.approx(1.0)


@pytest.mark.parametrize("flag_first", [True, False])
def test_a_restart_told_twice_is_one_segment(flag_first: bool) -> None:
    """Uptime running backward and the status flag speak of one restart, in either order; the next one counts anew."""
    clock = WheelClock()
    clock.time_s(100.0, 0.0, None)
    if flag_first:
        clock.note_restart()
    clock.time_s(0.2, 1.0, None)
    if not flag_first:
        clock.note_restart()
    clock.time_s(0.3, 1.1, None)
    assert clock.segment == 1
    clock.time_s(0.1, 2.0, None)
    assert clock.segment == 2


def follow(clock: WheelClock, *readings: tuple[float, float], span_s: float | None = None) -> list[tuple[float, int]]:
    """Time and segment of each reading (uptime, host time); a reply takes 5 ms."""
    return [(clock.time_s(up, host, span_s, host + 0.005, 0.001), clock.segment) for up, host in readings]


@pytest.mark.parametrize("jump_s", [3600.0, 0.6, -1000.0, -0.7, 1.0e9])
def test_a_jump_of_the_clock_is_a_new_segment(jump_s: float) -> None:
    """Forward or back, an hour or half a second: one new segment, time steady within it, the rate not spoilt."""
    clock = WheelClock()
    before = [(5000.0 + 0.1 * i, 1.0 + 0.1 * i) for i in range(50)]
    after = [(5005.0 + jump_s + 0.1 * i, 6.0 + 0.1 * i) for i in range(50)]
    reported = follow(clock, *before, *after)
    assert [segment for _, segment in reported] == [0] * 50 + [1] * 50
    steps = [b[0] - a[0] for a, b in itertools.pairwise(reported[50:])]
    assert steps == pytest.approx([0.1] * 49, abs=1e-4)
    assert clock.rate == pytest.approx(1.0, rel=0.01)
    assert clock.believed


@pytest.mark.parametrize("rate", [0.2, 0.97, 0.9999, 1.0001, 1.03, 10.0, 200.0])
def test_a_clock_at_another_rate_is_no_clock_that_jumps(rate: float) -> None:
    """A simulation that runs fast or slow, a quartz 100 ppm off, and a host that stands for 3 s: one segment."""
    clock = WheelClock()
    host = [0.1 * i + (3.0 if i > 40 else 0.0) + 0.02 * (i % 3) for i in range(200)]
    reported = follow(clock, *((rate * at, at) for at in host))
    assert {segment for _, segment in reported} == {0}
    assert clock.rate == pytest.approx(rate, rel=0.01)


def test_a_counter_that_wraps_has_not_jumped() -> None:
    """Through 2^32 ms time goes on in the same segment, also where replies were lost meanwhile."""
    span_s = 2**32 / 1000.0
    clock = WheelClock()
    reported = follow(
        clock, *(((span_s - 2.0 + at) % span_s, at) for at in (0.0, 0.1, 0.2, 1.9, 2.1, 30.0)), span_s=span_s
    )
    assert reported[-1][0] == pytest.approx(span_s + 28.0)
    assert reported[-1][1] == 0


def test_the_same_uptime_is_the_same_time_and_nothing_has_jumped_when_it_goes_on() -> None:
    """A reply that is repeated for ten seconds is no later reading; the next true one continues the segment."""
    clock = WheelClock()
    reported = follow(clock, (10.0, 0.0), (10.1, 0.1), *((10.1, 0.2 + 0.1 * i) for i in range(100)), (20.2, 10.2))
    assert {time for time, _ in reported[1:-1]} == {10.1}
    assert reported[-1] == (20.2, 0)


def test_a_clock_that_jumps_again_and_again_is_not_believed() -> None:
    """After the third jump within some readings the host counts; time grows, and there is no further segment."""
    clock = WheelClock()
    reported = follow(clock, *((100.0 + 7.3 * i, 0.1 * i) if i > 20 else (100.0 + 0.1 * i, 0.1 * i) for i in range(60)))
    assert not clock.believed
    assert clock.segment == 3
    steps = [b[0] - a[0] for a, b in itertools.pairwise(reported[30:])]
    assert steps == pytest.approx([0.1] * 29, abs=1e-6)


@pytest.mark.parametrize("rate_hz", [10, 100, 500])
def test_a_clock_that_jumps_once_a_second_is_not_believed_for_long(rate_hz: int) -> None:
    """At each second it is 70 s on: eight segments, then the host counts, at any rate of readings."""
    clock = WheelClock()
    at = [i / rate_hz for i in range(30 * rate_hz)]
    reported = follow(clock, *((100.0 + t + 70.0 * (i // rate_hz), t) for i, t in enumerate(at)))
    assert not clock.believed
    assert clock.segment == 8
    steps = [b[0] - a[0] for a, b in itertools.pairwise(reported[12 * rate_hz :])]
    assert steps == pytest.approx([1.0 / rate_hz] * len(steps), abs=1e-6)


@pytest.mark.parametrize("rate_hz", [1, 10])
def test_a_clock_that_jumps_once_a_minute_has_a_segment_for_each(rate_hz: int) -> None:
    """For ten minutes: nine jumps, and it is believed."""
    clock = WheelClock()
    at = [i / rate_hz for i in range(600 * rate_hz)]
    follow(clock, *((100.0 + t + 70.0 * (i // (60 * rate_hz)), t) for i, t in enumerate(at)))
    assert clock.believed
    assert clock.segment == 9


@pytest.mark.parametrize("stalled", [(3, 5, 8), (4, 9, 14, 19), (2,)])
def test_turns_that_are_late_while_the_rate_is_found_are_no_jumps(stalled: tuple[int, ...]) -> None:
    """A clock eight times as fast at 80 turns a second on a busy machine: short turns agree with any rate, late ones
    only with its own."""
    clock, host_s, readings = WheelClock(), 2.0, []
    for i in range(200):
        host_s += 0.045 if i in stalled else 0.0125
        readings.append((8.0 * host_s, host_s))
    assert {segment for _, segment in follow(clock, *readings)} == {0}
    assert clock.believed
    assert clock.rate == pytest.approx(8.0, rel=0.01)
