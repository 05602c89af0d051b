"""Something that is over at once: a knock, or a command that came late or not at all.

Of what is shorter than a record resolves, neither how long it lasted nor what it acted on is known, but by how much it
moved the speed. A torque within one interval says that with two numbers, and goes first where a longer event is not
clearly likelier.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.diagnosis.hypotheses.joint_regressors import evidence_of_drawn
from rw_ekf.diagnosis.hypotheses.law_grounds import LAW_LOG_ODDS, Ground, Nameless, grounds
from rw_ekf.diagnosis.hypotheses.noise_ratios import Profiled
from rw_ekf.diagnosis.thresholds import INDISTINGUISHABLE
from rw_ekf.effects.catalogue import SPELL
from rw_ekf.effects.spell import VALUES
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import RecordFacts, Term
from rw_ekf.model.law import Law

_BRIEF_S = 20.0  # of a spell, or three decays: what lasts longer is no instant, and is not tested as one
_INTERVALS = 250  # that are tested for one event; where there are more, evenly spread
_PLACES, _CELLS = 600, 8_000_000  # in a record, at which several are sought; of all their columns: 64 MB
_MOST = 12  # of these


def likeliest_impulse(profiled: Profiled, wanted: Iterable[Ground], begins_s: float, ends_s: float) -> Nameless | None:
    """The likeliest torque within one interval, about what lasts from one time to another; None if that is long."""
    ground, length = _timed(wanted), ends_s - begins_s
    if length > _BRIEF_S or ground is None:
        return None
    ended = profiled.fit.linearised.record.course.time_s
    near = (ended > begins_s - length) & (ground.at < ends_s + length) & (ended > ground.at) & (ground.slope != 0.0)
    inside = np.flatnonzero(near)
    step = -(-inside.size // _INTERVALS)
    inside = inside[:: max(step, 1)]
    if not inside.size:
        return None
    columns = _columns(ground, inside)
    _, squares, products = profiled.sums_of_each(profiled.own, columns)
    gains = profiled.own_gains(squares, products)
    best = int(np.argmax(gains))
    of_each = [profiled.sums(i, columns[:, best : best + 1]) for i in range(len(profiled.ratios))]
    factor, deviation = evidence_of_drawn(profiled, [(sums.gram, sums.products) for sums in of_each])
    weights = np.exp(gains - gains[best])
    factor += math.log(step * float(weights.sum()) / ended.size)
    at = int(inside[best])
    middles = 0.5 * (ground.at[inside] + ended[inside])
    spread = np.sum(weights * (middles - middles[best]) ** 2) / weights.sum() + (ended[at] - ground.at[at]) ** 2 / 12.0
    law = _law(ground, ended, at, deviation)
    std = math.sqrt(float(spread))
    return Nameless(ground, factor, Term(SPELL, (0.0,), (0.0,), law=replace(law, spread=(std, std))))


def at_once(less: Fit, fit: Fit, name: str, facts: RecordFacts) -> Fit | None:
    """A brief event as an impulse, unless the event is clearly likelier; less: without it."""
    term = fit.model.of(name)[0]
    onset, decay = term.effect.lasts(term.shape)
    if 3.0 * decay > _BRIEF_S:
        return None
    found = likeliest_impulse(Profiled(less), grounds(less, facts, ()), onset, onset + 3.0 * decay)
    if found is None:
        return None
    impulse = less.refitted(less.model.with_terms(found.term))
    return impulse if impulse.likelihood.value > fit.likelihood.value - INDISTINGUISHABLE else None


def impulses_together(less: Fit, facts: RecordFacts) -> Fit | None:
    """A fit with all impulses that stand out at once; None if that is no more than one.

    Beside each other they pass for torque noise, in which none stands out. So they are picked one after the other at
    each ratio of noises, down to hardly any torque noise, as long as each gains more than a law is worth at so many
    places (orthogonal matching pursuit: Pati, Rezaiifar & Krishnaprasad 1993).
    """
    ground = _timed(grounds(less, facts, ()))
    if ground is None:
        return None
    profiled, ended = Profiled(less), less.linearised.record.course.time_s
    moves = np.flatnonzero((ended > ground.at) & (ground.slope != 0.0))
    step = -(-moves.size // min(_PLACES, max(_CELLS // ground.at.size, 1)))
    found = [(*_pursued(profiled, i, ground, moves[::step]), i) for i in range(len(profiled.ratios))]
    _, rows, ratio = max(found)
    if len(rows) < 2:
        return None
    rows = _refined(profiled, ratio, ground, rows, moves, step)
    _, gram, products = profiled.sums(ratio, _columns(ground, rows))
    deviation = float(np.sqrt(np.mean(np.linalg.lstsq(gram, products)[0] ** 2)))
    period = float(np.median(np.diff(ended)))
    terms = [
        Term(SPELL, (0.0,), (0.0,), law=replace(_law(ground, ended, row, deviation), spread=(period, period)))
        for row in rows
    ]
    return less.refitted(less.model.with_terms(*terms))


def _pursued(profiled: Profiled, i: int, ground: Ground, places: Int64Array) -> tuple[float, list[int]]:
    """How likely the impulses are that are picked among some intervals at the i-th ratio, and which these are."""
    G = profiled.beside_own(i, _columns(ground, places))
    G /= np.maximum(np.linalg.norm(G, axis=0), 1.0e-300)
    cost = math.log(places.size) - LAW_LOG_ODDS
    left, taken, Q = profiled.residuals[i], list[int](), np.zeros((G.shape[0], 0))
    best, found = float(profiled.value(i, 0.0)), 0
    for count in range(1, _MOST + 1):
        j = int(np.argmax(np.abs(left @ G)))
        g = G[:, j] - Q @ (Q.T @ G[:, j])
        Q = np.column_stack((Q, g / max(float(np.linalg.norm(g)), 1.0e-300)))
        left = left - Q[:, -1] * float(Q[:, -1] @ left)
        taken.append(int(places[j]))
        merit = float(profiled.value(i, profiled.rss[i] - float(left @ left))) - cost * count
        if merit > best:
            best, found = merit, count
    return best, taken[:found]


def _refined(profiled: Profiled, i: int, ground: Ground, rows: list[int], moves: Int64Array, step: int) -> list[int]:
    """Each of some impulses in the likeliest interval about the one that was picked, the others as they are."""
    for number, row in enumerate(rows):
        others = [*rows[:number], *rows[number + 1 :]]
        near = moves[(np.abs(moves - row) <= 2 * step) & ~np.isin(moves, others)]
        near = near[:: -(-near.size // _INTERVALS)]
        Q = np.linalg.qr(profiled.beside_own(i, _columns(ground, others)))[0]
        G = profiled.beside_own(i, _columns(ground, near))
        G -= Q @ (Q.T @ G)
        left = profiled.residuals[i] - Q @ (Q.T @ profiled.residuals[i])
        gains = (left @ G) ** 2 / np.maximum(np.einsum("nm,nm->m", G, G), 1.0e-300)
        rows = [*rows[:number], int(near[np.argmax(gains)]), *rows[number + 1 :]]
    return rows


def _timed(wanted: Iterable[Ground]) -> Ground | None:
    """A torque over time; where a wheel turns one way, and no torque is sought, a drag."""
    timed = {ground.acts_as: ground for ground in wanted if ground.quantity == "time"}
    return timed.get("torque", timed.get("drag"))


def _columns(ground: Ground, rows: Sequence[int] | Int64Array) -> Float64Array:
    """Regressors (n, m) of impulses in some intervals."""
    columns = np.zeros((ground.at.size, len(rows)))
    columns[rows, np.arange(len(rows))] = ground.slope[rows]
    return columns


def _law(ground: Ground, ended: Float64Array, row: int, deviation: float) -> Law:
    """The law of an impulse in one interval."""
    return ground.law(float(ground.at[row]), float(ended[row]), np.array([VALUES]), np.array([deviation]))
