"""The tables of a proof: each mark with its count and interval, the confusion of effects, what went wrong."""

from __future__ import annotations

import math
import statistics
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from scipy.stats import binomtest

from rw_ekf.drivers.sim.plant_effects import CATALOGUE_IDS
from tools.proof.judge import OUTCOMES, Record, matched
from tools.proof.marks import MARKS
from tools.proof.plants import SEEN_CHI_SQUARE

VERDICTS = ("adequate", "unexplained", "insufficient_excitation")
REPORTED_WITHIN = 1.05  # free-run error after the diagnosis over that of a fit told the truth

Table = tuple[Sequence[str], list[Sequence[str]]]  # heading, rows


@dataclass(frozen=True)
class Share:
    """How many of how many, beside the mark."""

    title: str
    hits: int
    of: int
    mark: float | None = None
    at_most: bool = False

    @property
    def met(self) -> bool | None:
        """Whether the mark is reached; None where there is none, or nothing to judge by."""
        if self.mark is None or self.of == 0:
            return None
        share = self.hits / self.of
        return share <= self.mark if self.at_most else share >= self.mark

    def cells(self) -> tuple[str, ...]:
        """Title, count, per cent, 95 % interval (Clopper-Pearson), mark, verdict."""
        if self.of == 0:
            return self.title, "0 of 0", "", "", "", ""
        low, high = binomtest(self.hits, self.of).proportion_ci(0.95, "exact")
        sign = "<=" if self.at_most else ">="
        mark = "" if self.mark is None else f"{sign} {100.0 * self.mark:g} %"
        met = {None: "", True: "reached", False: "MISSED"}[self.met]
        percent = f"{100.0 * self.hits / self.of:.1f} %"
        return self.title, f"{self.hits} of {self.of}", percent, f"{100 * low:.1f} to {100 * high:.1f}", mark, met


def shares(records: Sequence[Record]) -> list[Share]:
    """Every mark that has records, and what stands beside it."""
    found: list[Share] = []
    for mark, kind in [*MARKS.items(), ("tty", None)]:
        mine = [record for record in records if record.mark == mark]
        if not mine:
            continue
        title, reach = (kind.title, kind.reach) if kind is not None else ("the whole way over a tty", None)
        if mark == "healthy":
            found.append(_share(title, mine, reach, _accused, at_most=True))
            found.append(_share("- of these by an effect", mine, None, lambda r: r.outcome == "accused" and r.named))
        elif mark == "pairs":
            found.append(_share(title, mine, reach, _both))
            found += _of_the_seen(mine, None, _both)
            found.append(_share("- both and nothing else", mine, None, _right))
        elif mark in {"id-5rpm", "p12-1rpm"}:
            # "Of what is detectable there at all": the mark stands at those.
            found.append(_share(title, mine, None, _right))
            found += _of_the_seen(mine, reach, _right)
        else:
            found.append(_share(title, mine, reach, _right))
            if mark not in {"foreign", "tty"}:
                found += _of_the_seen(mine, None, _right)
    reported = [ratio for record in records if (ratio := record.reported_ratio) is not None and _right(record)]
    if reported:
        title = "free-run error within 5 % of a fit told the truth"
        found.append(Share(title, sum(ratio <= REPORTED_WITHIN for ratio in reported), len(reported)))
    return found


def _of_the_seen(records: Sequence[Record], mark: float | None, hit: Callable[[Record], object]) -> list[Share]:
    """The same among the detectable, by the table of limits and by the excess chi-square."""
    seen = [record for record in records if record.detectable]
    excess = [r for r in records if r.excess_chi_square is not None and r.excess_chi_square >= SEEN_CHI_SQUARE]
    return [
        _share("- of the detectable (table of limits)", seen, mark, hit),
        _share(f"- of those with an excess chi-square above {SEEN_CHI_SQUARE:g}", excess, None, hit),
    ]


def _share(
    title: str, records: Sequence[Record], mark: float | None, hit: Callable[[Record], object], *, at_most: bool = False
) -> Share:
    return Share(title, sum(bool(hit(record)) for record in records), len(records), mark, at_most)


def _right(record: Record) -> bool:
    return record.outcome == "right"


def _both(record: Record) -> bool:
    return record.outcome in {"right", "right+extra"}


def _accused(record: Record) -> bool:
    return record.outcome in {"accused", "failed"}


def marks_table(records: Sequence[Record]) -> Table:
    """One row for each share."""
    return ("what", "count", "share", "95 % interval", "mark", ""), [share.cells() for share in shares(records)]


def outcomes_table(records: Sequence[Record]) -> Table:
    """Outcomes by mark, and the time a log took in a worker that is warm."""
    heading = ("mark", "logs", *OUTCOMES, "median s", "longest s")
    rows: list[Sequence[str]] = []
    for mark in dict.fromkeys(record.mark for record in records):
        mine = [record for record in records if record.mark == mark]
        counts = Counter(record.outcome for record in mine)
        times = [record.seconds for record in mine if not record.cold] or [math.nan]
        seconds = (f"{statistics.median(times):.1f}", f"{max(times):.1f}")
        rows.append((mark, str(len(mine)), *(str(counts[outcome] or "") for outcome in OUTCOMES), *seconds))
    return heading, rows


def injected(record: Record) -> str:
    """The row of the confusion table that a record belongs to."""
    if record.expects == "adequate":
        return "healthy"
    return " + ".join(record.expected) if record.expected else record.effects[0].partition(":")[0]


def confusion_table(records: Iterable[Record]) -> Table:
    """Injected against named, of wheels with one effect, none, or one outside the catalogue.

    An effect that was named by its group of indistinguishable ones counts as itself. Columns of effects are numbered
    as the rows are.
    """
    single = [record for record in records if len(record.expected) < 2 and record.kind is not None]
    numbers = [str(number) for number in range(1, len(CATALOGUE_IDS) + 1)]
    heading = ("injected", "logs", *numbers, "adequate", "unexpl.", "insuff.")
    order = [*CATALOGUE_IDS, *dict.fromkeys(injected(r) for r in single if injected(r) not in CATALOGUE_IDS)]
    rows: list[Sequence[str]] = []
    for name in order:
        mine = [record for record in single if injected(record) == name]
        if not mine:
            continue
        counts = Counter(column for record in mine for column in _columns(record))
        label = f"{CATALOGUE_IDS.index(name) + 1} {name}" if name in CATALOGUE_IDS else name
        cells = [str(counts[column] or "") for column in (*CATALOGUE_IDS, *VERDICTS)]
        rows.append((label, str(len(mine)), *cells))
    return heading, rows


def _columns(record: Record) -> list[str]:
    """Columns that a record counts in: the effects it names, or its verdict."""
    if record.kind != "effect":
        return [str(record.kind)]
    found, extra = matched(tuple(record.expected), record.named, record.indistinguishable)
    return [*found, *extra]


def effects_table(records: Iterable[Record]) -> Table:
    """By mark and by what was injected: how many were right, by size, and what was named instead."""
    groups: dict[tuple[str, str], list[Record]] = {}
    for record in records:
        groups.setdefault((record.mark, injected(record)), []).append(record)
    rows: list[Sequence[str]] = []
    for (mark, name), mine in groups.items():
        sizes = sorted({record.size_percent for record in mine if record.size_percent is not None})
        by_size = []
        for size in sizes:
            of_size = [record for record in mine if record.size_percent == size]
            by_size.append(f"{size:g} %: {sum(map(_right, of_size))}/{len(of_size)}")
        instead = Counter(stated(record) for record in mine if not _right(record))
        reported = "; ".join(f"{what} {count}" for what, count in instead.most_common(4))
        rows.append((mark, name, f"{sum(map(_right, mine))} of {len(mine)}", ", ".join(by_size), reported))
    return ("mark", "injected", "right", "by size", "said instead"), rows


def stated(record: Record) -> str:
    """What a verdict named, in few words."""
    if record.kind is None:
        return "failed"
    if record.kind != "effect":
        return record.kind + (f" ({' + '.join(record.named)})" if record.named else "")
    return " + ".join(record.named)


def not_right_table(records: Iterable[Record]) -> Table:
    """The cases to look into."""
    rows: list[Sequence[str]] = []
    for record in records:
        if _right(record):
            continue
        excess = "" if record.excess_chi_square is None else f"{record.excess_chi_square:.0f}"
        ratio = "" if record.table_ratio is None else f"{record.table_ratio:.1f}"
        rows.append(
            (record.case, record.profile, f"{record.noise_rpm:.2g}", ratio, excess, record.outcome, stated(record))
        )
    return ("case", "profile", "noise rpm", "of limit", "excess", "outcome", "said"), rows


def as_text(table: Table) -> str:
    """A table for a terminal."""
    heading, rows = table
    widths = [max(len(str(row[i])) for row in (heading, *rows)) for i in range(len(heading))]
    lines = [
        "  ".join(str(cell).ljust(width) for cell, width in zip(row, widths, strict=True)) for row in (heading, *rows)
    ]
    return "\n".join(line.rstrip() for line in lines)


def as_markdown(table: Table) -> str:
    """A table for docs/."""
    heading, rows = table
    lines = [heading, ["---"] * len(heading), *rows]
    return "\n".join("| " + " | ".join(str(cell) for cell in line) + " |" for line in lines)
