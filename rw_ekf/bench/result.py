"""What a contest came to: one row a scheme and noise, as a document and as a table for people."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from rw_ekf.bench.contest import Contest, Entry
from rw_ekf.bench.metrics import RECOVERED_DEG
from rw_ekf.bench.scenario import Scenario
from rw_ekf.control.compensation.registry import SCHEMES

SCHEMA = "rw_ekf.bench/1"
BASELINE = "pid_current"
_ORIGINS = {"adaptive": "estimator"}  # an estimator that begins with a poor prior is one


@dataclass(frozen=True)
class Row:
    """One scheme at one noise over all seeds; a figure is the median, NaN where more than half have none."""

    scheme: str
    noise_rpm: float
    peak_deg: float
    worst_deg: float
    steady_deg: float
    recover_s: float
    stop_s: float
    effort_A_s: float
    chatter_A_per_s: float
    impulse_Nms: float
    seeds: int  # that the wheel reversed in

    def document(self) -> dict[str, Any]:
        """As `bench --json` has it."""
        entry = SCHEMES[self.scheme]
        return {
            "scheme": self.scheme,
            "source": entry.source,
            "noise_rpm": self.noise_rpm,
            "peak_deg": {"median": self.peak_deg, "worst": self.worst_deg},
            "steady_deg": self.steady_deg,
            "recover_s": self.recover_s,
            "stop_s": self.stop_s,
            "effort_A_s": self.effort_A_s,
            "chatter_A_per_s": self.chatter_A_per_s,
            "impulse_Nms": self.impulse_Nms,
            "parameters_from": _ORIGINS.get(entry.parameters_from, entry.parameters_from),
        }


def rows_of(contest: Contest) -> list[Row]:
    """One row a scheme and noise, the schemes in the order of the registry."""
    schemes = [name for name in SCHEMES if any(entry.scheme == name for entry in contest.figures)]
    return [_row(contest, scheme, noise) for noise in contest.scenario.cycle.speed_noise_rpm for scheme in schemes]


def _row(contest: Contest, scheme: str, noise_rpm: float) -> Row:
    runs = [contest.figures[Entry(scheme, noise_rpm, seed)] for seed in range(1, contest.seeds + 1)]
    peaks = [run.peak_deg for run in runs]
    return Row(
        scheme=scheme,
        noise_rpm=noise_rpm,
        peak_deg=_middle(peaks),
        worst_deg=max(peak if math.isfinite(peak) else math.inf for peak in peaks),
        steady_deg=_middle([run.steady_deg for run in runs]),
        recover_s=_middle([run.recover_s for run in runs]),
        stop_s=_middle([run.stop_s for run in runs]),
        effort_A_s=_middle([run.effort_A_s for run in runs]),
        chatter_A_per_s=_middle([run.chatter_A_per_s for run in runs]),
        impulse_Nms=_middle([run.impulse_Nms for run in runs]),
        seeds=sum(math.isfinite(peak) for peak in peaks),
    )


def _middle(values: Sequence[float]) -> float:
    """Median; what has no number counts as endless, and NaN comes out where that is the median."""
    found = median(value if math.isfinite(value) else math.inf for value in values)
    return found if math.isfinite(found) else math.nan


def document_of(contest: Contest) -> dict[str, Any]:
    """The `rw_ekf.bench/1` document."""
    return {
        "schema": SCHEMA,
        "scenario": contest.scenario.model_dump(mode="json"),
        "seeds": contest.seeds,
        "schemes": [row.document() for row in rows_of(contest)],
    }


def table_text(rows: Sequence[Row], scenario: Scenario) -> str:
    """A table for a terminal, one part for each noise."""
    parts = []
    for noise_rpm in scenario.cycle.speed_noise_rpm:
        here = [row for row in rows if row.noise_rpm == noise_rpm]
        base = next((row.peak_deg for row in here if row.scheme == BASELINE), math.nan)
        lines = [
            f"speed noise {noise_rpm:g} rpm",
            f"  {'scheme':<20} {'source':<24} {'peak':>7} {'worst':>7} {'ratio':>6} {'steady':>7} {'recover':>7} "
            f"{'stop':>6} {'effort':>7} {'chatter':>8} {'impulse':>8}  parameters",
            f"  {'':<20} {'':<24} {'deg':>7} {'deg':>7} {'1:':>6} {'deg':>7} {'s':>7} "
            f"{'s':>6} {'A s':>7} {'A/s':>8} {'mNms':>8}",
        ]
        lines += [f"  {_line(row, base)}" for row in here]
        parts.append("\n".join(lines))
    parts.append(
        f"peak: largest attitude error in the 120 s from the reversal on; worst: of all seeds; ratio: of {BASELINE}'s "
        f"peak to it; recover: until the error stays below {RECOVERED_DEG:g} deg, - where it does not within 120 s."
    )
    return "\n\n".join(parts) + "\n"


def _line(row: Row, base_deg: float) -> str:
    entry = SCHEMES[row.scheme]
    source = entry.source if len(entry.source) <= 24 else entry.source[:23] + "…"
    ratio = base_deg / row.peak_deg if row.peak_deg > 0.0 else math.nan
    return (
        f"{row.scheme:<20} {source:<24} {_shown(row.peak_deg, 4):>7} {_shown(row.worst_deg, 4):>7} "
        f"{_shown(ratio, 1):>6} {_shown(row.steady_deg, 4):>7} {_shown(row.recover_s, 1):>7} "
        f"{_shown(row.stop_s, 2):>6} "
        f"{_shown(row.effort_A_s, 2):>7} {_shown(row.chatter_A_per_s, 4):>8} "
        f"{_shown(1e3 * row.impulse_Nms, 3):>8}  {entry.parameters_from}"
    )


def _shown(value: float, places: int) -> str:
    return f"{value:.{places}f}" if math.isfinite(value) else "-"
