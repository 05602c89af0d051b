"""All that is made of what was found, before it is written down."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rw_ekf.diagnosis.checks.excess_noise import Noises
from rw_ekf.diagnosis.checks.heldout import Performance
from rw_ekf.diagnosis.checks.reading_grid import Lattice
from rw_ekf.diagnosis.investigate.found import Found
from rw_ekf.diagnosis.verdict.explanations import Explanation
from rw_ekf.diagnosis.verdict.verdict import Verdict

if TYPE_CHECKING:
    from rw_ekf.wheel.model_file import WheelModel


@dataclass(frozen=True)
class Judged:
    """All that a document says of a record, each part a function of what was found."""

    found: Found
    before: Performance
    after: Performance
    lattice: Lattice | None  # None: no grid that is named
    weighed: list[Explanation]
    noise: Noises
    tests: dict[str, Any]  # of the residual
    uneven: str | None
    verdict: Verdict
    model: WheelModel | None
    refusal: str | None  # why no model is written

    @property
    def is_better(self) -> bool:
        """Whether there is a model that is better than the base."""
        return self.verdict.kind == "effect" or self.model is not None
