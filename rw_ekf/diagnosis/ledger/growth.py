"""How a ledger grows: from its likeliest rows, an effect at a time, and by exchanging effects of the likeliest one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from rw_ekf.diagnosis.checks.checks import of_size
from rw_ekf.diagnosis.hypotheses.changes import settled_change
from rw_ekf.diagnosis.hypotheses.contenders import Search
from rw_ekf.diagnosis.hypotheses.event import with_other_laws
from rw_ekf.diagnosis.hypotheses.impulse import at_once, impulses_together
from rw_ekf.diagnosis.hypotheses.law_grounds import Nameless
from rw_ekf.diagnosis.hypotheses.other_starts import (
    by_likeliest_law,
    in_deepest_valleys,
    lower_valley,
    with_laws_tried_again,
)
from rw_ekf.diagnosis.hypotheses.rivals import rivals_in_place
from rw_ekf.diagnosis.hypotheses.selection import Selection, Trial
from rw_ekf.diagnosis.ledger.ledger import Key, Ledger, Row, made_up_curves
from rw_ekf.diagnosis.standing import Reason, explained_by
from rw_ekf.diagnosis.thresholds import (
    ALIAS_SHARE,
    BEAM,
    LEAST_SIGMAS,
    MOST_GROWN,
    MOST_LAWS,
    MOST_TRIED,
    SIGNIFICANT_P,
)
from rw_ekf.effects.catalogue import CATALOGUE, CHANGE, LEARNED, SPELL
from rw_ekf.likelihood import work_budget
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.robust_fit import likelier_along_filter
from rw_ekf.model.effect import RecordFacts, Term
from rw_ekf.model.effect_kinds import LawEffect

Laws = Callable[[Fit], list[Nameless]]

_BEGINNINGS = (CHANGE.id, SPELL.id)
_MOST_EXCHANGES = 2  # while another row becomes the likeliest


def begun(base: Fit, facts: RecordFacts) -> tuple[Ledger, Selection]:
    """The ledger with the base model alone, and nothing tried."""
    return Ledger(base, facts).with_rows([base]), Selection(base, base)


def grown(
    search: Search, ledger: Ledger, selection: Selection, laws: Laws = lambda fit: []
) -> tuple[Ledger, Selection]:
    """The ledger grown, and what became of each effect on the way.

    laws: beside a fit. Where one of the base model is likelier than all that was found beside that, it is a row from
    then on: what else is searched for is tried beside it as well.
    """
    done: set[Key] = set()
    for turn in range(MOST_GROWN):
        row = next((row for row in ledger.rows[:BEAM] if row.key not in done), None)
        if row is None:
            break
        if turn > 0 and not search.work.has(work_budget.SEARCH):
            present = ", ".join(ledger.rows[0].effects) or "the model"
            search.work.leave_out(f"the search for more than {present}")
            break
        done.add(row.key)
        search.advance("searching the catalogue")
        ledger, selection = _grown_from(search, row, ledger, selection)
        if turn == 0 and len(ledger.rows) > 1 and not row.effects:
            ledger, selection = _with_laws(search, row, ledger, selection, laws, most=1, ahead_of=ledger.rows[0])
    ledger, selection = _in_place_of_laws(search, ledger, selection, laws, done)
    for _ in range(_MOST_EXCHANGES):
        top = ledger.rows[0]
        if not top.effects:
            break
        ledger, selection = _exchanged(search, top, ledger, selection)
        if ledger.rows[0].key == top.key:
            break
    return ledger, selection


def grown_with_laws(search: Search, ledger: Ledger, selection: Selection, laws: Laws) -> tuple[Ledger, Selection]:
    """The ledger grown on by laws without a formula, up to three in a row, and by what is found beside them."""
    done: set[Key] = set()
    waiting = [row for row in ledger.rows if not row.effects][:1]
    for _ in range(MOST_GROWN):
        row = next((row for row in [*waiting, *ledger.rows[:BEAM]] if row.key not in done), None)
        if row is None:
            break
        done.add(row.key)
        terms = row.fit.model.terms
        lasting = [
            t for t in terms if not t.given and issubclass(t.effect, LawEffect) and t.effect.has_a_kind(t, ledger.facts)
        ]
        if len(lasting) < MOST_LAWS:
            search.advance("fitting laws without a formula")
            ledger, selection = _with_laws(search, row, ledger, selection, laws)
            if any(law.is_impulse for law in laws(row.fit)[:1]) and (more := impulses_together(row.fit, ledger.facts)):
                ledger = ledger.with_rows([more])
                selection = _with_trial(selection, more.model.of(SPELL.id)[-1], row.fit, more)
        if any(term.law is not None for term in terms):
            ledger, selection = _grown_from(search, row, ledger, selection)
    return _in_place_of_laws(search, ledger, selection, laws, done)


def _in_place_of_laws(
    search: Search, ledger: Ledger, selection: Selection, laws: Laws, done: set[Key]
) -> tuple[Ledger, Selection]:
    """With named effects, and other laws, in the place of the likeliest row's laws without a formula, beside the rest.

    Alone a law follows a part of what else is there as well, so that it goes ahead of the constant torque, say, that it
    stands for, and whatever is found next is found beside it: a curve over time ahead of what begins at one moment.
    """
    top = ledger.rows[0]
    if LEARNED.id not in top.effects or len(top.effects) == 1:
        return ledger, selection
    row = ledger.row(search.without(top.fit, LEARNED.id))
    if row.key in done:
        return ledger, selection
    ledger, selection = _grown_from(search, row, ledger.with_rows([row.fit]), selection)
    timed = any(term.law is not None and term.law.quantity == "time" for term in top.fit.model.of(LEARNED.id))
    if timed:
        ledger, selection = _with_laws(search, row, ledger, selection, laws)
    if made_up_curves(top.fit):  # the law was found beside less, and is mended by names: it is sought anew
        fit = row.fit
        for name in [name for name in fit.model.effects.ids if CATALOGUE[name].smooth_over_speed]:
            fit = search.without(fit, name)
        ledger, selection = _with_laws(search, ledger.row(fit), ledger.with_rows([fit]), selection, laws)
        fit = ledger.rows[0].fit
        for name in [name for name in fit.model.effects.ids if name in _BEGINNINGS]:  # and so is what stands beside it
            less = search.without(fit, name)
            ledger, selection = _with_laws(search, ledger.row(less), ledger.with_rows([less]), selection, laws)
    return ledger, selection


def _with_laws(
    search: Search, row: Row, ledger: Ledger, selection: Selection, laws: Laws, *,
    most: int = MOST_TRIED, ahead_of: Row | None = None,
) -> tuple[Ledger, Selection]:  # fmt: skip
    """With the likeliest laws beside a row, and each of those without every named effect, and every law, of the row.

    ahead_of: only such as are likelier than this row, and go with no clock: a drift, or a walk, is tried after them.
    """
    least = 0.0 if ahead_of is None else max(ahead_of.weight - row.weight, 0.0)
    for law in [law for law in laws(row.fit) if ahead_of is None or not law.passes][:most]:
        if law.weight <= least:
            break
        term, model = law.term, row.fit.model
        fit = row.fit.refitted(model.with_terms(term))
        earlier = [other for other in model.terms if other.law is not None and other.law.prior_std]
        if term.effect.of_one_record:
            fit, term = settled_change(row.fit, fit, term)
        rows = [row.fit.refitted(model.changed(other, term)) for other in earlier]
        if fit.knows(term.id, LEAST_SIGMAS):
            named = [name for name in row.effects if not issubclass(CATALOGUE[name], LawEffect)]
            rows += [fit, *(search.without(fit, name) for name in named)]
        rows = [one for one in rows if one.model.possible(term.id, ledger.facts)]  # from any other nothing is to grow
        if not rows:
            continue
        selection = _with_trial(selection, term, row.fit, fit)
        ledger = ledger.with_rows(rows)
    return ledger, selection


def _with_trial(selection: Selection, law: Term, less: Fit, fit: Fit) -> Selection:
    """With what became of a law that was fitted beside a model, where none of its kind has gained as much."""
    trial, known = Trial.of_law(law, less, fit), selection.trials.get(law.id)
    return selection.tried(trial) if known is None or known.statistic < trial.statistic else selection


def _exchanged(search: Search, row: Row, ledger: Ledger, selection: Selection) -> tuple[Ledger, Selection]:
    """With rows that have a rival in the place of an effect of one, which is taken to its deepest valley before.

    A rival may do alone what takes two effects: each is tried without every other effect, too.
    """
    here = in_deepest_valleys(replace(selection, final=row.fit), search.facts)
    if here.final is not row.fit:
        ledger = ledger.with_rows([here.final])
    for name, rivals in rivals_in_place(search, here).items():
        for rival in rivals:
            fits = [rival.fit, *_without_others(search, rival.fit, set(row.effects) - {name})]
            ledger = ledger.with_rows(fits, constructed=rival.constructed, waits=rival.waits)
    return ledger, replace(here, final=ledger.base)


def _without_others(search: Search, fit: Fit, others: set[str]) -> list[Fit]:
    """A fit without each of some effects in turn, but for an event, whose place was sought beside the rest."""
    return [search.without(fit, name) for name in sorted(others) if not CATALOGUE[name].local_in_time]


def _grown_from(search: Search, row: Row, ledger: Ledger, selection: Selection) -> tuple[Ledger, Selection]:
    """With the row's strongest contenders beside it, and each of those without every other effect of the row."""
    contenders, selection = search.contenders(row.fit, selection)
    for number, score in enumerate(contenders[:MOST_TRIED]):
        effect, name = score.effect, score.effect.id
        if number and not search.work.has(work_budget.SEARCH):
            search.work.leave_out(f"{name} beside {', '.join(row.effects) or 'the model'}")
            break
        if effect.linear and score.statistic < ALIAS_SHARE * contenders[0].statistic:
            continue
        search.advance(f"fitting {name}")
        fit, statistic = search.fitted(row.fit, score, local=effect.local_in_time)
        trial = Trial.of(score).found_by(statistic, search.facts)
        if selection.trials[name].statistic <= trial.statistic:
            selection = selection.tried(trial)
        if not effect.local_in_time and trial.p_value >= SIGNIFICANT_P:
            continue
        lower = lower_valley(row.fit, fit, trial)
        if lower is not None:
            ledger = ledger.with_rows([lower])
            continue
        fit = by_likeliest_law(row.fit, fit, name, search.facts)
        fit = with_laws_tried_again(fit, row.effects, search.facts)
        fit = search.with_open_speed(likelier_along_filter(fit, row.fit, fit.model))
        refused = next((check.decision for check in of_size(search, fit, name) if check.decision is not None), None)
        if refused is not None:
            selection = selection.decided(name, refused)
            if refused.reason is Reason.IMPOSSIBLE:
                continue
        if effect.local_in_time:
            fit = with_other_laws(fit, name, search.facts)
            event_less = search.without(fit, name)
            impulse = at_once(event_less, fit, name, search.facts)
            if impulse is not None:
                selection = selection.decided(name, explained_by(SPELL.id))
                selection = selection.tried(Trial.of_law(impulse.model.of(SPELL.id)[-1], event_less, impulse))
                ledger = ledger.with_rows([impulse])
                continue
        less = [search.without(fit, other) for other in selection.new_in(fit) if other != name]
        ledger = ledger.with_rows([fit, *less])
    return ledger, selection
