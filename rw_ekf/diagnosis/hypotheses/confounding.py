"""What a record confounds by construction: a wheel that only slows down, or a temperature that only rises.

In such a record time is a function of speed (or of temperature), so that an effect of the one is an effect of the
other, whatever the likelihoods say of two particular shapes. Two questions are put to the data, none of names: is one
quantity a function of the other, and does an effect of the one say anything beside a smooth, otherwise unknown function
of the other (docs/likelihood.md, "Confounded by construction")?
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.hypotheses.candidates import Score
from rw_ekf.diagnosis.hypotheses.scorer import Scorer
from rw_ekf.diagnosis.thresholds import IS_FUNCTION, IS_ONE, LEAST_KELVIN
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.one_step import Record
from rw_ekf.likelihood.structure import hats, slopes_by_torque, where_begun
from rw_ekf.model.effect import Effect, RecordFacts

Quantity = Literal["speed", "time", "temperature"]

_KNOTS = 12  # of a smooth function, as in the map of the residual


def separates(other: Quantity) -> str:
    """What would distinguish an effect of time from one of another quantity, where a record has them as one."""
    if other == "temperature":
        return (
            "temperature goes with time in this record: one in which the temperature falls again, or "
            "another from another temperature (`rw-ekf diagnose LOG LOG`)"
        )
    return (
        "speed goes with time in this record: a second coast-down from another speed (`rw-ekf diagnose "
        "LOG LOG`), a dwell or a reversal"
    )


def quantity_of(effect: type[Effect]) -> Quantity:
    """What an effect goes with: the record's own clock, the temperature, else the motion."""
    if effect.of_one_record or effect.clocked:
        return "time"
    return "temperature" if "temperature_degC" in effect.needs else "speed"


def is_smooth_in_time(effect: type[Effect]) -> bool:
    """Whether an effect varies smoothly with the record's clock: no event's onset, and no sine, is a law of speed."""
    return quantity_of(effect) == "time" and not (effect.local_in_time or effect.clocked)


def values_of(record: Record, speed_rad_s: Float64Array, quantity: Quantity) -> Float64Array:
    """A quantity at each sample (n,): |speed|, temperature, or the time since the sample's own log began."""
    if quantity == "speed":
        return np.abs(speed_rad_s)
    if quantity == "temperature":
        return record.course.temperature_degC
    time = record.course.time_s
    return time - time[np.searchsorted(record.log_of, record.log_of)]


def function_share(record: Record, speed_rad_s: Float64Array, one: Quantity, other: Quantity) -> float:
    """Share of the variance of one quantity that a smooth function of the other has, 0 to 1."""
    y, x = values_of(record, speed_rad_s, one), values_of(record, speed_rad_s, other)
    kept = np.isfinite(y) & np.isfinite(x)
    y, x = y[kept], x[kept]
    if y.size < 2 * _KNOTS or np.ptp(y) <= 0.0 or np.ptp(x) <= (LEAST_KELVIN if other == "temperature" else 0.0):
        return 0.0
    A = hats(x, _KNOTS, float(x.min()), float(x.max()))
    left = y - A @ np.linalg.lstsq(A, y, rcond=None)[0]
    return 1.0 - float(np.var(left) / np.var(y))


def one_and_the_same(fit: Fit, one: Quantity, other: Quantity) -> bool:
    """Whether the record cannot distinguish a function of one quantity from one of the other."""
    return one != other and function_share(fit.linearised.record, fit.trajectory.speed, one, other) > IS_ONE


def may_confound(fit: Fit, one: Quantity, other: Quantity) -> bool:
    """Whether it is worth evaluating `beside`: one quantity goes with the other at all."""
    return one != other and function_share(fit.linearised.record, fit.trajectory.speed, one, other) > IS_FUNCTION


def smooth_regressors(fit: Fit, quantity: Quantity, *, with_gain: bool = False) -> Float64Array:
    """Slopes by a dry friction and a torque that follow a smooth unknown function of a quantity, (n, m).

    with_gain: by a motor gain too, as by one of temperature always.
    """
    drive, dry = slopes_by_torque(fit)
    record = fit.linearised.record
    x = where_begun(values_of(record, fit.trajectory.speed, quantity))
    shapes = hats(x, _KNOTS, float(np.min(x)), float(np.max(x)))
    parts = [dry[:, None] * shapes, drive[:, None] * shapes]
    if with_gain or quantity == "temperature":
        parts.append((drive * record.course.mean_current_A)[:, None] * shapes)
    return np.where(record.follows[:, None], np.concatenate(parts, axis=1), 0.0)


def deferred(fit: Fit, strong: list[Score], facts: RecordFacts, enough: float) -> dict[str, Quantity]:
    """Effects that go with time and must wait, by id: the record cannot distinguish them from one of this quantity.

    That must be a contender, or in the model already: a law that holds at any time goes first.
    """
    laws = {quantity_of(score.effect) for score in strong} | {quantity_of(term.effect) for term in fit.model.terms}
    timed = [s.effect for s in strong if quantity_of(s.effect) == "time" and not s.effect.local_in_time]
    found: dict[str, Quantity] = {}
    others: list[Quantity] = ["speed", "temperature"]
    for other in others:
        left = [effect for effect in timed if effect.id not in found]
        if left and other in laws and one_and_the_same(fit, "time", other):
            smooth = [effect for effect in left if not effect.clocked]  # what one law leaves is another law's
            found |= dict.fromkeys((effect.id for effect in smooth), other)
            left = [effect for effect in left if effect.clocked]  # a sine of many periods is no law
        if left and other in laws and may_confound(fit, "time", other):
            found |= {effect.id: other for effect in left if not says_more(fit, facts, effect, other, enough)}
    return found


def says_more(fit: Fit, facts: RecordFacts, effect: type[Effect], quantity: Quantity, enough: float) -> bool:
    """Whether an effect is significant at a p-value even beside a smooth function of a quantity."""
    found = Scorer(fit, smooth_regressors(fit, quantity)).best_of_each(facts, [effect]).get(effect.id)
    return found is not None and found.p_value < enough


def beside_motion(fit: Fit, facts: RecordFacts, score: Score) -> float:
    """p-value of what has a clock, beside friction and a motor gain that follow the speed in any smooth way.

    A motion that nearly repeats itself makes every law of motion nearly periodic.
    """
    laws = smooth_regressors(fit, "speed", with_gain=True)
    found = Scorer(fit, laws).best_at(facts, [(score.effect, score.candidate)]).get(score.effect.id)
    return 1.0 if found is None else found.p_value


def event_scores(fit: Fit, events: list[type[Effect]], facts: RecordFacts) -> dict[str, Score]:
    """Scores of events; where time goes with speed, of what is left beside any smooth function of that."""
    scorer = Scorer(fit, smooth_regressors(fit, "speed") if may_confound(fit, "time", "speed") else None)
    return scorer.best_of_each(facts, events)
