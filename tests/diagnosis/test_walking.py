"""Friction that wanders does what many an effect does: it is not named where a likelier effect was refused."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rw_ekf.diagnosis.hypotheses.candidates import Score
from rw_ekf.diagnosis.hypotheses.scorer import Scorer
from rw_ekf.diagnosis.hypotheses.selection import Selection, Trial
from rw_ekf.diagnosis.hypotheses.wander import wandering
from rw_ekf.diagnosis.investigate.found import Found, mapped
from rw_ekf.diagnosis.investigate.walking import _refused_is_likelier
from rw_ekf.diagnosis.ledger.ledger import Ledger
from rw_ekf.diagnosis.prepare.preparation import Prepared, prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.diagnosis.standing import Decision, Reason
from rw_ekf.effects.catalogue import CATALOGUE
from tests.diagnosis.simulated import log_of, simulated

OFFSET, DRAG = CATALOGUE["offset_torque"], CATALOGUE["quadratic_drag"]


@pytest.fixture(scope="module")
def prepared() -> Prepared:
    """A wheel with a constant torque of 4 % of its Coulomb friction, to which a walk of friction helps as well."""
    run = simulated(["offset_torque:torque_rad_s2=0.023"], seed=5)
    return prepare(source_of([log_of(run)]), None, None, "blocks")


@pytest.fixture(scope="module")
def walk(prepared: Prepared) -> Found:
    """The same record with a walk."""
    tried = wandering(prepared, prepared.base, enough=1.1)
    assert tried is not None
    return mapped(prepared, Selection(prepared.base, tried.fit), Ledger(prepared.base, prepared.facts))


def refused(prepared: Prepared, decisions: dict[str, Decision]) -> Found:
    """Nothing found, and these effects tried, each at its best place, with what became of them."""
    effects = [CATALOGUE[name] for name in decisions]
    scores: dict[str, Score] = Scorer(prepared.base).best_of_each(prepared.facts, effects)
    trials = {name: replace(Trial.of(scores[name]), decision=said) for name, said in decisions.items()}
    return mapped(prepared, Selection(prepared.base, prepared.base, trials), Ledger(prepared.base, prepared.facts))


def test_a_likelier_effect_that_held_out_errors_refused_leaves_a_walk_unnamed(prepared: Prepared, walk: Found) -> None:
    """The torque that is there makes the record likelier than a walk, and was refused: neither is named."""
    found = refused(
        prepared, {OFFSET.id: Decision(Reason.NOT_CONFIRMED, "on the held-out part NIS goes from 1.1 to 1.6")}
    )
    assert _refused_is_likelier(found, walk)


def test_an_effect_that_explains_less_than_a_walk_does_not(prepared: Prepared, walk: Found) -> None:
    """A refused drag that the record does not show is no reason to leave a walk unnamed."""
    assert not _refused_is_likelier(
        refused(prepared, {DRAG.id: Decision(Reason.NOT_CONFIRMED, "it is not there")}), walk
    )


def test_what_was_never_significant_does_not(prepared: Prepared, walk: Found) -> None:
    """Only what held-out errors refused counts: the rest was weighed in the search."""
    assert not _refused_is_likelier(refused(prepared, {OFFSET.id: Decision(Reason.NOT_SIGNIFICANT)}), walk)
