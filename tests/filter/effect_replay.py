"""Models with effects put through both filters: a belief over their states, a rough log, the log through each."""

from __future__ import annotations

import math

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.course.acting_temperature import acting_temperature
from rw_ekf.course.course import Course
from rw_ekf.drivers.sim.plant_batch import simulate_run
from rw_ekf.drivers.sim.plant_parameters import PlantParameters
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.filter.belief import DEFAULT_PRIOR, Belief
from rw_ekf.filter.estimator import Estimator
from rw_ekf.filter.filter_run import FilterRun
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.model.effect import RecordFacts, Term
from rw_ekf.model.state import CK13_STATISTICAL
from rw_ekf.records import Estimate, IssuedCommand, WheelSample
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.effect_table import EffectSet
from tests.filter.replay import Columns
from tools.measure.runs import OMEGA_S, constants_for

WHEEL = RecordFacts(
    first_s=0.0, last_s=90.0, period_s=0.1, top_speed_rad_s=60.0, top_current_A=0.15, friction=CK13_STATISTICAL,
    stribeck_speed_rad_s=OMEGA_S, stribeck_law=0, speed_noise_rad_s=RAD_S_PER_RPM, reversals=8,
    temperature_range_K=10.0, angle=True, channels=frozenset({"temperature_degC", "angle_rad"}),
)  # fmt: skip


def in_use(*ids: str) -> EffectSet:
    """Effects at a size that shows, as uncertain as they are large."""
    terms: list[Term] = []
    for name in ids:
        effect = CATALOGUE[name]
        tried, shape = effect.candidates(WHEEL)[0]
        value = 5.0 * effect.smallest(WHEEL) if effect.linear else tried
        terms.append(Term.of(effect, shape, value, abs(value)))
    return EffectSet(tuple(terms))


def believed(effects: EffectSet, base: Belief = DEFAULT_PRIOR) -> Belief:
    """A belief with the effects' coefficients behind the five states, and their hidden states behind those."""
    size = effects.table().size
    mean, covariance = np.zeros(size), np.zeros((size, size))
    mean[:5], covariance[:5, :5] = base.mean, base.covariance
    stds = [std for term in effects.state_terms for std in term.stds]
    for at, (value, std) in enumerate(zip(effects.values, stds, strict=True), start=5):
        mean[at], covariance[at, at] = value, std**2
    return Belief(mean, covariance)


def rough_log(seed: int, *, burst: bool = False, first_A: float = 0.0) -> tuple[Columns, Float64Array, Float64Array]:
    """Columns, temperature and angle, with everything that happens on a line; a constant current at every seeding.

    Readings missing alone and after a gap, a spike, a new segment whose clock restarts; burst: a run of bad readings
    too. first_A: commanded where the log and the segment begin.
    """
    rng = np.random.default_rng(seed)
    times, currents = sample_profile(make_profile("P2", seed=seed), 10.0)
    n = 700
    current = np.array(currents[:n])
    for seeded in (0, 200, 400, 550):
        current[max(seeded - 25, 0) : seeded + 25] = 0.0
    for begins in (0, 400):
        current[begins : begins + 25] = first_A
    run = simulate_run(PlantParameters(), current, times[:n], seed=seed, initial_speed_rad_s=30.0)
    time_s, speed = run.time_s.copy(), run.measured_speed_rad_s.copy()
    segment = np.where(np.arange(n) < 400, 0, 1)
    speed[rng.choice(n, n // 20, replace=False)] = np.nan
    speed[0], speed[120] = np.nan, speed[119] + 60.0 * RAD_S_PER_RPM
    time_s[200:] += 7.0
    time_s[400:] -= time_s[400] - 3.0
    if burst:
        speed[550:557] += 20.0 * RAD_S_PER_RPM  # within reach of the wheel: the gate gives up after five
    temperature = 25.0 + 5.0 * np.sin(0.005 * np.arange(n))
    temperature[rng.random(n) < 0.3] = np.nan
    angle = np.where(np.arange(n) % 40 == 0, rng.uniform(0.0, 6.0, n), np.nan)
    return Columns(time_s, speed, current, np.zeros(n), segment), temperature, angle


def both(
    log: Columns, temperature: Float64Array, angle: Float64Array, effects: EffectSet, temperature_lag_s: float = 0.0
) -> tuple[list[Estimate], FilterRun]:
    """The log sample by sample through the estimator, and through the compiled pass."""
    belief, constants = believed(effects), constants_for()._replace(temperature_lag_s=temperature_lag_s)
    drift = np.full(effects.size, 1.0e-9)
    estimator = Estimator(constants, belief.mean, belief.covariance, effects, drift)
    results = []
    for i in range(log.time_s.size):
        reading = None if math.isnan(log.speed_rad_s[i]) else float(log.speed_rad_s[i])
        sample = WheelSample(
            float(log.time_s[i]),
            reading,
            temperature_degC=None if math.isnan(temperature[i]) else float(temperature[i]),
            angle_rad=None if math.isnan(angle[i]) else float(angle[i]),
            segment=int(log.segment[i]),
        )
        results.append(estimator.step(sample))
        estimator.command_issued(IssuedCommand(float(log.current_A[i]), float(log.delay_s[i])))
    temperature = acting_temperature(log.time_s, log.segment, temperature, temperature_lag_s)
    course = Course.of(
        log.time_s, log.speed_rad_s, log.current_A, log.delay_s, log.segment, temperature, angle
    )  # fmt: skip
    run = filter_log(course, constants, belief.mean, belief.covariance, effects, drift, keep_states=True, mends=True)
    return results, run
