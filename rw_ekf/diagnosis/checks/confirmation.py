"""Whether an effect stands what the held-out part of a record says of it."""

from __future__ import annotations

import math
from typing import Any

from rw_ekf.diagnosis.checks.cross_fit import expected_excess
from rw_ekf.diagnosis.checks.event_agreement import agrees_with_itself
from rw_ekf.diagnosis.checks.heldout import ERRORS, by_fit_part, performance, performance_by_turns
from rw_ekf.diagnosis.hypotheses.fixed_size_fits import knows_size
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.thresholds import (
    BEYOND_DOUBT_P,
    BLIND,
    GREAT_GAIN,
    LEAST_SIGMAS,
    REAL_GAIN,
    UNDOUBTED_P,
    WORSE,
    WORSE_NIS,
    WORST,
    WORST_NIS,
)
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect_kinds import LawEffect

Figures = dict[str, Any]

_FAR_AHEAD = ("horizon_20s_rms_rpm", "free_run_rms_rpm")


def veto(prepared: Prepared, more: Fit, name: str, p_value: float) -> str | None:
    """Which held-out figure an effect makes clearly worse, in words.

    What the record leaves no doubt of (p_value: on all of it) is refused only where that is so whichever part is held
    out: half of a record that hardly shows the motor gain, say, may have it several sigma off, and figures in which
    torque noise hides nothing are worse for it. A part that knows so little of the numbers that errors elsewhere would
    grow by that alone has no say. Where neither has one, where the two do not agree on what is not quite beyond doubt,
    and where the only one that has a say refuses what is beyond it, stretches are held out by turns. A law without a
    formula has nothing to show for itself but what it predicts.
    """
    less = more.without(name)
    worse = _worse(prepared, less, more)
    lawful = not issubclass(CATALOGUE[name], LawEffect)
    if worse is not None and p_value < UNDOUBTED_P and knows_size(more, name, LEAST_SIGMAS):
        ways = (way for way in (prepared, prepared.exchanged()) if _can_tell(way, less, more))
        first = next(ways, None)  # of a law without a formula the other part is fitted only where this cannot decide
        if first is None:
            worse = _worse(prepared, less, more, by_turns=True, clearly=True)
        elif lawful:
            wanted = (first, *ways)
            agrees = any(_worse(way, less, more) is None for way in wanted)
            if agrees and p_value < BEYOND_DOUBT_P:
                worse = None
            elif agrees or (len(wanted) == 1 and p_value < BEYOND_DOUBT_P):
                worse = _worse(prepared, less, more, by_turns=True)
    if worse is None and CATALOGUE[name].local_in_time and not agrees_with_itself(more, name):
        worse = "every other 5 s inside it and the rest do not agree on its size"
    return worse


def _can_tell(way: Prepared, less: Fit, more: Fit) -> bool:
    """Whether a part knows enough of both models' numbers for its predictions of the rest to decide between them."""
    return all(for_want_of_knowledge(way, fit) < BLIND for fit in (less, more))


def better_known(prepared: Prepared, fit: Fit) -> Prepared:
    """The parts' roles so that a model's numbers come from the one that knows them well enough; else better."""
    if prepared.split.kind == "halves" or (wants := for_want_of_knowledge(prepared, fit)) < BLIND:
        return prepared
    other = prepared.exchanged()
    return other if for_want_of_knowledge(other, fit) < wants else prepared


def for_want_of_knowledge(way: Prepared, fit: Fit) -> float:
    """The share by which squared errors on the held-out part grow because the other part knows the numbers so well."""
    return expected_excess(fit, by_fit_part(way, fit), way.split.fit)


def _worse(prepared: Prepared, less: Fit, more: Fit, *, by_turns: bool = False, clearly: bool = False) -> str | None:
    """Which held-out figure gets clearly worse from one model to the next, in words.

    Sizes come from another part, so that small ones move figures by chance. Where the free run is nearer by half, only
    errors far ahead count: a model that leaves no torque noise predicts one step as its free run does, and what a
    number of the other part is off by, which torque noise would hide, shows there. By turns it does wherever the free
    run is nearer. clearly: where no half of the record knows the numbers all the rest may not either, so that a figure
    has to grow by as much as NIS may be off.
    """
    judge = performance_by_turns if by_turns else performance
    before, after = (judge(prepared, fit).figures for fit in (less, more))
    old, new = (figures.get("free_run_rms_rpm") for figures in (before, after))
    gain = 1.0 - new / old if old and new else 0.0
    if gain > (REAL_GAIN if by_turns else GREAT_GAIN):
        before = {key: before[key] for key in _FAR_AHEAD}
    if clearly:
        return worsened(before, after, WORST_NIS - 1.0, WORST_NIS)
    return worsened(before, after, *((WORST, WORST_NIS) if gain > REAL_GAIN else (WORSE, WORSE_NIS)))


def worsened(before: Figures, after: Figures, share: float, nis: float) -> str | None:
    """Which held-out figure an effect makes worse, by more than a share, or NIS by more than a factor; in words."""
    for key, words in ERRORS.items():
        old, new = before.get(key), after.get(key)
        if old and new and new > (1.0 + share) * old:
            return f"the {words} grows by {100.0 * (new / old - 1.0):.2g} %"
    old, new = before.get("nis_mean"), after.get("nis_mean")
    if old and new and abs(math.log(new)) > abs(math.log(old)) + math.log(nis):
        return f"NIS goes from {old:.3g} to {new:.3g}"
    return None
