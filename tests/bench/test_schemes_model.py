"""Compensations that know the friction: what they make of the reversal of [CK13] section 4, on seeds 1 and 2."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.attitude_bench.bench_run import run_bench
from rw_ekf.attitude_bench.bench_start import POOR_SHARE, poor_prior, start_of
from rw_ekf.attitude_bench.bench_wheels import nominal
from rw_ekf.attitude_bench.contest import Entry, run_entry
from rw_ekf.attitude_bench.metrics import metrics_of
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.schemes import SCHEMES
from rw_ekf.records import Tick

SCENARIO = Scenario()
SEEDS = (1, 2)

pytestmark = pytest.mark.slow


def peaks_deg(scheme: str, noise_rpm: float) -> np.ndarray:
    """Peak attitude errors [deg], one a seed."""
    runs = (run_entry(Entry(scheme, noise_rpm, seed), SCENARIO, {}) for seed in SEEDS)
    return np.array([metrics_of(run).peak_deg for run in runs])


@pytest.mark.parametrize("noise_rpm", [1.0, 5.0])
def test_crossings_by_the_filters_own_propagation_beat_dmc_and_that_beats_wrong_parameters(noise_rpm: float) -> None:
    """DMC with parameters that the EKF learned stays below 0.1 deg, with the deterministic ones it is worse.

    Predictive crossing stays far below the 0.038 deg of exact parameters, and below the DMC, on every seed.
    """
    predictive, dmc, deterministic = (
        peaks_deg(name, noise_rpm) for name in ("predictive_crossing", "dmc", "dmc_deterministic")
    )
    assert (dmc < 0.1).all()
    assert (deterministic > 2.0 * dmc).all()
    assert (predictive < 0.01).all()
    assert (predictive < dmc).all()


def test_the_raw_speed_makes_dmc_chatter_where_the_filters_does_not() -> None:
    """Exact parameters at the raw reading: hundredths of a degree at 1 rpm, a tenth and more at 5 rpm.

    At the reversal the speed falls by 0.3 rpm a cycle, so that the reading's sign is that of its noise for 3 cycles at
    1 rpm and 17 at 5 rpm, and with it the friction's, which is twice what is asked for. The filter knows the speed
    there within 0.03 rpm, whatever the noise: it has seen 230 s of it.
    """
    found = {noise_rpm: float(np.median([raw_peak_deg(noise_rpm, seed) for seed in (1, 2, 3)])) for noise_rpm in (1, 5)}
    assert found[1] < 0.038
    assert 0.08 < found[5] < 0.26  # one run gave 0.171


def raw_peak_deg(noise_rpm: float, seed: int) -> float:
    """Peak [deg] of DMC with exact parameters at the speed as it is read."""
    entry = SCHEMES["dmc"]
    start = start_of(entry, SCENARIO, noise_rpm, seed)

    def exact_at_the_reading(tick: Tick) -> WheelKnown:
        assert tick.sample.speed_rad_s is not None
        return WheelKnown.of_parameters(tick.sample.speed_rad_s, nominal(SCENARIO), start.sheet.stribeck)

    scheme = entry.make(start.sheet)
    run = run_bench(SCENARIO, start.plant, noise_rpm, seed, start.estimator, scheme, exact_at_the_reading)
    return metrics_of(run).peak_deg


def test_adaptive_dmc_converges_while_it_controls() -> None:
    """From parameters 30 % off: after the reversal friction over motor gain, which DMC lives by, is known to 3 %."""
    entry = SCHEMES["dmc_adaptive"]
    for seed in SEEDS:
        start = start_of(entry, SCENARIO, 1.0, seed)
        run = run_bench(SCENARIO, start.plant, 1.0, seed, start.estimator, entry.make(start.sheet), start.knowledge)
        believed, truth = start.estimator.parameters, nominal(SCENARIO)
        assert believed.coulomb / believed.motor_gain == pytest.approx(truth.coulomb / truth.motor_gain, rel=0.03)
        off = np.abs(np.array(poor_prior(SCENARIO, seed).parameters) / np.array(truth) - 1.0)
        assert off == pytest.approx(np.full(4, POOR_SHARE))
        assert metrics_of(run).peak_deg < metrics_of(run_entry(Entry("pid_current", 1.0, seed), SCENARIO, {})).peak_deg
