"""Faults of the telemetry in a log: they teach nothing, and their number is a finding."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

from rw_ekf.arrays import Float64Array
from rw_ekf.cli import main
from rw_ekf.filter import gating
from rw_ekf.filter.constants import chi_square_1_quantile
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.numbers import p_text
from rw_ekf.statistics import RunStatistics
from rw_ekf.units import RAD_S_PER_RPM
from tests.commands.logs import write_log
from tests.filter.replay import OUTCOMES, Columns, compiled, online
from tests.truth import run_of
from tools.measure.runs import Run, constants_for, prior_drawn_around

TRUTH = np.array(CK13_STATISTICAL)
GATE = chi_square_1_quantile(0.9999)


def spoilt(kind: str, run: Run, seed: int) -> Float64Array:
    """Readings of the run with a fault of that kind somewhere in it."""
    rng = np.random.default_rng([seed, 77])
    speed = run.reading_rad_s.copy()
    at = int(rng.integers(20, speed.size - 200))
    if kind == "one value":
        speed[at : at + 60] = 2870.0 * RAD_S_PER_RPM
    elif kind == "ends by turns":
        speed[at : at + 60] = 16383.5 * RAD_S_PER_RPM * np.where(np.arange(60) % 2, 1.0, -1.0)
    elif kind == "a lower end":
        speed[at : at + 35] = -16384.0 * RAD_S_PER_RPM
    else:
        places = rng.choice(np.arange(5, speed.size), int(kind), replace=False)
        speed[places] = rng.uniform(-16000.0, 16000.0, places.size) * RAD_S_PER_RPM
    return speed


@pytest.mark.parametrize("kind", ["1", "5", "50", "one value", "ends by turns", "a lower end"])
@pytest.mark.parametrize("profile", ["P1", "P2"])
def test_bad_readings_teach_nothing(profile: str, kind: str) -> None:
    """With spikes or a fault of seconds in a run, every estimate stays within four sigma, the sigmas those without."""
    for seed in range(4):
        run, prior = run_of(profile, seed), prior_drawn_around(CK13_STATISTICAL, seed)
        found = compiled(Columns(run.time_s, spoilt(kind, run, seed), run.current_A), constants_for(), prior)
        std = np.sqrt(np.diag(found.covariance)[1:])
        assert np.max(np.abs(found.mean[1:] - TRUTH) / std) < 4.0
        assert np.count_nonzero(found.outcome == gating.RESEEDED) == 0
        clean = compiled(Columns(run.time_s, run.reading_rad_s, run.current_A), constants_for(), prior)
        np.testing.assert_allclose(std, np.sqrt(np.diag(clean.covariance)[1:]), rtol=0.3)


@pytest.mark.parametrize("kind", ["50", "one value", "ends by turns"])
def test_online_and_compiled_refuse_alike(kind: str) -> None:
    """The gate's memory leads both paths to the same outcomes and the same numbers."""
    run, prior = run_of("P1", 3), prior_drawn_around(CK13_STATISTICAL, 3)
    log = Columns(run.time_s, spoilt(kind, run, 3), run.current_A)
    _, results = online(log, constants_for(), prior)
    other = compiled(log, constants_for(), prior)
    assert [r.outcome for r in results] == [OUTCOMES[code] for code in other.outcome]
    assert np.max(np.abs(np.array([r.values for r in results]) - other.states) / other.stds) < 1e-6


@pytest.mark.parametrize("rate_hz", [10.0, 100.0])
def test_a_filter_that_is_wrong_finds_back(rate_hz: float) -> None:
    """From a gain a third of the truth and called sure to 5 %, re-seeding still leads to the speed and the gain."""
    run = run_of("P1", 3, rate_hz=rate_hz)
    prior = prior_drawn_around(CK13_STATISTICAL, 3, 0.0)
    prior.mean[1] *= 0.3
    prior.covariance[1, :] = prior.covariance[:, 1] = 0.0
    prior.covariance[1, 1] = (0.05 * prior.mean[1]) ** 2
    found = compiled(Columns(run.time_s, run.reading_rad_s, run.current_A), constants_for(), prior)
    half = run.time_s.size // 2
    error = found.states[half:, 0] - run.speed_rad_s[half:]
    assert np.sqrt(np.mean(error**2)) < 0.3 * RAD_S_PER_RPM
    assert found.mean[1] == pytest.approx(CK13_STATISTICAL.motor_gain, rel=0.05)


def test_the_finding_counts_what_the_gate_predicts() -> None:
    """Of 1000 readings one refused is chance, three are not; of 100,000 twenty, not thirty: p is SciPy's binomial."""

    def finding(rejected: int, tested: int) -> str | None:
        return RunStatistics(used=tested - rejected, rejected=rejected).gate_finding(GATE)

    assert finding(0, 1000) is None
    assert finding(1, 1000) is None
    assert finding(20, 100_000) is None
    assert finding(0, 0) is None
    for rejected, tested in ((3, 1000), (42, 141), (30, 100_000), (1000, 1000), (50_000, 1_000_000)):
        stated = finding(rejected, tested)
        assert stated is not None
        assert f"{rejected} of {tested} readings" in stated
        assert f"({p_text(binom.sf(rejected - 1, tested, math.erfc(math.sqrt(0.5 * GATE))))})" in stated


@pytest.mark.parametrize("kind", ["none", "5"])
def test_replay_reports_a_share_of_rejected_readings(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    """Five spikes in 3000 readings are among the warnings of `replay --json`, none are not."""
    run = run_of("P1", 5)
    speed = run.reading_rad_s if kind == "none" else spoilt(kind, run, 5)
    header = "time_s,speed_rad_s,current_command_A"
    log = write_log(tmp_path / "log.csv", [run.time_s, speed, run.current_A], header)
    assert main(["replay", str(log), "--json"]) == 0
    warnings = json.loads(capsys.readouterr().out)["logs"][0]["warnings"]
    assert any("rejected by the gate" in text for text in warnings) == (kind != "none")
