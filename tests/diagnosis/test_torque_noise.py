"""Torque noise that is not the same everywhere is a finding; of healthy wheels it is as rare as is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.diagnosis.checks.uneven_noise import NoiseFinding, _p_values, noise_findings
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.prepare.preparation import prepare
from rw_ekf.diagnosis.prepare.source import source_of
from rw_ekf.diagnosis.thresholds import NOISE_P
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.units import RAD_S_PER_RPM
from tests.diagnosis.simulated import RATE_HZ, log_of, simulated
from tests.karnopp import karnopp
from tools.proof import plants
from tools.proof.marks import case_called

BUMP = "drag_bump:amplitude_rad_s2=0.0586,speed_rad_s=6.283,width_rad_s=1.571"  # 10 % of c at 60 +- 15 rpm


def found_in(log: WheelLog) -> NoiseFinding | None:
    """What the four parameters alone leave."""
    prepared = prepare(source_of([log]), None, None, "blocks")
    return noise_findings(prepared.base, prepared.facts).get("torque")


def noisy_above_half(seed: int, process_rpm: float, times: float) -> WheelLog:
    """A Karnopp wheel whose torque noise is so many times larger above half of its top speed."""
    time_s, current_A = (np.array(v) for v in sample_profile(make_profile("identification", seed=seed), RATE_HZ))
    draws = np.random.default_rng([seed, 5])
    quiet = np.abs(karnopp(CK13_STATISTICAL, time_s, current_A))
    sizes = np.where(quiet > 0.5 * quiet.max(), times, 1.0) * process_rpm * RAD_S_PER_RPM / np.sqrt(RATE_HZ)
    speed = karnopp(CK13_STATISTICAL, time_s, current_A, kicks_rad_s=sizes * draws.standard_normal(time_s.size))
    log = log_of(simulated(seed=seed))
    channels = {"current_command_A": log.channels["current_command_A"]}
    return replace(log, speed_rad_s=speed + RAD_S_PER_RPM * draws.standard_normal(speed.size), channels=channels)


@pytest.mark.parametrize("profile", ["identification", "P2"])
def test_a_narrow_drag_that_passes_for_noise_is_found_where_it_is(profile: str) -> None:
    """10 % of Coulomb friction around 60 rpm: the window holds it, and elsewhere there is the noise that there is."""
    finding = found_in(log_of(simulated([BUMP], seed=3, profile=profile, process_rpm=0.03)))
    assert finding is not None
    assert finding.along == "speed"
    assert finding.low < 60.0 * RAD_S_PER_RPM < finding.high
    assert finding.p_value < 1.0e-4
    assert finding.elsewhere < 0.1 * RAD_S_PER_RPM < finding.inside


def test_a_noise_that_is_three_times_larger_above_half_speed_is_found_with_its_size() -> None:
    """On a wheel of another simulation: where, and how much larger; a noise that is the same everywhere is none."""
    finding = found_in(noisy_above_half(1, 0.1, 3.0))
    assert finding is not None
    assert finding.along == "speed"
    assert finding.times is not None
    assert 2.0 < finding.times < 5.0
    assert found_in(noisy_above_half(1, 0.1, 1.0)) is None


def test_noise_alone_is_as_rare_as_is_said() -> None:
    """Squares of normal draws in windows that overlap: p below 5 % in about 5 % of 600 records."""
    draws = np.random.default_rng(4)
    mixing = draws.uniform(size=(40, 12)) < 0.3
    records = np.square(draws.standard_normal((1000, 40)))
    scores = np.column_stack((records.sum(axis=1), np.square(draws.standard_normal(1000)), records @ mixing))
    alone = scores[:400]
    chances = []
    for seen in scores[400:]:
        p, independent = _p_values(seen, alone)
        chances.append(-np.expm1(independent * np.log1p(-p.min())))
    assert 0.02 < np.mean(np.array(chances) < 0.05) < 0.08


def test_a_finding_in_words() -> None:
    """Where, how much larger, and in what unit; next to nothing elsewhere is no number of times."""
    rpm = RAD_S_PER_RPM
    some = NoiseFinding("speed", 50.0 * rpm, 70.0 * rpm, 0.24 * rpm, 0.1 * rpm, 2.0e-6)
    stated = (
        "torque noise is 2.4 times larger between 50 and 70 rpm than elsewhere (p = 2e-06): structure may hide in it"
    )
    assert some.sentence(in_rpm=True) == stated
    backward = NoiseFinding("direction", -1.0, -1.0, 0.24 * rpm, 0.001 * rpm, 2.0e-6)
    assert backward.times is None
    assert "by 0.24 rpm in a second where the wheel turns backward, and hardly elsewhere" in backward.sentence(
        in_rpm=True
    )
    assert some.document(in_rpm=True)["from"] == pytest.approx(50.0)


@pytest.mark.parametrize(("noise_rpm", "times", "kind"), [(0.03, 3.0, "adequate"), (0.1, 5.0, "unexplained")])
def test_a_noise_that_is_not_the_same_everywhere_is_said_and_weighed(noise_rpm: float, times: float, kind: str) -> None:
    """More noise above half speed is no effect: the kind is that of what is likelier, and the words say where."""
    document = diagnose_log(noisy_above_half(2, noise_rpm, times)).document()
    assert document["verdict"]["kind"] == kind
    assert (document["verdict"]["posterior"]["something_else"] > 0.5) == (kind == "unexplained")
    assert document["torque_noise"]["p_value"] < NOISE_P
    assert "torque noise is" in document["verdict"]["statement"]


def test_a_healthy_wheel_is_not_accused_for_a_chance_of_its_noise() -> None:
    """One in some six hundred shows 4e-7 by this test, whose tail is carried on from 400 draws: a warning, no more."""
    document = diagnose_log(plants.log_of(case_called("healthy-121", 3005))).document()
    assert document["verdict"]["kind"] == "adequate"
    assert "torque noise" in document["verdict"]["statement"]
    assert document["verdict"]["posterior"]["something_else"] < 0.2
