"""A model that was found in one record, in another: what of it that record bears, and the report where it does not.

A filter learns coefficients; where a bump lies, when a spike began and how it decays are constants to it. They were
fitted to the model's own record and are known no better than that record showed. Taken for certain in a second record,
they leave sigmas of the amplitude that hold in 60 %. So a log that is seen as a whole determines its own, within what
one step of a fit reaches, and what it leaves open of them is in the belief (`rw_ekf.hindsight`). And the numbers of the
model are an a priori that may be of another temperature or another wheel: where the log contradicts them, that is
reported, and they count as much less as they are off.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.acting_temperature import AHEAD_SIGMA, acting_temperature
from rw_ekf.course.course import Course
from rw_ekf.effects.catalogue import DEADZONE, TORQUE
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.parameters_held import without_drift
from rw_ekf.filter.second_pass import log_likelihood, was_reset
from rw_ekf.filter.tails import chi_square_tail
from rw_ekf.hindsight import CLEARLY, filtered
from rw_ekf.logs.wheel_log import WheelLog
from rw_ekf.model.effect import Effect, Term
from rw_ekf.model.state import COULOMB, MOTOR_GAIN, PARAMETER_COUNT, PARAMETER_NAMES, PARAMETERS, STATIC, VISCOUS
from rw_ekf.numbers import plus_minus
from rw_ekf.starting_point import FilterSetup, left_open
from rw_ekf.wheel.effect_table import EffectSet
from rw_ekf.wheel.model_file import WheelModel

_TURNS = 6
_GAINED = 0.02  # log-likelihood: with less a step was the last
_OPEN = 3.0  # log-likelihood, by which a law is less likely than another and yet may be it
MOVED = 3.0  # sigmas by which a number is another than the model's, to be reported
# p of the whole disagreement: a healthy wheel with sigmas a tenth too small is reported at one in 20,000.
_DISAGREE_P = 1.0e-5
# How a log is fitted by itself: ten of the model's sigmas, and the whole of each number. A wheel whose friction is
# another by a tenth is a thousand sigmas off; a filter that may look no further than ten of them is lost there.
_FREE_SIGMAS, _FREE_SHARE = 10.0, 1.0
_MOST_WIDENED, _HALVINGS = 1.0e12, 40  # of variances; no model knows a number to a millionth of what it is
_NOISIER = (3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)  # times the model's torque noise
_AGAIN = 0.5  # of its size: a warm-up from another temperature is that of another day, and is a warm-up
_STEADY: dict[str, type[Effect]] = {"torque": TORQUE, "current_loss": DEADZONE}  # what a change leaves behind it
_SHORT = 1.0e-3  # of a reach: a step that is no step


def as_of_another_record(course: Course, setup: FilterSetup) -> FilterSetup:
    """The setup of a model that was found elsewhere, for a log that is seen as a whole: its shapes, then its a priori.

    For a filter and for a fit alike; a run, which goes forward, does without what belonged to one record
    (`rw_ekf.learning.aged_model`).
    """
    setup = with_laws_of_record(course, with_times_of_record(course, setup))
    return with_prior_that_holds(course, with_noise_that_holds(course, with_shapes_of_record(course, setup)))


def with_warmth_of_record(log: WheelLog, course: Course, setup: FilterSetup) -> Course:
    """The course with a body as much warmer than its thermometer, where the record begins, as makes the log likeliest.

    Of a model whose temperature acts late; a record may begin in the middle of a cycle.
    """
    read, lag_s = log.channels.get("temperature_degC"), setup.temperature_lag_s
    if read is None or lag_s <= 0.0 or not np.isfinite(read).any():
        return course
    if not any(term.goes_with_temperature for term in setup.effects.terms):
        return course
    steady = replace(setup, constants=without_drift(setup.constants))
    range_K = max(float(np.ptp(read[np.isfinite(read)])), 1.0e-6)

    def warmer(ahead: float) -> Course:
        acts = acting_temperature(log.time_s, log.segment, read, lag_s, ahead * range_K)
        return course._replace(temperature_degC=acts)

    def loss(ahead: float) -> float:
        return 0.5 * (ahead / AHEAD_SIGMA) ** 2 - log_likelihood(filtered(warmer(ahead), steady), setup.constants.gate)

    from scipy.optimize import minimize_scalar  # takes long to import, and few models get here

    found = minimize_scalar(loss, bounds=(-1.0, 1.0), method="bounded", options={"xatol": 1.0e-3})
    return warmer(float(found.x)) if found.fun < loss(0.0) - CLEARLY else course


def with_times_of_record(course: Course, setup: FilterSetup, believed: Belief | None = None) -> FilterSetup:
    """The setup with what has a clock as this log makes it likeliest: as found, as it began or ended, or without it.

    What changed in the record that a model was found in has changed before the next one, or not yet; a change that
    comes at the same time of every run does so again. So may a friction that settles as a wheel warms up, but one that
    has run in, or a drag that came once, does not.

    believed: the a priori by which that is decided, where the setup's own leaves a parameter so open that it would
    follow any change; None: the setup's.
    """
    if not changes_with_time(setup.effects):
        return setup

    def value(way: FilterSetup) -> float:
        steady = replace(way, constants=without_drift(way.constants))
        return log_likelihood(filtered(course, steady), way.constants.gate)

    ways = _ways_in_time(setup)
    judged = ways if believed is None else _ways_in_time(replace(setup, prior=believed))
    values = [value(way) for way in judged]
    likeliest, *others = [ways[i] for i in sorted(range(len(ways)), key=lambda i: -values[i])]
    gone = [term.id for term in setup.effects.terms if term.of_its_record]
    if not gone:
        return likeliest
    if likeliest.effects.ids == setup.effects.ids:
        if _comes_again(course, likeliest):
            return likeliest
        likeliest = next(way for way in others if way.effects.ids != setup.effects.ids)
    note = (
        f"{', '.join(dict.fromkeys(gone))} of the model belonged to the record it was found in: this log is likelier "
        "without, and what it moved is what this log has"
    )
    return replace(likeliest, notes=(*likeliest.notes, note))


def _ways_in_time(setup: FilterSetup) -> list[FilterSetup]:
    """As found, with what changed as it ended or began; each of them without what belonged to its record as well."""
    ways = [setup]
    if any(_is_change(term) for term in setup.effects.terms):
        ways += [replace(setup, effects=_held(setup.effects, end)) for end in (-1, 0)]
    if any(term.of_its_record for term in setup.effects.terms):
        ways += [_without_record(way) for way in ways]
    return ways


def _comes_again(course: Course, setup: FilterSetup) -> bool:
    """Whether what belonged to the model's record has about the model's size in this log, were that open.

    Of two records that wander each its own way the one's course may look a little like the other's.
    """
    prior = setup.prior.covariance.copy()
    coefficients = [(term, value) for term in setup.effects.state_terms for value in term.values]
    places = [PARAMETERS.stop + at for at, (term, _) in enumerate(coefficients) if term.of_its_record]
    given = setup.prior.mean[places]
    prior[places, :] = prior[:, places] = 0.0
    prior[places, places] = given**2
    steady = replace(setup, constants=without_drift(setup.constants))
    run = filtered(course, replace(steady, prior=Belief(setup.prior.mean, prior, setup.prior.effect_ids)))
    return not was_reset(run) and bool(np.all(np.abs(run.mean[places] - given) < _AGAIN * np.abs(given)))


def _without_record(setup: FilterSetup) -> FilterSetup:
    """The setup without what belonged to the model's record; open is what that has moved by now."""
    return _without(setup, [term for term in setup.effects.terms if term.of_its_record])


def without_past_changes(setup: FilterSetup, parameters: Float64Array) -> FilterSetup:
    """The setup without a change that came before this log, or does not come in it; what it moved is open.

    For a diagnosis, to which another change at another time is another answer. A torque that came and stayed is an
    offset, a loss of current a dead zone, and a parameter that changed has the value that it changed to: parameters
    (4,), as `parameters_by_now` has them.
    """
    levels = {term: level for term in setup.effects.terms if (level := _level_of(term)) is not None}
    past = list(levels)
    for term, level in levels.items():
        steady, size = None if term.law is None else _STEADY.get(term.law.acts_as), level * term.values[0]
        if steady is None or steady.id in setup.effects.ids or size == 0.0:
            continue
        if steady.coefficient.lower <= size <= steady.coefficient.upper:
            setup = _as_constant(setup, term, level, steady)
            past.remove(term)
    mean = setup.prior.mean.copy()
    mean[PARAMETERS] = parameters
    return _without(replace(setup, prior=replace(setup.prior, mean=mean)), past)


def parameters_by_now(model: WheelModel, effects: EffectSet) -> tuple[Float64Array, Float64Array]:
    """The four parameters of a model with what changed in its own record, (4,), and their covariance (4, 4).

    effects: the model's, with each change as it is in a later log (`with_times_of_record`).
    """
    mean, slopes = np.array(model.parameters), np.eye(PARAMETER_COUNT, len(model.covariance))
    places: dict[tuple[str, tuple[float, ...]], int] = {}
    for at, own in enumerate(term for term in model.effects.state_terms for _ in term.values):
        places.setdefault((own.id, own.values), PARAMETER_COUNT + at)
    for term in effects.state_terms:
        level, place = _level_of(term), places.get((term.id, term.values))
        if level is not None and place is not None:
            mean, of_parameters, of_size = _moved_by(term, level, mean)
            slopes = of_parameters[:, None] * slopes
            slopes[:, place] += of_size
    return mean, slopes @ np.array(model.covariance) @ slopes.T


def _moved_by(change: Term, level: float, parameters: Float64Array) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Parameters (4,) with what a change at this level has left behind; slopes (4,) by each itself, and by its size."""
    k, b, c, s = (place - MOTOR_GAIN for place in (MOTOR_GAIN, VISCOUS, COULOMB, STATIC))
    own, by_size = np.ones(PARAMETER_COUNT), np.zeros(PARAMETER_COUNT)
    acts_as = None if change.law is None else change.law.acts_as
    if acts_as == "motor_gain":
        own[k], by_size[k] = 1.0 + level * change.values[0], level * parameters[k]
    elif acts_as == "drag":
        by_size[[c, s]] = level
    elif acts_as == "viscous_drag":
        by_size[b] = level
    return parameters + change.values[0] * by_size, own, by_size


def _level_of(term: Term) -> float | None:
    """What a change amounts to in a log in which nothing of it changes; None for what is no change, or changes."""
    if term.law is None or not _is_change(term):
        return None
    values = term.law.functions[0]
    return values[0] if min(values) == max(values) else None


def _as_constant(setup: FilterSetup, change: Term, level: float, steady: type[Effect]) -> FilterSetup:
    """The setup with a constant effect where it had a change that has come."""
    coefficients = [term for term in setup.effects.state_terms for _ in term.values]
    at = coefficients.index(change)
    constant = Term.of(steady, value=level * change.values[0], std=abs(level) * change.stds[0])
    effects = EffectSet(tuple(constant if term is change else term for term in setup.effects.terms))
    mean, covariance, place = setup.prior.mean.copy(), setup.prior.covariance.copy(), PARAMETERS.stop + at
    mean[place] *= level
    covariance[place, :] *= level
    covariance[:, place] *= level
    ids = [*setup.prior.effect_ids]
    ids[at] = steady.id
    return replace(setup, effects=effects, prior=Belief(mean, covariance, tuple(ids)))


def _without(setup: FilterSetup, gone: list[Term]) -> FilterSetup:
    """The setup without some terms; open is what they have moved by now."""
    if not gone:
        return setup
    prior = setup.prior
    stays = [term not in gone for term in setup.effects.state_terms for _ in term.values]
    places = [*range(PARAMETERS.stop), *(PARAMETERS.stop + at for at, kept in enumerate(stays) if kept)]
    ids = tuple(name for name, kept in zip(prior.effect_ids, stays, strict=False) if kept)
    values, covariance = Belief(prior.mean[places], prior.covariance[np.ix_(places, places)]).known(sum(stays))
    covariance += left_open(gone, prior.parameters, values.size)
    effects = EffectSet(tuple(term for term in setup.effects.terms if term not in gone))
    known = Belief.of_known(values, covariance, effects.table().size, effect_ids=ids)
    return replace(setup, effects=effects, prior=known)


def changes_with_time(effects: EffectSet) -> bool:
    """Whether a set of effects has something with a clock."""
    return any(_is_change(term) or term.of_its_record for term in effects.terms)


def _is_change(term: Term) -> bool:
    return term.law is not None and term.law.quantity == "time" and not term.of_its_record


def _held(effects: EffectSet, end: int) -> EffectSet:
    terms = (replace(t, law=t.law.held(end)) if t.law is not None and _is_change(t) else t for t in effects.terms)
    return EffectSet(tuple(terms))


def with_laws_of_record(course: Course, setup: FilterSetup) -> FilterSetup:
    """The setup with the law that this log makes likeliest, of an effect that may follow several with one coefficient.

    The record in which a model was found may have shown too little of a range to distinguish them; where this one does
    not either, both are in the belief. The log is fitted by itself: the model's numbers are those that go with its own
    law, and count for little where another one is likelier.
    """
    ways = [setup.effects]
    for i, term in enumerate(setup.effects.terms):
        place = next((j for j, c in enumerate(term.effect.constants) if c.whole and term.effect.linear), None)
        if place is not None:
            limits = term.effect.constants[place]
            codes = range(int(limits.lower), int(limits.upper) + 1)
            ways += [
                _with_constant(effects, i, place, code)
                for effects in ways
                for code in codes
                if code != term.shape[place]
            ]
    if len(ways) == 1:
        return setup
    steady = _freed(replace(setup, constants=without_drift(setup.constants)))
    values = [
        log_likelihood(filtered(course, replace(steady, effects=effects)), setup.constants.gate) for effects in ways
    ]
    open_ones = tuple(way for way, value in zip(ways, values, strict=True) if value > max(values) - _OPEN)
    likeliest = ways[int(np.argmax(values))]
    if likeliest is not setup.effects:
        setup = _widened(setup, _FREE_SIGMAS**2)
    return replace(setup, effects=likeliest, effect_hypotheses=open_ones if len(open_ones) > 1 else ())


def _with_constant(effects: EffectSet, number: int, place: int, value: float) -> EffectSet:
    """The effects, one shape constant of one term another number."""
    terms = list(effects.terms)
    shape = list(terms[number].shape)
    shape[place] = float(value)
    terms[number] = replace(terms[number], shape=(shape[0], shape[1], shape[2]))
    return EffectSet(tuple(terms))


def with_shapes_of_record(course: Course, setup: FilterSetup) -> FilterSetup:
    """The setup with the shape constants that this log makes likeliest, and with others that it leaves open.

    Unchanged for a model whose effects have none that are fitted.
    """
    places = [
        (i, constant) for i, term in enumerate(setup.effects.terms) for constant in term.refined if term.effect.in_state
    ]
    if not places:
        return setup
    steady = replace(setup, constants=without_drift(setup.constants))

    def likelihood(shapes: Float64Array) -> float:
        effects = _with_shapes(setup.effects, places, shapes)
        return -math.inf if effects is None else log_likelihood(
            filtered(course, replace(steady, effects=effects)), setup.constants.gate
        )  # fmt: skip

    given = np.array([setup.effects.terms[i].shape[constant] for i, constant in places])
    limits = [(setup.effects.terms[i].effect.constants[c], v) for (i, c), v in zip(places, given, strict=True)]
    reach = np.array([constant.reach_at(float(value)) for constant, value in limits])
    steps = np.array([constant.step_at(float(value)) for constant, value in limits])
    best, covariance = _likeliest(likelihood, given, steps, reach)
    root = np.linalg.cholesky(covariance)
    width = math.sqrt(given.size)
    points = [_with_shapes(setup.effects, places, best + way * width * root[:, i])
              for i in range(given.size) for way in (-1.0, 1.0)]  # fmt: skip
    effects = _with_shapes(setup.effects, places, best)
    if effects is None:
        return setup
    std = np.sqrt(np.diag(covariance))
    notes = [
        f"{setup.effects.terms[i].id}: this log has {setup.effects.terms[i].effect.constants[c].name} "
        f"{plus_minus(float(best[j]), float(std[j]))}, the model {given[j]:.5g}; its own is used here"
        for j, (i, c) in enumerate(places)
        if abs(best[j] - given[j]) > MOVED * std[j]
    ]
    return replace(
        setup,
        effects=effects,
        effect_hypotheses=tuple(point for point in points if point is not None),
        notes=(*setup.notes, *notes),
    )


def with_noise_that_holds(course: Course, setup: FilterSetup) -> FilterSetup:
    """The setup with a torque noise that this log can be followed with, where the model's own loses the wheel.

    A drag that begins in this log, or has gone by now, is a torque that the model does not have. A filter that knows of
    none refuses the readings instead, is reset, and is lost again.
    """
    constants = without_drift(setup.constants)._replace(dry_walk=setup.constants.dry_walk)
    steady = _freed(replace(setup, constants=constants))
    first = filtered(course, steady)
    if not was_reset(first):
        return setup
    own, gate = setup.constants.acceleration_noise, setup.constants.gate
    values = {1.0: log_likelihood(first, gate)}
    for times in _NOISIER:
        louder = replace(steady, constants=steady.constants.with_acceleration_noise(times * own))
        values[times] = log_likelihood(filtered(course, louder), gate)
    best = max(values, key=lambda times: values[times])
    if values[best] - values[1.0] < CLEARLY:
        return setup
    note = (
        "the wheel does in this log what the model given does not know: with the model's torque noise the filter loses "
        f"it, with {best:g} times as much it does not; `rw-ekf diagnose LOG --model F` asks what it is"
    )
    constants = setup.constants.with_acceleration_noise(best * own)
    return replace(setup, constants=constants, notes=(*setup.notes, note))


def with_prior_that_holds(course: Course, setup: FilterSetup) -> FilterSetup:
    """The setup with its a priori widened by as much as this log contradicts it, and a sentence; else unchanged.

    By Birge's ratio, of the model's variances alone: they grow until chi-square is its degrees of freedom. The log's
    own sigmas are no part of what was wrong, and may be much the larger ones.
    """
    steady = replace(setup, constants=without_drift(setup.constants))
    known = _known(setup)
    free = filtered(course, _freed(steady))
    if was_reset(free):
        return _left_to_itself(course, setup, steady)
    off = free.mean[known] - setup.prior.mean[known]
    own, given = free.covariance[known, known], setup.prior.covariance[known, known]
    if not contradict(off, own + given):
        return setup
    names = [*PARAMETER_NAMES, *setup.effects.state_names]
    worst = int(np.argmax(np.abs(off) / np.sqrt(np.diag(own + given))))
    alone = plus_minus(float(free.mean[known][worst]), math.sqrt(float(own[worst, worst])))
    reported = plus_minus(float(setup.prior.mean[known][worst]), math.sqrt(float(given[worst, worst])))
    note = (
        f"this log and the model given contradict each other ({names[worst]} {alone} by the log alone, {reported} in "
        "the model): the wheel was another then, or its law is not quite the model's; the model counts for less here, "
        "and `rw-ekf diagnose LOG --model F` asks what changed"
    )
    return replace(_widened(setup, _birge(off, own, given)), notes=(*setup.notes, note))


def _birge(off: Float64Array, own: Float64Array, given: Float64Array) -> float:
    """Times that a model's covariance `given` (m, m) has to grow for numbers `off` it, known to `own`, to be likely."""
    low, high = 0.0, math.log(_MOST_WIDENED)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _apart(off, own + math.exp(middle) * given) > off.size else (low, middle)
    return math.exp(high)


def contradict(off: Float64Array, covariance: Float64Array) -> bool:
    """Whether numbers (m,) of two records are apart by more than their covariance (m, m) together lets them be."""
    return bool(np.all(np.diag(covariance) > 0.0)) and chi_square_tail(_apart(off, covariance), off.size) < _DISAGREE_P


def _apart(off: Float64Array, covariance: Float64Array) -> float:
    """Chi-square of a difference (m,)."""
    size = np.sqrt(np.diag(covariance))
    scaled = covariance / np.outer(size, size)
    return float((off / size) @ np.linalg.lstsq(scaled, off / size, rcond=None)[0])


def _left_to_itself(course: Course, setup: FilterSetup, steady: FilterSetup) -> FilterSetup:
    """The setup for a log in which a filter loses the wheel whatever it may look for: the model's, if that holds."""
    if not was_reset(filtered(course, steady)):
        return setup
    note = (
        "the wheel does in this log what the model given does not know, and a filter loses it: the numbers here are "
        "the log's own, the model's count for nothing; `rw-ekf diagnose LOG --model F` asks what it is"
    )
    return replace(_freed(setup), notes=(*setup.notes, note))


def _freed(setup: FilterSetup) -> FilterSetup:
    """The setup with an a priori that leaves a log its own numbers, begun where the model's are."""
    return _widened(setup, _FREE_SIGMAS**2, (_FREE_SHARE * setup.prior.mean[_known(setup)]) ** 2)


def _widened(setup: FilterSetup, times: float, more: Float64Array | float = 0.0) -> FilterSetup:
    """The setup with so many times its a priori's covariance, and with variances (m,) more."""
    covariance, known = setup.prior.covariance.copy(), _known(setup)
    covariance[known, known] *= times
    at = np.arange(known.start, known.stop)
    covariance[at, at] += more
    return replace(setup, prior=Belief(setup.prior.mean, covariance, setup.prior.effect_ids))


def _known(setup: FilterSetup) -> slice:
    """The places of parameters and coefficients in the state."""
    return slice(PARAMETERS.start, PARAMETERS.stop + setup.effects.size)


def _with_shapes(effects: EffectSet, places: list[tuple[int, int]], shapes: Float64Array) -> EffectSet | None:
    """The effects with other shape constants; None outside of what the constants may be."""
    for (i, constant), value in zip(places, shapes, strict=True):
        limits = effects.terms[i].effect.constants[constant]
        if not limits.lower < value < limits.upper:
            return None
        effects = _with_constant(effects, i, constant, value)
    return effects


def _likeliest(
    likelihood: Callable[[Float64Array], float], given: Float64Array, steps: Float64Array, reach: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Where a log-likelihood plus that of a normal of widths `reach` around `given` is largest, and its covariance.

    Newton's method on parabolas through points a step apart, a sigma apart once that is known.
    """

    def value(at: Float64Array) -> float:
        return likelihood(at) - 0.5 * float(np.sum(((at - given) / reach) ** 2))

    best, top = given, value(given)
    covariance = np.diag(reach**2)
    for _ in range(_TURNS):
        slope, curvature = _parabola(value, best, top, steps)
        sizes, ways = np.linalg.eigh(curvature * np.outer(reach, reach))
        sizes = np.maximum(sizes, 1.0)  # what is known beforehand is in it: less is rounding, or a ridge
        covariance = (ways / sizes) @ ways.T * np.outer(reach, reach)
        steps = np.clip(np.sqrt(np.diag(covariance)), 0.02 * reach, 0.5 * reach)
        moved = covariance @ slope
        moved *= min(1.0, 1.0 / max(float(np.max(np.abs(moved) / reach)), 1.0e-300))
        gained, before = 0.0, top
        while gained <= 0.0 and float(np.max(np.abs(moved) / reach)) > _SHORT:
            there = value(best + moved)
            if there > top:
                best, top = best + moved, there
            gained, moved = there - before, 0.3 * moved
        if top - before < _GAINED:
            break
    _, curvature = _parabola(value, best, top, steps)
    sizes, ways = np.linalg.eigh(curvature * np.outer(reach, reach))
    covariance = (ways / np.maximum(sizes, 1.0)) @ ways.T * np.outer(reach, reach)
    return best, covariance


def _parabola(
    value: Callable[[Float64Array], float], at: Float64Array, top: float, steps: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Slope (q,) and minus the second derivatives (q, q) by differences; those of what cannot be reached are 0."""
    count = at.size
    offsets = np.diag(steps)
    ahead = np.array([value(at + row) for row in offsets])
    behind = np.array([value(at - row) for row in offsets])
    slope = (ahead - behind) / (2.0 * steps)
    curvature = np.diag((2.0 * top - ahead - behind) / steps**2)
    for i in range(count):
        for j in range(i):
            both = value(at + offsets[i] + offsets[j])
            curvature[i, j] = curvature[j, i] = -(both - ahead[i] - ahead[j] + top) / (steps[i] * steps[j])
    good = np.isfinite(slope)
    good &= np.isfinite(np.diag(curvature))
    return np.where(good, slope, 0.0), np.where(np.isfinite(curvature) & np.outer(good, good), curvature, 0.0)
