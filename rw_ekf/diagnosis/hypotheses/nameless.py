"""Laws that have no formula: where they may be, how likely the smoothest of each is, and the law itself as a term.

A law is a function of one quantity under a Gaussian-process prior (Matern 5/2; Rasmussen & Williams 2006, eq. 4.17),
what the four parameters follow taken out. Its size and smoothness are those of the highest marginal likelihood, so that
it pays for its freedom and is flat where the record says nothing (docs/likelihood.md, "Laws without a formula").
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.hypotheses.confounding import may_confound
from rw_ekf.diagnosis.hypotheses.group import evidence_of_drawn
from rw_ekf.diagnosis.hypotheses.profiled import Profiled
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.thresholds import CHOSEN_LOG, INDISTINGUISHABLE, UNNAMED_LOG_ODDS
from rw_ekf.effects.catalogue import CHANGE, LEARNED
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.likelihood.structure import hats, slopes_by_torque
from rw_ekf.model.effect import RecordFacts, Term
from rw_ekf.model.law import TURN, ActsAs, Law, Quantity

LAW_LOG_ODDS = UNNAMED_LOG_ODDS - CHOSEN_LOG
_HATS = 25  # with which a quantity is screened
_KNOTS = 66  # of a law that is fitted; even, so that none is at zero speed, where a law may jump
_TURN_KNOTS = 385
_SMOOTH = (1.0, 0.5, 0.25, 0.12)  # of the quantity's range, over which a law bends
_ORDERS = (2, 4, 8, 16)  # harmonics of the angle
_LEAST_SHARE = 1.0e-6  # of a law's greatest variance: curves with less are left out
_MOST_CURVES = 14
_BOTH_SIDES = ("speed", "current_along_motion")  # of zero, where the law may bend at once, or jump
_LEAST_RANGE = {"temperature": 1.0}  # K
_LEAST_VALUES = 8  # that a quantity has to have
_PLACES = 60  # in time, at which a change is sought
_ABRUPT_S = 0.01
_SEEN = 1.0e-6  # of a step's square: less is what the model itself follows
_TIME_TOLERANCE_S = 0.2  # to which the time of a change is sought
_RAMPS_S = (_ABRUPT_S, 10.0, 40.0)  # over which it comes


@dataclass(eq=False, frozen=True)
class Ground:
    """One quantity that a law may be a function of, and one way it may act."""

    quantity: Quantity
    acts_as: ActsAs
    at: Float64Array  # (n,) the quantity where each interval began
    slope: Float64Array  # (n,) of each prediction by 1 of the law there
    followed: tuple[int, ...] = (0,)  # powers of the quantity that the parameters, or a constant torque, follow
    turned: Float64Array | None = None  # (n,) rad within each interval, of a law of the angle
    column: str = ""
    slot: int = 0

    @property
    def range(self) -> tuple[float, float]:
        """From the least value to the greatest; of an angle one turn."""
        if self.turned is not None:
            return 0.0, TURN
        most = float(np.max(np.abs(self.at)))
        if self.quantity in {"speed_size", "current_size"}:
            return 0.0, most
        return (-most, most) if self.quantity in _BOTH_SIDES else (float(self.at.min()), float(self.at.max()))


@dataclass(eq=False, frozen=True)
class Nameless:
    """The likeliest law of one ground."""

    ground: Ground
    log_factor: float  # by how much the record is likelier with it
    term: Term

    @property
    def passes(self) -> bool:
        """Whether it belongs to the clock of its record."""
        return self.ground.quantity == "time"

    @property
    def weight(self) -> float:
        """Log of how much likelier it is than no law, what it is beforehand included."""
        return self.log_factor + LAW_LOG_ODDS - (INDISTINGUISHABLE if self.passes else 0.0)


def grounds(fit: Fit, facts: RecordFacts, columns: Sequence[str]) -> Iterator[Ground]:
    """Every quantity that the record moves, with every way in which a law of it may act."""
    drive, dry = slopes_by_torque(fit)
    record = fit.linearised.record
    course, follows = record.course, record.follows
    drive, dry = np.where(follows, drive, 0.0), np.where(follows, dry, 0.0)

    def begun(values: Float64Array) -> Float64Array:
        return np.concatenate((values[:1], values[:-1]))

    speed, current = begun(fit.trajectory.speed), course.mean_current_A
    along = current * np.sign(speed)
    viscous = drive * speed
    gain = drive * current * fit.model.parameters.motor_gain
    loss = drive * np.sign(current) * fit.model.parameters.motor_gain
    yield Ground("speed_size", "drag", np.abs(speed), dry, (0, 1))
    yield Ground("speed_size", "torque", np.abs(speed), drive)
    yield Ground("speed", "drag", speed, dry, (0, 1))
    if facts.top_current_A > 0.0:
        yield Ground("speed_size", "motor_gain", np.abs(speed), gain)
        yield Ground("current_along_motion", "drag", along, dry, (1,))
        yield Ground("current_size", "motor_gain", np.abs(current), gain)
        yield Ground("current_size", "torque", np.abs(current), drive)
    if "angle_rad" in facts.channels:
        turned = np.diff(course.angle_rad, prepend=course.angle_rad[:1])
        yield Ground("angle", "torque", begun(course.angle_rad), drive, (), turned)
        yield Ground("angle", "drag", begun(course.angle_rad), dry, (0,), turned)
    passing: list[tuple[Quantity, Float64Array, str, int]] = [("time", begun(course.time_s), "", 0)]
    # Where temperature goes with time a law of it says no more than a drift, which the catalogue has.
    if "temperature_degC" in facts.channels and not may_confound(fit, "time", "temperature"):
        passing.append(("temperature", begun(course.temperature_degC), "", 0))
    for slot, name in enumerate(columns):
        values = course.columns[:, slot] if course.columns.size else np.zeros(0)
        if values.size and np.isfinite(values).all():
            passing.append(("column", begun(values), name, slot))
    for quantity, values, name, slot in passing:
        if np.ptp(values) <= _LEAST_RANGE.get(quantity, 0.0) or np.unique(values[:5000]).size < _LEAST_VALUES:
            continue
        if quantity != "time":  # a dry friction that goes with time is the catalogue's drift
            yield Ground(quantity, "drag", values, dry, column=name, slot=slot)
        yield Ground(quantity, "viscous_drag", values, viscous, column=name, slot=slot)
        yield Ground(quantity, "windage", values, viscous * np.abs(speed), column=name, slot=slot)
        yield Ground(quantity, "torque", values, drive, column=name, slot=slot)
        if facts.top_current_A > 0.0:
            yield Ground(quantity, "motor_gain", values, gain, column=name, slot=slot)
            if quantity == "time":
                yield Ground(quantity, "current_loss", values, loss, column=name, slot=slot)


def laws_beside(prepared: Prepared, fit: Fit) -> list[Nameless]:
    """`likeliest_laws` beside a fit of a whole record, worked out once."""
    return prepared.remembered("laws", fit, lambda: likeliest_laws(fit, prepared.facts, prepared.source.columns))


def likeliest_laws(fit: Fit, facts: RecordFacts, columns: Sequence[str] = ()) -> list[Nameless]:
    """The likeliest law of each ground beside a fitted model, the likeliest first."""
    profiled = Profiled(fit)
    taken = {term.law.number for term in fit.model.terms if term.law is not None}
    found = []
    for ground in grounds(fit, facts, columns):
        law = _angle_law(profiled, ground) if ground.turned is not None else _smooth_law(profiled, ground)
        if law is not None and law.term.law is not None and law.term.law.number not in taken:
            found.append(law)
        if ground.quantity == "time":
            found.append(_change(profiled, ground, facts))
    return sorted(found, key=lambda item: -item.weight)


def _smooth_law(profiled: Profiled, ground: Ground) -> Nameless | None:
    """The likeliest smooth law of a ground, over all smoothnesses."""
    low, high = ground.range
    columns = ground.slope[:, None] * hats(ground.at, _HATS, low, high)
    sums = [profiled.sums(i, columns) for i in range(len(profiled.ratios))]
    count = _KNOTS + (ground.quantity == "current_along_motion")  # which is nothing at zero, and may bend there
    places, knots = np.linspace(low, high, _HATS), np.linspace(low, high, count)
    best: tuple[float, float, float] | None = None
    factors = []
    for smooth in _SMOOTH:
        root = _root(_unfollowed(_covariance(ground, places, smooth), ground, places))
        if root.shape[1] == 0:
            return None
        factor, deviation = evidence_of_drawn(
            profiled, [(root.T @ one.gram @ root, root.T @ one.products) for one in sums]
        )
        factors.append(factor)
        if best is None or factor > best[0]:
            best = factor, deviation, smooth
    assert best is not None
    _, deviation, smooth = best
    functions, stds = _curves(_unfollowed(_covariance(ground, knots, smooth), ground, knots))
    law = _law(ground, low, high, functions, deviation * stds)
    return Nameless(ground, float(np.logaddexp.reduce(factors)) - math.log(len(factors)), _term(law))


def _angle_law(profiled: Profiled, ground: Ground) -> Nameless:
    """The likeliest law of the angle, over how many harmonics it has."""
    assert ground.turned is not None
    middle = ground.at + 0.5 * ground.turned
    most = max(_ORDERS)
    orders = np.arange(1, most + 1)
    averaged = np.sinc(np.outer(ground.turned, orders) / TURN)  # sin(n turned/2) / (n turned/2)
    phases = np.outer(middle, orders)
    columns = ground.slope[:, None] * np.concatenate((averaged * np.sin(phases), averaged * np.cos(phases)), axis=1)
    sums = [profiled.sums(i, columns) for i in range(len(profiled.ratios))]
    best: tuple[float, float, int] | None = None
    factors = []
    for count in _ORDERS:
        kept = np.concatenate((np.arange(count), most + np.arange(count)))
        factor, deviation = evidence_of_drawn(
            profiled, [(one.gram[np.ix_(kept, kept)], one.products[kept]) for one in sums]
        )
        factors.append(factor)
        if best is None or factor > best[0]:
            best = factor, deviation, count
    assert best is not None
    _, deviation, count = best
    waves = np.outer(np.arange(1, count + 1), np.linspace(0.0, TURN, _TURN_KNOTS))
    law = _law(ground, 0.0, TURN, np.concatenate((np.sin(waves), np.cos(waves))), np.full(2 * count, deviation))
    return Nameless(ground, float(np.logaddexp.reduce(factors)) - math.log(len(factors)), _term(law))


def _change(profiled: Profiled, ground: Ground, facts: RecordFacts) -> Nameless:
    """The likeliest change at one time, over when it comes and how fast."""
    begins = np.linspace(facts.first_s, facts.last_s, _PLACES + 2)[1:-1]
    tried = [(float(at), ramp) for ramp in _RAMPS_S for at in begins]
    columns = ground.slope[:, None] * np.column_stack([_step(ground.at, at, ramp) for at, ramp in tried])
    sums = [profiled.sums(i, columns) for i in range(len(profiled.ratios))]
    # What each would gain at the model's own noises tells the likeliest place; the odds are asked of that alone.
    own = sums[profiled.own]
    squares = np.diag(own.gram)
    gains = np.where(squares > _SEEN * own.whole, own.products**2 / np.maximum(squares, 1.0e-300), 0.0)
    gains *= 0.5 * profiled.count / max(profiled.rss[profiled.own], 1.0e-300)
    j = int(np.argmax(gains))
    at, ramp = tried[j]
    factor, deviation = evidence_of_drawn(
        profiled, [(one.gram[j : j + 1, j : j + 1], one.products[j : j + 1]) for one in sums]
    )
    factor += float(np.logaddexp.reduce(gains - gains[j])) - math.log(len(tried))
    law = _law(ground, at - 0.5 * ramp, at + 0.5 * ramp, np.array([[0.0, 1.0]]), np.array([deviation]))
    return Nameless(ground, factor, Term(CHANGE, (0.0,), (0.0,), law=law))


def settled_change(less: Fit, fit: Fit) -> Fit:
    """A fit with a change that was found on a grid of times, at its likeliest time, which is known by the likelihood.

    less: without it. At once, unless it is clearly likelier that it takes its time.
    """
    term = fit.model.of(CHANGE.id)[-1]
    law = term.law
    assert law is not None
    slowly, std = _at_likeliest_time(less, fit, term, law)
    if law.last - law.first > _ABRUPT_S:
        middle = 0.5 * (law.first + law.last)
        at_once = replace(law, first=middle - 0.5 * _ABRUPT_S, last=middle + 0.5 * _ABRUPT_S)
        begun = less.refitted(less.model.with_terms(replace(term, law=at_once)))
        abrupt, its_std = _at_likeliest_time(less, begun, term, at_once)
        if abrupt.likelihood.value > slowly.likelihood.value - INDISTINGUISHABLE:
            slowly, std = abrupt, its_std
    placed = slowly.model.of(CHANGE.id)[-1]
    assert placed.law is not None
    return replace(slowly, model=slowly.model.changed(placed, replace(placed, law=replace(placed.law, spread=(std,)))))


def _at_likeliest_time(less: Fit, fit: Fit, term: Term, law: Law) -> tuple[Fit, float]:
    """The change at its likeliest time, and the time's standard deviation [s]."""
    fits = {law.first: fit}
    course = less.linearised.record.course
    reach = float(course.time_s[-1] - course.time_s[0]) / _PLACES
    while reach > _TIME_TOLERANCE_S:
        best = max(fits, key=lambda at: fits[at].likelihood.value)
        for at in (best - reach, best + reach):
            if at not in fits:
                moved = replace(law, first=at, last=at + law.last - law.first)
                fits[at] = less.refitted(less.model.with_terms(replace(term, law=moved)))
        reach *= 0.5
    times = np.array(sorted(fits))
    logs = np.array([fits[float(at)].likelihood.value for at in times])
    best = float(times[np.argmax(logs)])
    weights = np.exp(logs - logs.max()) * np.gradient(times)
    variance = float(np.sum(weights * (times - best) ** 2) / np.sum(weights))
    return fits[best], max(math.sqrt(variance), _TIME_TOLERANCE_S)


def _step(time_s: Float64Array, at: float, ramp_s: float) -> Float64Array:
    return np.clip((time_s - at) / ramp_s + 0.5, 0.0, 1.0)


def _law(ground: Ground, low: float, high: float, functions: Float64Array, stds: Float64Array) -> Law:
    return Law(
        ground.quantity, ground.acts_as, low, high,
        tuple(tuple(float(value) for value in row) for row in functions), tuple(float(std) for std in stds),
        ground.column, ground.slot,
    )  # fmt: skip


def _term(law: Law) -> Term:
    nothing = (0.0,) * len(law.functions)
    return Term(LEARNED, nothing, nothing, law=law)


def _covariance(ground: Ground, places: Float64Array, smooth: float) -> Float64Array:
    """Matern 5/2 of unit variance. Either side of zero is its own; of a current both begin with nothing there."""
    length = smooth * float(np.ptp(np.abs(places) if ground.quantity in _BOTH_SIDES else places))

    def alike(apart: Float64Array) -> Float64Array:
        scaled = math.sqrt(5.0) * np.abs(apart) / length
        return np.asarray((1.0 + scaled + scaled**2 / 3.0) * np.exp(-scaled))

    found = alike(places[:, None] - places)
    if ground.quantity not in _BOTH_SIDES:
        return found
    if ground.quantity == "current_along_motion":
        found = found - np.outer(alike(places), alike(places))
    return np.where(np.sign(places)[:, None] == np.sign(places), found, 0.0)


def _unfollowed(covariance: Float64Array, ground: Ground, places: Float64Array) -> Float64Array:
    """A covariance over places (k, k) without what the four parameters follow, weighed by where the record was."""
    if not ground.followed:
        return covariance
    edges = np.concatenate(([-np.inf], 0.5 * (places[1:] + places[:-1]), [np.inf]))
    weights = np.histogram(ground.at, edges)[0] + 1.0e-3 * ground.at.size / places.size
    if ground.quantity in _BOTH_SIDES:  # what is even has no odd part then
        weights = weights + weights[::-1]
    sizes = np.abs(places) if ground.quantity == "speed" else places  # Coulomb and viscous friction; a motor gain
    F = np.column_stack([(sizes / max(float(np.max(np.abs(sizes))), 1.0e-300)) ** power for power in ground.followed])
    free = np.eye(places.size) - F @ np.linalg.solve(F.T @ (weights[:, None] * F), F.T * weights)
    return free @ covariance @ free.T


def _root(covariance: Float64Array) -> Float64Array:
    """R (k, r) with R R' the covariance, but for what is next to nothing of it."""
    sizes, curves = np.linalg.eigh(covariance)
    kept = sizes > 1.0e-6 * sizes[-1]
    return np.asarray(curves[:, kept] * np.sqrt(sizes[kept]))


def _curves(covariance: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Independent functions (m, k) of unit mean square, and their deviations (m,), the greatest first."""
    sizes, curves = np.linalg.eigh(covariance)
    order = np.argsort(-sizes)[:_MOST_CURVES]
    order = order[sizes[order] > _LEAST_SHARE * sizes[order[0]]]
    count = covariance.shape[0]
    return math.sqrt(count) * curves[:, order].T, np.sqrt(sizes[order] / count)
