"""A Stribeck speed that nobody gave, beside a model's other numbers.

What a model lacks bends its Stribeck curve: of a small, fast wheel with an offset a fit makes a curve of a thousand rpm
and a break-away friction that is Coulomb's, and says so to a thousandth. Beside the offset it stays there, since over
Stribeck speed and break-away friction together the likelihood has several tops, tens of log-likelihood apart. So both
are begun anew all over what a wheel may have; and what the record does not decide about is in every sigma.
"""

from __future__ import annotations

import math
from dataclasses import replace

from rw_ekf.identify.record_scale import STRIBECK_SHARE_OF_TOP_SPEED
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.work_budget import MOST_UNITS
from rw_ekf.model.state import MOTOR_GAIN, STATIC

_RATIOS = (1.0 / 64.0, 1.0 / 16.0, 0.25, 1.0, 4.0)  # of the share of the top speed that is guessed first
_USUAL_FIRST = (0.25, 1.0 / 16.0, 1.0, 1.0 / 64.0, 4.0)  # where a share of the work is not enough for all
_NEIGHBOURS = (0.5, 2.0)  # of the best of those
_EXCESS = 1.15  # break-away over Coulomb friction, where a fit is begun once more
_EXCESSES = (1.03, 1.07, 1.11, 1.2, 1.3)  # and at the best speed
_LEAST_EXCESS = 0.97  # as little as noise makes of none
_SURELY = 2.0  # sigma
_NO_FRICTION = 30.0  # log-likelihood by which that must be likelier
_BETTER = 1.0  # log-likelihood by which another place must be likelier
_BEYOND = 3.0  # log-likelihood by which a speed that no wheel has must be likelier
_UNFINISHED = 10.0  # log-likelihood that a full fit may add to a sketch
_SHARE = 0.03  # of all work, for one search
_FINE = 0.5  # of the speed's logarithm: a smaller step stays in its valley
_UNLIKELY = 4.5  # log-likelihood that a speed may cost: three sigma
_STEPS = (
    math.log(4.0),
    math.log(2.0),
    math.log(1.3),
    math.log(1.1),
)  # of the speed's logarithm, one finer than another
_SEEN = 0.3  # of the best place's probability: the least that its neighbours together must have


def likeliest_stribeck_speed(fit: Fit, top_speed_rad_s: float) -> Fit:
    """The same model at the Stribeck speed and from the break-away friction that make the record likeliest.

    Sketched over a grid of both, then around its best place, as far as a share of the work goes; the best is fitted in
    full.
    """
    guess, own = STRIBECK_SHARE_OF_TOP_SPEED * top_speed_rad_s, fit.model.stribeck.omega_s
    usual = _RATIOS[0] * guess <= own <= _RATIOS[-1] * guess
    sketches = _Sketches(fit)
    for ratio in _USUAL_FIRST:
        sketches.add(_begun(fit.model, ratio * guess, _EXCESS))
    for way in ([r for r in _RATIOS if r * guess > own], [r for r in reversed(_RATIOS) if r * guess <= own]):
        last = fit
        for ratio in way:
            last = sketches.add(_at(last, ratio * guess)) or last
    best = sketches.best
    best_rad_s = best.model.stribeck.omega_s
    for ratio in _NEIGHBOURS:
        if _RATIOS[0] * guess <= ratio * best_rad_s <= _RATIOS[-1] * guess:
            sketches.add(_at(best, ratio * best_rad_s))
    for excess in _EXCESSES:
        sketches.add(_begun(best.model, best_rad_s, excess))
    best, least = sketches.best, _worth(fit) + (_BETTER if usual else -_BEYOND)
    if _worth(best) < least - _UNFINISHED:
        return fit
    best = best.refitted(best.model)
    return best if _worth(best) > least else fit


class _Sketches:
    """Sketches beside one fit, as many as a share of the work allows."""

    def __init__(self, fit: Fit) -> None:
        self._fit, self._work = fit, fit.linearised.record.work
        self._until = self._work.units + _SHARE * MOST_UNITS
        self._found: list[Fit] = []

    def add(self, model: Model) -> Fit | None:
        """A model sketched; None where no work is left."""
        if self._work.units > self._until:
            return None
        self._found.append(self._fit.sketched(model))
        return self._found[-1]

    @property
    def best(self) -> Fit:
        """The likeliest that is a friction; the fit itself where nothing was sketched."""
        return max(self._found, key=_worth, default=self._fit)


def over_stribeck_speeds(fit: Fit, top_speed_rad_s: float) -> list[tuple[float, Fit]]:
    """The model at each Stribeck speed that the record leaves possible, with probabilities; the fit's own comes first.

    Even steps of the speed's logarithm, as fine as the record requires, each as probable as it makes the record.
    """
    found = [fit]
    for step in _STEPS:
        found = [fit, *_outward(fit, -step, top_speed_rad_s), *_outward(fit, step, top_speed_rad_s)]
        likelihoods = [math.exp(min(_value(item) - _value(fit), 0.0)) for item in found[1:]]
        if math.fsum(likelihoods) > _SEEN:
            break
    best = max(_value(item) for item in found)
    odds = [math.exp(_value(item) - best) for item in found]
    return [(odd / math.fsum(odds), item) for odd, item in zip(odds, found, strict=True)]


def within_a_step(fit: Fit) -> list[tuple[float, Fit]]:
    """The model at three Stribeck speeds for what the record leaves open of one that it determines to less than a step.

    Its logarithm is taken for normal, with the curvature that the likelihood has over the finest step to either side;
    the three are those of Gauss and Hermite. The fit alone where the likelihood does not fall.
    """
    step, omega_s = _STEPS[-1], fit.model.stribeck.omega_s
    beside = [_value(fit.sketched(_at(fit, omega_s * math.exp(way * step)))) for way in (-1.0, 1.0)]
    fall = _value(fit) - 0.5 * math.fsum(beside)
    if not fall > 0.0:
        return [(1.0, fit)]
    off = math.sqrt(3.0) * step / math.sqrt(2.0 * fall)
    others = [fit.sketched(_at(fit, omega_s * math.exp(way * off))) for way in (-1.0, 1.0)]
    return [(2.0 / 3.0, fit), *((1.0 / 6.0, other) for other in others)]


def _outward(fit: Fit, step: float, top_speed_rad_s: float) -> list[Fit]:
    """Fits at speeds one step after another away from that of `fit`, as far as they are likely and a wheel has them."""
    guess = STRIBECK_SHARE_OF_TOP_SPEED * top_speed_rad_s
    found: list[Fit] = []
    last = fit
    while True:
        omega_s = last.model.stribeck.omega_s * math.exp(step)
        if omega_s < _RATIOS[0] * guess if step < 0.0 else omega_s > _RATIOS[-1] * guess:
            return found
        models = [_at(last, omega_s)]
        if abs(step) > _FINE:
            models += [_at(fit, omega_s), _begun(fit.model, omega_s, _EXCESS)]
        last = max((fit.sketched(model) for model in dict.fromkeys(models)), key=_worth)
        if _worth(last) < _value(fit) - _UNLIKELY:
            return found
        found.append(last)


def _at(fit: Fit, omega_s: float) -> Model:
    """The model of a fit at another Stribeck speed."""
    return replace(fit.model, stribeck=fit.model.stribeck._replace(omega_s=omega_s))


def _begun(model: Model, omega_s: float, excess: float) -> Model:
    """A model at another Stribeck speed and with so much of Coulomb friction for break-away."""
    parameters = model.parameters._replace(static=excess * model.parameters.coulomb)
    return replace(model, parameters=parameters, stribeck=model.stribeck._replace(omega_s=omega_s))


def _worth(fit: Fit) -> float:
    """Its likelihood; what surely breaks away more easily than it slides has to be much likelier."""
    static, coulomb = fit.model.parameters.static, fit.model.parameters.coulomb
    most = static + _SURELY * float(fit.std[STATIC - MOTOR_GAIN])
    return _value(fit) - (0.0 if most >= _LEAST_EXCESS * coulomb else _NO_FRICTION)


def _value(fit: Fit) -> float:
    return fit.likelihood.value
