"""A model of an earlier record beside the wheel's numbers in this one: what has changed, where no effect is new."""

from __future__ import annotations

import math

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.prepare.preparation import GivenParameters
from rw_ekf.model.state import PARAMETER_COUNT, PARAMETER_NAMES, STATE_UNITS
from rw_ekf.numbers import plus_minus
from rw_ekf.second_record import MOVED, contradict


def sentence_since_model(found: Found) -> str:
    """Which parameters this record has otherwise than the model that was given; nothing where it has them so.

    By the test by which a replay finds that a log contradicts its model. Where an effect is new, or the record is
    unexplained, the parameters beside it mean something else, and nothing is reported.
    """
    given = found.prepared.given
    if found.new_ids or found.is_unexplained or given is None:
        return ""
    here = slice(0, PARAMETER_COUNT)
    now, own = np.array(found.fit.model.parameters), found.reported.likelihood.covariance[here, here]
    off = now - given.values
    if not contradict(off, own + given.covariance):
        return ""
    size = np.sqrt(np.diag(own + given.covariance))
    moved = [_moved(i, now, own, given) for i in range(PARAMETER_COUNT) if abs(off[i]) > MOVED * size[i]]
    which = ", ".join(moved) if moved else "all four parameters together"
    return f"The wheel has changed since the model given was made, or is another: {which}. "


def _moved(i: int, now: Float64Array, own: Float64Array, given: GivenParameters) -> str:
    before = float(given.values[i])
    share = f", {100.0 * (now[i] - before) / before:+.2g} %" if before else ""
    where = "in the model after what changed in its record" if given.changed else "in the model"
    return (
        f"{PARAMETER_NAMES[i]} {plus_minus(float(now[i]), math.sqrt(own[i, i]))} {STATE_UNITS[PARAMETER_NAMES[i]]} "
        f"({plus_minus(before, math.sqrt(given.covariance[i, i]))} {where}{share})"
    )
