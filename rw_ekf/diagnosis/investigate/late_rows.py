"""Rows whose current is that of the interval before them: a logger that writes what it has just done.

Read as it stands such a log has every command a row late, so that the machine moves before it is told to; a delay, a
lag and a mean over a window are late the other way. So the base model is fitted to the record read either way. Of 162
simulated logs that are read as they should be none gains more than 4.6 in log-likelihood by the other reading; of 34
that are a row late half gain more than 80. A machine that the base model does not describe may gain by it as by
anything else: it counts where it is worth more than all that was found.
"""

from __future__ import annotations

import math
from dataclasses import replace

from rw_ekf.course.course import Course
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.thresholds import UNDOUBTED_P
from rw_ekf.likelihood.fitting import Fit, fit_model
from rw_ekf.likelihood.gauss_newton import Start
from rw_ekf.logs.row_rules import from_next_row


def said_of_late_rows(found: Found) -> str:
    """A sentence for the front of a verdict, or nothing."""
    prepared = found.prepared
    if prepared.source.log.command_delay_s.any():  # who logs these knows when a command takes force
        return ""
    gain = read_a_row_earlier(prepared).likelihood.value - prepared.base.likelihood.value
    explained = found.fit.likelihood.value - prepared.base.likelihood.value
    if gain < max(explained, -math.log(UNDOUBTED_P)):
        return ""
    return (
        "The log's current seems to stand a row late: as what was in force before each row the model alone explains it "
        f"better by {gain:.0f} in log-likelihood, more than all that was found. If the logger writes what it has just "
        "done, say `current_before: true` in the column map and diagnose again. As it was read: "
    )


def read_a_row_earlier(prepared: Prepared) -> Fit:
    """The base model fitted to the record with each row's current in force before it."""
    record, base = prepared.record, prepared.base
    course = record.course
    current_A = from_next_row(prepared.source.log.current_A[prepared.kept], course.segment)
    moved = Course.of(course.time_s, course.speed_rad_s, current_A, None, course.segment)
    course = course._replace(pieces=moved.pieces, piece_start=moved.piece_start, first_piece=moved.first_piece)
    problem = base.problem._replace(record=replace(record, course=course))
    return fit_model(problem, Start(base.model, base.trajectory, base.noise))
