"""A bearing that follows its thermometer late: the lag with which friction goes with the temperature of a record.

A thermometer sits on the housing, and a chamber warms that before the bearing. Laws of the temperature are laws of the
bearing's: read as they stand, ten seconds of lag in a chamber's cycle leave more than a reading's noise, and whatever
goes with time is then made of it. So before anything is searched the temperature is tried at several lags,

    tau dT/dt = T_read - T                                                                  (docs/effects.md eq. 10)

with a law each for what may go with it: viscous friction, Coulomb friction, motor gain.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.acting_temperature import acting_temperature
from rw_ekf.course.conditions import filled
from rw_ekf.diagnosis.hypotheses.confounding import one_and_the_same
from rw_ekf.diagnosis.prepare.preparation import Advance, Prepared, TemperatureLag
from rw_ekf.diagnosis.prepare.slower import slower
from rw_ekf.diagnosis.thresholds import UNDOUBTED_P
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit, fit_model
from rw_ekf.likelihood.gauss_newton import Start
from rw_ekf.likelihood.one_step import Record
from rw_ekf.model.effect import NO_SHAPE, REFERENCE_DEGC, Candidate, Term
from rw_ekf.model.effect_kinds import FormulaEffect

_SHORTEST_S = 2.0  # tried: friction does not tell a shorter lag from none, and a longer one goes on from it
_FACTOR = 2.5  # between lags that are tried
_STEPS = (0.1, 0.02)  # of the logarithm of a lag, and of the temperature's range: over which a likelihood bends
_FLAT = 1.0e-3  # of a log-likelihood over a step: flatter tells no width


def with_likely_lag(prepared: Prepared, advance: Advance) -> Prepared:
    """The record with the temperature that acts late, where that makes laws of it likelier beyond doubt.

    As it is without a logged temperature, and where the model given knows of a lag, or of none that it needs.
    """
    terms = _laws(prepared)
    given = prepared.base.model.effects.ids
    if prepared.temperature_lag is not None or not terms or any(term.id in given for term in terms):
        return prepared
    advance("asking how late friction follows the temperature")
    part = slower(prepared)
    fitted = _Lagged(part, part.base.refitted(part.base.model.with_terms(*terms)))
    duration_s = float(prepared.course.time_s[-1] - prepared.course.time_s[0])
    lags = _SHORTEST_S * _FACTOR ** np.arange(math.ceil(math.log(max(duration_s / _SHORTEST_S, 1.0), _FACTOR)) + 1)
    values = [fitted.value(lag_s) for lag_s in lags]
    best = int(np.argmax(values))
    without = max(fitted.begun.likelihood.value, part.base.likelihood.value)
    if not 0 < best < lags.size - 1 or values[best] - without < -math.log(UNDOUBTED_P):
        return prepared
    late = at_lag(prepared, _likeliest(fitted, float(lags[best])))
    # Behind a lag as long as the record any temperature is a slow function of time, and a drift is likelier than a lag.
    return prepared if one_and_the_same(late.base, "time", "temperature") else late


def _likeliest(fitted: _Lagged, near_s: float) -> TemperatureLag:
    """The likeliest lag near one [s], and by how much the body was ahead of its thermometer to begin with.

    A record may begin in the middle of a cycle. As far as the temperature went is a standard deviation of that.
    """
    from scipy.optimize import minimize

    def loss(at: Float64Array) -> float:
        return 0.5 * float(at[1]) ** 2 - fitted.value(math.exp(at[0]), float(at[1]) * fitted.range_K)

    first = np.array([math.log(near_s), 0.0])
    simplex = first + np.array([[0.0, 0.0], [_STEPS[0], 0.0], [0.0, _STEPS[1]]])
    found = minimize(
        loss, first, method="Nelder-Mead", options={"initial_simplex": simplex, "xatol": 1e-4, "fatol": 0.1}
    )
    return TemperatureLag(math.exp(found.x[0]), ahead_K=float(found.x[1]) * fitted.range_K)


def _laws(prepared: Prepared) -> list[Term]:
    """A law for each thing that may go with the temperature, as a lubricant's does where it may follow several."""
    return [
        Term.at(effect, effect.starts(Candidate(0.0, NO_SHAPE), 0.0)[-1])
        for effect in CATALOGUE.values()
        if "temperature_degC" in effect.needs and effect.untestable(prepared.facts) is None
        if not issubclass(effect, FormulaEffect)
    ]


def at_lag(prepared: Prepared, lag: TemperatureLag) -> Prepared:
    """The same with a temperature that follows the log's with this lag."""
    acts = _acting(prepared, lag.value_s, lag.ahead_K)
    facts = replace(prepared.facts, temperature_range_K=float(np.ptp(acts)))
    whole, fit_part, heldout = (
        _with(record, acts) for record in (prepared.record, prepared.fit_part, prepared.heldout)
    )
    return replace(
        prepared, course=prepared.course._replace(temperature_degC=acts), facts=facts, record=whole,
        fit_part=fit_part, heldout=heldout, base=_on(prepared.base, whole), _of_fit={}, temperature_lag=lag,
    )  # fmt: skip


def width_of(prepared: Prepared, fit: Fit) -> tuple[TemperatureLag, Float64Array]:
    """The lag with its standard deviation beside a fit that stands, and what that adds to the covariance (p, p).

    By the likelihood's curvature over the logarithm of the lag and what the body was ahead by, every other number
    fitted anew, and by how far the fit is from where it is likeliest.
    """
    lag = prepared.temperature_lag
    assert lag is not None
    fitted = _Lagged(prepared, fit)
    log, ahead = math.log(lag.value_s), lag.ahead_K / fitted.range_K

    def at(way: Float64Array) -> Fit:
        return fitted.at(math.exp(log + way[0] * _STEPS[0]), (ahead + way[1] * _STEPS[1]) * fitted.range_K)

    along = np.eye(2)
    fits = [(at(way), at(-way)) for way in along]
    values = np.array([[end.likelihood.value - fit.likelihood.value for end in ends] for ends in fits])
    corner = at(along.sum(axis=0)).likelihood.value - fit.likelihood.value
    bent = np.diag(np.maximum(-values.sum(axis=1), _FLAT))
    bent[0, 1] = bent[1, 0] = -(corner - values[:, 0].sum())
    if np.linalg.det(bent) <= 0.0:
        bent = np.diag(np.diag(bent))
    covariance = np.linalg.inv(bent)
    off = covariance @ (0.5 * (values[:, 0] - values[:, 1]))
    covariance += np.outer(off, off)
    slopes = np.array([0.5 * (up.model.vector - down.model.vector) for up, down in fits])
    std_s = lag.value_s * _STEPS[0] * math.sqrt(covariance[0, 0])
    return lag._replace(std_s=std_s), slopes.T @ covariance @ slopes


class _Lagged:
    """A model with laws of the temperature, fitted at any lag from where it stands."""

    def __init__(self, prepared: Prepared, begun: Fit) -> None:
        self.begun = begun
        self.range_K = max(float(np.ptp(_acting(prepared, 0.0, 0.0))), 1.0e-6)
        self._prepared = prepared

    def at(self, lag_s: float, ahead_K: float = 0.0) -> Fit:
        """The fit at a lag [s], of a body that was ahead by so much."""
        record = _with(self.begun.problem.record, _acting(self._prepared, lag_s, ahead_K))
        return _on(self.begun, record, anew=True)

    def value(self, lag_s: float, ahead_K: float = 0.0) -> float:
        """Log-likelihood there."""
        return self.at(lag_s, ahead_K).likelihood.value


def _acting(prepared: Prepared, lag_s: float, ahead_K: float) -> Float64Array:
    """The temperature that acts at the samples looked at, (n,)."""
    course = prepared.source.course
    acts = acting_temperature(course.time_s, course.segment, course.temperature_degC, lag_s, ahead_K)
    return filled(acts, REFERENCE_DEGC)[0][prepared.kept]


def _with(record: Record, temperature_degC: Float64Array) -> Record:
    return replace(record, course=record.course._replace(temperature_degC=temperature_degC))


def _on(fit: Fit, record: Record, *, anew: bool = False) -> Fit:
    """A fit on a record of another temperature; as it stands where nothing in it goes with that."""
    if anew:
        return fit_model(fit.problem._replace(record=record), Start(fit.model, fit.trajectory, fit.noise))
    return replace(fit, linearised=replace(fit.linearised, record=record))
