"""What of a model holds for a run that begins later: without what belonged to its record, and as old as it is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.constants import FilterConstants, filter_constants
from rw_ekf.model.effect import Term
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, PARAMETER_COUNT, SPEED, STATIC, VISCOUS
from rw_ekf.starting_point import FilterSetup, left_open, with_open_phases
from rw_ekf.wheel.model_file import WheelModel

# A wheel that stood, or ran unseen, may have another temperature: within hours by some 5 K (one sigma). What a kelvin
# does to a wheel's parameters [1/K]: the lubricant thins, friction follows it a little, magnets and winding hardly.
_KELVIN = 5.0
_WARMS_WITHIN_S = 3600.0
_GIVEN_AGE_S = 3.0 * 3600.0  # of a model that is given: 4.8 K; a third less or more of it are 4.3 and 4.9 K
_PER_KELVIN = {MOTOR_GAIN: 0.002, VISCOUS: 0.03, COULOMB: 0.005, STATIC: 0.005}
_KNOWN_BY = {  # effects that already answer for the temperature, where the model has them
    MOTOR_GAIN: "motor_gain_temperature",
    VISCOUS: "viscous_temperature",
    COULOMB: "coulomb_temperature",
    STATIC: "coulomb_temperature",
}


def carried_over(model: WheelModel) -> tuple[WheelModel, list[str]]:
    """What of a model holds for a run that begins now, and what had to be reported about the rest.

    A spike or a drift belongs to the record it was found in; where the drift has left dry friction nobody knows. A
    periodic torque continues, but its phase is not known any more: sine and cosine start from zero, as uncertain as the
    amplitude is large.
    """
    model = with_open_phases(model, angle_is_logged=False)
    kept: list[Term] = []
    gone: list[Term] = []
    notes: list[str] = []
    covariance = np.array(model.covariance)
    places = list(range(PARAMETER_COUNT))
    end = PARAMETER_COUNT
    for term in model.effects.terms:
        if not term.effect.in_state:
            kept.append(term)
            continue
        at, end = range(end, end + len(term.values)), end + len(term.values)
        if term.law is not None and term.law.quantity == "time" and not term.is_over:
            term = replace(term, law=term.law.held(-1))  # noqa: PLW2901
            notes.append(f"{term.id} over time: this run begins with it as it was at the end of its record")
        elif term.of_its_record:
            notes += [f"{term.id} belongs to the record it was found in and is not carried into this run"] * len(at)
            gone.append(term)
            continue
        places += at
        kept.append(term)
    effects = replace(model.effects.only(lambda term: term not in gone), terms=tuple(kept))
    rows = covariance[np.ix_(places, places)] + left_open(gone, model.parameters, len(places))
    return replace(model, covariance=_as_rows(rows), effects=effects), notes


def as_given(model: WheelModel, constants: FilterConstants | None = None, prior: Belief | None = None) -> WheelModel:
    """A model that is given and does not say when it was made: of a wheel of another temperature, at the least.

    constants: whose drifts it wanders by; None: those of any filter of that model. prior: beyond whose sigmas nothing
    is forgotten; None: no bound.
    """
    if constants is None:
        constants = filter_constants(model.stribeck_speed_rad_s, scale=model.parameters)
    return _believed_less(model, constants, _GIVEN_AGE_S, prior)


def aged(model: WheelModel, start: FilterSetup, seconds: float) -> WheelModel:
    """The model after so many seconds [s] in which nobody watched its wheel: the same values, believed less.

    The parameters wander as the filter lets them (its drifts), and the wheel's temperature is no longer the one they
    were learned at. start: how the configuration would start: from its drifts, and what nothing is forgotten beyond.
    """
    return _believed_less(model, start.constants, seconds, start.prior)


def _believed_less(model: WheelModel, c: FilterConstants, seconds: float, prior: Belief | None) -> WheelModel:
    covariance = np.array(model.covariance)
    warmth = _KELVIN * -math.expm1(-seconds / _WARMS_WITHIN_S)
    walk = (model.dry_walk or 0.0) ** 2
    rates = (c.motor_gain_drift, c.viscous_drift, c.coulomb_drift + walk, c.static_drift + walk)
    grown = np.array([*(rate * seconds for rate in rates), *_effects_growth(model, c.relative_drift * seconds)])
    for place, share in _PER_KELVIN.items():
        if _KNOWN_BY[place] not in model.effects.ids:
            grown[place - 1] += (share * warmth * model.parameters[place - 1]) ** 2
    widest = np.full(len(grown), np.inf)
    if prior is not None:
        widest[:PARAMETER_COUNT] = np.diag(prior.covariance)[SPEED + 1 : STATIC + 1]
    at = np.arange(len(grown))
    covariance[at, at] += np.minimum(grown, np.maximum(widest - covariance[at, at], 0.0))
    stds = np.sqrt(covariance[at, at])
    effects = model.effects.with_values(model.effects.values, stds[PARAMETER_COUNT:])
    return replace(model, covariance=_as_rows(covariance), effects=effects)


def _effects_growth(model: WheelModel, relative: float) -> list[float]:
    """Variance that each coefficient gains: of its size as much as the parameters wander."""
    pairs = [(v, s) for term in model.effects.state_terms for v, s in zip(term.values, term.stds, strict=True)]
    return [relative * max(abs(value), std) ** 2 for value, std in pairs]


def _as_rows(covariance: Float64Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(v) for v in row) for row in covariance)
