"""The ledger: rows weighed by evidence, the likeliest that passes every check, what is left of one that does not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from rw_ekf.diagnosis.checks.checks import Check, of_size
from rw_ekf.diagnosis.hypotheses.contenders import Search
from rw_ekf.diagnosis.hypotheses.learned_laws import laws_beside
from rw_ekf.diagnosis.hypotheses.selection import Selection
from rw_ekf.diagnosis.investigate import law_rows
from rw_ekf.diagnosis.investigate.found import mapped
from rw_ekf.diagnosis.ledger import choice, growth
from rw_ekf.diagnosis.ledger.choice import chosen
from rw_ekf.diagnosis.ledger.evidence import log_evidence
from rw_ekf.diagnosis.ledger.growth import begun, grown
from rw_ekf.diagnosis.ledger.ledger import Ledger
from rw_ekf.diagnosis.log_diagnosis import richer_part
from rw_ekf.diagnosis.prepare.preparation import Prepared, prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.diagnosis.standing import Decision, Reason
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.by_simulation import at_given_numbers
from rw_ekf.likelihood.fitting import Fit, _sigmas
from rw_ekf.model.effect import Candidate, Term
from tests.diagnosis.simulated import log_of, simulated
from tools.proof.uncatalogued_laws import Nameless


@lru_cache
def record() -> Prepared:
    """Five minutes of a wheel with windage and an offset."""
    effects = ["quadratic_drag:coefficient_1_rad=6e-5", "offset_torque:torque_rad_s2=0.03"]
    run = simulated(effects, seed=4, samples=3000, noise_rpm=1.0)
    return richer_part(prepare(source_of([log_of(run)]), None, None, "blocks"))


def search() -> Search:
    """Of that record."""
    return Search(record().record, record().facts, lambda text: None)


@lru_cache
def full() -> tuple[Ledger, Selection]:
    """All that is fitted to it."""
    return grown(search(), *begun(record().base, record().facts))


def with_effects(*names: str) -> Fit:
    """The base model with effects, fitted from their usual start."""
    base = record().base
    return base.refitted(base.model.with_terms(*(Term.of(CATALOGUE[name]) for name in names)))


def test_rows_stand_in_the_order_of_their_evidence_each_once() -> None:
    """Their weight is the integrated likelihood of the very fit, the base model is among them, and no two are alike."""
    ledger, _ = full()
    weights = [row.weight for row in ledger.rows if not row.waits]
    assert weights == sorted(weights, reverse=True)
    assert len({row.key for row in ledger.rows}) == len(ledger.rows)
    assert () in [row.effects for row in ledger.rows]
    for row in ledger.rows:
        assert row.log_evidence == pytest.approx(log_evidence(row.fit, row.effects, record().facts), abs=1e-9)
    assert set(ledger.rows[0].effects) == {"quadratic_drag", "offset_torque"}


def test_a_fit_that_stopped_short_has_the_evidence_of_where_it_is() -> None:
    """And not of where its slope leads: a delay at the edge of an interval was likeliest by a step out of reach."""
    fit = with_effects("quadratic_drag", "offset_torque")
    moved = fit.model.vector + np.eye(fit.std.size)[0] * 8.0 * fit.std
    short = at_given_numbers(fit, fit.model.with_vector(moved), fit.likelihood.covariance)
    lost = fit.likelihood.value - short.likelihood.value
    assert lost > 15.0
    evidence = [log_evidence(one, ("quadratic_drag", "offset_torque"), record().facts) for one in (fit, short)]
    assert evidence[0] - evidence[1] == pytest.approx(lost, rel=0.15)


def test_of_two_rows_that_hold_the_same_the_likelier_stays() -> None:
    """Whatever the order in which they come."""
    one = with_effects("quadratic_drag")
    other = record().base.sketched(one.model)
    weights = {fit: log_evidence(fit, ("quadratic_drag",), record().facts) for fit in (one, other)}
    assert weights[one] != weights[other]
    for fits in ([one, other], [other, one]):
        ledger = Ledger(record().base, record().facts).with_rows(fits)
        assert [row.log_evidence for row in ledger.rows] == [max(weights.values())]


def test_a_row_with_a_term_more_has_none_of_its_effects_in_the_place_of_another() -> None:
    """A torque that is likelier beside a second ripple is no rival beside one."""
    base = record().base
    ripple, second = (Term.at(CATALOGUE["torque_ripple"], Candidate(0.1, (order, 0.0, 0.0))) for order in (1.0, 7.0))
    offset, asymmetry = (Term.of(CATALOGUE[name], value=0.03) for name in ("offset_torque", "viscous_asymmetry"))
    fits = [base.sketched(base.model.with_terms(*terms)) for terms in (
        (ripple, offset), (ripple, asymmetry), (ripple, second, asymmetry), (ripple, offset, asymmetry),
    )]  # fmt: skip
    ledger = Ledger(base, record().facts).with_rows(fits)
    found = ledger.in_place(ledger.row(fits[0]), "offset_torque")
    assert [(name, row.fit) for name, row in found] == [("viscous_asymmetry", fits[1])]


def test_a_rival_may_stand_for_what_was_found_beside_a_term_given_of_the_same_effect() -> None:
    """The given term of a ripple stays in both rows; only the order that was found is exchanged, or left out."""
    base = record().base
    ripple, second = (Term.at(CATALOGUE["torque_ripple"], Candidate(0.1, (order, 0.0, 0.0))) for order in (1.0, 7.0))
    offset, asymmetry = (Term.of(CATALOGUE[name], value=0.03) for name in ("offset_torque", "viscous_asymmetry"))
    given = base.sketched(base.model.with_terms(replace(ripple, given=True)))
    found, rival = (given.sketched(given.model.with_terms(term)) for term in (second, offset))
    ledger = Ledger(given, record().facts).with_rows([found, rival])
    assert [row.effects for row in (ledger.row(found), ledger.row(rival))] == [("torque_ripple",), ("offset_torque",)]
    assert [name for name, _ in ledger.in_place(ledger.row(found), "torque_ripple")] == ["offset_torque"]
    assert [term.shape[0] for term in found.model.of("torque_ripple")] == [7.0]
    assert [term.shape[0] for term in found.model.without("torque_ripple").of("torque_ripple")] == [1.0]
    assert given.model.without("torque_ripple").effects.terms == ()  # alone it is pruned like any other
    pruned = given.sketched(base.model.with_terms(asymmetry))
    selection = Selection(given, pruned, searched=((given, {}),))
    assert selection.without("viscous_asymmetry").model.effects.terms == ()


def test_a_row_that_is_refused_for_the_size_of_something_else_is_no_rival() -> None:
    """It may be likelier for that alone, which no machine has."""
    fits = [with_effects("quadratic_drag", "offset_torque"), with_effects("cubic_drag", "offset_torque")]
    ledger = Ledger(record().base, record().facts).with_rows(fits)
    row, selection = ledger.row(fits[0]), Selection(record().base, record().base)

    def rivals(reason: Reason, effect: str) -> list[str]:
        wanted = ledger.with_checks(fits[1], Check("size", effect, 0.0, 0.0, Decision(reason)))
        likelier = replace(row, log_evidence=ledger.row(fits[1]).log_evidence)
        found = choice._with_rivals(wanted, likelier, selection).rivals
        return [rival.name for rival in found.get("quadratic_drag", ())]

    assert rivals(Reason.NOT_CONFIRMED, "offset_torque") == ["cubic_drag"]
    assert rivals(Reason.IMPOSSIBLE, "cubic_drag") == ["cubic_drag"]
    assert rivals(Reason.IMPOSSIBLE, "offset_torque") == []


def test_what_only_this_record_s_clock_tells_has_lower_odds_beforehand() -> None:
    """By the three sigma within which two explanations are not told apart."""
    ledger = Ledger(record().base, record().facts)
    assert ledger.row(with_effects("coulomb_drift")).log_odds == -4.5
    assert ledger.row(with_effects("quadratic_drag")).log_odds == 0.0


def test_the_row_that_stands_has_passed_every_check_and_says_so() -> None:
    """Both effects of the wheel; each was asked everything, what costs most last."""
    ledger, selection = chosen(record(), search(), *full())
    assert set(selection.new_ids) == {"quadratic_drag", "offset_torque"}
    row = next(item for item in ledger.document(selection.final) if item["stands"])
    wanted = [(check["effect"], check["check"]) for check in row["checks"]]
    assert all(check["passed"] for check in row["checks"])
    assert len(wanted) == len(set(wanted)) == 12
    assert [name for _, name in wanted][-2:] == ["held-out figures"] * 2


def test_a_size_that_is_large_and_not_known_is_not_called_too_small() -> None:
    """An offset of which nothing is known is refused as unsettled; a thousandth of it, well known, as too small."""
    fit, name = with_effects("quadratic_drag", "offset_torque"), "offset_torque"

    def refusals(fit: Fit) -> list[Reason]:
        return [check.decision.reason for check in of_size(search(), fit, name) if check.decision is not None]

    assert refusals(fit) == []
    assert refusals(fit.widened(np.full(fit.model.vector.size, 100.0))) == [Reason.UNKNOWN_SIZE]
    vector = fit.model.vector.copy()
    vector[-1] *= 1e-3
    small = replace(fit, model=fit.model.with_vector(vector)).widened(np.full(vector.size, 1e-5))
    assert refusals(small) == [Reason.TOO_SMALL]


def test_of_a_row_that_fails_what_is_left_may_stand(monkeypatch: pytest.MonkeyPatch) -> None:
    """An effect that a check refuses is in nothing that stands; the other one is kept, though far less likely."""

    def no_offset(prepared: Prepared, search: Search, fit: Fit, effects: tuple[str, ...], *_: Any) -> Iterator[Check]:
        for name in effects:
            why = Decision(Reason.TOO_SMALL) if name == "offset_torque" else None
            yield Check("is liked", name, None, None, why)

    monkeypatch.setattr(choice, "checks", no_offset)
    ledger, selection = chosen(record(), search(), *full())
    assert selection.new_ids == ["quadratic_drag"]
    assert selection.trials["offset_torque"].decision.reason is Reason.TOO_SMALL
    assert not ledger.rows[0].checks[-1].passed


def test_where_every_row_fails_the_model_alone_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    """The base has no effect that could be asked anything."""

    def nothing_stands(
        prepared: Prepared, search: Search, fit: Fit, effects: tuple[str, ...], *_: Any
    ) -> Iterator[Check]:
        yield from (Check("is liked", name, None, None, Decision(Reason.TOO_SMALL)) for name in effects)

    monkeypatch.setattr(choice, "checks", nothing_stands)
    _, selection = chosen(record(), search(), *full())
    assert selection.new_ids == []


def test_what_waited_for_the_motion_stands_before_a_less_likely_thing_that_goes_with_time_itself() -> None:
    """Where time goes with speed a curve of time waits for laws of the motion, and not for another curve of time."""
    waiting, timed, moving = (with_effects(name) for name in ("quadratic_drag", "coulomb_drift", "offset_torque"))
    for here, stands in ((timed, waiting), (moving, moving)):
        ledger = Ledger(record().base, record().facts).with_rows([here]).with_rows([waiting], waits=True)
        row = choice._next(ledger, ledger.rows[0], set())
        assert row is not None
        assert row.fit is stands


@lru_cache
def windy() -> Prepared:
    """A wheel whose drag grows with the square of the speed and with the pressure, which is logged."""
    return richer_part(prepare(source_of([Nameless("windage by pressure", 31).log()]), None, None, "blocks"))


def columns_of(fit: Fit) -> tuple[str, ...]:
    """Of the laws of a fitted model."""
    return tuple(term.law.column for term in fit.model.terms if term.law is not None)


def test_a_law_is_tried_in_the_place_of_one_that_came_before_it_as_well_as_beside_it() -> None:
    """The pressure's drag, found last, did better alone than beside a motor gain by speed that had gone before it."""
    prepared = windy()
    base, there = prepared.base, Search(prepared.record, prepared.facts, lambda text: None)
    ledger, selection = begun(base, prepared.facts)
    offered = [law for law in laws_beside(prepared, base) if law.term.effect is CATALOGUE["learned_law"]]
    right = next(law for law in offered if law.ground.column == "pressure_Pa" and law.ground.acts_as == "windage")
    wrong = next(law for law in offered if law.ground.quantity == "speed_size" and law.ground.acts_as == "motor_gain")
    ledger = ledger.with_rows([base.refitted(base.model.with_terms(wrong.term))])
    row = next(row for row in ledger.rows if row.effects)
    grown_on, tried = growth._with_laws(there, row, ledger, selection, lambda fit: [right])
    assert {("",), ("pressure_Pa",)} <= {columns_of(row.fit) for row in grown_on.rows}
    assert "learned_law" in tried.trials


def test_a_law_is_known_by_all_its_coefficients_together() -> None:
    """What a record says nothing of takes nothing from what it knows to ten sigmas."""
    assert _sigmas(np.array([1.0, 0.0]), np.diag([0.01, 100.0])) == pytest.approx(10.0)


def test_what_became_of_a_law_that_does_not_stand_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """A record of a high rate asks its rows again on all readings, and a law that stood there had never been tried."""
    prepared = windy()
    ledger, selection = begun(prepared.base, prepared.facts)
    monkeypatch.setattr(
        law_rows, "grown_with_laws",
        lambda there, rows, found, laws: growth._with_laws(there, rows.rows[0], rows, found, laws, most=1),
    )  # fmt: skip
    monkeypatch.setattr(law_rows, "chosen", lambda _, __, rows, found: (rows, replace(found, final=rows.base)))
    found = law_rows.with_laws(mapped(prepared, selection, ledger), lambda text: None)
    assert any("learned_law" in row.effects for row in found.weighed)
    assert "learned_law" in found.selection.trials
