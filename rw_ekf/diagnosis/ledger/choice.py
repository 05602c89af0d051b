"""Which row of the ledger stands: the likeliest that passes every check, with its rivals."""

from __future__ import annotations

from dataclasses import replace

from rw_ekf.diagnosis.checks.checks import Check, checks
from rw_ekf.diagnosis.hypotheses.confounding import quantity_of
from rw_ekf.diagnosis.hypotheses.contenders import Search
from rw_ekf.diagnosis.hypotheses.selection import Rival, Selection
from rw_ekf.diagnosis.ledger.ledger import Key, Ledger, Row
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.standing import SMALL_OR_UNKNOWN, Reason, explained_by
from rw_ekf.diagnosis.thresholds import INDISTINGUISHABLE, TIE
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.model.effect_kinds import LawEffect


def chosen(prepared: Prepared, search: Search, ledger: Ledger, selection: Selection) -> tuple[Ledger, Selection]:
    """The likeliest row that passes every check, its rivals beside it; the ledger with the checks of each row.

    A row that is far less likely than one that a check refused does not stand for it, unless it is what is left of it.
    """
    top, refused = ledger.rows[0], set[Key]()
    while (row := _next(ledger, top, refused)) is not None:
        results: list[Check] = []
        for check in checks(prepared, search, row.fit, row.effects, selection):
            results.append(check)
            if not check.passed:
                break
        ledger = ledger.with_checks(row.fit, *results)
        failed = next((check for check in results if not check.passed), None)
        if failed is None or failed.decision is None:
            return ledger, _with_rivals(ledger, row, selection)
        if failed.effect in selection.trials:
            selection = selection.decided(failed.effect, failed.decision)
        refused.add(row.key)
        ledger = ledger.with_rows([search.without(row.fit, failed.effect)])
    return ledger, replace(selection, final=ledger.base)


def _next(ledger: Ledger, top: Row, refused: set[Key]) -> Row | None:
    """The likeliest row that may stand and was not refused."""
    for row in ledger.rows:
        is_near = top.weight - row.weight <= INDISTINGUISHABLE or set(row.effects) <= set(top.effects)
        if is_near and not row.waits and row.key not in refused:
            first = _by_first_name(ledger, row)
            return _or_one_that_waited(ledger, row if first.key in refused else first, refused)
    return None


def _or_one_that_waited(ledger: Ledger, row: Row, refused: set[Key]) -> Row:
    """A row; where it goes with time itself, a likelier one that waited for what goes with the motion."""
    timed = any(quantity_of(CATALOGUE[name]) == "time" for name in row.effects)
    if not timed and all(law.quantity != "time" for law in row.fit.model.sought_laws):
        return row
    waited = [other for other in ledger.rows if other.waits and other.key not in refused and other.weight > row.weight]
    return max(waited, key=lambda other: other.weight, default=row)


def _by_first_name(ledger: Ledger, row: Row) -> Row:
    """Of rows that are equally likely that whose effects the catalogue has first."""
    order = [*CATALOGUE]
    twins = [row]
    for name in row.effects:
        for _, other in ledger.in_place(row, name):
            if abs(other.weight - row.weight) < TIE and other.log_odds == row.log_odds and not other.waits:
                twins.append(other)
    return min(twins, key=lambda item: sorted(order.index(name) for name in item.effects))


def _has_no_size_of(row: Row, rival: str) -> bool:
    """Whether a row was refused for the size of something that it has beside a rival: it is likelier for that alone."""
    failed = {check.decision.reason for check in row.checks if check.decision is not None and check.effect != rival}
    return bool(failed & {*SMALL_OR_UNKNOWN, Reason.IMPOSSIBLE})


def _with_rivals(ledger: Ledger, row: Row, selection: Selection) -> Selection:
    """With the rows indistinguishable from one: as likely, or what time does in a record that has it as one."""
    rivals: dict[str, list[Rival]] = {}
    for name in row.effects:
        for other, item in ledger.in_place(row, name):
            ahead = item.weight - row.weight
            lawful = issubclass(CATALOGUE[name], LawEffect)  # what a record has as one with a law was not tested
            is_time_as_one = item.constructed and quantity_of(CATALOGUE[other]) == "time" and not lawful
            if (is_time_as_one or ahead > -INDISTINGUISHABLE) and not _has_no_size_of(item, other):
                rival = Rival(other, item.fit, ahead, item.constructed or row.constructed)
                rivals.setdefault(name, []).append(rival)
    for other in {item.name for found in rivals.values() for item in found} - set(row.effects):
        if other in selection.trials:
            selection = selection.decided(other, explained_by(*row.effects))
    likeliest_first = {name: tuple(sorted(found, key=lambda item: -item.ahead)) for name, found in rivals.items()}
    return replace(selection, final=row.fit, rivals=likeliest_first)
