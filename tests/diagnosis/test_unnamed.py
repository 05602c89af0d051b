"""A law without a name against those that have one: a weak stranger is no alias, a law of the catalogue is named."""

from __future__ import annotations

from rw_ekf.diagnosis.checks.residual_map import residual_map
from rw_ekf.diagnosis.hypotheses.contenders import Search
from rw_ekf.diagnosis.hypotheses.learned_laws import likeliest_laws
from rw_ekf.diagnosis.ledger.evidence import log_evidence
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.preparation import Prepared, prepare
from rw_ekf.diagnosis.prepare.source import source_of
from tests.diagnosis.simulated import log_of, simulated


def prepared_of(effect: str, seed: int, noise_rpm: float = 1.0) -> Prepared:
    """A simulated wheel with one effect, its base model fitted."""
    return prepare(source_of([log_of(simulated([effect], seed=seed, noise_rpm=noise_rpm))]), None, None, "blocks")


def test_a_weak_law_that_is_in_no_catalogue_is_no_saturating_motor() -> None:
    """Friction loaded by the torque at 5 rpm: a law of the current that has no formula, and nothing with a name."""
    run = simulated(["acceleration_friction:ratio=0.005"], seed=37, noise_rpm=5.0)
    verdict = diagnose_log(log_of(run)).document()["verdict"]
    assert verdict["kind"] == "unexplained" or verdict["effects"] == ["learned_law"], verdict["statement"]


def test_a_law_of_the_catalogue_is_likelier_than_one_without_a_formula() -> None:
    """What a constant torque is needs no curve: the law pays for its freedom."""
    prepared = prepared_of("offset_torque:torque_rad_s2=0.03", 3)
    search = Search(prepared.record, prepared.facts, lambda text: None)
    named = search.with_known(prepared.base, "offset_torque")
    gained = log_evidence(named, ("offset_torque",), prepared.facts) - log_evidence(prepared.base, (), prepared.facts)
    best = likeliest_laws(prepared.base, prepared.facts)[0]
    assert gained > best.weight + 3.0
    assert likeliest_laws(named, prepared.facts)[0].weight < 0.0


def test_smooth_curves_show_what_drowns_among_all_hats() -> None:
    """Two smooth curves of the current see a weak law at a level that the map calls structure."""
    prepared = prepared_of("acceleration_friction:ratio=0.005", 11, noise_rpm=5.0)
    current = next(item for item in residual_map(prepared.base, prepared.facts) if item.name == "current")
    assert current.p_value < 3.0e-4
    assert current.freedom == 2
