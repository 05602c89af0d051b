"""What a verdict is called, by what was found and by how probable it is."""

from __future__ import annotations

import numpy as np

from rw_ekf.diagnosis.checks.heldout import performance
from rw_ekf.diagnosis.checks.residual_tests import failed_tests, residual_tests
from rw_ekf.diagnosis.investigate.investigation import investigate
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.diagnosis.verdict.verdict import Evidence, verdict_on
from tests.diagnosis.simulated import log_of, simulated

POSTERIOR = {"none": 0.9, "something_else": 0.1}


def test_a_model_that_is_all_but_ruled_out_is_not_adequate() -> None:
    """A record with no finding is called unexplained where its own probabilities leave "nothing" less than 1 %."""
    prepared = prepare(source_of([log_of(simulated(seed=5, samples=1200))]), None, None, "blocks")
    found = investigate(prepared, lambda _: None)
    figures = performance(prepared, found.selection.base)
    assert found.new_ids == []

    def called(none: float) -> tuple[str, str]:
        posterior = {"quadratic_drag": 0.9 - none, "none": none, "something_else": 0.1}
        verdict = verdict_on(Evidence(found, None, posterior, figures, figures, 60.0, {}, None))
        return verdict.kind, verdict.statement

    assert called(0.8)[0] == "adequate"
    assert called(0.02)[0] == "adequate"
    kind, statement = called(0.004)
    assert kind == "unexplained"
    assert "quadratic_drag 90 %" in statement


def test_no_sentence_stands_against_a_test_of_its_own_document() -> None:
    """Where a test of the residual fails, the model is not adequate, and the sentence says what failed."""
    prepared = prepare(source_of([log_of(simulated(seed=5, samples=1200))]), None, None, "blocks")
    found = investigate(prepared, lambda _: None)
    figures = performance(prepared, found.selection.base)
    white = np.random.default_rng(1).standard_normal(2000)
    for left, words in ((white, ""), (white + 0.3 * np.roll(white, 1), "correlated in time"), (1.2 * white, "spread")):
        failed = failed_tests(residual_tests(left))
        verdict = verdict_on(Evidence(found, None, POSTERIOR, figures, figures, 60.0, failed, None))
        assert (verdict.kind == "adequate") == (not words)
        assert words in verdict.statement
    assert failed_tests(residual_tests(1.2 * white, rounded=True)) == {}
