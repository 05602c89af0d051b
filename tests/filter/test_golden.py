"""The online estimator and the compiled pass over logs are one filter: every number, every decision."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.records import Outcome
from rw_ekf.units import RAD_S_PER_RPM
from tests.filter.replay import OUTCOMES, Columns, compiled, online
from tests.truth import run_of
from tools.measure.runs import constants_for

LAWS = ("gauss", "tustin", "lorentz")


def rough_log(profile: str, seed: int, law: str, samples: int = 900) -> Columns:
    """A run with everything that happens on a line.

    Late commands (some by more than a period), missing readings (at the start, alone, and at the end of a gap), gaps,
    spikes alone and in runs, repeated and backward rows, a new segment whose clock restarts, one that starts blind.
    """
    rng = np.random.default_rng(seed)
    run = run_of(profile, seed, law=law)
    time_s, speed, current = (v[:samples].copy() for v in (run.time_s, run.reading_rad_s, run.current_A))
    delay = rng.choice(np.array([0.0, 0.012, 0.05, 0.1, 0.13, 0.31]), samples, p=[0.2, 0.4, 0.2, 0.1, 0.05, 0.05])
    segment = np.zeros(samples, np.int64)
    speed[:2] = np.nan
    speed[rng.choice(samples, samples // 20, replace=False)] = np.nan
    time_s += 0.01 * rng.uniform(0.0, 1.0, samples)
    time_s[200:] += 7.0
    time_s[300:] += 3.0
    speed[300] = np.nan
    for i in (120, 260, 420):
        speed[i] += 60.0 * RAD_S_PER_RPM
    speed[500:507] += 80.0 * RAD_S_PER_RPM
    time_s[350] = time_s[349]
    time_s[380] = time_s[379] - 0.35
    time_s[381] = time_s[379]
    segment[600:] = 1
    time_s[600:] -= time_s[600]
    segment[750:] = 2
    time_s[750:] -= time_s[750] - 12.0
    speed[750:752] = np.nan
    return Columns(time_s, speed, current, delay, segment)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("profile", ["P1", "P2", "S2"])
def test_online_and_compiled_agree_at_every_sample(profile: str, law: str) -> None:
    """Means, sigmas and innovations agree to 1e-12 of a sigma and every outcome is the same, on a rough log."""
    log = rough_log(profile, 5, law)
    constants = constants_for(law=law)
    estimator, results = online(log, constants, DEFAULT_PRIOR)
    run = compiled(log, constants, DEFAULT_PRIOR)
    assert [r.outcome for r in results] == [OUTCOMES[code] for code in run.outcome]
    assert {r.outcome for r in results} == set(Outcome)
    means, stds = np.array([r.values for r in results]), np.array([r.stds for r in results])
    assert np.max(np.abs(means - run.states) / run.stds) < 1e-12
    assert np.max(np.abs(stds / run.stds - 1.0)) < 1e-12
    assert np.max(np.abs(estimator.mean - run.mean) / run.stds[-1]) < 1e-12
    scale = np.outer(run.stds[-1], run.stds[-1])
    assert np.max(np.abs(estimator.covariance - run.covariance) / scale) < 1e-12
    for i, result in enumerate(results):
        if result.innovation is None:
            assert np.isnan(run.innovation_rad_s[i])
        else:
            spread = np.sqrt(run.innovation_variance[i])
            assert abs(result.innovation.innovation_rad_s - run.innovation_rad_s[i]) < 1e-12 * spread
            assert result.innovation.std_rad_s == pytest.approx(spread, rel=1e-12)
            assert result.innovation.nis == pytest.approx(run.nis[i], rel=1e-12, abs=1e-15)


@pytest.mark.parametrize("rate_hz", [1.0, 100.0])
def test_online_and_compiled_agree_at_other_rates(rate_hz: float) -> None:
    """At 1 Hz and at 100 Hz they are still one filter."""
    run = run_of("P1", 3, rate_hz=rate_hz)
    n = min(run.time_s.size, 2000)
    log = Columns(run.time_s[:n], run.reading_rad_s[:n], run.current_A[:n])
    _, results = online(log, constants_for(), DEFAULT_PRIOR)
    other = compiled(log, constants_for(), DEFAULT_PRIOR)
    assert np.max(np.abs(np.array([r.values for r in results]) - other.states) / other.stds) < 1e-12
