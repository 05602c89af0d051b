"""What a hypothesis has to pass to stand, whatever its likelihood; each check one function of a row and the record."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from rw_ekf.diagnosis.checks.confirmation import veto
from rw_ekf.diagnosis.checks.cross_fit import disputed_share
from rw_ekf.diagnosis.checks.heldout import gain_over
from rw_ekf.diagnosis.hypotheses.candidates import p_value, threshold
from rw_ekf.diagnosis.hypotheses.contenders import Search
from rw_ekf.diagnosis.hypotheses.fixed_size_fits import knows_size
from rw_ekf.diagnosis.hypotheses.selection import Selection
from rw_ekf.diagnosis.prepare.preparation import Prepared
from rw_ekf.diagnosis.standing import Decision, Reason, explained_by
from rw_ekf.diagnosis.thresholds import LAW_GAINS, LEAST_SIGMAS, MOST_DISPUTED, SIGNIFICANT_P
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect_kinds import LawEffect, StribeckEffect


@dataclass(frozen=True)
class Check:
    """One test of one effect of a hypothesis, and its result."""

    name: str
    effect: str
    value: float | None  # None: not one number
    limit: float | None
    decision: Decision | None = None  # of the effect, where it does not pass

    @property
    def passed(self) -> bool:
        """Whether it stands."""
        return self.decision is None

    def document(self) -> dict[str, object]:
        """As the document has it."""
        return {
            "check": self.name, "effect": self.effect, "value": self.value, "limit": self.limit, "passed": self.passed,
            "words": "" if self.decision is None else self.decision.words,
        }  # fmt: skip


def checks(
    prepared: Prepared, search: Search, fit: Fit, effects: tuple[str, ...], selection: Selection
) -> Iterator[Check]:
    """Every check of every effect of a fitted model, what costs most last: the caller may stop at one that fails."""
    for name in effects:
        yield from of_size(search, fit, name)
        if not CATALOGUE[name].local_in_time:
            yield _missed(search, fit, name, [other for other in effects if other != name])
    for name in effects:
        if not CATALOGUE[name].local_in_time:  # an event is in one part only
            yield _agreed(prepared, fit, name)
    for name in effects:
        if issubclass(CATALOGUE[name], LawEffect) and not CATALOGUE[name].local_in_time:  # that foretells its time only
            yield _predicts(prepared, fit, name)
    for name in reversed(effects):  # the last to enter first
        trial = selection.trials.get(name)
        yield _held_out(prepared, fit, name, 1.0 if trial is None else trial.p_value)


def of_size(search: Search, fit: Fit, name: str) -> Iterator[Check]:
    """What is tested of an effect's size."""
    yield _matters(search, fit, name)
    yield _of_known_size(fit, name)
    yield _of_possible_size(search, fit, name)
    if issubclass(CATALOGUE[name], StribeckEffect):
        yield _breaks_away(fit, name)


def _breaks_away(fit: Fit, name: str) -> Check:
    """Whether a wheel of another Stribeck curve takes no less to start than to keep going, as far as that is known."""
    why = _unless(fit.below_coulomb <= LEAST_SIGMAS, Reason.IMPOSSIBLE)
    return Check("break-away below Coulomb friction, sigmas", name, fit.below_coulomb, LEAST_SIGMAS, why)


def _of_possible_size(search: Search, fit: Fit, name: str) -> Check:
    stands = fit.model.possible(name, search.facts)
    limit = CATALOGUE[name].largest(search.facts)
    return Check("size is possible", name, fit.size_of(name)[0], limit, _unless(stands, Reason.IMPOSSIBLE))


def _matters(search: Search, fit: Fit, name: str) -> Check:
    stands = fit.may_matter(name, search.facts)
    limit = CATALOGUE[name].smallest(search.facts)
    return Check("size matters", name, fit.size_of(name)[0], limit, _unless(stands, Reason.TOO_SMALL))


def _of_known_size(fit: Fit, name: str) -> Check:
    stands = knows_size(fit, name, LEAST_SIGMAS)
    return Check(
        "size is known, sigmas", name, fit.sigmas_of(name) or None, LEAST_SIGMAS, _unless(stands, Reason.UNKNOWN_SIZE)
    )


def _missed(search: Search, fit: Fit, name: str, others: list[str]) -> Check:
    """Whether the record requires it beside all else: an offset that friction by direction explains is not missed."""
    effect = CATALOGUE[name]
    statistic, _ = search.loss_without(fit, name)
    why = explained_by(*others) if others else Decision(Reason.NOT_SIGNIFICANT)
    stands = p_value(effect, statistic, search.facts, _freedom(fit, name)) < SIGNIFICANT_P
    limit = threshold(effect, search.facts)
    return Check("is missed without it", name, statistic, limit, None if stands else why)


def _freedom(fit: Fit, name: str) -> int:
    """Coefficients of a law; of any other effect as many as one term has."""
    terms = fit.model.of(name)
    return sum(len(term.values) for term in terms if term.law is not None) or CATALOGUE[name].components


def _agreed(prepared: Prepared, fit: Fit, name: str) -> Check:
    share = disputed_share(fit, name, prepared.split.fit)
    why = Decision(Reason.NOT_CONFIRMED, "the two parts of the record do not agree on it")
    return Check("share that the parts dispute", name, share, MOST_DISPUTED, None if share < MOST_DISPUTED else why)


def _held_out(prepared: Prepared, fit: Fit, name: str, p: float) -> Check:
    worse = veto(prepared, fit, name, p)
    why = None if worse is None else Decision(Reason.NOT_CONFIRMED, f"on the held-out part {worse}")
    return Check("held-out figures", name, None, None, why)


def _predicts(prepared: Prepared, fit: Fit, name: str) -> Check:
    """Whether a law without a formula, which may be anything, makes the held-out error smaller at all."""
    gained = gain_over(prepared, fit.without(name), fit)
    why = Decision(Reason.NOT_CONFIRMED, "no held-out error is smaller for it")
    stands = gained is None or gained >= LAW_GAINS
    return Check("held-out error falls, percent", name, gained, LAW_GAINS, None if stands else why)


def _unless(stands: bool, reason: Reason) -> Decision | None:
    return None if stands else Decision(reason)
