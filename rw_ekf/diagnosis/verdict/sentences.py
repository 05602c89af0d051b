"""Subclauses and sentences of a verdict: an effect's size, what it may be instead, what the held-out errors say."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from rw_ekf.diagnosis.checks.confirmation import for_want_of_knowledge
from rw_ekf.diagnosis.checks.heldout import ERRORS, telling_figure
from rw_ekf.diagnosis.hypotheses.confounding import quantity_of, separates
from rw_ekf.diagnosis.hypotheses.other_starts import LAW
from rw_ekf.diagnosis.hypotheses.random_walk import walk_of, without_walk
from rw_ekf.diagnosis.hypotheses.selection import Selection
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.thresholds import INDISTINGUISHABLE, LEAST_SIGMAS
from rw_ekf.diagnosis.verdict.formulas_in_band import readings
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.effects.learned_law import QUANTITY_WORDS
from rw_ekf.likelihood.fitting import Fit, FittedTerm
from rw_ekf.model.effect import RecordFacts
from rw_ekf.model.effect_kinds import LawEffect, WanderingEffect
from rw_ekf.numbers import chance_text, number_text, plus_minus
from rw_ekf.units import rad_s_from_rpm, rpm_from_rad_s

_REPORTED = ("free_run_rms_rpm", "horizon_20s_rms_rpm", "one_step_rms_rpm")  # the first of these that there is
_REPORTED_RATIO = 1.0e-3  # q dt / R: with less process noise nobody would see it in the speed
_SURE = 0.95  # probability of an order beside which no other is reported
_ORDERS_REPORTED = 4
_REPEATS_REPORTED = 3  # ripples, or torques with a period, the largest
_BLURRED = 0.25  # share by which squared errors held out grow for want of knowledge, and which is reported


def measured_by_little(found: Found, *, by_turns: bool) -> str:
    """A sentence where held-out errors are those of numbers that the other part hardly knows, else nothing."""
    if by_turns:
        return (
            " Half of this record knows too little of the numbers to foretell the other: each stretch held out is"
            " foretold by all the rest of the record."
        )
    excess = for_want_of_knowledge(found.prepared, without_walk(found.selection.final))
    if excess < _BLURRED:
        return ""
    return (
        " The part of the record that these errors' numbers come from knows them poorly: for that alone, errors held"
        f" out may well be {100.0 * (math.sqrt(1.0 + excess) - 1.0):.0f} % larger than the noise."
    )


def noise_text(found: Found) -> str:
    """Noise of the readings, and of the torque where anybody would see it in the speed, in the log's units."""
    noise, period = found.fit.noise, found.prepared.course.period_s
    sigma, wander = float(np.sqrt(noise.variance)), float(np.sqrt(noise.ratio * noise.variance / period))
    unit = "rad/s (or m/s)"
    if found.prepared.in_rpm:
        sigma, wander, unit = rpm_from_rad_s(sigma), rpm_from_rad_s(wander), "rpm"
    if noise.ratio < _REPORTED_RATIO:
        return f"{sigma:.3g} {unit}"
    return f"{sigma:.3g} {unit}, and a torque noise that moves the speed by {wander:.2g} in a second"


def sentence_of(fit: Fit, name: str, facts: RecordFacts) -> str:
    """What was found of one effect, its size as a share of the friction that the final model has."""
    facts = replace(facts, friction=fit.model.parameters)
    effect, terms = CATALOGUE[name], fit.terms_of(name)
    walk = walk_of(fit)
    if issubclass(effect, WanderingEffect) and walk is not None:
        return effect.sentence_of_pieces([item.term for item in terms], walk.rate, facts)
    if effect.repeats:
        terms.sort(key=lambda item: -item.term.size)
    described = terms[:_REPEATS_REPORTED] if effect.repeats else terms
    text = "; ".join(_each_once([item.term.sentence(item.covariance, facts) + _as_read(item) for item in described]))
    if more := len(terms) - len(described):
        text += f"; and {more} smaller one{'s' * (more > 1)}"
    # A bristle's length and damping do the same where all of its motion is slow: that there is one is known, no more.
    unsettled = not effect.linear and len(terms) == 1 and not fit.knows(name, LEAST_SIGMAS)
    return f"{text} (it is missed without it; how large it is, this record does not settle)" if unsettled else text


def _each_once(sentences: list[str]) -> list[str]:
    """The same, with words in brackets that all of them end with behind the last alone."""
    tails = {text[text.rfind(" (") :] if text.endswith(")") else "" for text in sentences}
    tail = tails.pop() if len(tails) == 1 else ""
    return [*(text.removesuffix(tail) for text in sentences[:-1]), *sentences[-1:]]


def lag_of(found: Found) -> str:
    """How late the temperature acts, in a subclause behind its laws; nothing where it is as it was read."""
    lag = found.prepared.temperature_lag
    if lag is None or not found.prepared.temperature_is_logged:
        return ""
    if lag.std_s == 0.0:
        return f"; the temperature that acts follows the log's with the lag of the model given, {lag.value_s:.4g} s"
    return f"; the temperature that acts follows the log's with a lag of {plus_minus(lag.value_s, lag.std_s)} s"


def _as_read(item: FittedTerm) -> str:
    """What a law without a formula may be, in a subclause."""
    law = item.term.law
    read = [] if law is None else readings(law, item.term.values, item.covariance)
    return f" (within its band it is {read[0].text})" if read else ""


def or_another_law(found: Found, name: str) -> str:
    """Which laws an effect may follow instead, in brackets, where it has several and one is not sure."""
    laws = found.laws.get(name, {})
    if max(laws.values(), default=1.0) > _SURE:
        return ""
    own = CATALOGUE[name].described(1.0, 1.0, found.reported.terms_of(name)[0].term.shape)[LAW]["value"]
    others = [f"{law} ({chance_text(chance)})" for law, chance in laws.items() if law != own]
    return f" (its law may also be {', '.join(others)})" if others else ""


def or_another_kind(found: Found, name: str) -> str:
    """What a law or a change may act on instead, in brackets, where other rows of the ledger are nearly as likely.

    Where the motion is the same all the while, what changed looks the same whatever it was.
    """
    terms = found.fit.model.of(name)
    effect = CATALOGUE[name]
    if not issubclass(effect, LawEffect) or len(terms) != 1 or not effect.has_a_kind(terms[0], found.prepared.facts):
        return ""
    own = found.ledger.row(found.fit)
    weights = {_kind(own.fit, name): own.weight}
    for row in found.ledger.rows:
        if sorted(row.effects) == sorted(own.effects) and row.weight > own.weight - INDISTINGUISHABLE:
            weights.setdefault(_kind(row.fit, name), row.weight)
    top = max(weights.values())
    total = math.fsum(math.exp(weight - top) for weight in weights.values())
    chances = {kind: math.exp(weight - top) / total for kind, weight in weights.items()}
    others = [f"{kind} ({chance_text(p)})" for kind, p in list(chances.items())[1:] if p > 1.0 - _SURE]
    return f" (it may also be {' or '.join(others)} instead)" if others else ""


def _kind(fit: Fit, name: str) -> str:
    """How a law acts, and what it follows where that is no time."""
    law = fit.model.of(name)[0].law
    assert law is not None
    acts = f"the {law.acts_as.replace('_', ' ')}"
    return acts if law.quantity == "time" else f"{acts} by {QUANTITY_WORDS.get(law.quantity, law.column)}"


def or_another_order(found: Found, name: str) -> str:
    """What is open of a ripple without a logged angle, in brackets: its order, unless it is sure, or its phase."""
    if not CATALOGUE[name].angular or found.prepared.angle_is_logged:
        return ""
    if max(found.orders.values(), default=1.0) > _SURE:
        return " (without a logged angle its phase is this record's: another one begins elsewhere in the turn)"
    listed = [f"{order:g} ({chance_text(probability)})" for order, probability in found.orders.items()]
    more = f" and {len(listed) - _ORDERS_REPORTED} others" if len(listed) > _ORDERS_REPORTED else ""
    return f" (without a logged angle its order may be {', '.join(listed[:_ORDERS_REPORTED])}{more})"


def separation(group: list[str], posterior: dict[str, float], selection: Selection) -> str:
    """What would distinguish the members of a group."""
    first, *others = group
    same = selection.one_by_construction(first)
    ways = dict.fromkeys(
        separates(quantity_of(CATALOGUE[first]))
        if other in same
        else CATALOGUE[first].confounded.get(other)
        or CATALOGUE[other].confounded.get(first)
        or CATALOGUE[other].excitation
        for other in others
    )
    chances = ", ".join(f"{name} {chance_text(posterior.get(name, 0.0))}" for name in group)
    return f"How probable each is: {chances}; what separates them: {'; '.join(ways)}"


def improvement(before: dict[str, Any], after: dict[str, Any], seconds: float, *, wheel_units: bool) -> str:
    """Free-run error before and after, in a subclause; a shorter horizon where no stretch is free."""
    telling = telling_figure(before, after)
    for key in _REPORTED:
        if before.get(key) is None or after.get(key) is None or (telling is not None and key != telling):
            continue
        old, new, words = before[key], after[key], ERRORS[key]
        if wheel_units:
            return f"{words} {number_text(old)} -> {number_text(new)} rpm on {seconds:.0f} s held out"
        change = f"{number_text(rad_s_from_rpm(old))} -> {number_text(rad_s_from_rpm(new))}"
        return f"{words} {change} rad/s (or m/s) on {seconds:.0f} s held out"
    return f"nothing held out to judge it by in {seconds:.0f} s"
