"""What a contest came to: one row a scheme and noise, as a document and as tables, for a terminal and for a page."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any, NamedTuple

from rw_ekf.attitude_bench.contest import Contest, Entry
from rw_ekf.attitude_bench.metrics import RECOVERED_DEG, WINDOW_S, Metrics
from rw_ekf.attitude_bench.scenario import Scenario
from rw_ekf.control.compensation.schemes import SCHEMES

_WIDEST = 24  # characters of a terminal's column


@dataclass(frozen=True)
class Table:
    """Heads, units and rows of texts; the first columns are words, set to the left."""

    title: str
    heads: tuple[str, ...]
    units: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: int  # how many columns are words
    notes: tuple[str, ...] = ()

    def text(self) -> str:
        """For a terminal."""
        lines = [tuple(map(_shortened, line)) for line in (self.heads, self.units, *self.rows)]
        widths = [max(len(line[i]) for line in lines) for i in range(len(self.heads))]
        shown = [
            "  ".join(f"{cell:{'<' if i < self.words else '>'}{widths[i]}}" for i, cell in enumerate(line))
            for line in lines
        ]
        return "\n".join([self.title, *(f"  {line}".rstrip() for line in shown), *self.notes]) + "\n"

    @property
    def headings(self) -> list[str]:
        """For a page: heads with their units."""
        return [f"{head} [{unit}]" if unit else head for head, unit in zip(self.heads, self.units, strict=True)]


def _shortened(cell: str) -> str:
    return cell if len(cell) <= _WIDEST else cell[: _WIDEST - 1] + "…"


def shown(value: float, places: int) -> str:
    """A figure; a dash where there is none."""
    return f"{value:.{places}f}" if math.isfinite(value) else "-"


def texts(tables: Sequence[Table]) -> str:
    """Several, an empty line between."""
    return "\n".join(table.text() for table in tables)


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
        worst_deg=max(peak if math.isfinite(peak) else math.inf for peak in peaks),
        seeds=sum(math.isfinite(peak) for peak in peaks),
        **{name: _middle([getattr(run, name) for run in runs]) for name in Metrics._fields},
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


def tables_of(rows: Sequence[Row], scenario: Scenario) -> list[Table]:
    """The figures of a contest, one table for each noise."""
    return [_table(noise_rpm, rows) for noise_rpm in scenario.cycle.speed_noise_rpm]


def _table(noise_rpm: float, rows: Sequence[Row]) -> Table:
    here = [row for row in rows if row.noise_rpm == noise_rpm]
    base_deg = next((row.peak_deg for row in here if row.scheme == BASELINE), math.nan)
    return Table(
        title=f"{noise_rpm:g} rpm of speed noise",
        heads=("scheme", "source", "parameters", *(column.name for column in _COLUMNS)),
        units=("", "", "", *(column.unit for column in _COLUMNS)),
        rows=tuple(
            (
                row.scheme,
                SCHEMES[row.scheme].source,
                SCHEMES[row.scheme].parameters_from,
                *(shown(column.of(row, base_deg), column.places) for column in _COLUMNS),
            )
            for row in here
        ),
        words=3,
    )


class _Column(NamedTuple):
    """A figure as tables show it."""

    name: str
    unit: str
    places: int
    of: Callable[[Row, float], float]  # of a row and the baseline's peak [deg]


_COLUMNS = (
    _Column("peak", "deg", 4, lambda row, _: row.peak_deg),
    _Column("worst", "deg", 4, lambda row, _: row.worst_deg),
    _Column("ratio", "1:", 1, lambda row, base: base / row.peak_deg if row.peak_deg > 0.0 else math.nan),
    _Column("steady", "deg", 4, lambda row, _: row.steady_deg),
    _Column("recover", "s", 1, lambda row, _: row.recover_s),
    _Column("stop", "s", 2, lambda row, _: row.stop_s),
    _Column("effort", "A s", 2, lambda row, _: row.effort_A_s),
    _Column("chatter", "A/s", 4, lambda row, _: row.chatter_A_per_s),
    _Column("impulse", "mNms", 3, lambda row, _: 1e3 * row.impulse_Nms),
)
LEGEND = (
    f"peak: largest attitude error in the {WINDOW_S:g} s from the reversal on; worst: of all seeds; ratio: of "
    f"{BASELINE}'s peak to it; recover: until the error stays below {RECOVERED_DEG:g} deg, - where it does not within "
    f"{WINDOW_S:g} s."
)
