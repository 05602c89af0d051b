"""What the exported self-test is held against: a motion of the model's own wheel, and the estimator's answers to it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.filter.estimator import OUTCOMES, Estimator
from rw_ekf.filter.physician import TROUBLES
from rw_ekf.model.effect import REFERENCE_DEGC
from rw_ekf.model.flow import flow
from rw_ekf.model.friction import FrictionCurve
from rw_ekf.model.law import MOST_COLUMNS
from rw_ekf.records import IssuedCommand, WheelSample
from rw_ekf.starting_point import FilterSetup

SAMPLES = 600
_BLOCK = 40  # samples under one current
_BREAKAWAYS = (6.0, -6.0, 0.0, 0.5, 8.0, 0.0, -0.5, -3.0, 2.0, 0.0, 12.0, -12.0, 1.5, 0.0, -1.1)  # of current
_LEAST_A = 1.0e-3
_SEED = 42
_READ = frozenset(WheelSample.__dataclass_fields__)  # columns that the estimator reads of a wheel


@dataclass(frozen=True)
class Recorded:
    """n readings, the commands behind them, and what the estimator made of them."""

    time_s: Float64Array  # (n,)
    speed_rad_s: Float64Array  # (n,) NaN: missing
    begins: Int64Array  # (n,) 1: a new segment
    temperature_degC: Float64Array  # (n,)
    angle_rad: Float64Array  # (n,) NaN: not told
    columns: Float64Array  # (n, 3)
    current_A: Float64Array  # (n,) commanded behind each reading, ...
    delay_s: Float64Array  # ... in force so much later
    outcome: Int64Array  # (n,)
    trouble: Int64Array  # (n,)
    mean: Float64Array  # (n, m)
    std: Float64Array  # (n, m)


def recorded(setup: FilterSetup, period_s: float) -> Recorded:
    """Move the model's wheel without its effects, spoil the readings, and let the estimator answer.

    Reversals, rests, a creep, outliers, a gap, missing readings, a step that re-seeds, a new segment, late commands.
    """
    rng = np.random.default_rng(_SEED)
    n = SAMPLES
    k, b, c, s = setup.prior.parameters
    breakaway_A = max(abs(s / k), _LEAST_A) if k != 0.0 else _LEAST_A
    current = breakaway_A * np.repeat(_BREAKAWAYS, _BLOCK)[:n]
    time_s = period_s * np.arange(n)
    stribeck = setup.constants.stribeck
    curve = FrictionCurve(b, c, s, stribeck.omega_s, stribeck.law)
    true = np.zeros(n)
    for i in range(1, n):
        true[i] = flow(true[i - 1], k * current[i - 1], curve, period_s, False)[0]
    noise = setup.constants.speed_noise_rad_s
    speed = true + noise * rng.normal(size=n)
    speed[rng.choice(n, n // 40, replace=False)] = math.nan
    speed[[50, 170, 330]] += 1.0e3 * noise
    speed[450:457] += 15.0 * noise
    begins = np.zeros(n, dtype=np.int64)
    begins[500] = 1
    time_s[250:] += 10.0 * setup.constants.max_gap_s
    time_s[500:] -= time_s[500] - 3.0
    delay = np.where(rng.random(n) < 0.3, 0.3 * period_s, 0.0)
    temperature = REFERENCE_DEGC + 4.0 * np.sin(0.01 * np.arange(n))
    angle = np.where(np.arange(n) % 50 == 0, rng.uniform(0.0, 2.0 * math.pi, n), math.nan)
    columns = np.full((n, MOST_COLUMNS), math.nan)
    for term in setup.effects.terms:
        if term.law is not None and term.law.column in _READ:
            columns[:, term.law.slot] = rng.uniform(term.law.first, term.law.last, n)
    return _answered(setup, time_s, speed, begins, temperature, angle, columns, current, delay)


def _answered(setup: FilterSetup, *told: Any) -> Recorded:
    time_s, speed, begins, temperature, angle, columns, current, delay = told
    belief = setup.prior
    estimator = Estimator(setup.constants, belief.mean, belief.covariance, setup.effects, setup.effect_drift)
    outcomes = {outcome: code for code, outcome in OUTCOMES.items()}
    troubles = {trouble: code for code, trouble in TROUBLES.items()}
    n, names = time_s.size, setup.effects.columns
    outcome, trouble = np.zeros(n, np.int64), np.zeros(n, np.int64)
    mean, std = np.zeros((n, belief.mean.size)), np.zeros((n, belief.mean.size))
    for i in range(n):
        read: dict[str, Any] = {name: float(columns[i, slot]) for slot, name in enumerate(names) if name in _READ}
        sample = WheelSample(
            float(time_s[i]),
            None if math.isnan(speed[i]) else float(speed[i]),
            temperature_degC=float(temperature[i]),
            angle_rad=float(angle[i]),
            segment=int(begins[: i + 1].sum()),
            **read,
        )
        estimate = estimator.step(sample)
        estimator.command_issued(IssuedCommand(float(current[i]), float(delay[i])))
        outcome[i] = outcomes[estimate.outcome]
        trouble[i] = 0 if estimate.health is None else troubles[estimate.health.trouble]
        mean[i], std[i] = estimator.ekf.x, estimator.ekf.std
    return Recorded(
        time_s, speed, begins.astype(np.int64), temperature, angle, columns, current, delay, outcome, trouble, mean, std
    )
