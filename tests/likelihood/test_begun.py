"""Starts of one effect are begun together; what goes on is the deepest, and it ends where it would have ended alone."""

from __future__ import annotations

import pytest

from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.model.effect import Candidate, Term
from tools.proof.marks import case_called
from tools.proof.plants import log_of


@pytest.fixture(scope="module")
def base() -> Fit:
    """The base fit of a wheel whose current lags by 53 ms."""
    return prepare(source_of([log_of(case_called("id-1rpm-009-actuator_lag", 14))]), None, None, "blocks").base


def lags(base: Fit, *values_s: float) -> list[Model]:
    return [base.model.with_terms(Term.at(CATALOGUE["actuator_lag"], Candidate(v))) for v in values_s]


def test_of_starts_that_end_in_one_place_one_goes_on(base: Fit) -> None:
    """From 40 and 60 ms a lag of 53 ms is reached within three turns: one of the two is worth a full fit."""
    models = lags(base, 0.04, 0.06)
    kept = base.worth_a_fit(models)
    assert len(kept) == 1
    found = base.refitted(kept[0]).model.of("actuator_lag")[0].values[0]
    assert found == pytest.approx(0.053, abs=0.003)


def test_a_fit_that_was_begun_ends_where_it_would_have_ended(base: Fit) -> None:
    """With three turns behind it, and from nothing: the same log-likelihood, to what is no difference between fits."""
    (model,) = lags(base, 0.03)
    alone = base.refitted(model)
    begun = lags(base, 0.03)[0]
    other = Fit(base.model, base.prior, base.likelihood, base.linearised, base.omit)
    sketch = other.sketched(begun)
    went_on = other.refitted(begun)
    assert went_on.likelihood.value >= sketch.likelihood.value - 0.5
    assert went_on.likelihood.value == pytest.approx(alone.likelihood.value, abs=0.5)


def test_starts_in_different_places_that_are_as_likely_both_go_on(base: Fit) -> None:
    """Half a standard deviation apart is one place, more is two."""
    here, there = (base.sketched(model) for model in lags(base, 0.05, 0.055))
    assert here.is_at(here)
    far = here.model.with_vector(here.model.vector + here.std)
    assert not here.is_at(Fit(far, here.prior, here.likelihood, here.linearised, here.omit))
    assert here.is_at(there)
