"""Laws of a model that a record goes beyond, and does not bear out there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.beyond_law_range import BeyondLaws
from rw_ekf.diagnosis.hypotheses.law_grounds import Ground, grounds
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.thresholds import UNDOUBTED_P, WORSE
from rw_ekf.likelihood.structure import structure
from rw_ekf.model.law import Law
from rw_ekf.wheel.effect_table import EffectSet


@dataclass(frozen=True)
class LeftBehind:
    """Laws of a model that a record goes beyond and does not bear out there, with words for the user."""

    words: tuple[str, ...] = ()
    at_once: bool = (
        False  # what they are off by there adds to the errors of the record as a whole what a figure may grow by
    )


def laws_left_behind(prepared: Prepared, effects: EffectSet) -> LeftBehind:
    """Those of the model's effects that do not stay there as they are at their edge.

    Held at its edge a law is off by nobody knows what, and what it is off by would be made up of torques, drifts and
    changes that the machine does not have. Whether it is off is tested on the record: by a slope of the law beyond
    either edge, tested as `structure` tests all that a model may lack. One of which there is a doubt stays, and no law
    of time is learned where it is held (`grounds`).
    """
    found, fit = BeyondLaws(effects), prepared.base
    found.add(prepared.record.course)
    laws, left, most = found.laws, list[str](), 0.0
    if not laws or fit.model.has_memory:
        return LeftBehind()
    for ground in grounds(fit, prepared.facts, prepared.source.columns):
        for law, words in laws.items():
            if (ground.quantity, ground.acts_as, ground.column) != (law.quantity, law.acts_as, law.column):
                continue
            wanted = structure(fit, _slopes_beyond(law, ground))
            if wanted.p_value is not None and wanted.p_value < UNDOUBTED_P:
                most = max(most, wanted.statistic)
                left.append(
                    f"{words}, where it is no longer what it is at its edge: it was put aside (the figures before are "
                    "without it), and sought anew"
                )
    return LeftBehind(tuple(left), most > WORSE * fit.linearised.innovation_at.size)


def _slopes_beyond(law: Law, ground: Ground) -> Float64Array:
    """Each prediction's slopes (n, 1 or 2) by the slope that the law has below its first knot, and above its last."""
    below, above = np.minimum(ground.at - law.first, 0.0), np.maximum(ground.at - law.last, 0.0)
    slopes = np.column_stack((below, above)) * ground.slope[:, None]
    return np.ascontiguousarray(slopes[:, np.any(slopes != 0.0, axis=0)])
