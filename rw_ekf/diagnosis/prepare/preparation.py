"""A log made ready for diagnosis: conditions, split, the base model fitted to all of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array, by_identity
from rw_ekf.checking.choices import SplitKind
from rw_ekf.course.conditions import filled, filled_columns, integrated_angle, is_logged, with_conditions
from rw_ekf.course.course import Course
from rw_ekf.diagnosis.prepare.current_levels import Levels, at_levels, levels_of, limits_of, sentence_about
from rw_ekf.diagnosis.prepare.source import Source, gross_errors
from rw_ekf.diagnosis.prepare.split import Split, reversals, split_record
from rw_ekf.diagnosis.thresholds import UNDOUBTED_P
from rw_ekf.filter.belief import Belief
from rw_ekf.identify.least_squares import least_squares
from rw_ekf.identify.noise_colour import independent_readings
from rw_ekf.learning.aged_model import as_given
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import Record
from rw_ekf.likelihood.open_stribeck import likeliest_stribeck_speed
from rw_ekf.likelihood.robust_fit import (
    likelier_along_filter,
    read_trajectory,
    robust_fit,
    smoothed_by_filter,
    with_later_break_away,
)
from rw_ekf.likelihood.torque_noise import TorqueNoisePrior
from rw_ekf.likelihood.work_budget import Work
from rw_ekf.log_replay import refuse_runaway_model
from rw_ekf.model.effect import REFERENCE_DEGC, RecordFacts
from rw_ekf.model.state import PARAMETER_COUNT, FrictionParameters
from rw_ekf.second_record import parameters_by_now, with_times_of_record, without_past_changes
from rw_ekf.starting_point import FilterSetup, belief_of_model, setup_of_record, with_open_phases
from rw_ekf.units import rpm_from_rad_s
from rw_ekf.wheel.effect_table import EffectSet

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration
    from rw_ekf.wheel.model_file import WheelModel

# Of the top speed. A record cleaner than the first shows the steps of any integration near rest as structure, and is
# looked at with noise of the second added: 0.06 rpm of 2000.
_CLEAN, _LEAST_NOISE = 1.5e-5, 3.0e-5
_LEAST_SQUARES_SAMPLES = 20_000
_TURN_PER_SAMPLE = 2.0  # rad: an angle is integrated where the wheel is slow enough for some of the record
_SLOW_SHARE = 0.02
_AT_REST, _SLOW = 0.25, 10.0  # Stribeck speeds
_WIDENED, _AGEING = 3.0, 0.2
_LEAST_VISCOUS = 1.0e-3  # 1/s: a model's viscous friction of zero is not known exactly


_Given = TypeVar("_Given")
Advance = Callable[[str], object]  # is given what is done next


class TemperatureLag(NamedTuple):
    """By which the temperature that acts follows the log's."""

    value_s: float
    std_s: float = math.nan  # until it is determined; 0 of a model's
    ahead_K: tuple[float, ...] = ()  # by which the body is warmer than its thermometer where each log begins


@by_identity
class GivenParameters(NamedTuple):
    """The four parameters of the model given, with what has changed in its own record."""

    values: Float64Array  # (4,)
    covariance: Float64Array  # (4, 4)
    changed: bool  # whether anything has


@dataclass(eq=False, frozen=True)
class Prepared:
    """Everything that a search starts from."""

    source: Source
    course: Course  # temperature and angle without gaps
    setup: FilterSetup
    current_A: Float64Array  # as it is taken to have been in force
    split: Split
    facts: RecordFacts
    record: Record  # all of it
    fit_part: Record  # what the figures' parameters are fitted to
    heldout: Record  # what the figures are of
    base: Fit  # of the whole record
    kept: BoolArray  # (samples of the log,) those looked at; all arrays above are of these alone
    notes: tuple[str, ...]  # for the user
    in_rpm: bool  # speeds are reported in rpm: of a wheel, and of any plant whose log has them so
    temperature_lag: TemperatureLag | None = None  # where the course's temperature is not as it was read
    levels: Levels | None = None  # of the current, where it was taken at these and had a noise of its own
    given: GivenParameters | None = None  # of the model given, if there was one
    _of_fit: dict[tuple[str, int], tuple[Fit, Any]] = field(default_factory=dict)  # what, of which fit (its id)

    @property
    def angle_is_logged(self) -> bool:
        """Whether the angle is the log's, and not integrated."""
        return "angle_rad" in self.facts.channels

    @property
    def temperature_is_logged(self) -> bool:
        """Whether the temperature is the log's."""
        return "temperature_degC" in self.facts.channels

    def exchanged(self) -> Prepared:
        """The same with the roles of the two parts exchanged."""
        return replace(self, split=self.split.exchanged(), fit_part=self.heldout, heldout=self.fit_part, _of_fit={})

    def remember(self, what: str, fit: Fit, given: object) -> None:
        """Let what a fit of the whole record gives be this."""
        self._of_fit[what, id(fit)] = fit, given

    def remembered(self, what: str, fit: Fit, work_out: Callable[[], _Given]) -> _Given:
        """What a fit of the whole record gives on the two parts, worked out once."""
        if (what, id(fit)) not in self._of_fit:
            self.remember(what, fit, work_out())
        given: _Given = self._of_fit[what, id(fit)][1]
        return given


# Of a reading's noise: by so much may a speed between two readings be off for a current that is taken as even there.
_UNSEEN = 0.1


def prepare(source: Source, configuration: Configuration | None, model: WheelModel | None, kind: SplitKind) -> Prepared:
    """Fit the base model to the whole record. The source must not be `unfit`.

    Raises BadInputError for a model with which the filter runs away.
    """
    log, log_of = source.log, source.log_of
    model = None if model is None else with_open_phases(model, angle_is_logged=is_logged(source.course.angle_rad))
    course, setup, noise, notes, given = _set_up(source, configuration, model)
    in_rpm = setup.inertia_kg_m2 is not None or log.in_rpm
    split = split_record(course.time_s, course.segment, course.speed_rad_s, kind, noise, log_of)
    kept = split.looked_at
    current, delay = log.current_A, log.command_delay_s
    if log.left_out or not kept.all():
        samples = kept.size + log.left_out
        notes += (
            f"of {samples} samples {int(kept.sum())} were looked at, in stretches evenly spread over the record; "
            "what happened between them is not known",
        )
    if not kept.all():
        course = part_of(course, current, delay, kept)
        current, delay, split, log_of = current[kept], delay[kept], split.at(kept), log_of[kept]
    if not np.any(current != 0.0):
        notes += ("the current is zero throughout: the motor gain cannot be identified and keeps its prior",)
    temperature, warm = filled(course.temperature_degC, REFERENCE_DEGC)
    logged_angle, turned = filled(course.angle_rad, 0.0)
    course = course._replace(
        temperature_degC=temperature, angle_rad=logged_angle, columns=filled_columns(course.columns)
    )
    parameters, free_run = setup.prior.parameters, np.zeros(0)
    if model is None:
        nearly = None if setup.lowest_loss is None else [setup.lowest_loss]
        head = least_squares(course.window(0, _LEAST_SQUARES_SAMPLES), setup.constants, setup.prior.core, starts=nearly)
        parameters, free_run = head.parameters, head.simulated_rad_s
    start = model_of_setup(setup, parameters)
    turning = [term for term in start.terms if term.effect.angular and not turned]
    for term in turning:
        start = start.without(term.id)
    everything = np.ones(course.samples, dtype=bool)
    by_filter = smoothed_by_filter(course, everything, start.base, setup.constants, noise)
    paths = [read_trajectory(course, noise), by_filter]
    if free_run.size:
        paths.append(by_filter.along(free_run, noise))
    work = Work()
    torque_noise = _torque_noise(setup, configuration, model)
    record = Record.of(course, everything, setup.constants, work, log_of, torque_noise)
    base = robust_fit(record, start, setup.prior, noise, paths)
    base = with_later_break_away(likelier_along_filter(base, base, base.model))
    levels = levels_of(current, course.segment) or limits_of(current, course.segment)
    if levels is not None:
        fit = at_levels(base, levels, delay)
        gain = fit.likelihood.value - base.likelihood.value
        if gain > math.log(UNDOUBTED_P):
            base, current, record = fit, levels.current_A, fit.problem.record
            course = record.course
            notes += (sentence_about(levels, gain, in_rpm=in_rpm),)
        else:
            levels = None
    if levels is None:
        course = course.with_even_pieces(unseen_A_s(base))
        record = replace(record, course=course)
        base = replace(base, linearised=replace(base.linearised, record=record))
    if not turned:
        course = course._replace(angle_rad=integrated_angle(course, base.trajectory.speed))
        record = replace(record, course=course, angle_is_integrated=True)
        base = replace(base, linearised=replace(base.linearised, record=record))
    if turning:  # from likely angles, once there is one to integrate
        sizes = [(max(term.size, *term.stds), term) for term in turning]
        base = base.refitted(base.model.with_terms(*(replace(term, values=(size, 0.0)) for size, term in sizes)))
    channels = frozenset(name for name, there in (("temperature_degC", warm), ("angle_rad", turned)) if there)
    starts = tuple(float(course.time_s[i]) for i in np.flatnonzero(np.diff(log_of) > 0) + 1)
    facts = facts_of(course, base, channels, source.timing_doubt_s, starts)
    if setup.stribeck_speed_std > 0.0:
        base = likeliest_stribeck_speed(base, facts.top_speed_rad_s)
        facts = replace(facts_of(course, base, channels, source.timing_doubt_s, starts), stribeck_is_open=True)
    facts = replace(facts, began_utc_s=source.began_utc_s)
    fit_part, heldout = (
        replace(
            Record.of(course, mask, setup.constants, work, log_of, torque_noise, angle_is_integrated=not turned),
            levels=record.levels,
        )
        for mask in (split.fit, split.heldout)
    )
    return Prepared(
        source=source,
        course=course,
        setup=setup,
        current_A=current,
        split=split,
        facts=facts,
        record=record,
        fit_part=fit_part,
        heldout=heldout,
        base=base,
        kept=kept,
        notes=notes,
        in_rpm=in_rpm,
        levels=levels,
        given=given,
        temperature_lag=TemperatureLag(setup.temperature_lag_s, std_s=0.0) if setup.temperature_lag_s > 0.0 else None,
    )


def _set_up(
    source: Source, configuration: Configuration | None, model: WheelModel | None
) -> tuple[Course, FilterSetup, float, tuple[str, ...], GivenParameters | None]:
    """Readings without gross errors and not too clean, the filter's setup, their noise [rad/s], notes, `given`."""
    given = None
    course = source.course
    if model is not None and model.temperature_lag_s > 0.0:
        course = course._replace(temperature_degC=source.acting_temperature(model.temperature_lag_s))
    wrong = gross_errors(course.speed_rad_s, course.segment)
    notes: tuple[str, ...] = ()
    if wrong.any():
        notes += (
            f"{int(wrong.sum())} of {wrong.size} speed readings stood far from those around them and were left out, "
            f"the first at {source.log.time_s[int(np.argmax(wrong))]:.10g} s",
        )
        course = course._replace(speed_rad_s=np.where(wrong, np.nan, course.speed_rad_s))
    course, colour = independent_readings(course)
    if colour is not None:
        notes += (colour.sentence,)
    setup = setup_of_record(course, configuration, model)
    if model is not None:  # also one of this very log, whose say is small: its sigmas are widened
        notes += model.remarks
        if model.effects.terms:
            refuse_runaway_model(source.log.name, course, setup, model)
        believed = belief_of_model(as_given(model, setup.constants))
        setup = with_times_of_record(with_conditions(course), replace(setup, prior=_aged(model)), believed)
        values, covariance = parameters_by_now(model, setup.effects)
        given = GivenParameters(values, covariance, changed=bool(np.any(values != model.parameters)))
        setup = without_past_changes(setup, values)
    noise = setup.constants.speed_noise_rad_s
    own = setup if configuration is None and model is None else setup_of_record(course)
    top = float(np.nanquantile(np.abs(course.speed_rad_s), 0.999))
    if own.constants.speed_noise_rad_s < _CLEAN * top:
        least = _LEAST_NOISE * top
        course = course._replace(
            speed_rad_s=course.speed_rad_s + least * np.random.default_rng(0).standard_normal(wrong.size)
        )
        if own is setup:
            setup = setup_of_record(course)
        noise = max(setup.constants.speed_noise_rad_s, least)
        notes += (
            f"the readings are cleaner than any integration of a wheel near rest: noise of {rpm_from_rad_s(least):.2g} "
            "rpm was added to them",
        )
    return course, setup, noise, notes, given


def _torque_noise(
    setup: FilterSetup, configuration: Configuration | None, model: WheelModel | None
) -> TorqueNoisePrior | None:
    """What is known beforehand: from other logs of the wheel, else what wheels have; nothing of any other machine."""
    if model is not None and model.acceleration_noise is not None:
        return TorqueNoisePrior.of_healthy(model.acceleration_noise)
    if configuration is not None:
        return TorqueNoisePrior.of_healthy(setup.constants.acceleration_noise)
    return None if setup.inertia_kg_m2 is None else TorqueNoisePrior()


def _aged(model: WheelModel) -> Belief:
    """Prior from a model of another log: three times as wide as it says, and as much wider as a wheel may have aged.

    Coefficients of effects are as wide, each by itself.
    """
    covariance = np.array(model.covariance)[:PARAMETER_COUNT, :PARAMETER_COUNT]
    width = _AGEING * np.maximum(np.abs(model.parameters), [0.0, _LEAST_VISCOUS, 0.0, 0.0])
    aged = Belief.of_known(model.parameters, _WIDENED**2 * covariance + np.diag(width**2))
    coefficients = [(term, value) for term in model.effects.state_terms for value in term.values]
    for at, (term, value) in enumerate(coefficients, start=len(model.parameters)):
        ageing = 0.0 if term.effect.local_in_time else _AGEING * abs(value)
        std = math.hypot(_WIDENED * math.sqrt(max(model.covariance[at][at], 0.0)), ageing)
        aged = aged.with_coefficient(term.id, value, max(std, 1.0e-9 * max(abs(value), 1.0)))
    known = aged.known(len(coefficients))
    return Belief.of_known(*known, model.effects.table().size, effect_ids=aged.effect_ids)  # hidden states behind


def facts_of(
    course: Course,
    base: Fit,
    channels: frozenset[str],
    timing_doubt_s: float = 0.0,
    log_starts_s: tuple[float, ...] = (),
) -> RecordFacts:
    """What the catalogue needs to know of a record and its base model; channels: those logged."""
    model, speed_noise_rad_s = base.model, math.sqrt(base.noise.variance)
    speed = course.speed_rad_s[np.isfinite(course.speed_rad_s)]
    period = course.period_s
    top = float(np.quantile(np.abs(speed), 0.999)) if speed.size else 0.0
    slow = np.mean(np.abs(speed) * period < _TURN_PER_SAMPLE) if speed.size else 0.0
    return RecordFacts(
        first_s=float(course.time_s[0]),
        last_s=float(course.time_s[-1]),
        period_s=period,
        top_speed_rad_s=top,
        top_current_A=float(np.max(np.abs(course.pieces.current_A))) if course.pieces.current_A.size else 0.0,
        friction=model.parameters,
        stribeck_speed_rad_s=model.stribeck.omega_s,
        stribeck_law=model.stribeck.law,
        speed_noise_rad_s=speed_noise_rad_s,
        reversals=reversals(course.speed_rad_s, speed_noise_rad_s),
        slow_samples=int(np.count_nonzero(slow_motion(base.trajectory.speed, model.stribeck.omega_s))),
        temperature_range_K=float(np.ptp(course.temperature_degC)) if "temperature_degC" in channels else None,
        angle="angle_rad" in channels or bool(slow > _SLOW_SHARE),
        channels=channels,
        timing_doubt_s=timing_doubt_s,
        log_starts_s=log_starts_s,
        reading_s=period * course.samples / max(speed.size, 1),
    )


def unseen_A_s(fit: Fit) -> float:
    """What a charge [A s] between two readings may be off by unseen."""
    gain = abs(fit.model.parameters.motor_gain)
    return _UNSEEN * math.sqrt(fit.noise.variance) / gain if gain > 0.0 else 0.0


def slow_motion(speed_rad_s: Float64Array, stribeck_speed_rad_s: float) -> BoolArray:
    """At which of smoothed speeds (n,) a wheel turns, within ten Stribeck speeds of rest."""
    ratio = np.abs(speed_rad_s) / stribeck_speed_rad_s
    return (ratio > _AT_REST) & (ratio < _SLOW)


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
        course.columns[part] if course.columns.size else None,
    )


def model_of_setup(setup: FilterSetup, parameters: FrictionParameters) -> Model:
    """The model to begin with: the setup's effects, if a model file gave some, and its Stribeck curve.

    Their shapes stay as they were found: on a whole record, of which only a part is fitted here.
    """
    effects = EffectSet(tuple(replace(term, settled=True, given=True) for term in setup.effects.terms))
    return Model(parameters, setup.constants.stribeck, effects)
