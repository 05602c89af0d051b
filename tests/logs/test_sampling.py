"""What the rows of a log are worth: lost rows and held readings, and what is neither."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.logs.joined import joined
from rw_ekf.logs.mending import mended
from rw_ekf.logs.sampling import evenly_stamped, sampling_of
from rw_ekf.logs.wheel_log import WheelLog


def log_of(time_s: Float64Array, speed: Float64Array, current: Float64Array | None = None, name: str = "a") -> WheelLog:
    """A log of one segment."""
    n = time_s.size
    drive = np.zeros(n) if current is None else current
    return WheelLog(name, time_s, speed, drive, "current_command_A", np.zeros(n), np.zeros(n, dtype=np.int64))


def ramp(n: int, rate_hz: float, seed: int, noise: float = 0.05) -> tuple[Float64Array, Float64Array]:
    """A wheel that swings between -30 and 30 rad/s, read with noise."""
    time = np.arange(n) / rate_hz
    return time, 30.0 * np.sin(0.2 * time) + noise * np.random.default_rng(seed).standard_normal(n)


def test_rows_lost_from_a_grid_are_counted() -> None:
    """Of a 10 Hz log thinned at random by 35 % the share, the grid and the rate are said."""
    time, speed = ramp(4000, 10.0, 1)
    keep = np.random.default_rng(2).random(time.size) > 0.35
    sampling = sampling_of(log_of(time[keep], speed[keep]))
    assert sampling.period_s == pytest.approx(0.1)
    assert sampling.lost == pytest.approx(np.count_nonzero(~keep), abs=3)
    assert "on a 10 Hz grid, 35 % of the rows and their commands are missing" in sampling.first_remark


@pytest.mark.parametrize("lost", [0.02, 0.1, 0.35])
def test_rows_lost_from_a_grid_are_counted_though_the_others_come_early_and_late(lost: float) -> None:
    """Each row up to a fifth of a period off: all that are lost are counted, and the period is that of the grid."""
    time, speed = ramp(6000, 10.0, 1)
    draws = np.random.default_rng(2)
    time = time + draws.uniform(-0.02, 0.02, time.size)
    keep = draws.random(time.size) > lost
    sampling = sampling_of(log_of(time[keep], speed[keep]))
    assert sampling.period_s == pytest.approx(0.1, rel=0.005)
    assert sampling.lost == pytest.approx(np.count_nonzero(~keep), rel=0.03)


@pytest.mark.parametrize("kind", ["regular", "jittered", "far off", "any length", "any moment"])
def test_a_log_that_lost_nothing_is_believed(kind: str) -> None:
    """Rows in time, rows a tenth or a fifth off, rows at any moment: nothing is said, the log is left as it is."""
    time, speed = ramp(2000, 10.0, 3)
    draws = np.random.default_rng(4)
    if kind in {"jittered", "far off"}:
        off_s = 0.01 if kind == "jittered" else 0.02
        time = time + draws.uniform(-off_s, off_s, time.size)
    elif kind == "any length":
        time = np.cumsum(draws.uniform(0.05, 0.4, time.size))
    elif kind == "any moment":
        time = np.cumsum(draws.exponential(0.1, time.size))
    log = log_of(time, speed)
    sampling = sampling_of(log)
    assert sampling.remarks() == ()
    assert mended(log, sampling) is log


def test_a_gap_is_bridged_where_the_current_hardly_changed_and_cut_where_it_did() -> None:
    """One lost row within a constant current becomes a row without a speed; one at a step of it ends the segment."""
    time = np.arange(600) / 10.0
    current = np.where(np.arange(600) // 50 % 2 == 0, 0.2, -0.2)
    speed = np.cumsum(16.0 * current) / 10.0 + 0.05 * np.random.default_rng(5).standard_normal(600)
    keep = np.ones(600, dtype=bool)
    keep[[120, 250]] = False  # amid a level, and the first row of another
    log = log_of(time[keep], speed[keep], current[keep])
    found = mended(log, sampling_of(log))
    assert found.segment.max() == 1
    assert found.time_s[found.segment == 1][0] == pytest.approx(25.1)
    (gap,) = np.flatnonzero(np.isnan(found.speed_rad_s))
    assert found.time_s[gap] == pytest.approx(12.0)
    assert found.current_A[gap] == pytest.approx(current[120])


@pytest.mark.parametrize("grid", [0.0, 0.01])
def test_readings_that_are_held_are_no_readings(grid: float) -> None:
    """A speed refreshed at 30 Hz in rows at 100 Hz, exact or with few digits: each refresh is one reading."""
    time, true = ramp(6000, 100.0, 6)
    refresh = np.floor(time * 30.0 + 1e-9)
    first = np.concatenate(([True], np.diff(refresh) > 0))
    read = true[np.maximum.accumulate(np.where(first, np.arange(time.size), 0))]
    log = log_of(time, read if grid == 0.0 else grid * np.round(read / grid))
    sampling = sampling_of(log)
    assert sampling.refresh_s == pytest.approx(1.0 / 30.0, rel=0.02)
    assert sampling.held_share == pytest.approx(0.7, abs=0.02)
    assert "of the rows repeat the reading before, which is refreshed at 30 Hz" in sampling.first_remark
    left = np.isfinite(mended(log, sampling).speed_rad_s)
    assert np.count_nonzero(left) == pytest.approx(np.count_nonzero(first), rel=0.02)
    assert not np.any(left & ~first)


def test_a_hold_on_a_grid_that_is_as_coarse_as_its_steps_is_known_by_how_regular_it_is() -> None:
    """Counts over 10 ms of an encoder of 400, new in every third row: a third of the changes are of two counts.

    Without the hold no row of the same grid is taken for a repeat.
    """
    draws, rows = np.random.default_rng(6), np.arange(6000)
    true = 60.0 * np.sin(0.015 * rows) + 0.05 * draws.standard_normal(rows.size)
    grid = 2.0 * np.pi / 4.0
    held = grid * np.round(true[rows // 3 * 3] / grid)
    sampling = sampling_of(log_of(rows / 100.0, held))
    assert sampling.refresh_s == pytest.approx(0.03, rel=0.01)
    assert sampling_of(log_of(rows / 100.0, grid * np.round(true / grid))).refresh_s is None


@pytest.mark.parametrize("stamped", ["evenly", "in batches"])
def test_a_refresh_is_known_though_readings_are_alike_and_rows_come_in_batches(stamped: str) -> None:
    """One refresh in five repeats the reading before, rows of a batch share a moment: 10 Hz, 1000 rows a second."""
    draws = np.random.default_rng(11)
    time, true = ramp(60_000, 1000.0, 10)
    refreshed = true[::100].copy()
    for i in np.flatnonzero(draws.random(refreshed.size) < 0.2)[1:]:
        refreshed[i] = refreshed[i - 1]
    if stamped == "in batches":
        ends = np.cumsum(draws.integers(2, 60, time.size))
        batch = np.searchsorted(ends, np.arange(time.size))
        time = time[np.minimum(ends[batch], time.size - 1)] + 1e-6 * np.arange(time.size)
    sampling = sampling_of(log_of(time, np.repeat(refreshed, 100)))
    assert sampling.refresh_s == pytest.approx(0.1, rel=0.01)
    assert sampling.period_s == pytest.approx(1e-3, rel=0.01)


def test_a_refresh_regular_in_time_is_known_in_rows_at_any_moment() -> None:
    """A register refreshed at 5 Hz, polled at moments of a Poisson process, 40 a second."""
    time = np.cumsum(np.random.default_rng(12).exponential(0.025, 6000))
    at = np.floor(time * 5.0).astype(int)
    read = 30.0 * np.sin(0.04 * at) + 0.05 * np.random.default_rng(13).standard_normal(at.max() + 1)[at]
    assert sampling_of(log_of(time, read)).refresh_s == pytest.approx(0.2, rel=0.05)


def test_a_row_that_is_lost_where_a_limit_chatters_is_not_bridged() -> None:
    """Between two rows of one current a command that goes there and back in each row may have been anything."""
    time = 0.1 * np.arange(1200, dtype=float)
    noise = 0.05 * np.random.default_rng(3).standard_normal(1200)
    chatters = np.abs(time - 90.0) < 2.0
    current = np.where(chatters, np.where(np.arange(time.size) % 2, 0.3, -0.2), 0.1 * np.sign(np.sin(0.2 * time)))
    speed = np.asarray(np.cumsum(1.5 * np.append(0.0, current[:-1])) + noise)
    quiet, chattering = 300, 901
    keep = np.ones(time.size, dtype=bool)
    keep[[quiet, chattering]] = False
    log = log_of(time[keep], speed[keep], current[keep])
    whole = mended(log, sampling_of(log))
    assert list(whole.time_s[1:][np.diff(whole.segment) > 0]) == [pytest.approx(time[chattering + 1])]
    assert whole.time_s.size == log.time_s.size + 1


@pytest.mark.parametrize("kind", ["coarse grid", "register of half an rpm", "stands half the time"])
def test_a_grid_and_a_wheel_at_rest_are_not_held(kind: str) -> None:
    """Repeats that rounding or standing still explain stay readings."""
    time, speed = ramp(6000, 100.0, 7, noise=0.0 if kind == "coarse grid" else 0.05)
    if kind == "coarse grid":
        speed = 0.5 * np.round(speed / 0.5)
    elif kind == "register of half an rpm":
        speed = 0.052 * np.round(speed / 0.052)
    else:
        speed = np.where(np.arange(time.size) % 2000 < 1000, 0.0, speed)
    assert sampling_of(log_of(time, speed)).refresh_s is None


def test_logs_are_joined_one_after_the_other() -> None:
    """Two logs whose clocks overlap: time rises, each is a segment of its own, and its place is known."""
    one, two = log_of(*ramp(300, 10.0, 8), name="one"), log_of(*ramp(200, 10.0, 9), name="two")
    both = joined([one, two])
    assert both.log.name == "one, two"
    assert np.all(np.diff(both.log.time_s) > 0.0)
    assert both.log.segment[299] != both.log.segment[300]
    assert [part["begins_s"] for part in both.parts] == pytest.approx([0.0, 30.0])
    assert np.array_equal(both.log.speed_rad_s[300:], two.speed_rad_s)
    assert joined([one]).log is one


def in_batches(time_s: Float64Array, seed: int) -> Float64Array:
    """The stamps that rows get on arrival, in batches of 2 to 60."""
    n = time_s.size
    ends = np.cumsum(np.random.default_rng(seed).integers(2, 60, n))
    batch = np.searchsorted(ends, np.arange(n), side="left")
    place = np.arange(n) - np.append(0, ends)[batch]
    arrives = time_s[np.minimum(ends[batch], n - 1)]
    late: Float64Array = np.maximum.accumulate(arrives + 1.4e-4 * np.maximum(place, 0)) + 1.0e-7 * np.arange(n)
    return late


def test_rows_that_come_in_batches_go_by_their_count() -> None:
    """Stamped on arrival, up to 60 ms late: the clock they were taken by comes back, and it is said."""
    time, speed = ramp(20_000, 1000.0, 11)
    found = evenly_stamped(log_of(in_batches(time, 12), speed))
    assert np.ptp(found.time_s - time) < 0.003
    assert "stamped as these arrive" in found.warnings[-1]


def test_rows_that_are_late_or_lost_for_good_keep_their_stamps() -> None:
    """Even rows, rows at any moment, batches with a pause or lost rows, one pause, a duty cycle: left as they are."""
    time, speed = ramp(20_000, 1000.0, 13)
    late = in_batches(time, 14)
    paused = late + np.where(np.arange(time.size) > 9000, 2.0, 0.0)
    lost = np.ones(time.size, dtype=bool)
    lost[6000:7000] = False
    moments = np.cumsum(np.random.default_rng(15).exponential(0.001, time.size))
    once = time + np.where(np.arange(time.size) > 10_000, 500.0, 0.0)
    duty = time + 9.0 * (np.arange(time.size) // 500)  # half a second of rows, every 9.5 s
    for stamps in (time, paused, late[lost], moments, once, duty):
        log = log_of(stamps, speed[: stamps.size])
        assert evenly_stamped(log) is log


def test_rows_of_no_grid_are_cut_where_they_pause() -> None:
    """Runs of a second each, half a minute apart, stamps that jitter: over a pause nothing is known of the command."""
    rng = np.random.default_rng(3)
    time = np.concatenate([30.0 * i + np.cumsum(rng.uniform(0.004, 0.008, 160)) for i in range(4)])
    log = log_of(time, 90.0 + rng.standard_normal(time.size), np.full(time.size, 0.5))
    assert mended(log, sampling_of(log)).segment.tolist() == np.repeat(np.arange(4), 160).tolist()


def test_rows_that_come_once_a_turn_are_not_cut_as_the_wheel_slows_down() -> None:
    """Their steps grow to seconds, one after the other."""
    step = np.geomspace(0.05, 6.0, 120)
    log = log_of(np.cumsum(step), 6.28 / step, np.zeros(120))
    assert set(mended(log, sampling_of(log)).segment.tolist()) == {0}


@pytest.mark.parametrize(("current_A", "answers", "added"), [(0.5, True, 1), (0.5, False, 0), (0.0, True, 0)])
def test_a_command_that_moves_a_resting_wheel_was_not_there_before(current_A: float, answers: bool, added: int) -> None:
    """Where a run begins at rest under its first command a row without one is put ahead of it, a period earlier."""
    time = np.arange(300) / 100.0
    speed = 90.0 * (1.0 - np.exp(-np.maximum(time - 0.03, 0.0) / 0.1)) if answers else np.zeros(300)
    log = log_of(time, speed, np.full(300, current_A))
    read = mended(log, sampling_of(log))
    assert len(read) == 300 + added
    assert float(read.time_s[0]) == pytest.approx(-0.01 * added)
    assert float(read.current_A[0]) == (0.0 if added else current_A)
    assert read.current_A[added:].tolist() == log.current_A.tolist()
