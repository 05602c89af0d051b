"""Measure what the whole of `rw-ekf diagnose LOG --out DIR` costs in processor time, alone or beside another checkout.

    python -m tools.measure.diagnosis_time                        42 logs of ten minutes; two minutes
    python -m tools.measure.diagnosis_time --against ../before    by turns with the code of another folder

The logs are those of the proof's first mark (identification, 1 rpm, 10 Hz, 600 s), from a plant that shares no code
with the estimator. Start, search, pictures and page count, user and system. A machine's seconds say little about
another's, and drift with what else it does: beside another checkout each log is diagnosed by both in turn, and the
ratio is what holds.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from tools.measure.processor import add_other_checkout, spent, trees_of
from tools.measure.table import Row, at_most, show
from tools.proof.plants import log_of, save_log
from tools.proof.prove import chosen_cases

_MEDIAN_S, _WORST_S = 4.0, 10.0  # marks


def diagnosed_s(tree: Path, log: Path, out: Path) -> float:
    """Processor time of one diagnosis by the code in `tree` [s]."""
    return spent((sys.executable, "-m", "rw_ekf", "diagnose", str(log), "--out", str(out)), tree).processor_s


def write_logs(folder: Path, count: int, seed: int) -> list[Path]:
    """The proof's logs as CSV."""
    paths = []
    for case in tqdm(chosen_cases(["id-1rpm"], seed, count, quick=False), desc="simulating", leave=False):
        paths.append(folder / f"{case.name}.csv")
        save_log(log_of(case), str(paths[-1]))
    return paths


def rows_of(name: str, found: Sequence[float]) -> list[Row]:
    """Median and worst beside their marks."""
    return [
        at_most(f"{name}  processor time, median of {len(found)}", statistics.median(found), _MEDIAN_S, " s"),
        at_most(f"{name}  worst", max(found), _WORST_S, " s"),
    ]


def main() -> int:
    """Print the table; exit status 1 if this tree misses a mark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--logs", type=int, default=42)
    parser.add_argument("--seed", type=int, default=14)
    add_other_checkout(parser)
    options = parser.parse_args()
    trees = trees_of(parser, options)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        logs = write_logs(folder, options.logs, options.seed)
        for tree in trees:  # the first run of a checkout compiles, and is not counted
            diagnosed_s(tree, logs[0], folder / "out")
        found: list[list[float]] = [[] for _ in trees]
        for turn, log in enumerate(tqdm(logs, desc="diagnosing", leave=False)):
            for at in range(len(trees)) if turn % 2 else reversed(range(len(trees))):
                found[at].append(diagnosed_s(trees[at], log, folder / "out"))
    rows = rows_of("this tree", found[0])
    for other in found[1:]:
        ratios = [mine / its for mine, its in zip(found[0], other, strict=True)]
        rows += [Row(row.what, row.value) for row in rows_of(str(options.against), other)]
        rows.append(Row("this tree to the other, median of the ratios", f"{statistics.median(ratios):.3f}"))
    show(rows)
    return 0 if all(row.met is not False for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
