"""Noises by maximum likelihood of the innovations (`fit --noise`; docs/identification.md eq. 5-7).

The filter runs with its parameters frozen at an estimate, so that the innovations are those of a prediction-error
filter; their Gaussian likelihood is maximised over the speed noise and the acceleration noise. The gate is open
meanwhile, because a likelihood over samples that the noise itself selects is none; readings far outside are left out
beforehand, once for all.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rw_ekf.filter.constants import FilterConstants
from rw_ekf.filter.log_filter import FilterInput, filter_log
from rw_ekf.identify.record_scale import speed_noise_of
from rw_ekf.model.state import STATE_SIZE, FrictionParameters

Float64Array = NDArray[np.float64]

_OPEN_GATE = 1.0e30
_OUTLIER_NIS = 36.0
_LOG_LIKELIHOOD_RATIO_95 = 1.92  # half the 95 % quantile of chi-square(1)
_NO_NOISE_RATIO_95 = 1.35  # half the 90 % quantile: at the boundary zero only one side is left


@dataclass(frozen=True)
class NoiseFit:
    """Maximum-likelihood noises with standard deviations from the curvature of the likelihood."""

    speed_noise_rad_s: float
    speed_noise_std: float
    acceleration_noise: float  # rad/s per sqrt(s); 0.0 where the data do not ask for any
    acceleration_noise_std: float | None  # None at the boundary
    acceleration_noise_limit: float  # 95 % upper limit
    log_likelihood: float
    samples: int


def frozen(parameters: FrictionParameters, whole: Float64Array | None = None) -> tuple[Float64Array, Float64Array]:
    """A belief that is certain of its parameters: mean (n,), covariance (n, n) of zeros but for the speed.

    whole (n,): a state whose coefficients of effects are kept; n is 5 without it.
    """
    mean = np.zeros(STATE_SIZE) if whole is None else np.array(whole, dtype=np.float64)
    mean[:STATE_SIZE] = (0.0, *parameters)
    covariance = np.zeros((mean.size, mean.size))
    covariance[0, 0] = 1.0
    return mean, covariance


def without_drift(constants: FilterConstants) -> FilterConstants:
    """The same constants with parameters that do not wander."""
    return constants._replace(motor_gain_drift=0.0, viscous_drift=0.0, coulomb_drift=0.0, static_drift=0.0)


def fit_noise(
    data: FilterInput,
    constants: FilterConstants,
    parameters: FrictionParameters,
    *,
    max_samples: int = 60_000,
    advance: Callable[[], object] = lambda: None,
) -> NoiseFit:
    """Tune R and q on (at most the first max_samples of) a log whose parameters are known or fitted.

    The speed noise is sought between a tenth and three times what third differences of the readings show: where the
    model is wrong, process noise alone could explain everything and the likelihood would run to a sensor without noise.
    """
    from scipy.optimize import minimize

    data = _leave_out_spikes(data.head(max_samples), constants, parameters)
    base = without_drift(constants)._replace(gate=_OPEN_GATE)
    mean, covariance = frozen(parameters)

    def negative(log_sigma: float, log_q: float) -> float:
        advance()
        sigma = math.exp(log_sigma)
        q = math.exp(log_q)
        trial = base._replace(speed_variance=sigma * sigma, acceleration_noise=q * q, stuck_variance=(0.1 * sigma) ** 2)
        value = -filter_log(data, trial, mean, covariance).log_likelihood
        return value if math.isfinite(value) else 1.0e300

    seen = speed_noise_of(data.time_s, data.speed_rad_s, data.segment)
    sigma_0 = seen or math.sqrt(constants.speed_variance)
    low, high = (math.log(0.1 * sigma_0), math.log(3.0 * sigma_0)) if seen is not None else (-math.inf, math.inf)
    floor = math.log(sigma_0) - 12.0
    best = None
    for q_0 in (0.03 * sigma_0, 0.6 * sigma_0, _model_error(data, base, parameters)):
        found = minimize(
            lambda v: negative(min(max(v[0], low), high), max(v[1], floor)),
            x0=[math.log(sigma_0), math.log(max(q_0, 1.0e-3 * sigma_0))],
            method="Nelder-Mead",
            options={"xatol": 1e-4, "fatol": 1e-4, "maxfev": 240},
        )
        if best is None or found.fun < best.fun:
            best = found
    assert best is not None
    log_sigma, log_q = min(max(float(best.x[0]), low), high), max(float(best.x[1]), floor)
    lowest = float(best.fun)
    at_boundary = negative(log_sigma, floor) - lowest < _NO_NOISE_RATIO_95
    limit = _upper_limit(negative, log_sigma, floor if at_boundary else log_q, lowest)
    sigma_std = math.exp(log_sigma) * _curvature_std(lambda v: negative(v, log_q), log_sigma, 0.02)
    q_std = None if at_boundary else math.exp(log_q) * _curvature_std(lambda v: negative(log_sigma, v), log_q, 0.2)
    return NoiseFit(
        speed_noise_rad_s=math.exp(log_sigma),
        speed_noise_std=sigma_std,
        acceleration_noise=0.0 if at_boundary else math.exp(log_q),
        acceleration_noise_std=q_std,
        acceleration_noise_limit=limit,
        log_likelihood=-lowest,
        samples=int(np.isfinite(data.speed_rad_s).sum()),
    )


def _model_error(data: FilterInput, constants: FilterConstants, parameters: FrictionParameters) -> float:
    """Acceleration noise that one-step errors would ask for if readings had none [rad/s per sqrt(s)]."""
    mean, covariance = frozen(parameters)
    run = filter_log(data, constants, mean, covariance)
    return float(np.sqrt(np.nanmean(run.innovation_rad_s**2) / max(data.period_s, 1.0e-9)))


def _leave_out_spikes(data: FilterInput, constants: FilterConstants, parameters: FrictionParameters) -> FilterInput:
    mean, covariance = frozen(parameters)
    run = filter_log(data, without_drift(constants)._replace(gate=_OPEN_GATE), mean, covariance)
    nis = run.nis
    finite = nis[np.isfinite(nis)]
    level = max(1.0, float(np.median(finite)) / 0.455) if finite.size else 1.0
    spikes = nis > _OUTLIER_NIS * level
    if not spikes.any() or spikes.sum() > 0.01 * nis.size:
        return data
    speed = data.speed_rad_s.copy()
    speed[spikes] = np.nan
    return data.with_speed(speed)


def _curvature_std(negative: Callable[[float], float], at: float, h: float) -> float:
    """Standard deviation of a logarithm from the second difference, over a step h, of the negative log-likelihood."""
    curvature = (negative(at + h) + negative(at - h) - 2.0 * negative(at)) / (h * h)
    return 1.0 / math.sqrt(curvature) if curvature > 0.0 else math.inf


def _upper_limit(negative: Callable[[float, float], float], log_sigma: float, start: float, lowest: float) -> float:
    """Acceleration noise at which the likelihood has fallen by the 95 % ratio, by bisection upward from `start`."""
    low, high = start, start
    for _ in range(60):
        high += 0.5
        if negative(log_sigma, high) - lowest > _LOG_LIKELIHOOD_RATIO_95:
            break
        low = high
    for _ in range(12):
        middle = 0.5 * (low + high)
        if negative(log_sigma, middle) - lowest > _LOG_LIKELIHOOD_RATIO_95:
            high = middle
        else:
            low = middle
    return math.exp(high)
