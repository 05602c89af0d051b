"""A friction with a memory, once chosen, fitted again from places all over its numbers.

Near rest the likelihood of a bristle has several valleys in deflection and damping, and the slope in a wrong one says
of a size many sigmas off that it is known to a percent. So a fit is sketched from each place, along the path on which
the model runs freely there, which knows nothing of where the first fit ended, and the deepest valley counts.
"""

from __future__ import annotations

from dataclasses import replace

from rw_ekf.diagnosis.search.candidates import INFLATION, p_value
from rw_ekf.diagnosis.search.selection import Selection
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood import work
from rw_ekf.model.effect import RecordFacts, Term

_DEEPER = 0.5  # log-likelihood by which another valley must be deeper


def in_deepest_valleys(selection: Selection, facts: RecordFacts) -> None:
    """Fit what was chosen and has several valleys again from all of them; what lies deeper stands in its place."""
    for name in selection.new_ids:
        starts = CATALOGUE[name].valleys(selection.final.model.seen_by(CATALOGUE[name], facts))
        record = selection.final.linearised.record
        if not starts:
            continue
        if not record.work.has(work.FITS):
            record.work.leave_out(f"other valleys of {name}")
            continue
        less = selection.without(name)
        model = selection.final.model.without(name)
        sketches = [less.sketched(model.with_terms(Term.at(CATALOGUE[name], start))) for start in starts]
        best = max(sketches, key=lambda fit: fit.likelihood.value)
        if best.likelihood.value < selection.final.likelihood.value + _DEEPER:
            continue
        selection.final = best.refitted(best.model)
        _update(selection, name, 2.0 * (selection.final.likelihood.value - less.likelihood.value), facts)


def _update(selection: Selection, name: str, statistic: float, facts: RecordFacts) -> None:
    trial = selection.trials[name]
    evidence = trial.evidence + 0.5 * (statistic - trial.statistic) / INFLATION
    selection.trials[name] = replace(
        trial, statistic=statistic, evidence=evidence, p_value=p_value(trial.effect, statistic, facts)
    )
