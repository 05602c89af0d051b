"""What is searched and what is held out: every block in its turn, long enough, and nothing counted twice."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.prepare.split import Split, reversals, running_time, split_record


def turning(duration_s: float, period_s: float, rate_hz: float = 10.0) -> tuple[Float64Array, Float64Array]:
    """Times and speeds of a wheel that reverses twice in every period."""
    time_s = np.arange(round(duration_s * rate_hz)) / rate_hz
    return time_s, 100.0 * np.sin(2.0 * np.pi * (time_s + 0.25) / period_s)


def split_of(time_s: Float64Array, speed: Float64Array, kind: str = "blocks", noise: float = 0.1) -> Split:
    """One segment."""
    return split_record(time_s, np.zeros(time_s.size, np.int64), speed, kind, noise)  # type: ignore[arg-type]


def lengths(split: Split) -> Float64Array:
    """Seconds of every block, fitted and held out."""
    document = split.document()
    return np.array([b - a for a, b in document["fit_s"] + document["heldout_s"]])


@pytest.mark.parametrize("duration_s", [5.0, 100.0, 159.0, 161.0, 600.0, 3600.0])
@pytest.mark.parametrize("kind", ["blocks", "halves"])
def test_every_sample_belongs_to_one_part(duration_s: float, kind: str) -> None:
    """Fit and held-out part share no sample, and the spans of the document are those of the samples."""
    time_s, speed = turning(duration_s, 30.0)
    split = split_of(time_s, speed, kind)
    assert np.array_equal(split.fit, ~split.heldout)
    assert 0.4 < split.fit.mean() < 0.65
    document = split.document()
    assert document["kind"] == kind
    for spans, part in ((document["fit_s"], split.fit), (document["heldout_s"], split.heldout)):
        inside = np.zeros(time_s.size, dtype=bool)
        for a, b in spans:
            inside |= (time_s >= a) & (time_s <= b)
        assert np.array_equal(inside, part)


def test_halves_are_the_first_and_the_second() -> None:
    """The first half is fitted, the second held out."""
    split = split_of(*turning(200.0, 30.0), "halves")
    assert np.flatnonzero(split.fit).max() < np.flatnonzero(split.heldout).min()
    assert split.fit.sum() == pytest.approx(1000, abs=1)


@pytest.mark.parametrize(
    ("duration_s", "period_s", "least_s", "most_s"),
    [
        (600.0, 5.0, 40.0, 45.0),  # many reversals: the shortest block that is allowed
        (1200.0, 100.0, 100.0, 125.0),  # two reversals in each
        (100.0, 10.0, 24.0, 26.0),  # short: four blocks
        (800.0, 1100.0, 199.0, 201.0),  # one reversal: four blocks
        (800.0, 5000.0, 40.0, 45.0),  # none: none to wait for
    ],
)
def test_blocks_last_for_two_reversals_and_forty_seconds(
    duration_s: float, period_s: float, least_s: float, most_s: float
) -> None:
    """Blocks take turns, begin with a fitted one, and are as long as the record's reversals ask for."""
    split = split_of(*turning(duration_s, period_s))
    assert np.all((lengths(split) > least_s - 0.2) & (lengths(split) < most_s))
    assert np.all(np.isin(np.diff(split.block), (0, 1)))
    assert np.array_equal(split.fit, split.block % 2 == 0)


def test_noise_about_zero_is_no_reversal() -> None:
    """Within five sigma of zero the sign means nothing; a missing reading hides no reversal."""
    rng = np.random.default_rng(1)
    speed = np.concatenate((np.full(50, 9.0), 0.1 * rng.standard_normal(200), np.full(50, -9.0), np.full(50, 9.0)))
    assert reversals(speed, 0.1) == 2
    speed[49:251] = np.nan
    assert reversals(speed, 0.1) == 2
    assert reversals(np.abs(speed), 0.1) == 0
    assert reversals(np.full(9, np.nan), 0.1) == 0


def test_time_runs_on_where_the_clock_restarts() -> None:
    """Between segments no time passes, whatever their clocks say; within one a gap counts."""
    time_s = np.array([5.0, 6.0, 9.0, 0.0, 1.0, 100.0, 101.0])
    segment = np.array([0, 0, 0, 1, 1, 2, 2])
    assert running_time(time_s, segment).tolist() == [0.0, 1.0, 4.0, 4.0, 5.0, 5.0, 6.0]
    assert running_time(np.zeros(0), np.zeros(0, np.int64)).size == 0


@pytest.mark.parametrize("period_s", [20.0, 150_000.0, 1.0e6])
@pytest.mark.parametrize("kind", ["blocks", "halves"])
def test_a_long_record_is_looked_at_in_part(period_s: float, kind: str) -> None:
    """Of a million samples some 25,000 are searched and as many held out, spread over the record, reversals or not."""
    time_s, speed = turning(100_000.0, period_s)
    split = split_of(time_s, speed, kind)
    assert 12_000 < split.fit.sum() <= 40_000
    assert 12_000 < split.heldout.sum() <= 40_000
    assert not np.any(split.fit & split.heldout)
    if kind == "blocks":
        assert np.ptp(time_s[split.fit]) > 0.5 * np.ptp(time_s)


@pytest.mark.parametrize("samples", [0, 1, 2])
def test_next_to_nothing_can_be_split(samples: int) -> None:
    """A log of no, one or two samples has a document; what can be judged of it is decided elsewhere."""
    split = split_of(np.arange(samples, dtype=np.float64), np.ones(samples))
    assert split.document()["kind"] == "blocks"
    assert int(split.fit.sum() + split.heldout.sum()) == samples


def test_coast_downs_by_turns_are_in_both_parts() -> None:
    """Four segments of 400 s, forward and backward by turns: each part has both directions."""
    time_s = np.tile(np.arange(4000) * 0.1, 4)
    segment = np.repeat(np.arange(4), 4000)
    speed = np.concatenate([way * np.linspace(200.0, 100.0, 4000) for way in (1.0, -1.0, 1.0, -1.0)])
    split = split_record(time_s, segment, speed, "blocks", 0.1)
    for part in (split.fit, split.heldout):
        assert (speed[part] > 0.0).any()
        assert (speed[part] < 0.0).any()
