"""Whether stated probabilities hold: of all that was said with 70 %, seven in ten should be so.

Each entry of a verdict's `posterior` is one statement: the wheel has this effect, or none, or something that is in no
catalogue. The expected calibration error is the mean over bins of the statements' probability, weighted by their
number, of |mean stated - share true| (Naeini, Cooper, Hauskrecht 2015). Statements near zero are many and easy, so that
it is also told of the likeliest statement of each verdict alone (Guo et al. 2017).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rw_ekf.diagnosis.verdict.explanations import NONE
from rw_ekf.diagnosis.verdict.posterior import SOMETHING_ELSE
from tools.proof.judge import Record
from tools.proof.tables import Table

BINS = 10


@dataclass(frozen=True)
class Statement:
    """A probability that a verdict gave, and whether it was so."""

    stated: float
    true: bool


def statements(record: Record) -> list[Statement]:
    """All that one verdict stated, the likeliest first."""
    remarked = sorted(record.posterior.items(), key=lambda item: -item[1])
    return [Statement(chance, _is_so(record, name)) for name, chance in remarked]


def _is_so(record: Record, name: str) -> bool:
    if name == NONE:
        return record.expects == "adequate"
    if name == SOMETHING_ELSE:
        return record.expects == "unexplained"
    return name in record.expected


def all_statements(records: Iterable[Record]) -> list[Statement]:
    """Of every verdict that had probabilities."""
    return [item for record in records for item in statements(record)]


def likeliest_statements(records: Iterable[Record]) -> list[Statement]:
    """The first of each verdict."""
    return [remarked[0] for record in records if (remarked := statements(record))]


def _by_bin(remarked: Sequence[Statement]) -> list[list[Statement]]:
    bins: list[list[Statement]] = [[] for _ in range(BINS)]
    for item in remarked:
        bins[min(int(item.stated * BINS), BINS - 1)].append(item)
    return bins


def calibration_error(remarked: Sequence[Statement]) -> float:
    """Expected calibration error, 0 to 1; NaN of nothing."""
    if not remarked:
        return float("nan")
    total = sum(len(found) * abs(_stated(found) - _true(found)) for found in _by_bin(remarked) if found)
    return float(total / len(remarked))


def _stated(remarked: Sequence[Statement]) -> float:
    return float(np.mean([item.stated for item in remarked]))


def _true(remarked: Sequence[Statement]) -> float:
    return float(np.mean([item.true for item in remarked]))


def reliability_table(records: Sequence[Record]) -> Table:
    """Stated against true, by tenths of the stated probability; the last row has the calibration error."""
    every, first = all_statements(records), likeliest_statements(records)
    rows: list[Sequence[str]] = []
    for number, (found, top) in enumerate(zip(_by_bin(every), _by_bin(first), strict=True)):
        if found:
            rows.append((f"{number / BINS:.1f} to {(number + 1) / BINS:.1f}", *_cells(found), *_cells(top)))
    rows.append(
        ("calibration error", "", "", f"{calibration_error(every):.3f}", "", "", f"{calibration_error(first):.3f}")
    )
    return ("stated", "statements", "mean stated", "true", "likeliest of a verdict", "mean stated", "true"), rows


def _cells(remarked: Sequence[Statement]) -> tuple[str, str, str]:
    return ("", "", "") if not remarked else (str(len(remarked)), f"{_stated(remarked):.3f}", f"{_true(remarked):.3f}")
