"""Laws without a formula as rows of the ledger, where a record calls for one (docs/likelihood.md).

A law of the catalogue makes a definite prediction and pays for one or two numbers. A law of which no more is known than
that it is smooth pays for its freedom, and for being rarer. Where it makes the record likelier all the same, what was
named is an alias of it: the ledger then grows on by such laws, and the likeliest row that passes its checks stands.
"""

from __future__ import annotations

from dataclasses import replace

from rw_ekf.diagnosis.checks.residual_map import residual_map
from rw_ekf.diagnosis.hypotheses.contenders import Search
from rw_ekf.diagnosis.hypotheses.law_grounds import Nameless
from rw_ekf.diagnosis.hypotheses.learned_laws import laws_beside
from rw_ekf.diagnosis.hypotheses.rivals import twins_in_place
from rw_ekf.diagnosis.investigate.found import Found, mapped
from rw_ekf.diagnosis.investigate.investigation import with_widths
from rw_ekf.diagnosis.ledger.choice import chosen
from rw_ekf.diagnosis.ledger.growth import grown_with_laws
from rw_ekf.diagnosis.ledger.ledger import made_up_curves
from rw_ekf.diagnosis.prepare.preparation import Advance
from rw_ekf.diagnosis.standing import Decision, Reason
from rw_ekf.diagnosis.thresholds import MAP_P
from rw_ekf.likelihood import work_budget
from rw_ekf.likelihood.fitting import Fit


def with_laws(found: Found, advance: Advance) -> Found:
    """What stands when laws without a formula are rows too; the same where none is worth a row."""
    if not found.prepared.record.work.has(work_budget.LAWS):
        found.prepared.record.work.leave_out("laws without a formula")
        return found
    advance("weighing laws without a formula")
    prepared = found.prepared if found.corrected is None else found.corrected
    base, facts = found.selection.base, prepared.facts

    def laws(fit: Fit) -> list[Nameless]:
        return laws_beside(prepared, fit)

    own = found.ledger.row(found.fit).weight - found.ledger.row(base).weight
    alone = max((law.weight for law in laws(base)), default=0.0)
    ahead, beside = alone - own, alone
    if found.new_ids:
        found = replace(found, unnamed_odds=ahead)
        beside = max((law.weight for law in laws(found.fit)), default=0.0)
    if max(ahead, beside) <= 0.0 and not made_up_curves(found.fit):
        return found
    search = Search(prepared.record, facts, advance)
    ledger = found.ledger.unchecked().with_rows([found.fit])
    selection = replace(found.selection, final=ledger.base, rivals={})
    ledger, selection = grown_with_laws(search, ledger, selection, laws)
    ledger, selection = chosen(prepared, search, ledger, selection)
    if twins := twins_in_place(search, selection):
        begun = replace(selection, final=ledger.base, rivals={})
        ledger, selection = chosen(prepared, search, ledger.with_rows(twins), begun)
    advance("mapping the residual")
    other = mapped(prepared, selection, ledger)
    if not other.new_ids or (other.is_unexplained and found.is_unexplained):
        tried = {**selection.trials, **found.selection.trials}  # what became of the laws as well
        weighed = replace(found, weighed=ledger.rows, selection=replace(found.selection, trials=tried))
        return _unexplained(weighed) if ahead > 0.0 and not other.new_ids else weighed
    wide = with_widths(other, advance)
    return replace(wide, prepared=found.prepared, lattice=found.lattice, corrected=found.corrected)


def _unexplained(found: Found) -> Found:
    """The same with nothing named; as it was where nothing would be left without."""
    if not found.new_ids or found.is_unexplained:
        return found
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
    share = min(max(explained, 0.0) / max(there, 1.0e-12), 1.0)
    return replace(
        found, selection=selection, fit=base, reported=base, dependences=dependences, left=left, new_ids=[],
        is_unexplained=True, share=share, nearest=found.fit,
    )  # fmt: skip
