"""What the marks of the proof do where a threshold of the diagnosis is a third smaller or larger.

    python -m tools.measure.thresholds --cases 3 --json thresholds.json
    python -m tools.measure.thresholds --only SIGNIFICANT_P MAP_P --marks id-5rpm healthy --cases 12

Each run is the proof (tools.proof) in a process of its own, in which the number was changed before anything read it.
Counted are logs that end right or wrong otherwise than with the numbers as they are, and logs with other names.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

from rw_ekf.diagnosis import thresholds
from rw_ekf.diagnosis.thresholds import TABLE

FACTORS = (0.7, 1.3)
_WHOLE = frozenset(name for name in TABLE if isinstance(getattr(thresholds, name), int))
Outcomes = dict[str, tuple[bool, tuple[str, ...]]]  # by case: whether it ended right, its verdict and what was named


class Moved(NamedTuple):
    """What a changed threshold did to the logs of a proof."""

    value: float
    right: int
    lost: list[str]  # cases that were right
    won: list[str]
    renamed: list[str]  # right or wrong as before, by another name


def other_value(name: str, factor: float) -> float:
    """A threshold a third off; of a p-value its exponent, of a factor what it is beyond 1, of a count the next one.

    A share stays below 1.
    """
    value = TABLE[name].value
    if name in _WHOLE:
        return value + (1.0 if factor > 1.0 else -1.0)
    if TABLE[name].unit == "p":
        return float(value**factor)
    if TABLE[name].unit == "factor":
        return 1.0 + factor * (value - 1.0)
    above = value * factor
    return 0.5 * (1.0 + value) if value < 1.0 < above else above


def outcomes(name: str, value: float, marks: list[str], count: int, seed: int) -> Outcomes:
    """Of a proof of so many logs per mark, in this process, whose threshold is another from now on; no name: none."""
    if name:
        setattr(thresholds, name, type(getattr(thresholds, name))(value))
    assert "rw_ekf.diagnosis.hypotheses.contenders" not in sys.modules, "what reads the thresholds was there before"
    from tools.proof.prove import Job, chosen_cases, prove  # noqa: PLC0415 - it reads them where it is imported

    job = Job(reported=False)
    records = [prove(case, job) for case in chosen_cases(marks, seed, count, quick=False)]
    return {record.case: (record.outcome == "right", (str(record.kind), *sorted(record.named))) for record in records}


def compared(usual: Outcomes, found: Outcomes, value: float) -> Moved:
    """What became of the same logs."""
    lost = [case for case, (right, _) in usual.items() if right and not found[case][0]]
    won = [case for case, (right, _) in usual.items() if not right and found[case][0]]
    same = [case for case in usual if usual[case][0] == found[case][0]]
    renamed = [case for case in same if usual[case][1] != found[case][1]]
    return Moved(value, sum(right for right, _ in found.values()), lost, won, renamed)


def page(measured: dict[str, Any]) -> str:
    """The table of docs/thresholds.md, with what was measured: right logs lost and won at either value."""
    lines = [
        "| name | value | unit | decides | source | a third less | a third more |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, row in TABLE.items():
        moved = [sentence_about(item) for item in measured.get("moved", {}).get(name, [])] or ["not measured"] * len(
            FACTORS
        )
        lines.append(
            f"| `{name}` | {row.value:.3g} | {row.unit} | {row.decides} | {row.source} | {' | '.join(moved)} |"
        )
    return "\n".join(lines) + "\n"


def sentence_about(moved: dict[str, Any]) -> str:
    """`-2 +1, 3 renamed`; a dash where no log ends otherwise."""
    lost, won, renamed = (len(moved[key]) for key in ("lost", "won", "renamed"))
    words = [f"-{lost}"] * (lost > 0) + [f"+{won}"] * (won > 0)
    reported = [" ".join(words)] * bool(words) + [f"{renamed} renamed"] * (renamed > 0)
    return ", ".join(reported) or "-"


def main(arguments: list[str] | None = None) -> int:
    """Measure, print a table, and write what became of which log."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=3, help="logs per mark")
    parser.add_argument("--marks", nargs="+", default=[], help="of the proof; default: all")
    parser.add_argument("--seed", type=int, default=3003)
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=[*TABLE], default=[*TABLE])
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", metavar="FILE")
    parser.add_argument("--table-of", metavar="FILE", help="print the page's table from such a file, and leave")
    options = parser.parse_args(arguments)
    if options.table_of:
        print(page(json.loads(Path(options.table_of).read_text(encoding="utf-8"))), end="")
        return 0
    wanted = [("", 0.0)] + [(name, other_value(name, factor)) for name in options.only for factor in FACTORS]
    found: dict[str, list[dict[str, Any]]] = {}
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(options.jobs, mp_context=context, max_tasks_per_child=1) as pool:
        runs = [
            pool.submit(outcomes, name, value, options.marks, options.cases, options.seed) for name, value in wanted
        ]
        usual = runs[0].result()
        right = sum(ended for ended, _ in usual.values())
        print(f"{len(usual)} logs, {right} right", flush=True)
        for (name, value), run in zip(wanted[1:], runs[1:], strict=True):
            moved = compared(usual, run.result(), value)
            found.setdefault(name, []).append(moved._asdict())
            words = f"right {moved.right}, lost {len(moved.lost)}, won {len(moved.won)}, renamed {len(moved.renamed)}"
            print(f"{name:20} {value:<12.4g} {words}  {' '.join([*moved.lost, *moved.won])}", flush=True)
            if options.json:
                document = {"logs": len(usual), "right": right, "moved": found}
                Path(options.json).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
