"""A bearing that follows its thermometer late: the lag with which friction goes with the temperature of a record.

A thermometer sits on the housing, and a chamber warms that before the bearing. Laws of the temperature are laws of the
bearing's: read as they stand, ten seconds of lag in a chamber's cycle leave more than a reading's noise, and whatever
goes with time is then made of it. So before anything is searched the temperature is tried at several lags,

    tau dT/dt = T_read - T                                                                  (docs/effects.md eq. 10)

with a law each for what may go with it: viscous friction, Coulomb friction, motor gain.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.acting_temperature import AHEAD_SIGMA
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

_SHORTEST_S = 2.0  # tried: friction does not distinguish a shorter lag from none, and a longer one starts from it
_FACTOR = 2.5  # between lags that are tried
_STEPS = (0.1, 0.02)  # of the logarithm of a lag, and of the temperature's range: over which a likelihood bends
_EVALUATIONS = 60  # of the likelihood, for each number that is sought
_FLAT = 1.0e-3  # of a log-likelihood over a step: flatter shows no width


def with_likely_lag(prepared: Prepared, advance: Advance) -> Prepared:
    """The record with the temperature that acts late, where that makes laws of it likelier beyond doubt.

    As it is without a logged temperature, and where the model given has laws of a temperature that has no lag; with a
    lag of the model's only how warm the body was when each log began is determined.
    """
    if prepared.temperature_lag is not None:
        return _as_warm_as_likely(prepared, prepared.temperature_lag)
    laws = _laws(prepared)
    given = prepared.base.model.effects.ids
    if not laws[0] or any(term.id in given for term in laws[0]):
        return prepared
    advance("asking how late friction follows the temperature")
    part = slower(prepared)
    ways = [_Lagged(part, part.base.refitted(part.base.model.with_terms(*terms))) for terms in laws]
    fitted = ways[0]
    duration_s = float(prepared.course.time_s[-1] - prepared.course.time_s[0])
    lags = _SHORTEST_S * _FACTOR ** np.arange(math.ceil(math.log(max(duration_s / _SHORTEST_S, 1.0), _FACTOR)) + 1)
    values = [fitted.value(TemperatureLag(lag_s)) for lag_s in lags.tolist()]
    best = int(np.argmax(values))
    without = max(fitted.begun.likelihood.value, part.base.likelihood.value)
    if not 0 < best < lags.size - 1 or values[best] - without < -math.log(UNDOUBTED_P):
        return prepared
    here = TemperatureLag(float(lags[best]))
    # A wrong law is as likely at the wrong lag: straight lines and exponentials are taken to their own, and then mixed.
    apart = [(way, way.likeliest(here)) for way in (ways[0], ways[-1])]
    own, found = max(apart, key=lambda item: item[0].worth(item[1]))
    mixed = max(ways, key=lambda way: way.worth(found))
    found = found if mixed is own else mixed.likeliest(found)
    late = at_lag(prepared, found)
    # Behind a lag as long as the record any temperature is a slow function of time, and a drift is likelier than a lag.
    is_drift = found.value_s > 0.5 * duration_s and one_and_the_same(late.base, "time", "temperature")
    return prepared if is_drift else late


def _as_warm_as_likely(prepared: Prepared, lag: TemperatureLag) -> Prepared:
    """The record of a model with a lag, the body as warm where each log began as makes that model likeliest."""
    if not prepared.temperature_is_logged or not any(term.goes_with_temperature for term in prepared.base.model.terms):
        return prepared
    part = slower(prepared)
    return at_lag(prepared, _Lagged(part, part.base).likeliest(lag, moves=False))


def _laws(prepared: Prepared) -> list[tuple[Term, ...]]:
    """A law for each thing that may go with the temperature, in every mixture of those that it may follow."""
    effects = [
        effect
        for effect in CATALOGUE.values()
        if "temperature_degC" in effect.needs and effect.untestable(prepared.facts) is None
        if not issubclass(effect, FormulaEffect)
    ]
    starts = (dict.fromkeys(effect.starts(Candidate(0.0, NO_SHAPE), 0.0)) for effect in effects)
    each = [[Term.at(effect, start) for start in some] for effect, some in zip(effects, starts, strict=True)]
    return list(itertools.product(*each))


def at_lag(prepared: Prepared, lag: TemperatureLag) -> Prepared:
    """The same with a temperature that follows the log's with this lag."""
    acts = _acting(prepared, lag)
    facts = replace(prepared.facts, temperature_range_K=float(np.ptp(acts)))
    whole, fit_part, heldout = (
        _with(record, acts) for record in (prepared.record, prepared.fit_part, prepared.heldout)
    )
    base = prepared.base
    if any(term.goes_with_temperature for term in base.model.terms):
        base = _anew(base, whole)
    else:
        base = replace(base, linearised=replace(base.linearised, record=whole))
    return replace(
        prepared, course=prepared.course._replace(temperature_degC=acts), facts=facts, record=whole,
        fit_part=fit_part, heldout=heldout, base=base, _of_fit={}, temperature_lag=lag,
    )  # fmt: skip


def width_of(prepared: Prepared, fit: Fit) -> tuple[TemperatureLag, Float64Array]:
    """The lag with its standard deviation beside a fit that stands, and what that adds to the covariance (p, p).

    By the likelihood's curvature over the logarithm of the lag and what the body was ahead by, every other number
    fitted anew, and by how far the fit is from where it is likeliest.
    """
    lag = prepared.temperature_lag
    assert lag is not None
    fitted = _Lagged(prepared, fit)
    here = fitted.place_of(lag)
    along = np.diag(fitted.steps)

    def at(way: Float64Array) -> Fit:
        return fitted.at(fitted.lag_at(here + way, lag))

    fits = [(at(way), at(-way)) for way in along]
    values = np.array([[end.likelihood.value - fit.likelihood.value for end in ends] for ends in fits])
    bent = np.diag(np.maximum(-values.sum(axis=1), _FLAT))
    for i in range(1, here.size):  # what logs were ahead by says nothing of each other
        corner = at(along[0] + along[i]).likelihood.value - fit.likelihood.value
        bent[0, i] = bent[i, 0] = -(corner - values[0, 0] - values[i, 0])
    if np.linalg.eigvalsh(bent)[0] <= 0.0:
        bent = np.diag(np.diag(bent))
    covariance = np.linalg.inv(bent)
    off = covariance @ (0.5 * (values[:, 0] - values[:, 1]))
    covariance += np.outer(off, off)
    slopes = np.array([0.5 * (up.model.vector - down.model.vector) for up, down in fits])
    std_s = lag.value_s * fitted.steps[0] * math.sqrt(covariance[0, 0])
    return lag._replace(std_s=std_s), slopes.T @ covariance @ slopes


class _Lagged:
    """A model with laws of the temperature, fitted at any lag from where it stands.

    A place is the logarithm of the lag, and for each log what the body was ahead by, in ranges of the temperature.
    """

    def __init__(self, prepared: Prepared, begun: Fit) -> None:
        self.begun = begun
        self._prepared = prepared
        self._range_K = max(float(np.ptp(_acting(prepared, TemperatureLag(0.0)))), 1.0e-6)
        self._logs = int(prepared.source.log_of.max(initial=0)) + 1
        self.steps = np.array([_STEPS[0], *(_STEPS[1:] * self._logs)])

    def at(self, lag: TemperatureLag) -> Fit:
        """The fit at a lag."""
        return _anew(self.begun, _with(self.begun.problem.record, _acting(self._prepared, lag)))

    def value(self, lag: TemperatureLag) -> float:
        """Log-likelihood there."""
        return self.at(lag).likelihood.value

    def worth(self, lag: TemperatureLag) -> float:
        """The same, with what is known beforehand of how far a body may be ahead of its thermometer."""
        return self.value(lag) - 0.5 * float(np.sum((self.place_of(lag)[1:] / AHEAD_SIGMA) ** 2))

    def place_of(self, lag: TemperatureLag) -> Float64Array:
        """Where a lag is."""
        ahead = lag.ahead_K or (0.0,) * self._logs
        return np.array([math.log(lag.value_s), *(ahead_K / self._range_K for ahead_K in ahead)])

    def lag_at(self, place: Float64Array, like: TemperatureLag) -> TemperatureLag:
        """What is at a place."""
        ahead = tuple(float(share) * self._range_K for share in place[1:])
        return like._replace(value_s=math.exp(place[0]), ahead_K=ahead)

    def likeliest(self, near: TemperatureLag, *, moves: bool = True) -> TemperatureLag:
        """The likeliest lag near one, and what the body was ahead by; that alone where the lag does not move.

        A record may begin in the middle of a cycle: half of what the temperature went through is a standard deviation.
        """
        from scipy.optimize import minimize

        free = slice(0 if moves else 1, None)
        first = self.place_of(near)

        def placed(at: Float64Array) -> Float64Array:
            place = first.copy()
            place[free] = at
            return place

        def loss(at: Float64Array) -> float:
            return -self.worth(self.lag_at(placed(at), near))

        start = first[free]
        simplex = np.vstack((start, start + np.diag(self.steps[free])))
        options = {"initial_simplex": simplex, "xatol": 1e-4, "fatol": 0.1, "maxfev": _EVALUATIONS * start.size}
        found = minimize(loss, start, method="Nelder-Mead", options=options)
        return self.lag_at(placed(found.x), near)


def _acting(prepared: Prepared, lag: TemperatureLag) -> Float64Array:
    """The temperature that acts at the samples looked at, (n,)."""
    acts = prepared.source.acting_temperature(lag.value_s, lag.ahead_K)
    return filled(acts, REFERENCE_DEGC)[0][prepared.kept]


def _with(record: Record, temperature_degC: Float64Array) -> Record:
    return replace(record, course=record.course._replace(temperature_degC=temperature_degC))


def _anew(fit: Fit, record: Record) -> Fit:
    """The model of a fit fitted to a record of another temperature."""
    return fit_model(fit.problem._replace(record=record), Start(fit.model, fit.trajectory, fit.noise))
