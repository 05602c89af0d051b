"""What the fit of the base model starts from: the part that is searched, the prior, least squares over it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.course.course import Course
from rw_ekf.identify.least_squares import least_squares
from rw_ekf.likelihood.model import Model
from rw_ekf.model.friction import LAW_CODES
from rw_ekf.model.state import FrictionParameters
from rw_ekf.starting_point import FilterSetup
from rw_ekf.wheel.table import EffectSet

_LEAST_SQUARES_SAMPLES = 20_000


def part_of(course: Course, current_A: Float64Array, delay_s: Float64Array, part: BoolArray) -> Course:
    """The samples of a part alone, a segment for each of its blocks."""
    jumps = np.flatnonzero(part)
    block = np.cumsum(np.diff(jumps, prepend=jumps[:1]) > 1)
    segment = course.segment[part] * (int(block.max(initial=0)) + 1) + block
    return Course.of(
        course.time_s[part],
        course.speed_rad_s[part],
        current_A[part],
        delay_s[part],
        segment,
        course.temperature_degC[part],
        course.angle_rad[part],
    )


def start_parameters(part: Course, setup: FilterSetup) -> FrictionParameters:
    """Least squares over the part, from several starts: the likelihood has one valley from here."""
    head = part.window(0, _LEAST_SQUARES_SAMPLES)
    return least_squares(head, setup.constants, setup.prior.core).parameters


def model_of_setup(setup: FilterSetup, parameters: FrictionParameters) -> Model:
    """The model to begin with: the setup's effects, if a model file gave some, and its Stribeck curve.

    Their shapes stay as they were found: on a whole record, of which only a part is fitted here.
    """
    effects = EffectSet(tuple(replace(term, settled=True) for term in setup.effects.terms))
    return Model(parameters, setup.stribeck_speed_rad_s, LAW_CODES[setup.stribeck_law], effects)
