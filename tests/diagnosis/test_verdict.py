"""What a verdict is called, by what was found and by how probable it is."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rw_ekf.diagnosis.checks.excess_noise import NOTHING
from rw_ekf.diagnosis.checks.heldout import performance
from rw_ekf.diagnosis.checks.residual_map import Dependence
from rw_ekf.diagnosis.checks.residual_tests import failed_tests, residual_tests
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.investigate.investigation import investigate
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.preparation import facts_of, prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.diagnosis.verdict import conclude
from rw_ekf.diagnosis.verdict.explanations import Explanation
from rw_ekf.diagnosis.verdict.posterior import posterior_of, unlikely
from rw_ekf.diagnosis.verdict.sentences import or_another_kind, or_another_order, sentence_of
from rw_ekf.diagnosis.verdict.verdict import Evidence, verdict_on
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.model.effect import Candidate, Term
from tests.diagnosis.simulated import log_of, simulated

POSTERIOR = {"none": 0.9, "something_else": 0.1}


def test_the_kind_is_that_of_what_is_likeliest() -> None:
    """A record with no finding is called unexplained where an effect, or anything else, is likelier than nothing."""
    prepared = prepare(source_of([log_of(simulated(seed=5, samples=1200))]), None, None, "blocks")
    found = investigate(prepared, lambda _: None)
    figures = performance(prepared, found.selection.base)
    assert found.new_ids == []

    mapped = replace(found, is_unexplained=True, left=[Dependence("speed", 27.6, 2, 2e-4)])

    def called(none: float, elsewhere: float = 0.1, found: Found = found) -> tuple[str, str]:
        posterior = {"quadratic_drag": 1.0 - none - elsewhere, "none": none, "something_else": elsewhere}
        verdict = verdict_on(Evidence(found, None, posterior, figures, figures, 60.0, False, {}, None))
        return verdict.kind, verdict.statement

    assert called(0.8)[0] == "adequate"
    assert called(0.46)[0] == "adequate"
    assert called(0.44)[0] == "unexplained"
    assert called(0.3, 0.6)[0] == "unexplained"
    kind, statement = called(0.004)
    assert kind == "unexplained"
    assert "quadratic_drag 90 %" in statement
    kind, statement = called(0.6, 0.23, mapped)
    assert kind == "adequate"
    assert "it depends on speed (p = 2e-04), by chance unless something else (23 %) is there" in statement
    assert called(0.3, 0.6, mapped)[0] == "unexplained"


def test_no_effect_is_named_that_is_less_likely_than_not() -> None:
    """What was found and is doubted is told with its probability, and the kind is that it is not settled."""
    prepared = prepare(source_of([log_of(simulated(["quadratic_drag"], seed=5))]), None, None, "blocks")
    found = investigate(prepared, lambda _: None)
    assert found.new_ids
    figures = performance(prepared, found.selection.base)
    name, alike = found.new_ids[0], [rival.name for rival in found.selection.rivals.get(found.new_ids[0], ())]
    sure = {name: 0.4, **dict.fromkeys(alike, 0.2), "none": 0.0, "something_else": 0.1}
    open_ = {name: 0.3, "none": 0.2, "something_else": 0.1}
    assert unlikely(found, sure) == ([] if alike else [name])
    assert unlikely(found, open_) == [name]
    verdict = verdict_on(Evidence(found, None, open_, figures, figures, 60.0, False, {}, None, [name]))
    assert (verdict.kind, verdict.effects) == ("unexplained", [])
    assert f"{name} 30 %" in verdict.statement
    sound = {name: 0.2, "none": 0.7, "something_else": 0.1}
    verdict = verdict_on(Evidence(found, None, sound, figures, figures, 60.0, False, {}, None, [name]))
    assert (verdict.kind, verdict.effects) == ("adequate", [])
    assert f"{name} 20 %" in verdict.statement


def test_a_document_of_what_is_doubted_contradicts_itself_nowhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """No model, no better figures, no row of the ledger that stands, and each effect said to be unlikely."""
    monkeypatch.setattr(conclude, "unlikely", lambda found, posterior: found.new_ids)
    diagnosis = diagnose_log(log_of(simulated(["quadratic_drag"], seed=5)))
    document = diagnosis.document()
    assert document["verdict"]["kind"] == "unexplained"
    assert "less likely than not" in document["verdict"]["statement"]
    assert "not significant" not in document["verdict"]["statement"]
    assert (diagnosis.model, document["model"], document["parameters"]["after"]) == (None, None, None)
    assert document["after"] == document["before"]
    assert not any(row["stands"] for row in document["ledger"])
    assert "added" not in {one["decision"] for one in document["candidates"]}


def test_what_foretells_better_and_is_no_cause_is_a_description(monkeypatch: pytest.MonkeyPatch) -> None:
    """Something else is likelier: nothing is named, and the model that halves the errors is written all the same."""
    monkeypatch.setattr(conclude, "unlikely", lambda found, posterior: found.new_ids)
    monkeypatch.setattr(conclude, "posterior_of", lambda *args: {**posterior_of(*args), "something_else": 0.9})
    diagnosis = diagnose_log(log_of(simulated(["viscous_temperature"], seed=5)))
    document = diagnosis.document()
    assert (document["verdict"]["kind"], document["verdict"]["effects"]) == ("unexplained", [])
    assert "likelier (90 %) behind this log than what comes nearest to it" in document["verdict"]["statement"]
    assert "as a description, and as no cause" in document["verdict"]["statement"]
    assert diagnosis.model is not None
    assert diagnosis.model.effects.ids == ("viscous_temperature",)
    assert document["after"]["free_run_rms_rpm"] < 0.5 * document["before"]["free_run_rms_rpm"]
    assert "added" not in {one["decision"] for one in document["candidates"]}


def test_something_else_is_instead_of_what_foretells_little_and_beside_what_foretells_all() -> None:
    """What is left is no noise: an effect that takes off a tenth of the error is not named, one that takes all is."""
    prepared = prepare(source_of([log_of(simulated(["quadratic_drag"], seed=5))]), None, None, "blocks")
    found = investigate(prepared, lambda _: None)
    weighed = [Explanation(tuple(found.new_ids), found.fit, 0.0, 1.0)]

    def chance(foretold: float) -> float:
        posterior = posterior_of(found, weighed, None, NOTHING, 1e-20, foretold)
        assert posterior["something_else"] > 0.9
        return posterior[found.new_ids[0]]

    assert chance(0.1) < 0.2
    assert chance(0.6) < 0.5 < chance(0.75)
    assert 0.6 < chance(1.0) < 0.7


def test_no_sentence_stands_against_a_test_of_its_own_document() -> None:
    """Where a test of the residual fails, the model is not adequate, and the sentence says what failed."""
    prepared = prepare(source_of([log_of(simulated(seed=5, samples=1200))]), None, None, "blocks")
    found = investigate(prepared, lambda _: None)
    figures = performance(prepared, found.selection.base)
    white = np.random.default_rng(1).standard_normal(2000)
    for left, words in ((white, ""), (white + 0.3 * np.roll(white, 1), "correlated in time"), (1.2 * white, "spread")):
        failed = failed_tests(residual_tests(left))
        verdict = verdict_on(Evidence(found, None, POSTERIOR, figures, figures, 60.0, False, failed, None))
        assert (verdict.kind == "adequate") == (not words)
        assert words in verdict.statement
    assert failed_tests(residual_tests(1.2 * white, rounded=True)) == {}


def test_what_a_change_may_be_as_well_is_told_with_its_chance() -> None:
    """Where the motion is the same meanwhile rows of another kind are as likely; those far behind are left out."""

    def row(acts_as: str, weight: float) -> Any:
        law = SimpleNamespace(acts_as=acts_as, quantity="time", column="", first=280.0, last=320.0, spread=(1.0, 1.0))
        fit = SimpleNamespace(model=SimpleNamespace(of=lambda name: [SimpleNamespace(law=law)]))
        return SimpleNamespace(fit=fit, weight=weight, effects=("spell",))

    rows = [row("drag", 10.0), row("torque", 10.0), row("viscous_drag", 5.0)]
    found: Any = SimpleNamespace(
        fit=rows[0].fit, ledger=SimpleNamespace(row=lambda fit: rows[0], rows=rows),
        prepared=SimpleNamespace(facts=SimpleNamespace(period_s=0.1)),
    )  # fmt: skip
    assert or_another_kind(found, "spell") == " (it may also be the torque (50 %) instead)"
    rows[1].weight = 4.0
    assert or_another_kind(found, "spell") == ""
    assert or_another_kind(found, "offset_torque") == ""


def test_of_many_torques_with_a_period_the_largest_are_told() -> None:
    """Three of five with their sizes, the others by their number; the model has them all."""
    base = prepare(source_of([log_of(simulated(seed=5, samples=1200))]), None, None, "blocks").base
    found = [
        Term.at(CATALOGUE["external_torque"], Candidate(1.0, (hertz, 0.0, 0.0)))
        for hertz in (0.31, 0.47, 0.73, 1.1, 1.7)
    ]
    sizes = (0.3, 0.01, 0.2, 0.1, 0.02)
    terms = [replace(term, values=(size, 0.0)) for term, size in zip(found, sizes, strict=True)]
    fit = base.sketched(base.model.with_terms(*terms))
    facts = facts_of(fit.linearised.record.course, base, frozenset())
    stated = sentence_of(fit, "external_torque", facts)
    assert stated.count("A torque of") == 3
    assert stated.endswith("; and 2 smaller ones")


def test_of_a_ripple_without_a_logged_angle_the_phase_is_said_to_be_the_record_s() -> None:
    """Where its order is sure; with a logged angle nothing is open."""
    prepared = SimpleNamespace(angle_is_logged=False)
    sure = cast(Found, SimpleNamespace(prepared=prepared, orders={1.0: 0.99}))
    assert "its phase is this record's" in or_another_order(sure, "torque_ripple")
    logged = cast(Found, SimpleNamespace(prepared=SimpleNamespace(angle_is_logged=True), orders={1.0: 0.99}))
    assert or_another_order(logged, "torque_ripple") == ""
    assert or_another_order(sure, "quadratic_drag") == ""
