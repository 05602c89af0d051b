"""What the fit of the base model starts from: the part that is searched, the prior, least squares over it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.filter.log_filter import FilterInput
from rw_ekf.identify.least_squares import least_squares
from rw_ekf.likelihood.model import Model
from rw_ekf.model.friction import LAW_CODES
from rw_ekf.model.state import FrictionParameters
from rw_ekf.starting_point import FilterSetup
from rw_ekf.wheel.table import EffectSet

_LEAST_SQUARES_SAMPLES = 20_000


def part_of(data: FilterInput, current_A: Float64Array, delay_s: Float64Array, part: BoolArray) -> FilterInput:
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


def model_of_setup(setup: FilterSetup, parameters: FrictionParameters) -> Model:
    """The model to begin with: the setup's effects, if a model file gave some, and its Stribeck curve.

    Their shapes stay as they were found: on a whole record, of which only a part is fitted here.
    """
    effects = EffectSet(tuple(replace(term, settled=True) for term in setup.effects.terms))
    return Model(parameters, setup.stribeck_speed_rad_s, LAW_CODES[setup.stribeck_law], effects)
