"""The ledger: every hypothesis about a record that was fitted, and how likely it is (docs/likelihood.md, "The ledger").

A row is a model of the whole record: the base with effects beyond it. Rows are grown from the likeliest rows, an effect
at a time, and never change. How likely one is, is one number: its log-evidence, and what was known before the record.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from rw_ekf.diagnosis.checks.checks import Check
from rw_ekf.diagnosis.hypotheses.law_grounds import LAW_LOG_ODDS
from rw_ekf.diagnosis.ledger.evidence import log_evidence
from rw_ekf.diagnosis.thresholds import INDISTINGUISHABLE
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import RecordFacts, Term
from rw_ekf.model.law import OF_SPEED

_MOST_REPORTED = 8  # rows that a document has, whatever became of them
_ONE_RECORD_ODDS = -INDISTINGUISHABLE  # log, of what only this record's clock shows, beside what holds at any time

Key = frozenset[tuple[str, float, int]]


def key_of(fit: Fit) -> Key:
    """What is in a model: ids, each order or frequency of a periodic effect for itself; of laws how many of each."""
    counts = Counter((term.id, _number_of(term)) for term in fit.model.terms)
    laws = {term.id for term in fit.model.terms if term.law is not None}
    return frozenset((*one, count if one[0] in laws else 1) for one, count in counts.items())


def _number_of(term: Term) -> float:
    if term.law is not None:
        return term.law.number
    return round(term.shape[0], 6) if term.effect.repeats else 0.0


def made_up_curves(fit: Fit) -> int:
    """How many drags over speed make up a curve that has no name, and pay for it as a law without a formula does.

    All of them beside such a law of the speed; else all but one, where they cancel. Each has a name, and none of them
    is there.
    """
    signs = [math.copysign(1.0, term.values[0]) for term in fit.model.terms if term.effect.smooth_over_speed]
    if any(law.quantity in OF_SPEED and law.acts_as == "drag" for law in fit.model.sought_laws):
        return len(signs)
    return len(signs) - 1 if len(set(signs)) > 1 else 0


@dataclass(frozen=True, eq=False)
class Row:
    """A hypothesis: effects beyond the base model, their fit to the whole record, and how likely that makes it."""

    effects: tuple[str, ...]
    fit: Fit
    log_evidence: float
    log_odds: float  # before the record was seen
    constructed: bool = False  # the record has an effect of it as one with that of another row: no likelihood decides
    waits: bool = False  # and that goes first
    checks: tuple[Check, ...] = ()  # that were made, up to one that it fails

    @property
    def key(self) -> Key:
        """What is in it."""
        return key_of(self.fit)

    @property
    def term_counts(self) -> Counter[str]:
        """How many terms of each effect there are in it, the base model's among them."""
        return Counter(name for name, _, count in self.key for _ in range(count))

    @property
    def weight(self) -> float:
        """Log of how likely it is, but for a constant."""
        return self.log_evidence + self.log_odds


@dataclass(frozen=True, eq=False)
class Ledger:
    """All rows so far, the likeliest first."""

    base: Fit
    facts: RecordFacts
    rows: tuple[Row, ...] = ()

    def row(self, fit: Fit, *, constructed: bool = False, waits: bool = False) -> Row:
        """A fitted model as a row: that which it has already, or a new one."""
        known = next((row for row in self.rows if row.fit is fit), None)
        if known is not None:
            return known
        effects = fit.model.effects.beyond(self.base.model.effects)
        odds = sum(_ONE_RECORD_ODDS for name in effects if CATALOGUE[name].of_one_record)
        odds += sum(
            _ONE_RECORD_ODDS for law in fit.model.sought_laws if law.quantity == "time" and len(law.functions) > 1
        )
        odds += LAW_LOG_ODDS * made_up_curves(fit)
        return Row(effects, fit, log_evidence(fit, effects, self.facts), odds, constructed, waits)

    def with_rows(self, fits: Iterable[Fit], *, constructed: bool = False, waits: bool = False) -> Ledger:
        """With further rows; of two that hold the same the likelier."""
        rows = {row.key: row for row in self.rows}
        for fit in fits:
            row = self.row(fit, constructed=constructed, waits=waits)
            if row.key not in rows or rows[row.key].weight < row.weight:
                rows[row.key] = row
        return replace(self, rows=tuple(sorted(rows.values(), key=lambda row: (row.waits, -row.weight))))

    def with_checks(self, fit: Fit, *checks: Check) -> Ledger:
        """With these checks of a model's row, beside those made before."""
        key = key_of(fit)
        rows = (replace(row, checks=(*row.checks, *checks)) if row.key == key else row for row in self.rows)
        return replace(self, rows=tuple(rows))

    def unchecked(self) -> Ledger:
        """With no row checked yet: whatever a check stands on has changed."""
        return replace(self, rows=tuple(replace(row, checks=()) for row in self.rows))

    def document(self, stands: Fit | None) -> list[dict[str, Any]]:
        """The likeliest rows, the one that stands, the base model, and all that were checked at all."""
        key, bare = None if stands is None else key_of(stands), key_of(self.base)
        best = max((row.weight for row in self.rows if not row.waits), default=0.0)
        return [
            {
                "effects": list(row.effects), "log_evidence": row.log_evidence, "log_odds": row.log_odds,
                "behind": best - row.weight, "stands": row.key == key,
                "as_one_by_construction": row.constructed, "checks": [check.document() for check in row.checks],
            }
            for number, row in enumerate(self.rows)
            if number < _MOST_REPORTED or row.checks or row.key in (key, bare)
        ]  # fmt: skip

    def in_place(self, chosen: Row, name: str) -> list[tuple[str, Row]]:
        """Rows that have one other effect in the place of one of a row, with its id, and of the rest as many terms."""
        rest = chosen.term_counts - Counter({name: len(chosen.fit.model.of(name))})
        found = []
        for row in self.rows:
            new = row.term_counts - rest
            if rest <= row.term_counts and len(new) == 1 and name not in new:
                found.append((next(iter(new)), row))
        return found
