"""Friction that wanders does what many an effect does: it is not named where a likelier effect was refused."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rw_ekf.diagnosis.hypotheses.candidates import Score
from rw_ekf.diagnosis.hypotheses.random_walk import wandering
from rw_ekf.diagnosis.hypotheses.scorer import Scorer
from rw_ekf.diagnosis.hypotheses.selection import Selection, Trial
from rw_ekf.diagnosis.investigate.found import Found, mapped
from rw_ekf.diagnosis.investigate.walk_row import _refused_is_likelier
from rw_ekf.diagnosis.ledger.ledger import Ledger
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.preparation import Prepared, prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.diagnosis.standing import Decision, Reason
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.log_replay import replay_log
from rw_ekf.model.state import CK13_STATISTICAL
from tests.diagnosis.simulated import log_of, simulated
from tools.proof.uncatalogued_laws import Nameless

C = CK13_STATISTICAL.coulomb
WALK = 0.06 * C / 10.0  # rad/s^2 per sqrt(s), as tools/proof/uncatalogued_laws.py simulates it
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
    trials = {name: replace(Trial.of(scores[name]), decision=stated) for name, stated in decisions.items()}
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


@pytest.mark.slow
def test_a_walk_is_carried_on_as_process_noise_that_fits_the_next_log() -> None:
    """Its rate is right by a factor, no figure is worse, and a replay of either log with the model is consistent.

    The walk is another integrator's; the gain that the next log gives is the wheel's within three sigma.
    """
    wheel = Nameless("friction walks", 12)
    diagnosis = diagnose_log(wheel.log())
    document, model = diagnosis.document(), diagnosis.model
    assert document["verdict"]["effects"] == ["coulomb_drift"]
    before, after = document["before"], document["after"]
    assert after["horizon_20s_rms_rpm"] < 0.6 * before["horizon_20s_rms_rpm"]
    assert after["free_run_rms_rpm"] == before["free_run_rms_rpm"]
    assert after["one_step_rms_rpm"] < before["one_step_rms_rpm"]
    assert after["nis_mean"] == pytest.approx(1.0, abs=0.15)
    assert model is not None
    assert model.dry_walk == pytest.approx(WALK, rel=0.4)
    assert model.effects.terms == ()
    for log in (wheel.log(), replace(wheel, seed=1012).log()):
        replayed = replay_log(log, model=model)
        assert replayed.consistency.noise_ratio == pytest.approx(1.0, abs=0.05)
        assert replayed.consistency.is_noise
        off = replayed.belief.parameters.motor_gain - CK13_STATISTICAL.motor_gain
        assert abs(off) < 3.0 * replayed.belief.parameter_std.motor_gain


def test_what_was_never_significant_does_not(prepared: Prepared, walk: Found) -> None:
    """Only what held-out errors refused counts: the rest was weighed in the search."""
    assert not _refused_is_likelier(refused(prepared, {OFFSET.id: Decision(Reason.NOT_SIGNIFICANT)}), walk)
