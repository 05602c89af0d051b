"""Where a filter starts: configuration, model file or the record itself, in that order of authority."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.conditions import is_logged
from rw_ekf.course.course import Course
from rw_ekf.filter.belief import (
    DEFAULT_PRIOR,
    Belief,
    with_prior_table,
)
from rw_ekf.filter.constants import FilterConstants, filter_constants
from rw_ekf.model.bounds import ASSUMED
from rw_ekf.model.effect import Term
from rw_ekf.model.friction import LAW_NAMES
from rw_ekf.model.state import (
    CK13_STATISTICAL,
    PARAMETER_COUNT,
    PARAMETER_NAMES,
    STATE_NAMES,
    STATE_SIZE,
    FrictionParameters,
)
from rw_ekf.units import RAD_S_PER_RPM, rad_s_from_rpm, rpm_from_rad_s
from rw_ekf.version import __version__
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet
from rw_ekf.wheel.model_file import WheelModel
from rw_ekf.wheel.momentary_friction import variance_of_known_shapes
from rw_ekf.wheel.wheel_tag import WheelTag

if TYPE_CHECKING:
    from rw_ekf.identify.record_scale import RecordScale
    from rw_ekf.likelihood.log_fit import LogFit
    from rw_ekf.likelihood.noise_posterior import NoisePosterior
    from rw_ekf.likelihood.record_stribeck import StribeckHypothesis
    from rw_ekf.logs.wheel_log import WheelLog
    from rw_ekf.settings.schema import Configuration

DEFAULT_INERTIA_KG_M2 = 1.5e-3
_MOVED_BY = {"drag": ("coulomb", "static"), "viscous_drag": ("viscous",), "motor_gain": ("motor_gain",)}
_OPEN = 0.2  # of a parameter, one sigma: what a drift of it has come to by the time of another record
LEAST_NOISE_RATIO = 1e-3  # of torque noise [1/sqrt(s)] to the readings' own, of a machine that nobody described


@dataclass(frozen=True)
class FilterSetup:
    """Everything a filter needs to start, and what was decided on the way."""

    constants: FilterConstants
    prior: Belief
    inertia_kg_m2: float | None  # None: not known, nothing is turned into torques
    notes: tuple[str, ...] = ()
    effects: EffectSet = NO_EFFECTS
    inertia_from: str = ""  # "configuration", "model", or "assumed": what stands behind every torque
    fit_of_record: LogFit | None = None  # where the noises came from the record
    stribeck_speed_std: float = 0.0  # where the record had to give the Stribeck speed; 0: it is given
    acceleration_noises: tuple[float, ...] = ()  # of equal weight, where the record had to give it [rad/s per sqrt(s)]
    lowest_loss: FrictionParameters | None = None  # of the free run, where it was sought over the whole record
    effect_hypotheses: tuple[EffectSet, ...] = ()  # of equal weight: shapes that the record leaves open
    stribeck_hypotheses: tuple[StribeckHypothesis, ...] = ()  # where the record showed them (`rw_ekf.hindsight`)
    lost_angle_rate: float = 0.0  # [rad^2/s] variance that an angle integrated from speeds gains; 0 of a logged one

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the states that are shown: speed, four parameters, effects' coefficients."""
        return (*STATE_NAMES, *self.effects.state_names)

    @property
    def temperature_lag_s(self) -> float:
        """By which the temperature that acts follows what is read [s]."""
        return self.constants.temperature_lag_s

    @property
    def effect_drift(self) -> Float64Array:
        """Variance rates of the effects' coefficients [unit^2/s]: of their size as much as the parameters wander.

        Sine and cosine of a ripple turn by as much as its phase is lost besides (docs/filter.md).
        """
        rate, found = self.constants.relative_drift if self.constants.wanders else 0.0, []
        for term in self.effects.state_terms:
            sizes = [max(abs(value), std) for value, std in zip(term.values, term.stds, strict=True)]
            turned = 0.5 * self.lost_angle_rate * (term.shape[0] * max(sizes)) ** 2 if term.effect.angular else 0.0
            found += [rate * size**2 + turned for size in sizes]
        return np.array(found)


def setup_of_configuration(
    configuration: Configuration, model: WheelModel | None, period_s: float = 0.0
) -> FilterSetup:
    """Start as a configuration says; a model (its `filter.model`, or --model) gives prior and Stribeck law.

    period_s: of the record, where there is one; a gap is never shorter than five of the longer period.
    """
    section = configuration.filter
    prior = DEFAULT_PRIOR if model is None else belief_of_model(model)
    if section.prior is not None:
        table = {}
        for name in PARAMETER_NAMES:
            value = getattr(section.prior, name)
            if value is not None:
                table[name] = (value.value, value.std)
        prior = with_prior_table(prior, table)
    omega_s = rad_s_from_rpm(configuration.wheel.stribeck_speed_rpm)
    law = configuration.wheel.stribeck_law
    if model is not None:
        omega_s, law = model.stribeck_speed_rad_s, model.stribeck_law  # type: ignore[assignment]
    constants = filter_constants(
        omega_s,
        law,
        speed_noise_rad_s=rad_s_from_rpm(section.speed_noise_rpm),
        acceleration_noise=section.acceleration_noise_rpm_per_sqrt_s * RAD_S_PER_RPM,
        parameter_drift=0.01 * section.parameter_drift_percent_per_sqrt_hour,
        dry_walk=_walk_of(model),
        scale=prior.parameters,
        gate_probability=section.gate_probability,
        max_gap_s=section.max_gap_s,
        nominal_period_s=max(1.0 / configuration.loop.rate_hz, period_s),
        temperature_lag_s=0.0 if model is None else model.temperature_lag_s,
    )
    inertia, inertia_from = _inertia(configuration, model)
    return FilterSetup(
        constants,
        prior,
        inertia,
        effects=NO_EFFECTS if model is None else model.effects,
        inertia_from=inertia_from,
    )


def _inertia(configuration: Configuration, model: WheelModel | None) -> tuple[float, str]:
    """The inertia [kg m^2], and who gave it: the configuration, else the model, else nobody."""
    given = configuration.wheel.inertia_kg_m2  # or its default
    if "inertia_kg_m2" in configuration.wheel.model_fields_set:
        return given, "configuration"
    if model is None or model.inertia_kg_m2 is None or model.inertia_is_assumed:
        return given, ASSUMED
    return model.inertia_kg_m2, "model"


def setup_of_start(configuration: Configuration, start: WheelModel) -> FilterSetup:
    """Start as a run did, whose `STEM.start.yaml` this is; filter.prior went into it, or was learned beyond."""
    section = configuration.filter.model_copy(update={"prior": None})
    setup = setup_of_configuration(configuration.model_copy(update={"filter": section}), start)
    # The metadata hold the resolved configuration, in which a default looks as if somebody had given it.
    return replace(setup, inertia_from=ASSUMED) if start.inertia_is_assumed else setup


def setup_of_record(
    course: Course, configuration: Configuration | None = None, model: WheelModel | None = None
) -> FilterSetup:
    """Start for a log: from the configuration if there is one, else from the model, else from the record itself."""
    if model is None:
        return _setup_of_record(course, configuration, None)
    logged = is_logged(course.angle_rad)
    setup = _setup_of_record(course, configuration, with_open_phases(model, angle_is_logged=logged))
    return setup if logged else replace(setup, lost_angle_rate=setup.constants.speed_variance * course.period_s)


def course_for(log: WheelLog, known: WheelModel | FilterSetup | None) -> Course:
    """A log's course with what a model, or a start, requires of it: the columns of its laws, the temperature that acts.

    Raises LogError for a value that no machine can have.
    """
    return Course.of_log(log) if known is None else Course.of_log(log, known.effects.columns, known.temperature_lag_s)


def _setup_of_record(course: Course, configuration: Configuration | None, model: WheelModel | None) -> FilterSetup:
    period = course.period_s
    if configuration is not None:
        return setup_of_configuration(configuration, model, period)
    from rw_ekf.identify.record_scale import default_scale, measure
    from rw_ekf.likelihood.record_noise import is_foreign, noise_of_record

    scale = measure(course)
    if model is not None:
        noises = scale.constants.speed_noise_rad_s, scale.constants.acceleration_noise
        return setup_of_model(model, *noises, period)
    if not scale.like_default_wheel and not is_foreign(course, scale):
        scale = default_scale(scale.constants.speed_noise_rad_s, period)
    if not scale.like_default_wheel:
        return _foreign_setup(course, scale, period)
    constants = scale.constants
    found = noise_of_record(course, constants, scale.prior)
    if found is not None:
        constants = filter_constants(
            constants.stribeck.omega_s,
            speed_noise_rad_s=found.speed_noise_rad_s,
            acceleration_noise=found.acceleration_noise,
            nominal_period_s=period,
        )
    fit = None if found is None else found.fit
    return FilterSetup(
        constants,
        scale.prior,
        DEFAULT_INERTIA_KG_M2,
        _remarks_of_one_speed(course),
        inertia_from=ASSUMED,
        fit_of_record=fit,
        acceleration_noises=() if found is None else found.acceleration_noises,
        lowest_loss=None if found is None else found.lowest_loss,
    )


def _remarks_of_one_speed(course: Course) -> tuple[str, ...]:
    """A sentence about a record whose speed is one and the same number throughout, which is no motion."""
    read = course.speed_rad_s[np.isfinite(course.speed_rad_s)]
    if read.size < 2 or np.ptp(read) > 0.0:
        return ()
    return (
        f"the speed is {rpm_from_rad_s(float(read[0])):.4g} rpm in every row: what reads it is dead, or nothing moved "
        "the wheel; of its friction this log says nothing",
    )


def setup_of_model(
    model: WheelModel, speed_noise_rad_s: float, acceleration_noise: float, period_s: float
) -> FilterSetup:
    """Start as a model says; the noises [rad/s, rad/s per sqrt(s)] count where it knows none."""
    own = model.acceleration_noise
    constants = filter_constants(
        model.stribeck_speed_rad_s,
        model.stribeck_law,
        speed_noise_rad_s=model.speed_noise_rad_s or speed_noise_rad_s,
        acceleration_noise=acceleration_noise if own is None else own,
        dry_walk=_walk_of(model),
        scale=model.parameters,
        nominal_period_s=period_s,
        temperature_lag_s=model.temperature_lag_s,
    )
    return FilterSetup(
        constants,
        belief_of_model(model),
        model.inertia_kg_m2,
        effects=model.effects,
        inertia_from=ASSUMED if model.inertia_is_assumed else "model",
    )


def _walk_of(model: WheelModel | None) -> float:
    return 0.0 if model is None else model.dry_walk or 0.0


def belief_of_model(model: WheelModel) -> Belief:
    """Belief over the state from a model file; the speed and hidden states are left to the first reading."""
    values = (*model.parameters, *model.effects.values)
    size, ids = model.effects.table().size, model.effects.coefficient_ids
    return Belief.of_known(values, np.array(model.covariance), size, effect_ids=ids)


def with_open_phases(model: WheelModel, *, angle_is_logged: bool) -> WheelModel:
    """The model in a record that begins at another time: its periodic torques are there, their phases are not known.

    Sine and cosine start from zero, as uncertain as the amplitude is large. By the angle, where that is logged, a phase
    is the wheel's own.
    """
    covariance, terms, end = np.array(model.covariance), [], PARAMETER_COUNT
    for term in model.effects.terms:
        if term.effect.in_state:
            at, end = range(end, end + len(term.values)), end + len(term.values)
            if term.effect.components > 1 and not (term.effect.angular and angle_is_logged):
                size = max(term.size, *term.stds)
                covariance[at, :] = covariance[:, at] = 0.0
                covariance[at, at] = size**2
                term = replace(term, values=(0.0,) * len(at), stds=(size,) * len(at))  # noqa: PLW2901
        terms.append(term)
    return replace(model, covariance=tuple(tuple(row) for row in covariance.tolist()),
                   effects=replace(model.effects, terms=tuple(terms)))  # fmt: skip


def without_effects(model: WheelModel) -> WheelModel:
    """The four parameters of a model alone, for what knows no effects."""
    known = len(model.parameters)
    return replace(model, covariance=tuple(row[:known] for row in model.covariance[:known]), effects=NO_EFFECTS)


def model_of(
    belief: Belief,
    setup: FilterSetup,
    source: Mapping[str, Any],
    noise: NoisePosterior | None = None,
    wheel: WheelTag | None = None,
) -> WheelModel:
    """Return what a run or a fit leaves for the next to start from; `noise` replaces the setup's where it was tuned."""
    covariance = _with_considered(setup, belief.known(setup.effects.size)[1])
    known, stds = STATE_SIZE + setup.effects.size, np.sqrt(np.diag(covariance))
    reported = setup.constants if noise is None else noise
    return WheelModel(
        parameters=belief.parameters,
        covariance=tuple(tuple(float(v) for v in row) for row in covariance),
        stribeck_speed_rad_s=setup.constants.stribeck.omega_s,
        stribeck_law=LAW_NAMES[setup.constants.stribeck.law],
        speed_noise_rad_s=reported.speed_noise_rad_s,
        acceleration_noise=reported.acceleration_noise,
        dry_walk=math.sqrt(setup.constants.dry_walk) or None,
        inertia_kg_m2=setup.inertia_kg_m2,
        inertia_is_assumed=setup.inertia_from == ASSUMED,
        source={**source, "rw_ekf": __version__},
        effects=setup.effects.with_values(belief.mean[STATE_SIZE:known], stds[PARAMETER_COUNT:]),
        wheel=wheel,
        temperature_lag_s=setup.temperature_lag_s,
    )


def _with_considered(setup: FilterSetup, covariance: Float64Array) -> Float64Array:
    """A filter's covariance (4 + m, 4 + m) with what its effects' shapes make of the numbers, x_k of eq. 7a.

    A filter begins with that in its variances, and learns as if the shapes were known: as much of it comes on top as
    makes the variances those of an estimate.
    """
    ways = np.array([way.numbers for way in setup.effects.considered])
    if ways.size == 0:
        return covariance
    began, now = np.diag(setup.prior.known(setup.effects.size)[1]), np.diag(covariance)
    follows = np.sum(ways**2, axis=0)
    known = np.array(list(map(variance_of_known_shapes, now.tolist(), began.tolist(), follows.tolist())))
    more = np.divide(known + follows - now, follows, out=np.zeros_like(now), where=follows > 0.0)
    ways = ways * np.sqrt(np.maximum(more, 0.0))
    return np.asarray(covariance + ways.T @ ways)


def _foreign_setup(course: Course, scale: RecordScale, period: float) -> FilterSetup:
    """Noises, prior and Stribeck speed from the record of a machine that is not the default wheel; says so."""
    from rw_ekf.likelihood.record_noise import noise_of_record

    found = noise_of_record(course, scale.constants, scale.prior, guessed_stribeck=True)
    if found is None:
        stated = note_of_foreign_machine(course, scale.rough, scale.constants)
        return FilterSetup(scale.constants, scale.prior, None, (stated,))
    constants = filter_constants(
        found.stribeck_speed_rad_s,
        speed_noise_rad_s=found.speed_noise_rad_s,
        acceleration_noise=max(found.acceleration_noise, LEAST_NOISE_RATIO * found.speed_noise_rad_s),
        scale=found.fit.parameters,
        nominal_period_s=period,
    )
    stated = note_of_foreign_machine(course, found.fit.parameters, constants)
    spread = found.stribeck_speed_std
    return FilterSetup(constants, scale.prior, None, (stated,), fit_of_record=found.fit, stribeck_speed_std=spread)


def note_of_foreign_machine(course: Course, parameters: FrictionParameters, constants: FilterConstants) -> str:
    """What is reported of a record that is not the default wheel's, and that nobody described."""
    from rw_ekf.identify.units_guess import times

    noise, omega_s = constants.speed_noise_rad_s, constants.stribeck.omega_s
    driven = bool(np.any(course.pieces.current_A))
    gain, coulomb = (parameters.motor_gain / CK13_STATISTICAL.motor_gain, parameters.coulomb / CK13_STATISTICAL.coulomb)
    sizes = f"Coulomb friction {times(coulomb)} a wheel's" if coulomb > 0.0 else "no Coulomb friction"
    if driven:
        of_gain = f"{times(gain)} a wheel's" if gain > 0.0 else "not above zero"
        sizes = f"the gain is {of_gain}, {sizes}"
    return (
        f"the record does not look like the default wheel ({sizes}). "
        "Noise, prior and Stribeck speed were taken from the record itself "
        f"(speed noise {noise:.3g} rad/s = {rpm_from_rad_s(noise):.3g} rpm, "
        f"Stribeck speed {omega_s:.3g} rad/s), so that a wrong unit would not show in them; torques are not given, "
        "because its inertia is not known. `--config` settles them otherwise."
    )


def left_open(gone: Iterable[Term], parameters: FrictionParameters, size: int) -> Float64Array:
    """Covariance (size, size) that a model gains where terms are left out that drifted with the clock of its record.

    size: of the four parameters and what follows them. Coulomb and break-away friction drift as one; what comes and
    goes leaves nothing open.
    """
    more = np.zeros((size, size))
    for term in gone:
        if not (term.effect.local_in_time or term.is_over):
            of = term.effect.acts_as if term.law is None else term.law.acts_as
            places = [PARAMETER_NAMES.index(name) for name in _MOVED_BY.get(of, ())]
            more[np.ix_(places, places)] += (_OPEN * parameters[places[0]]) ** 2 if places else 0.0
    return more
