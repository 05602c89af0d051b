"""Rows whose current is that of the interval before them: a logger that writes what it has just done.

Read as it stands such a log has every command a row late, so that the machine moves before it is commanded; a delay, a
lag and a mean over a window are late the other way. So the base model is fitted to the record read either way. Of 162
simulated logs that are read as they should be none gains more than 4.6 in log-likelihood by the other reading; of 34
that are a row late half gain more than 80. A machine that the base model does not describe may gain by it as by
anything else: it counts where it is worth more than all that was found, each number of which costs what it does in BIC
[Schwarz 1978]: another reading of the log has none. Half a row is what the current of a moment
leaves as well, where a controller that is faster than the log keeps acting (`sampled_loop.py`).
"""

from __future__ import annotations

import math

import numpy as np

from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.prepare.current_levels import read_with
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.thresholds import UNDOUBTED_P
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.logs.row_rules import from_next_row

_EARLIER = {1.0: "before each row", 0.5: "from half a row earlier on"}  # by shares of a row
_OR_MEAN = "; if a controller that is faster than the log goes on between rows, log the mean of its current over them"


def sentence_about_late_rows(found: Found) -> str:
    """A sentence for the front of a verdict, or nothing.

    A speed that is the mean over the row before it, as counts make it, is half a row late: beside a current that is a
    row late it takes half of that back, and read a whole row earlier such a record is worse than as it stands.
    """
    prepared = found.prepared
    if prepared.source.log.command_delay_s.any():  # who logs these knows when a command takes force
        return ""
    gains = {by: read_earlier(prepared, by).likelihood.value - prepared.base.likelihood.value for by in _EARLIER}
    numbers = found.fit.model.vector.size - prepared.base.model.vector.size
    readings = int(np.count_nonzero(np.isfinite(prepared.record.course.speed_rad_s)))
    explained = found.fit.likelihood.value - prepared.base.likelihood.value - 0.5 * numbers * math.log(readings)
    by = max(gains, key=lambda by: gains[by])
    if gains[by] < max(explained, -math.log(UNDOUBTED_P)):
        return ""
    return (
        f"The log's current seems to stand a row late: as what was in force {_EARLIER[by]} the model alone explains it "
        f"better by {gains[by]:.0f} in log-likelihood, more than all that was found. If the logger writes what it has "
        f"just done, say `current_before: true` in the column map{_OR_MEAN if by < 1.0 else ''}; and diagnose again. "
        "As it was read: "
    )


def read_earlier(prepared: Prepared, by: float = 1.0) -> Fit:
    """The base model fitted to the record with each row's current in force before it, by this share of a row."""
    course = prepared.record.course
    later = np.full(course.samples, (1.0 - by) * course.period_s)
    return read_with(prepared.base, from_next_row(prepared.current_A, course.segment), later)
