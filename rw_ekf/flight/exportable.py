"""Which models can be printed as C, and what of one is: the filter's start, its constants, its effects."""

from __future__ import annotations

import ast
from collections.abc import Collection

from rw_ekf.c_code.python_source import source_of
from rw_ekf.errors import BadInputError
from rw_ekf.flight.c_files import Estimator
from rw_ekf.flight.onboard import onboard_of
from rw_ekf.model.effect import Term
from rw_ekf.model.effect_kinds import (
    CurrentEffect,
    DelayEffect,
    FormulaEffect,
    FrictionMemoryEffect,
    StaticEffect,
    WindowEffect,
)
from rw_ekf.model.state import STATE_SIZE
from rw_ekf.starting_point import FilterSetup
from rw_ekf.wheel.effect_table import EffectSet

_TAKEN = frozenset({"states", "h", "other_libm"})  # what follows RW_EKF_ in the printed names
_HIDDEN = "has a memory of its own, whose equations are stiff"
_PAST = "looks back at past currents, which the exported memory does not keep"
_NOT_EXPORTED: dict[type, str] = {
    CurrentEffect: _HIDDEN,
    FrictionMemoryEffect: _HIDDEN,
    DelayEffect: _PAST,
    WindowEffect: _PAST,
}


def estimator_of(setup: FilterSetup, name: str, *, single: bool) -> Estimator:
    """What is printed of a filter's start. Raises BadInputError, naming the effect, for what cannot be.

    name: of the model, for messages. single: reals are float, and times count from each reading on.
    """
    for term in setup.effects.state_terms:
        why = _refused(term, single=single)
        if why is not None:
            raise BadInputError(
                f"{name}: the effect {term.id} {why}: it cannot be exported as C. Fit the wheel again without it, "
                "or run the estimator itself"
            )
    refuse_names(setup.effects, _TAKEN, name)
    table = setup.effects.table(setup.effect_drift)
    known = table if table.size > STATE_SIZE else None
    constants = setup.constants
    constants = constants._replace(speed_variance=constants.speed_variance + setup.effects.reading_variance)
    belief = setup.prior
    return Estimator(onboard_of(belief.mean, belief.covariance, constants, known), constants, known, setup.state_names)


def refuse_names(effects: EffectSet, taken: Collection[str], name: str) -> None:
    """Raises BadInputError for an effect of one's own whose id is something else in what is exported."""
    for term in effects.state_terms:
        if issubclass(term.effect, FormulaEffect) and term.id in taken:
            raise BadInputError(
                f"{name}: the id of your effect {term.id} is the name of something else in the export: give it another "
                "in the model (docs/own-effects.md)"
            )


def _refused(term: Term, *, single: bool) -> str | None:
    """Why an effect is not exported; None where it is."""
    for kind, why in _NOT_EXPORTED.items():
        if issubclass(term.effect, kind):
            return why
    if single and reads(term, "time"):
        return "is a function of the time, which single precision does not keep (leave out --float)"
    return None


def reads(term: Term, quantity: str) -> bool:
    """Whether an effect is a function of "time", "temperature" or "angle"."""
    if term.law is not None:
        return term.law.quantity == quantity
    if issubclass(term.effect, FormulaEffect):
        return quantity in term.effect.formula.tree.names()
    if not issubclass(term.effect, StaticEffect):
        return False
    tree = source_of(term.effect.contribution).tree
    return any(isinstance(node, ast.Attribute) and node.attr == quantity for node in ast.walk(tree))
