"""What becomes of a candidate effect, and why: one table of the words that a document has for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Literal

Standing = Literal["added", "related", "rejected", "untestable"]


class Reason(Enum):
    """Why an effect is in the model or not; `{}` stands for what only the record knows."""

    ADDED = "added"
    GIVEN = "in the model already"
    UNTESTABLE = "not testable: {}"
    NOT_SIGNIFICANT = "not significant"
    TOO_SMALL = "too small to matter"
    UNKNOWN_SIZE = "of a size that the record does not settle"
    IMPOSSIBLE = "of a size that no machine has"
    NOT_BESIDE_MOTION = "nothing beside smooth laws of the motion"
    WAITS = "nothing beside a smooth effect of the {}"
    NOT_CONFIRMED = "not confirmed: {}"
    PARTIAL = "explains only part of the residual"
    NOT_LIKELY = "less likely than not"
    NO_GRID = "no grid coarser than the noise"
    HARMLESS_GRID = "a grid, but held-out readings are missed by more"
    EXPLAINED = "explained by {}"
    ALIKE = "indistinguishable from {}"
    LOOKS_LIKE = "looks like {}"


SMALL_OR_UNKNOWN = frozenset({Reason.TOO_SMALL, Reason.UNKNOWN_SIZE})  # refused, however sure that it is there


@dataclass(frozen=True)
class Decision:
    """A reason, and what the record says to it."""

    reason: Reason
    detail: str = ""
    instead: tuple[str, ...] = ()  # effects that have all of its gain, whatever becomes of them (`EXPLAINED`)

    @property
    def words(self) -> str:
        """As a document has it."""
        return self.reason.value.format(self.detail)


def explained_by(*names: str) -> Decision:
    """All of an effect's gain is these effects'."""
    return Decision(Reason.EXPLAINED, ", ".join(names), names)


_STANDINGS: dict[Reason, Standing] = {
    Reason.ADDED: "added",
    Reason.GIVEN: "added",
    Reason.UNTESTABLE: "untestable",
    Reason.EXPLAINED: "related",
    Reason.ALIKE: "related",
}  # any other is a rejection


def standing_of(candidate: Mapping[str, Any]) -> Standing:
    """What the decision about a candidate of a document comes down to."""
    words = str(candidate.get("decision") or "")
    return next(
        (found for reason, found in _STANDINGS.items() if words.startswith(reason.value.partition("{}")[0])), "rejected"
    )


def untestable_because(candidate: Mapping[str, Any]) -> str:
    """What a candidate of a document that is not testable needs."""
    return str(candidate["decision"]).removeprefix(Reason.UNTESTABLE.value.partition("{}")[0])
