"""What a diagnosis is made of: one log or several of one wheel, mended where rows or readings are missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from rw_ekf.arrays import Int64Array
from rw_ekf.logs.joined import joined
from rw_ekf.logs.sampling import mended, sampling_of
from rw_ekf.logs.wheel_log import WheelLog


@dataclass(frozen=True)
class Source:
    """The log as it is looked at, and what must be said of it first."""

    log: WheelLog
    log_of: Int64Array  # (n,) which of the logs a sample belongs to
    parts: tuple[dict[str, Any], ...]  # of each log: its name, samples, rate, where it begins in the joint time
    samples: int  # rows that were read
    rate_hz: float
    said_first: str  # sentences in front of the verdict, or nothing
    notes: tuple[str, ...]
    timing_doubt_s: float  # by which a reading may be older than its row says

    def document(self) -> dict[str, Any]:
        """The first keys of the diagnosis document; `logs` only where there are several."""
        said: dict[str, Any] = {"log": self.log.name, "samples": self.samples, "rate_hz": self.rate_hz}
        return said if len(self.parts) == 1 else said | {"logs": list(self.parts)}


def source_of(logs: Sequence[WheelLog]) -> Source:
    """Look at the rows of each log, mend what is lost, and join them."""
    seen = [sampling_of(log) for log in logs]
    whole = joined([mended(log, sampling) for log, sampling in zip(logs, seen, strict=True)])
    several = len(logs) > 1
    notes, first = [], []
    for log, sampling in zip(logs, seen, strict=True):
        of = f"{log.name}: " if several else ""
        notes += [of + text for text in sampling.remarks()]
        if sampling.said_first:
            first.append(of + sampling.said_first)
    parts = tuple(part | {"samples": len(log)} for part, log in zip(whole.parts, logs, strict=True))
    doubts = [s.period_s for s in seen if s.refresh_s is not None]
    return Source(
        whole.log,
        whole.log_of,
        parts,
        sum(len(log) for log in logs),
        logs[0].rate_hz if not several else whole.log.rate_hz,
        "".join(first),
        (*notes, *whole.notes),
        max(doubts, default=0.0),
    )
