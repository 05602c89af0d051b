"""A law that has no name, as a rival of those that have one (docs/likelihood.md, "A law without a name").

A law of the catalogue makes a definite prediction and pays for one or two numbers. A law of which no more is known
than that it is smooth, in speed, current or temperature, and acts as a drag, as a torque or on the motor's gain, pays
for the freedom that it has, and for being rarer; what a law of the catalogue is itself is not in it. Where it makes the
record likelier nevertheless, what was named is an alias of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from rw_ekf.diagnosis.checks.checks import Check
from rw_ekf.diagnosis.checks.residual_map import covers_of, residual_map
from rw_ekf.diagnosis.hypotheses.group import evidence_of_random
from rw_ekf.diagnosis.hypotheses.profiled import Profiled
from rw_ekf.diagnosis.hypotheses.wander import followed_finely
from rw_ekf.diagnosis.investigate.drifting import drifts_otherwise
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.standing import Decision, Reason
from rw_ekf.diagnosis.thresholds import MAP_P, UNNAMED_LOG_ODDS
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import RecordFacts

Advance = Callable[[str], object]

_LAWS_OF = ("speed", "current", "temperature")
LIKELIER_WALK = Decision(Reason.UNLIKELIER, "a walk of something else")
UNNAMED_LAW = Decision(Reason.UNLIKELIER, "a law without a name")


@dataclass(frozen=True)
class UnnamedLaw:
    """The likeliest law without a name beside a model."""

    dependence: str
    log_factor: float  # by how much the record is likelier with it, what it is beforehand included


def unnamed_law(fit: Fit, facts: RecordFacts) -> UnnamedLaw | None:
    """The likeliest law without a name beside a fitted model; None where the record can show none."""
    profiled = Profiled(fit)
    covers = [(name, cover) for name, found in covers_of(fit, facts).items() if name in _LAWS_OF for cover in found]
    weighed = [(evidence_of_random(profiled, cover.smooth(unnamed=True)), name) for name, cover in covers]
    if not weighed:
        return None
    factor, name = max(weighed)
    return UnnamedLaw(name, factor + UNNAMED_LOG_ODDS - math.log(len(weighed)))


def weighed_against_unnamed(found: Found, advance: Advance) -> Found:
    """The same, or a record that nothing explains, where one law without a name is likelier than all that were named.

    It has to be likelier than those together with such a law beside them, too.
    A friction that wanders has no law itself, and is left alone.
    """
    if not found.new_ids or found.is_unexplained:
        return found
    advance("weighing a law without a name")
    if drifts_otherwise(found):
        return _unexplained(_checked(found, "likelier than a walk of something else", None, LIKELIER_WALK))
    if followed_finely(found.fit) is not None:
        return found
    base, facts = found.selection.base, found.prepared.facts
    without = found.ledger.row(base).log_evidence
    named = found.ledger.row(found.fit).log_evidence - without
    unnamed = unnamed_law(base, facts)
    if unnamed is None:
        return found
    odds = unnamed.log_factor - named
    found = replace(found, unnamed_odds=odds)
    beside = unnamed_law(found.fit, facts) if odds > 0.0 else None
    stands = odds <= 0.0 or (beside is not None and unnamed.log_factor <= named + beside.log_factor)
    found = _checked(found, "log odds to a law without a name", -odds, None if stands else UNNAMED_LAW)
    return found if stands else _unexplained(found)


def _checked(found: Found, name: str, value: float | None, why: Decision | None) -> Found:
    ledger = found.ledger.with_checks(found.fit, Check(name, "", value, None if value is None else 0.0, why))
    return replace(found, ledger=ledger)


def _unexplained(found: Found) -> Found:
    """The same with nothing named; as it was where nothing would be left without."""
    base, facts = found.selection.base, found.prepared.facts
    dependences = residual_map(base, facts)
    left = [item for item in dependences if item.p_value < MAP_P]
    if not left:
        return found
    selection = replace(found.selection, final=base, rivals={})
    for name in found.new_ids:
        selection = selection.decided(name, Decision(Reason.PARTIAL))
    explained = 2.0 * (found.fit.likelihood.value - base.likelihood.value)
    there = max(item.statistic for item in left)
    return replace(
        found,
        selection=selection,
        fit=base,
        reported=base,
        dependences=dependences,
        left=left,
        new_ids=[],
        is_unexplained=True,
        share=min(max(explained, 0.0) / max(there, 1.0e-12), 1.0),
        nearest=found.fit,
    )
