"""What becomes of a candidate effect: one table of the words in `decision`, and of what they come down to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

Standing = Literal["added", "related", "rejected", "untestable"]

ADDED = "added"
GIVEN = "in the model already"
UNTESTABLE = "not testable"
NOT_SIGNIFICANT = "not significant"
TOO_SMALL = "too small to matter"
IMPOSSIBLE = "of a size that no machine has"
NOT_BESIDE_MOTION = "nothing beside smooth laws of the motion"
NOT_CONFIRMED = "not confirmed"
PARTIAL = "explains only part of the residual"
NO_GRID = "no grid coarser than the noise"
HARMLESS_GRID = "a grid, but held-out readings are missed by more"
EXPLAINED, ALIKE = "explained by ", "indistinguishable from "  # and names

_STANDINGS: dict[str, Standing] = {
    ADDED: "added",
    GIVEN: "added",
    UNTESTABLE: "untestable",
    EXPLAINED: "related",
    ALIKE: "related",
}  # by how a decision begins; any other is a rejection


def standing_of(candidate: Mapping[str, Any]) -> Standing:
    """What a candidate's decision comes down to."""
    decision = str(candidate.get("decision") or "")
    return next((found for words, found in _STANDINGS.items() if decision.startswith(words)), "rejected")
