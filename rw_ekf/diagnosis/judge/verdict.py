"""From fits to a verdict: what is named, what cannot be told apart, and one sentence a person can act on."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from rw_ekf.arrays import Float64Array
from rw_ekf.diagnosis.search.confounding import quantity_of, separates
from rw_ekf.diagnosis.search.trial import Selection
from rw_ekf.effects.catalogue import CATALOGUE
from rw_ekf.likelihood.fitting import Fit
from rw_ekf.model.effect import RecordFacts, Term
from rw_ekf.numbers import number_text
from rw_ekf.units import rad_s_from_rpm

_FIGURES = (
    ("free_run_rms_rpm", "free-run error"),
    ("horizon_20s_rms_rpm", "error 20 s ahead"),
    ("one_step_rms_rpm", "one-step error"),
)
_GROUP = 3  # at most so many are named together


@dataclass
class Verdict:
    """The `verdict` object, and how each effect's candidate was decided."""

    kind: str
    effects: list[str] = field(default_factory=list)
    indistinguishable: list[list[str]] = field(default_factory=list)
    statement: str = ""

    def document(self) -> dict[str, Any]:
        """The object of the diagnosis document."""
        return {
            "kind": self.kind,
            "effects": self.effects,
            "indistinguishable": self.indistinguishable,
            "statement": self.statement,
        }


def _with_covariances(fit: Fit, name: str) -> list[tuple[int, Term, Float64Array]]:
    """Terms of an effect in the order of use: (number among all, term, covariance of its coefficients)."""
    return [
        (number, term, fit.likelihood.covariance[at, at])
        for number, (term, at) in enumerate(fit.model.placed)
        if term.id == name
    ]


def described(fit: Fit, name: str) -> dict[str, Any]:
    """`parameters` of a candidate that was fitted, with standard deviations; the strongest term of several first."""
    found: dict[str, Any] = {}
    terms = sorted(_with_covariances(fit, name), key=lambda item: -item[1].size)
    for count, (number, term, covariance) in enumerate(terms, start=1):
        parameters = dict(term.described(covariance))
        for at, (i, j) in enumerate(fit.model.refined, start=fit.model.known):
            if i == number:
                constant = term.effect.constants[j].name
                parameters[constant] = {**parameters[constant], "std": float(fit.std[at])}
        found |= {key if count == 1 else f"{key}_{count}": value for key, value in parameters.items()}
    return found


def sentence(fit: Fit, name: str, facts: RecordFacts) -> str:
    """What was found of one effect, its size as a share of the friction that the final model has."""
    facts = replace(facts, friction=fit.model.parameters)
    terms = _with_covariances(fit, name)  # pieces of a broken line are in the order of time
    if CATALOGUE[name].repeats:
        terms.sort(key=lambda item: -item[1].size)
    return "; ".join(term.sentence(covariance, facts) for _, term, covariance in terms)


def grouped(selection: Selection, chosen: list[str]) -> list[list[str]]:
    """Each effect with those that the data cannot tell from it."""
    groups: list[list[str]] = []
    for name in chosen:
        rivals = []
        told = {other for group in groups for other in group} & selection.constructed.get(name, set())
        for fit in selection.rivals.get(name, []):
            rivals += [other for other in fit.model.effects.ids if other not in chosen and other not in told]
        if rivals:
            groups.append([name, *dict.fromkeys(rivals)][:_GROUP])
    return groups


def separation(group: list[str], selection: Selection) -> str:
    """What would tell the members of a group apart."""
    first, *others = group
    same = selection.constructed.get(first, set())
    ways = dict.fromkeys(
        separates(quantity_of(CATALOGUE[first]))
        if other in same
        else CATALOGUE[first].confounded.get(other)
        or CATALOGUE[other].confounded.get(first)
        or CATALOGUE[other].excitation
        for other in others
    )
    return f"{' or '.join(group)} fit alike; what separates them: {'; '.join(ways)}"


def improvement(before: dict[str, Any], after: dict[str, Any], seconds: float, *, wheel_units: bool) -> str:
    """Free-run error before and after, in a subclause; a shorter horizon where no stretch is free."""
    for key, words in _FIGURES:
        if before.get(key) is None or after.get(key) is None:
            continue
        old, new = before[key], after[key]
        if wheel_units:
            return f"{words} {number_text(old)} -> {number_text(new)} rpm on {seconds:.0f} s held out"
        change = f"{number_text(rad_s_from_rpm(old))} -> {number_text(rad_s_from_rpm(new))}"
        return f"{words} {change} rad/s (or m/s) on {seconds:.0f} s held out"
    return f"nothing held out to judge it by in {seconds:.0f} s"
