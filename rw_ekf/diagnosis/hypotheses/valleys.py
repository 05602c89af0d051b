"""A friction with a memory, once chosen, fitted again from places all over its numbers.

Near rest the likelihood of a bristle has several valleys in deflection and damping, and the slope in a wrong one says
of a size many sigmas off that it is known to a percent. So a fit is sketched from each place, along the path on which
the model runs freely there, which knows nothing of where the first fit ended, and the deepest valley counts.
"""

from __future__ import annotations

from dataclasses import replace

from rw_ekf.diagnosis.hypotheses.selection import Selection
from rw_ekf.diagnosis.thresholds import DEEPER
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood import work
from rw_ekf.model.effect import RecordFacts, Term


def in_deepest_valleys(selection: Selection, facts: RecordFacts) -> Selection:
    """What was chosen and has several valleys fitted again from all of them; what lies deeper stands in its place."""
    for name in selection.new_ids:
        selection = _in_deepest_valley(selection, name, facts)
    return selection


def _in_deepest_valley(selection: Selection, name: str, facts: RecordFacts) -> Selection:
    effect, final = CATALOGUE[name], selection.final
    starts = effect.valleys(final.model.seen_by(effect, facts))
    record = final.linearised.record
    if not starts:
        return selection
    if not record.work.has(work.FITS):
        record.work.leave_out(f"other valleys of {name}")
        return selection
    less, model = selection.without(name), final.model.without(name)
    sketches = [less.sketched(model.with_terms(Term.at(effect, start))) for start in starts]
    best = max(sketches, key=lambda fit: fit.likelihood.value)
    if best.likelihood.value < final.likelihood.value + DEEPER:
        return selection
    deepest = best.refitted(best.model)
    trial = selection.trials[name].found_by(2.0 * (deepest.likelihood.value - less.likelihood.value), facts)
    return replace(selection.tried(trial), final=deepest)
