"""What becomes of a candidate effect: one table of the words in `decision`, and of what they come down to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

Standing = Literal["added", "related", "rejected", "untestable"]

ADDED = "added"
GIVEN = "in the model already"
UNTESTABLE = "not testable"
NOT_SIGNIFICANT = "not significant"
TOO_SMALL = "too small to matter"
IMPOSSIBLE = "of a size that no machine has"
NOT_CONFIRMED = "not confirmed"
PARTIAL = "explains only part of the residual"
NO_GRID = "no grid coarser than the noise"
_EXPLAINED, _ALIKE = "explained by ", "indistinguishable from "

_STANDINGS: dict[str, Standing] = {
    ADDED: "added",
    GIVEN: "added",
    UNTESTABLE: "untestable",
    _EXPLAINED: "related",
    _ALIKE: "related",
}  # by how a decision begins; any other is a rejection


def standing_of(candidate: Mapping[str, Any]) -> Standing:
    """What a candidate's decision comes down to."""
    decision = str(candidate.get("decision") or "")
    return next((found for words, found in _STANDINGS.items() if decision.startswith(words)), "rejected")


def explained_by(names: Sequence[str]) -> str:
    """The decision about an effect whose gain others have in full."""
    return _EXPLAINED + ", ".join(names)


def explanations(decision: str) -> list[str]:
    """The names in `explained_by`; none in any other decision."""
    return decision.removeprefix(_EXPLAINED).split(", ") if decision.startswith(_EXPLAINED) else []


def indistinguishable_from(name: str) -> str:
    """The decision about an effect that fits as well as the one named."""
    return _ALIKE + name
