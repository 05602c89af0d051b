"""A log made ready for diagnosis: conditions, split, the base model fitted to the part that is searched."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rw_ekf.diagnosis.base_fit import fit_base, model_of_setup, part_of, start_parameters
from rw_ekf.diagnosis.conditions import REFERENCE_DEGC, facts_of, filled, integrated_angle
from rw_ekf.diagnosis.frame import Fit, Prior
from rw_ekf.diagnosis.model import Model
from rw_ekf.diagnosis.one_step import Record
from rw_ekf.diagnosis.split import Kind, Split, split_record
from rw_ekf.effects.effect import RecordFacts
from rw_ekf.filter.belief import prior_around
from rw_ekf.filter.log_filter import FilterInput
from rw_ekf.replay import input_of_log
from rw_ekf.starting_point import FilterSetup, setup_of_record

if TYPE_CHECKING:
    from rw_ekf.logs.wheel_log import WheelLog
    from rw_ekf.model_file import WheelModel
    from rw_ekf.settings.schema import Configuration

Float64Array = NDArray[np.float64]

_LEAST_READINGS = 100
_LEAST_SECONDS = 10.0
_LEAST_MOVE = 0.05  # of the top speed: a wheel whose speed changes by less shows no friction law
_MOST_SAMPLES = 60_000  # of the whole-record fit; beyond, every so many blocks are looked at


@dataclass(frozen=True)
class Prepared:
    """Everything that a search starts from."""

    log: WheelLog
    data: FilterInput
    setup: FilterSetup
    split: Split
    prior: Prior
    facts: RecordFacts
    fit_part: Record
    whole: Record
    heldout: Record
    base: Fit
    angle_is_logged: bool
    temperature_is_logged: bool

    def swapped(self) -> Prepared:
        """The same with the parts' roles exchanged: what was held out is searched."""
        split = replace(self.split, fit=self.split.heldout, heldout=self.split.fit)
        return _with_base(replace(self, split=split, fit_part=self.heldout, heldout=self.fit_part), self.base.model)


def unfit(log: WheelLog, data: FilterInput) -> str | None:
    """Why the base model cannot be judged on this log; None if it can."""
    speed = data.speed_rad_s[np.isfinite(data.speed_rad_s)]
    if speed.size < _LEAST_READINGS or log.duration_s < _LEAST_SECONDS:
        return (
            f"the log has {speed.size} speed readings over {log.duration_s:.3g} s; "
            f"{_LEAST_READINGS} readings over {_LEAST_SECONDS:g} s are the least that can be judged"
        )
    low, high = np.quantile(speed, (0.01, 0.99))
    top = max(abs(low), abs(high))
    third = np.diff(speed, 3)
    noise = float(np.median(np.abs(third))) / 0.6745 / math.sqrt(20.0)
    if high - low < _LEAST_MOVE * top or high - low < 8.0 * noise:
        return "the speed hardly changes in this log, so that any friction fits it"
    return None


def prepare(log: WheelLog, configuration: Configuration | None, model: WheelModel | None, kind: Kind) -> Prepared:
    """Fit the base model to the part that is searched. The log must not be `unfit`."""
    data = input_of_log(log)
    setup = setup_of_record(data, configuration, model)
    if model is not None:  # a model's covariance is that of its own log: here it is a place to start from
        setup = replace(setup, prior=prior_around(model.parameters))
    noise = setup.noise.speed_noise_rad_s
    split = split_record(data.time_s, data.segment, data.speed_rad_s, kind, noise)
    n = data.time_s.size
    temperature, warm = filled(data.temperature_degC, n, REFERENCE_DEGC)
    logged_angle, turned = filled(data.angle_rad, n, 0.0)
    gap = setup.constants.max_gap_s
    prior = Prior.of(setup.prior.core.mean[1:], setup.prior.core.covariance[1:, 1:])
    part = part_of(data, log.current_A, log.command_delay_s, split.fit)
    start = model_of_setup(setup, setup.prior.parameters if model is not None else start_parameters(part, setup))
    everything = np.ones(n, dtype=bool)
    angle = logged_angle
    if not turned:
        seen = fit_base(Record.of(data, everything, gap, temperature, logged_angle), start, prior, noise)
        angle = integrated_angle(data, seen.reference.speed)
    channels = frozenset(name for name, there in (("temperature_degC", warm), ("angle_rad", turned)) if there)
    fit_part, whole, heldout = (
        Record.of(data, mask, gap, temperature, angle) for mask in (split.fit, everything, split.heldout)
    )
    base = fit_base(fit_part, start, prior, noise)
    facts = facts_of(data, base.model, math.sqrt(base.noise.variance), temperature, split.fit, channels)
    return Prepared(log, data, setup, split, prior, facts, fit_part, whole, heldout, base, turned, warm)


def _with_base(prepared: Prepared, model: Model) -> Prepared:
    """Fit the base to the present fit part."""
    noise = prepared.setup.noise.speed_noise_rad_s
    base = fit_base(prepared.fit_part, model, prepared.prior, noise)
    channels = prepared.facts.channels
    warmth = prepared.fit_part.temperature_degC
    facts = facts_of(prepared.data, base.model, math.sqrt(base.noise.variance), warmth, prepared.split.fit, channels)
    return replace(prepared, base=base, facts=facts)
