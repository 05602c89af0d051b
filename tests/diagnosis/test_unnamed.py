"""A law without a name against those that have one: a weak stranger is no alias, a law of the catalogue is named."""

from __future__ import annotations

import numpy as np

from rw_ekf.diagnosis.checks.residual_map import covers_of, residual_map
from rw_ekf.diagnosis.diagnose import diagnose_log
from rw_ekf.diagnosis.investigate.unnamed import unnamed_law
from rw_ekf.diagnosis.prepare.preparation import Prepared, prepare
from rw_ekf.diagnosis.prepare.source import source_of
from tests.diagnosis.simulated import log_of, simulated


def prepared_of(effect: str, seed: int, noise_rpm: float = 1.0) -> Prepared:
    """A simulated wheel with one effect, its base model fitted."""
    return prepare(source_of([log_of(simulated([effect], seed=seed, noise_rpm=noise_rpm))]), None, None, "blocks")


def test_a_weak_law_that_is_in_no_catalogue_is_no_saturating_motor() -> None:
    """Friction loaded by the torque at 5 rpm: the nearest name explains half of it, and is only said to be near."""
    run = simulated(["acceleration_friction:ratio=0.005"], seed=37, noise_rpm=5.0)
    verdict = diagnose_log(log_of(run)).document()["verdict"]
    assert verdict["kind"] == "unexplained", verdict["statement"]
    assert "depends on current" in verdict["statement"]
    assert verdict["posterior"]["something_else"] > 0.5


def test_a_law_of_the_catalogue_is_in_no_law_without_a_name() -> None:
    """Neither curves of a constant torque are left over the speed nor those of a saturating motor over the current."""
    prepared = prepared_of("offset_torque:torque_rad_s2=0.03", 3)
    covers = covers_of(prepared.base, prepared.facts)
    torque = next(cover for cover in covers["speed"] if cover.kind == "torque")
    weights = np.sum(torque.regressors**2, axis=0)
    curves = np.linalg.lstsq(torque.regressors, torque.smooth(unnamed=True), rcond=None)[0]
    np.testing.assert_allclose(weights @ curves, 0.0, atol=1.0e-6 * float(weights.sum()))
    law = unnamed_law(prepared.base, prepared.facts)
    assert law is not None
    offset = next(item for item in residual_map(prepared.base, prepared.facts) if item.name == "speed")
    assert law.log_factor < 0.25 * offset.statistic


def test_smooth_curves_show_what_drowns_among_all_hats() -> None:
    """Two smooth curves of the current see a weak law at a level that the map calls structure."""
    prepared = prepared_of("acceleration_friction:ratio=0.005", 11, noise_rpm=5.0)
    current = next(item for item in residual_map(prepared.base, prepared.facts) if item.name == "current")
    assert current.p_value < 3.0e-4
    assert current.freedom == 2
