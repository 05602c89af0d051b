"""What whole commands cost beside another checkout: `python -m tools.measure.speed --against ../before`.

Each command is run by both in turn, the order turned round each time, and what is told is the processor time (user and
system, its children's too) of each, as a median, the median and spread of the ratios of the turns, and the most memory
that each had: a machine's seconds drift with what else it does, ratios of one turn hardly do. The logs are simulated
once, for both.
"""

from __future__ import annotations

import os
import statistics
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from rw_ekf.log_simulation import simulate
from tools.measure.processor import Spent, spent

_LONG_ROWS, _LONGER_ROWS = 400_000, 2_000_000


def show_against(trees: Sequence[Path], turns: int) -> None:
    """Print a line for each command: this tree, the other, and the ratio."""
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores; {turns} turns; processor time, this / other\n")
    with tempfile.TemporaryDirectory() as place:
        for what, command, per in tqdm(_commands(Path(place)), leave=False):
            whole = (sys.executable, "-m", "rw_ekf", *command)
            found: tuple[list[Spent], list[Spent]] = ([], [])
            for tree in trees:  # the first run of a checkout compiles, and is not counted
                spent(whole, tree)
            for turn in range(turns):
                for at in (0, 1) if turn % 2 else (1, 0):
                    found[at].append(spent(whole, trees[at]))
            ratios = sorted(mine.processor_s / its.processor_s for mine, its in zip(*found, strict=True))
            mine, its = (statistics.median(one.processor_s for one in turns_of) for turns_of in found)
            peaks = [statistics.median(one.peak_MB for one in turns_of) for turns_of in found]
            unit = "s" if per == 1 else "us a row"
            scale = 1.0 if per == 1 else 1e6 / per
            tqdm.write(
                f"{what:<36}{scale * mine:>8.2f} / {scale * its:<8.2f}{unit:<9} ratio {statistics.median(ratios):.2f} "
                f"({ratios[0]:.2f} to {ratios[-1]:.2f})  {peaks[0]:.0f} / {peaks[1]:.0f} MB"
            )


def _commands(place: Path) -> list[tuple[str, tuple[str, ...], int]]:
    """(what it is, arguments, rows that its time is told for, or 1)."""
    short, healthy, long = place / "short.csv", place / "healthy.csv", place / "long.csv"
    longer = place / "longer.parquet"
    simulate("identification", effects=["viscous_temperature"], seed=3).save(short)
    simulate("identification", seed=4).save(healthy)
    simulate("P1", seed=5, duration_s=0.1 * _LONG_ROWS).save(long)
    simulate("P1", seed=5, duration_s=0.1 * _LONGER_ROWS).save(longer)
    runs = place / "runs"
    runs.mkdir()
    for number in range(5):
        simulate("P1", seed=number, duration_s=600.0).save(runs / f"run-{number}.csv")
    reported = ("--config", "simulated")
    return [
        ("stop --help", ("stop", "--help"), 1),
        ("replay, 600 s", ("replay", str(healthy)), 1),
        ("replay, 600 s, a configuration", ("replay", str(healthy), *reported), 1),
        ("replay, 5 logs of 600 s", ("replay", *map(str, sorted(runs.iterdir())), *reported), 1),
        (f"replay, {_LONG_ROWS} rows", ("replay", str(long)), _LONG_ROWS),
        (f"replay, {_LONG_ROWS} rows, a configuration", ("replay", str(long), *reported), _LONG_ROWS),
        (f"the same, {_LONGER_ROWS} of Parquet", ("replay", str(longer), *reported), _LONGER_ROWS),
        ("fit, 600 s", ("fit", str(short)), 1),
        ("diagnose, 600 s, healthy", ("diagnose", str(healthy)), 1),
        ("diagnose, 600 s, with an effect", ("diagnose", str(short)), 1),
    ]
