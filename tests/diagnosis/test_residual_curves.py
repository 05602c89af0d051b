"""Shapes that a search must find beside sizes: a bristle's damping, a friction that wanders."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.diagnosis.hypotheses.random_walk import wandering
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.model.effect_kinds import StaticEffect
from rw_ekf.model.moment import Moment
from tests.diagnosis.simulated import log_of, simulated


@pytest.mark.slow
@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_a_bristle_is_found_with_its_damping(damping: float) -> None:
    """Dahl's bristle, which swings undamped, and LuGre's: each named, both numbers as they are, with sigmas."""
    run = simulated([f"presliding_hysteresis:deflection_rad=0.1,damping={damping}"], seed=7)
    document = diagnose_log(log_of(run)).document()
    assert document["verdict"]["effects"] == ["presliding_hysteresis"], document["verdict"]["statement"]
    found = next(c for c in document["candidates"] if c["effect"] == "presliding_hysteresis")["parameters"]
    std = found["damping"]["std"]
    assert abs(found["damping"]["value"] - damping) < (0.01 if std is None else min(4.0 * std, 0.05))
    assert math.isclose(found["deflection_rad"]["value"], 0.1, rel_tol=0.1)
    assert abs(found["deflection_rad"]["value"] - 0.1) < 4.0 * found["deflection_rad"]["std"]


@pytest.mark.slow
def test_friction_that_follows_what_is_not_logged_drifts() -> None:
    """Coulomb friction falls with a temperature that nobody logs, up and down again: a drift, and nearer 20 s ahead."""
    log = log_of(simulated(["coulomb_temperature:slope_1_K=-0.015"], seed=5))
    blind = replace(log, channels={name: v for name, v in log.channels.items() if name != "temperature_degC"})
    document = diagnose_log(blind).document()
    assert document["verdict"]["effects"] == ["coulomb_drift"], document["verdict"]["statement"]
    assert document["after"]["horizon_20s_rms_rpm"] < 0.7 * document["before"]["horizon_20s_rms_rpm"]


@pytest.mark.parametrize(("wander", "walks"), [(0.0, False), (0.0024, True)])
def test_a_friction_that_walks_at_random_is_told_from_one_that_keeps_still(wander: float, walks: bool) -> None:
    """0.4 % of Coulomb friction per sqrt(s) is a walk beyond doubt; process noise of the speed is none."""
    effect = f"coulomb_drift:rate_rad_s3=0,wander_rad_s2={wander}"
    run = simulated([effect], seed=12, profile="P2", process_rpm=0.02)
    prepared = prepare(source_of([log_of(run)]), None, None, "blocks")
    found = wandering(prepared, prepared.base, 1.0e-4)
    assert (found is not None) == walks
    if found is not None:
        assert found.trial.p_value < 1.0e-6
        assert found.gain == pytest.approx(found.trial.statistic)  # nothing else had to give way
        assert found.fit.model.matters("coulomb_drift", prepared.facts)


@pytest.mark.slow
def test_a_strong_short_spike_is_followed_to_the_end() -> None:
    """A quarter of Coulomb friction for 25 s, within a block that is held out: named, with onset, decay and size."""
    run = simulated(["drag_spike:amplitude_rad_s2=0.147,onset_s=230,decay_s=25"], seed=13, profile="P2")
    document = diagnose_log(log_of(run)).document()
    assert document["verdict"]["effects"] == ["drag_spike"], document["verdict"]["statement"]
    found = next(c for c in document["candidates"] if c["effect"] == "drag_spike")["parameters"]
    for name, value, share in (("onset_s", 230.0, 0.01), ("decay_s", 25.0, 0.2), ("amplitude_rad_s2", 0.147, 0.15)):
        assert math.isclose(found[name]["value"], value, rel_tol=share), found


@pytest.mark.slow
def test_a_friction_that_walks_is_named_as_one_that_wanders() -> None:
    """Not unexplained, and not one of the shapes that a stretch of it happens to have."""
    run = simulated(["coulomb_drift:rate_rad_s3=0,wander_rad_s2=0.0024"], seed=3, profile="P2")
    verdict = diagnose_log(log_of(run)).document()["verdict"]
    assert verdict["effects"] == ["coulomb_drift"], verdict["statement"]
    assert "wanders with time" in verdict["statement"]


def test_pieces_of_a_broken_line_add_up_to_it() -> None:
    """Slopes from knot to knot, each level after its own end, are linear interpolation between the knots."""
    drift = CATALOGUE["coulomb_drift"]
    assert issubclass(drift, StaticEffect)
    knots, heights = np.array([10.0, 40.0, 55.0, 120.0]), np.array([0.0, 0.03, -0.01, 0.02])
    slopes, lengths = np.diff(heights) / np.diff(knots), np.diff(knots)
    for time in np.linspace(0.0, 150.0, 61):
        parts = [
            drift.contribution(a, (0.0, start, length), Moment(50.0, 0.0, 20.0, 0.0, time, 0.1))[5]
            for a, start, length in zip(slopes, knots[:-1], lengths, strict=True)
        ]
        assert sum(parts) == pytest.approx(np.interp(time, knots, heights), abs=1e-15)
