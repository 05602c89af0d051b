"""What drifts: dry friction, as the catalogue has it, or something else that no law of the catalogue lets drift.

A dry friction that wanders follows nearly anything that goes with time, a viscous friction that has changed or a torque
that set in as well. But those act in proportion to the speed, or whichever way the wheel turns. So a walk of each is
weighed on the same footing: how much likelier it makes the record, its size and its path integrated out.
"""

from __future__ import annotations

import math

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.hypotheses.group import evidence_of_random
from rw_ekf.diagnosis.hypotheses.profiled import Profiled
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.ledger.evidence import log_evidence
from rw_ekf.diagnosis.thresholds import UNNAMED_LOG_ODDS
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.structure import slopes_by_torque
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, PARAMETERS, STATIC, VISCOUS

_PIECES = 24
_DRY = "dry friction"


def drifts_otherwise(found: Found) -> bool:
    """Whether what goes with the record's time was named where a walk of something else makes the record likelier."""
    passing = [name for name in found.new_ids if CATALOGUE[name].of_one_record]
    if not passing:
        return False
    base, facts, less = found.selection.base, found.prepared.facts, found.fit
    for name in passing:
        less = less.without(name)
    without = found.ledger.row(base).log_evidence
    others = tuple(name for name in found.new_ids if name not in passing)
    beside = log_evidence(less, others, facts) - without if others else 0.0
    walks = {name: beside + factor for name, factor in _walks(less).items()}
    own = max(walks.pop(_DRY), found.ledger.row(found.fit).log_evidence - without)
    if others:
        alone = _walks(base)
        walks = {name: max(factor, alone[name]) for name, factor in walks.items()}
    return max(walks.values()) + UNNAMED_LOG_ODDS - math.log(len(walks)) > own


def _walks(fit: Fit) -> dict[str, float]:
    """By what walks: log of how much likelier the record is with it."""
    linearised, profiled = fit.linearised, Profiled(fit)

    def by(parameter: int) -> Float64Array:
        return linearised.jacobian[:, parameter - PARAMETERS.start]

    carriers = {
        _DRY: by(COULOMB) + by(STATIC),
        "viscous friction": by(VISCOUS),
        "motor gain": by(MOTOR_GAIN),
        "torque": slopes_by_torque(fit)[0],
    }
    ramps = _ramps(linearised.record.course.time_s)
    return {name: evidence_of_random(profiled, slope[:, None] * ramps) for name, slope in carriers.items()}


def _ramps(time_s: Float64Array) -> Float64Array:
    """From 0 to 1 over each piece of the record, (n, _PIECES): steps of a walk."""
    knots = np.linspace(time_s[0], time_s[-1], _PIECES + 1)
    return np.clip((time_s[:, None] - knots[:-1]) / np.diff(knots), 0.0, 1.0)
