"""What the held-out part of a record says of effects that the search found: kept, or dropped with a reason."""

from __future__ import annotations

import math
from typing import Any

from rw_ekf.diagnosis.judge.metrics import heldout_likelihood, performance
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.search.event import event_gain
from rw_ekf.diagnosis.search.selection import Search
from rw_ekf.diagnosis.search.trial import Selection
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit

Figures = dict[str, Any]

_WORST_GAIN_PERCENT = -2.0  # an effect that matters does not make the free run worse; a small one may not better it
_VETOED = (
    ("one_step_rms_rpm", "one-step error"),
    ("horizon_1s_rms_rpm", "error 1 s ahead"),
    ("horizon_20s_rms_rpm", "error 20 s ahead"),
    ("free_run_rms_rpm", "free-run error"),
)
# Share by which a held-out figure may grow, and factor by which NIS may be further from 1: for an effect whose free run
# gains clearly, and for one whose does not. Sizes come from another part, so that small ones move figures by chance.
_WORST, _WORSE = (0.07, 1.35), (0.03, 1.15)
_REAL_GAIN = 0.05
_LEAST_EVENT = 4.0  # of twice the log-likelihood on the seconds left out of an event: two sigma


def confirm(prepared: Prepared, search: Search, selection: Selection, names: list[str]) -> None:
    """Drop what worsens the held-out part, by its likelihood or by its free run; an event is not judged there."""
    for name in names:
        if CATALOGUE[name].local_in_time:
            continue
        less = search.without(selection.final, name)
        with_it = heldout_likelihood(prepared.heldout, selection.final, prepared.seen)
        likelier = with_it > heldout_likelihood(prepared.heldout, less, prepared.seen)
        gain = gain_over(prepared, less, selection.final)
        if not likelier or (gain is not None and gain < _WORST_GAIN_PERCENT):
            selection.trials[name].decision = "not confirmed on the held-out part"
            selection.final = less


def veto(prepared: Prepared, search: Search, selection: Selection) -> None:
    """Drop whatever makes one of the held-out figures clearly worse, an event too, the last to enter first."""
    for name in reversed(selection.new_ids):
        less = search.without(selection.final, name)
        before, after = performance(prepared, less).figures, performance(prepared, selection.final).figures
        free = [figures.get("free_run_rms_rpm") for figures in (before, after)]
        gained = bool(free[0] and free[1] and free[1] < (1.0 - _REAL_GAIN) * free[0])
        worse = worsened(before, after, *(_WORST if gained else _WORSE))
        if worse is None and CATALOGUE[name].local_in_time:
            gain = event_gain(search.on_whole(selection.final), name, prepared.prior, prepared.seen)
            if gain is not None and gain.statistic < _LEAST_EVENT:
                worse = f"nothing is gained by it ({gain.percent:+.1f} % on every other 5 s inside it)"
        if worse is not None:
            selection.trials[name].decision = f"not confirmed: on the held-out part {worse}"
            selection.final = less


def worsened(before: Figures, after: Figures, share: float, nis: float) -> str | None:
    """Which held-out figure an effect makes worse, by more than a share, or NIS by more than a factor; in words."""
    for key, words in _VETOED:
        old, new = before.get(key), after.get(key)
        if old and new and new > (1.0 + share) * old:
            return f"the {words} grows by {100.0 * (new / old - 1.0):.2g} %"
    old, new = before.get("nis_mean"), after.get("nis_mean")
    if old and new and abs(math.log(new)) > abs(math.log(old)) + math.log(nis):
        return f"NIS goes from {old:.3g} to {new:.3g}"
    return None


def gain_over(prepared: Prepared, less: Fit, more: Fit) -> float | None:
    """Percent by which the free-run error (20 s ahead where there is none) on the held-out part is smaller."""
    before, after = performance(prepared, less).figures, performance(prepared, more).figures
    key = "free_run_rms_rpm" if before["free_run_rms_rpm"] is not None else "horizon_20s_rms_rpm"
    if not before[key] or after[key] is None:
        return None
    return float(100.0 * (1.0 - after[key] / before[key]))
