"""The table of measured records, in markdown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

MOST = 1.05  # of the best rival's free-run error

_HEAD = (
    "record", "verdict", "one step", "1 s ahead", "free run", "NIS", "least squares", "spline over speed",
    "sparse regression", "ours over best", "CPU s",
)  # fmt: skip


def table(found: Sequence[dict[str, Any]]) -> str:
    """A row a record; errors are of held-out readings, rms, before -> after, in rad/s (m/s of a carriage)."""
    lines = [_line(_HEAD), _line(["---"] * len(_HEAD)), *(_line(_row(item)) for item in found)]
    known = [item for item in found if item["holds"] is not None]
    held = sum(item["holds"] for item in known)
    lines += ["", f"Lost to no rival by more than {100.0 * (MOST - 1.0):.0f} %: {held} of {len(known)}."]
    unjudged = [item["record"] for item in found if item["holds"] is None]
    if unjudged:
        lines[-1] += f" Not judged: {', '.join(unjudged)}."
    return "\n".join(lines)


def _row(item: dict[str, Any]) -> list[str]:
    before, after = item["before"], item["after"]
    verdict = item["verdict"]
    effects = ", ".join(verdict["effects"])
    ratio = item["ours_over_best"]
    held = "" if item["holds"] is None else (" yes" if item["holds"] else " no")
    return [
        item["record"],
        verdict["kind"] + (f": {effects}" if effects else ""),
        *(_change(before[name], after[name]) for name in ("one_step_rms_rad_s", "horizon_1s_rms_rad_s")),
        _change(before["free_run_rms_rad_s"], item["ours_free_run_rad_s"]),
        _number(after["nis_mean"]),
        *(_number(rival["free_run_rad_s"]) for rival in item["rivals"]),
        "" if ratio is None else f"{ratio:.2f}{held}",
        f"{item['cpu_s']:.0f}",
    ]


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"


def _change(before: float | None, after: float | None) -> str:
    return _number(after) if before == after else f"{_number(before)} -> {_number(after)}"


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"
