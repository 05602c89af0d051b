"""The same record at a lower rate, which is what hypotheses are sought in (docs/likelihood.md, "Records of high rate").

A friction acts over tenths of a second. A reading each millisecond makes a search a hundred times as dear as one each
tenth of a second, and shows hardly more of what is sought. So some readings of a fast record are left out, and no
current: the pieces of constant current between the readings that stay are those of the record, to the microsecond.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, Int64Array
from rw_ekf.diagnosis.prepare.preparation import Prepared, facts_of, unseen_A_s
from rw_ekf.likelihood.fitting import fit_model
from rw_ekf.likelihood.gauss_newton import Problem, Start
from rw_ekf.likelihood.linearisation import Noise
from rw_ekf.likelihood.one_step import Record, Trajectory
from rw_ekf.likelihood.work_budget import Work

# A search of so many samples tries all that it has within its budget; ten minutes at 10 Hz are 6,000.
_MOST_SAMPLES = 8_000
# What a wheel's telemetry usually has: all that is sought is found at that rate (docs/diagnosis-proof.md).
_LEAST_HZ = 10.0


def slower(prepared: Prepared) -> Prepared:
    """The record with every second, third, ... reading alone, its own budget beside it; itself where it is short."""
    course, period_s = prepared.record.course, prepared.record.period_s
    every = min(math.ceil(course.samples / _MOST_SAMPLES), int(1.0 / (_LEAST_HZ * period_s)))
    if every < 2:
        return prepared
    rows = one_of_each(course.speed_rad_s, course.segment, every)
    thin, base, split = course.at(rows), prepared.base, prepared.split.at(rows)
    if prepared.levels is None:
        thin = thin.with_even_pieces(unseen_A_s(base))
    whole, work, logs = prepared.record, Work(), prepared.record.log_of[rows]

    def record(part: BoolArray) -> Record:
        return Record.of(
            thin, part, whole.constants, work, logs, whole.torque_noise,
            angle_is_integrated=whole.angle_is_integrated,
        )  # fmt: skip

    everything = record(np.ones(thin.samples, dtype=bool))
    noise = Noise(base.noise.variance, base.noise.ratio * everything.period_s / period_s)
    path = Trajectory(*(values[rows] if values.size else values for values in base.trajectory))
    fitted = fit_model(Problem(everything, base.prior, base.omit[rows]), Start(base.model, path, noise))
    given = prepared.facts
    facts = facts_of(thin, fitted, given.channels, given.timing_doubt_s, given.log_starts_s)
    kept = np.zeros(prepared.kept.size, dtype=bool)
    kept[np.flatnonzero(prepared.kept)[rows]] = True
    return replace(
        prepared, course=thin, split=split, record=everything, fit_part=record(split.fit),
        heldout=record(split.heldout), base=fitted, kept=kept, _of_fit={},
        facts=replace(facts, stribeck_is_open=given.stribeck_is_open, began_utc_s=given.began_utc_s),
    )  # fmt: skip


def one_of_each(speed_rad_s: Float64Array, segment: Int64Array, every: int) -> BoolArray:
    """Of every so many rows (n,) of a segment the first that has a reading; a segment's first and last row always."""
    n = segment.size
    opens = np.diff(segment, prepend=segment[:1] - 1) != 0
    first = np.maximum.accumulate(np.where(opens, np.arange(n), 0))
    group = np.cumsum(((np.arange(n) - first) % every == 0) | opens)
    read = np.isfinite(speed_rad_s)
    _, at = np.unique(np.where(read, group, 0), return_index=True)
    rows = np.zeros(n, dtype=bool)
    rows[at[read[at]]] = True
    rows[opens | np.roll(opens, -1)] = True  # the last row's next is the first
    return rows
