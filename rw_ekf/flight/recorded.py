"""What the exported self-test is held against: a motion of the model's own wheel, and the estimator's answers to it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.control.compensation.dmc import DynamicModelCompensation
from rw_ekf.control.compensation.known import WheelKnown
from rw_ekf.control.compensation.predictive_crossing import PredictiveCrossing
from rw_ekf.control.compensation.scheme import Compensation
from rw_ekf.filter.estimator import OUTCOMES, Estimator
from rw_ekf.filter.health_monitor import TROUBLES
from rw_ekf.model.effect import REFERENCE_DEGC
from rw_ekf.model.flow import flow
from rw_ekf.model.friction import FrictionCurve
from rw_ekf.model.law import MOST_COLUMNS
from rw_ekf.records import Estimate, IssuedCommand, Tick, WheelSample
from rw_ekf.starting_point import FilterSetup

SAMPLES = 3000
EVERY = 10  # samples, all numbers are held against each other; outcome, health and speed at every one
_BLOCK = 40  # samples under one current
_BREAKAWAYS = (6.0, -6.0, 0.0, 0.5, 8.0, 0.0, -0.5, -3.0, 2.0, 0.0, 12.0, -12.0, 1.5, 0.0, -1.1)  # of current
_STEADY, _OTHER_WHEEL, _ELSEWHERE = 800, 2000, 2750  # samples where the next part of the motion begins
_FAST = 60.0  # Stribeck speeds
_LEAST_A = 1.0e-3
_STEP_S = 0.1  # or the period, where that is longer: a divergence takes minutes
_DIGITS = 6
_SEED = 42
_READ = frozenset(WheelSample.__dataclass_fields__)  # columns that the estimator reads of a wheel


@dataclass(eq=False, frozen=True)
class Recorded:
    """n readings with what follows them, and what the estimator and the compensations made of them."""

    reported: Float64Array  # (n, 10) time, speed, temperature, angle, three columns, current, delay, request
    begins: Int64Array  # (n,) 1: a new segment
    outcome: Int64Array  # (n,)
    trouble: Int64Array  # (n,)
    mean: Float64Array  # (n, m)
    std: Float64Array  # (n, m)
    wanted_A: Float64Array  # (n, 2) by DMC and by predictive crossing; NaN: not to be compared
    period_s: float


def recorded(setup: FilterSetup, period_s: float) -> Recorded:
    """Move the model's wheel without its effects, spoil the readings, and let the estimator answer.

    Reversals, rests, creep, outliers, a gap, missing readings, times that stand or go back, steps that re-seed, a new
    segment, late commands; a long steady turn; another wheel, which the filter has to be mended for; readings that
    are elsewhere for so long that it is locked out.
    """
    rng = np.random.default_rng(_SEED)
    n = SAMPLES
    gap_s = setup.constants.max_gap_s
    step_s = round(min(max(period_s, _STEP_S), 0.4 * gap_s), _DIGITS)
    k, b, c, s = setup.prior.parameters
    omega_s = setup.constants.stribeck.omega_s
    breakaway_A = max(abs(s / k), _LEAST_A) if k != 0.0 else _LEAST_A
    current = breakaway_A * np.resize(np.repeat(_BREAKAWAYS, _BLOCK), n)
    current[_STEADY:_OTHER_WHEEL] = breakaway_A * (abs(c) + abs(b) * _FAST * omega_s) / max(abs(s), 1.0e-12)
    current = np.array([float(f"{value:.4g}") for value in current])
    true = _motion(setup, current, step_s)
    noise = setup.constants.speed_noise_rad_s
    speed = true + noise * rng.normal(size=n)
    speed[rng.choice(n, n // 40, replace=False)] = math.nan
    speed[[50, 170, 330]] += 1.0e3 * noise
    for at in (450, _STEADY - 100):
        speed[at : at + 7] += 15.0 * noise
    speed[_ELSEWHERE:] += 1.0e4 * noise + 1.0e3 * abs(c) * step_s
    time_s = step_s * np.arange(n)
    time_s[250:] += 10.0 * gap_s
    time_s[500:] -= time_s[500] - 3.0
    time_s[300], time_s[310] = time_s[299], time_s[309] - 0.5 * step_s
    delay = np.where(rng.random(n) < 0.3, 0.3 * step_s, 0.0)
    delay[350:360] = 2.5 * step_s
    angle = np.where(np.arange(n) % 50 == 0, rng.uniform(0.0, 2.0 * math.pi, n), math.nan)
    columns = np.full((n, MOST_COLUMNS), math.nan)
    for term in setup.effects.terms:
        if term.law is not None and term.law.column in _READ:
            columns[:, term.law.slot] = rng.uniform(term.law.first, term.law.last, n)
    request = np.where(np.arange(n) % 60 < 30, 0.3, -0.3) * abs(c)
    request[np.arange(n) % 100 < 10] = 0.0
    temperature = REFERENCE_DEGC + 4.0 * np.sin(0.01 * np.arange(n))
    reported = np.column_stack([time_s, speed, temperature, angle, columns, current, delay, request])
    reported = np.array([[float(f"{value:.9g}") for value in row] for row in reported.tolist()])  # short to print
    begins = np.zeros(n, dtype=np.int64)
    begins[500] = 1
    return _answered(setup, reported, begins, step_s)


def _motion(setup: FilterSetup, current: Float64Array, step_s: float) -> Float64Array:
    """Speeds of the wheel of a model (n,), and from one sample on of another."""
    k, b, c, s = setup.prior.parameters
    stribeck = setup.constants.stribeck
    true = np.zeros(current.size)
    for i in range(1, current.size):
        if i == _STEADY:
            true[i - 1] = _FAST * stribeck.omega_s
        gain, more = (1.7 * k, 1.5) if i >= _OTHER_WHEEL else (k, 1.0)
        curve = FrictionCurve(b, more * c, more * s, stribeck.omega_s, stribeck.law)
        true[i] = flow(true[i - 1], gain * current[i - 1], curve, step_s, False)[0]
    return true


def _answered(setup: FilterSetup, reported: Float64Array, begins: Int64Array, step_s: float) -> Recorded:
    belief, stribeck = setup.prior, setup.constants.stribeck
    estimator = Estimator(setup.constants, belief.mean, belief.covariance, setup.effects, setup.effect_drift)
    dmc, crossing = DynamicModelCompensation(), PredictiveCrossing(1.0 / step_s)
    period_s = 1.0 / (1.0 / step_s)  # as the scheme has it
    outcomes = {outcome: code for code, outcome in OUTCOMES.items()}
    troubles = {trouble: code for code, trouble in TROUBLES.items()}
    n, names = begins.size, setup.effects.columns
    outcome, trouble, wanted = np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros((n, 2))
    mean, std = np.zeros((n, belief.mean.size)), np.zeros((n, belief.mean.size))
    for i, row in enumerate(reported.tolist()):
        time_s, speed, temperature, angle, *columns, current_A, delay_s, request = row
        read: dict[str, Any] = {name: columns[slot] for slot, name in enumerate(names) if name in _READ}
        sample = WheelSample(
            time_s,
            None if math.isnan(speed) else speed,
            temperature_degC=temperature,
            angle_rad=angle,
            segment=int(begins[: i + 1].sum()),
            **read,
        )
        estimate = estimator.step(sample)
        known = WheelKnown.of_estimate(estimate, stribeck)
        wanted[i] = [_wanted(scheme, Tick(sample, estimate), request, known) for scheme in (dmc, crossing)]
        estimator.command_issued(IssuedCommand(current_A, delay_s))
        outcome[i] = outcomes[estimate.outcome]
        trouble[i] = _trouble(estimate, troubles)
        mean[i], std[i] = estimator.ekf.x, estimator.ekf.std
    return Recorded(reported, begins, outcome, trouble, mean, std, wanted, period_s)


def _wanted(scheme: Compensation, tick: Tick, request: float, known: WheelKnown) -> float:
    """A current [A]; NaN where the scheme cannot say."""
    try:
        return scheme.current_A(tick, request, known)
    except (ArithmeticError, ValueError):
        return math.nan


def _trouble(estimate: Estimate, codes: dict[Any, int]) -> int:
    return 0 if estimate.health is None else codes[estimate.health.trouble]
