"""The base model fitted to the part that is searched: least squares, then the likelihood along a reference."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rw_ekf.effects.table import EffectSet
from rw_ekf.filter.log_filter import FilterInput
from rw_ekf.filter.smoother import smooth_log
from rw_ekf.identify.least_squares import least_squares
from rw_ekf.likelihood.fitting import Fit, fit_model
from rw_ekf.likelihood.frame import Noise, Prior
from rw_ekf.likelihood.frozen_filter import run_frozen
from rw_ekf.likelihood.model import Model
from rw_ekf.likelihood.one_step import Record, Reference
from rw_ekf.model.friction import LAW_CODES
from rw_ekf.model.state import FrictionParameters
from rw_ekf.starting_point import FilterSetup

Float64Array = NDArray[np.float64]

_OUTLIER_STDS = 6.0
_OUTLIER_SHARE = 0.01
_LEAST_SQUARES_SAMPLES = 20_000
_FILTER_RATIO = 1.0e-3  # q dt / R


def part_of(data: FilterInput, current_A: Float64Array, delay_s: Float64Array, part: NDArray[np.bool_]) -> FilterInput:
    """The samples of a part alone, a segment for each of its blocks."""
    jumps = np.flatnonzero(part)
    block = np.cumsum(np.diff(jumps, prepend=jumps[:1]) > 1)
    segment = data.segment[part] * (int(block.max(initial=0)) + 1) + block
    temperature, angle = data.temperature_degC, data.angle_rad
    return FilterInput.of(
        data.time_s[part],
        data.speed_rad_s[part],
        current_A[part],
        delay_s[part],
        segment,
        None if temperature is None else temperature[part],
        None if angle is None else angle[part],
    )


def start_parameters(part: FilterInput, setup: FilterSetup) -> FrictionParameters:
    """Least squares over the part, from several starts: the likelihood has one valley from here."""
    head = part.head(_LEAST_SQUARES_SAMPLES)
    return least_squares(head, setup.constants, setup.prior.core).parameters


def prior_of(setup: FilterSetup) -> Prior:
    """The setup's prior over the four parameters."""
    return Prior.of(setup.prior.core.mean[1:], setup.prior.core.covariance[1:, 1:])


def model_of_setup(setup: FilterSetup, parameters: FrictionParameters) -> Model:
    """The model to begin with: the setup's effects, if a model file gave some, and its Stribeck curve.

    Their shapes stay as they were found: on a whole record, of which only a part is fitted here.
    """
    effects = EffectSet(tuple(replace(column, settled=True) for column in setup.effects.columns))
    return Model(parameters, setup.stribeck_speed_rad_s, LAW_CODES[setup.stribeck_law], effects)


def read_reference(data: FilterInput, noise_rad_s: float) -> Reference:
    """The readings themselves, gaps bridged: no model has had a say in them."""
    speed = data.speed_rad_s
    index = np.arange(speed.size)
    good = np.isfinite(speed)
    return Reference.of_speed(np.interp(index, index[good], speed[good]), np.full(speed.size, noise_rad_s))


def smoothed_by_filter(
    data: FilterInput, part: NDArray[np.bool_], parameters: FrictionParameters, setup: FilterSetup, noise_rad_s: float
) -> Reference:
    """The speed smoothed by the filter itself, its parameters frozen: near rest only a model tells stick from slip.

    Readings outside `part` (n,) are not looked at.
    """
    bare = model_of_setup(setup, parameters).base
    seen = data.with_speed(np.where(part, data.speed_rad_s, np.nan))
    run = run_frozen(seen, bare, Noise(noise_rad_s**2, _FILTER_RATIO), setup.constants, keep_history=True)
    means, stds = smooth_log(run)
    return Reference.of_speed(means[:, 0], np.maximum(stds[:, 0], 0.02 * noise_rad_s))


def fit_base(record: Record, model: Model, prior: Prior, noise_rad_s: float, starts: list[Reference]) -> Fit:
    """Fit from each reference, keep the likeliest, leave out the readings that no noise explains, and fit again."""
    n = record.data.time_s.size
    noise = Noise(noise_rad_s**2, 1.0e-2)
    none = np.zeros(n, dtype=bool)
    fits = [fit_model(record, model, prior, reference, noise, none) for reference in starts]
    fit = max(fits, key=lambda item: item.likelihood.value)
    spikes = outliers(fit)
    if spikes.any() and spikes.sum() <= _OUTLIER_SHARE * n:
        return fit_model(record, fit.model, prior, fit.reference, fit.noise, spikes)
    return fit


def outliers(fit: Fit) -> NDArray[np.bool_]:
    """Readings beyond six standard deviations of what the model predicts, (n,)."""
    none = np.zeros((fit.frame.chain.reading.size, 0))
    r, _, _ = fit.frame.whitened(fit.noise.ratio, fit.noise.variance, none)
    found = np.zeros(fit.frame.chain.reading.size, dtype=bool)
    found[fit.frame.innovation_at] = np.abs(r) > _OUTLIER_STDS
    return found
