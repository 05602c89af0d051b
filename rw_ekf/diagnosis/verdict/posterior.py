"""How probable each effect is, what is not in the catalogue included (docs/active-diagnosis.md).

Those of the explanations that were weighed follow from their evidence. What is in no catalogue has none; that it is
there is seen in what the residual's map still shows. The slope of that was fitted to simulated wheels, and tried on
others. A torque noise that is not the same everywhere counts half as much.
"""

from __future__ import annotations

import math

from rw_ekf.diagnosis.checks.command_periods import chance_of_answer
from rw_ekf.diagnosis.checks.excess_noise import Noises
from rw_ekf.diagnosis.checks.reading_grid import Lattice
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.thresholds import (
    BESIDE,
    ELSE_BIAS,
    ELSE_SLOPE,
    INDISTINGUISHABLE,
    NOISE_COUNTS,
    TEMPERATURE,
)
from rw_ekf.diagnosis.verdict.explanations import NONE, Explanation
from rw_ekf.effects.catalogue import CATALOGUE, GRID, LEARNED
from rw_ekf.effects.external_torque import ExternalTorque
from rw_ekf.model.effect_kinds import LawEffect

SOMETHING_ELSE = "something_else"
_MOST_DECADES = 8.0
_MOST_ODDS = 10.0  # log, of a law without a name
_LEAST = 1.0e-3  # less is left out


def posterior_of(
    found: Found,
    weighed: list[Explanation],
    lattice: Lattice | None,
    noise: Noises,
    residual_p: float,
    foretold: float,
) -> dict[str, float]:
    """Probability of each effect beyond the base model, of none, and of something else; they may come together.

    weighed: the explanations, the final model among them; lattice: None where the readings' grid is not named; noise:
    what the noises show; residual_p: of the clearest failed test of the residual, or 1; foretold: the share of the
    squares of the held-out error that is gone with what was found.
    """
    elsewhere = something_else(found, noise.p_value, residual_p)
    # What the readings' noise has swallowed stands beside an effect. What a torque noise has may be what an effect was
    # taken for; hardly where that foretells much.
    instead = something_else(found, noise.torque_p_value, residual_p) / (1.0 + BESIDE * foretold**2)
    answer = chance_of_answer(found.fit, found.prepared.record.course)
    chances: dict[str, float] = {}
    for item in weighed:
        for name in item.effects or (NONE,):
            doubt = instead if item.effects and found.new_ids else elsewhere
            share = 1.0 - doubt * ((1.0 - foretold) if name == LEARNED.id else 1.0)  # a curve claims no cause
            share *= 1.0 - (answer if name == ExternalTorque.id else 0.0)
            chances[name] = chances.get(name, 0.0) + share * item.posterior
    if lattice is not None:
        chances[GRID.id] = 1.0 / (1.0 + math.exp(-0.5 * (lattice.statistic + lattice.heldout_statistic)))
        chances[NONE] = 0.0
    kept = {
        name: chance for name, chance in chances.items() if name != NONE and (chance >= _LEAST or name in found.new_ids)
    }
    ranked = dict(sorted(kept.items(), key=lambda item: -item[1]))
    return {**ranked, NONE: chances.get(NONE, 0.0), SOMETHING_ELSE: max(elsewhere, answer)}


def something_else(found: Found, noise_p: float, residual_p: float) -> float:
    """Probability that the record holds what is in no catalogue, by what its map, noise or residual still show."""
    decades = _decades(min([residual_p, *(item.p_value for item in found.dependences)]))
    decades = max(decades, NOISE_COUNTS * _decades(noise_p))
    odds = ELSE_BIAS + ELSE_SLOPE * min(decades, _MOST_DECADES)
    if found.unnamed_odds is not None:
        odds = max(odds, min(found.unnamed_odds, _MOST_ODDS) / TEMPERATURE)
    return 1.0 / (1.0 + math.exp(-odds))


def unlikely(found: Found, posterior: dict[str, float]) -> list[str]:
    """Effects of a verdict that are, with all that cannot be distinguished from them, less likely than not."""
    return [name for name in found.new_ids if _with_rivals(found, name, posterior) < 0.5]


def _with_rivals(found: Found, name: str, posterior: dict[str, float]) -> float:
    # What is likelier than what stands by more than INDISTINGUISHABLE was refused there, and speaks for nothing named;
    # but for what the record has as one with it by construction, which only waited.
    rivals = {
        rival.name
        for rival in found.selection.rivals.get(name, ())
        if rival.constructed or rival.ahead < INDISTINGUISHABLE
    }
    if not issubclass(CATALOGUE[name], LawEffect):  # what a law without a formula may be is not what was named
        rivals = {other for other in rivals if not issubclass(CATALOGUE[other], LawEffect)}
    alike = {name, *rivals}
    return math.fsum(posterior.get(other, 0.0) for other in alike)


def _decades(p_value: float) -> float:
    return -math.log10(max(p_value, 1.0e-300))
