"""Measure how soon a command answers: processor time beside a bare interpreter and beside `import numpy`, as ratios.

    python -m tools.measure.startup [--runs 15] [--first]

Times of a machine say little about another one, or about the same when it is busy: the commands take turns, each figure
is a median over the turns, and what counts is the ratio to the bare interpreter of the same turn. The tests assert what
is imported, not how long it takes (tests/commands/test_help_and_imports.py).

--first: what a first use compiles instead, each time into an empty cache, beside what is announced.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rw_ekf import compile_ahead
from tools.measure.processor import spent as spent_by

_PROGRAM = (sys.executable, "-m", "rw_ekf")
_SERVED_S = 20.0


def main() -> int:
    """Print a line for every command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=15, help="turns; default 15")
    parser.add_argument("--first", action="store_true", help="what a first use takes, instead")
    args = parser.parse_args()
    runs: int = args.runs
    if args.first:
        _first_use()
        return 0
    with _wheel() as (process, config):
        commands: dict[str, Sequence[str]] = {
            "bare interpreter": (sys.executable, "-c", "pass"),
            "import numpy": (sys.executable, "-c", "import numpy"),
            "rw-ekf --help": (*_PROGRAM, "--help"),
            "rw-ekf run --help": (*_PROGRAM, "run", "--help"),
            "rw-ekf check-config": (*_PROGRAM, "check-config", str(config)),
            "rw-ekf stop": (*_PROGRAM, "stop", "--config", str(config)),
            "import of run": (sys.executable, "-c", "import rw_ekf.live.daemon"),
        }
        spent: dict[str, list[float]] = {name: [] for name in commands}
        for _ in range(runs):
            for name, command in commands.items():
                spent[name].append(spent_by(command).processor_s)
        print(f"{'':<22}{'processor time':>16}{'times bare':>12}   median of {runs}")
        for name, times in spent.items():
            ratio = statistics.median(a / b for a, b in zip(times, spent["bare interpreter"], strict=True))
            print(f"{name:<22}{1e3 * statistics.median(times):>13.0f} ms{ratio:>12.1f}")
        before, began = _processor_of(process.pid), time.monotonic()
        time.sleep(_SERVED_S)
        share = (_processor_of(process.pid) - before) / (time.monotonic() - began)
        print(f"an idle simulated wheel takes {100 * share:.1f} % of a core")
    return 0


def _first_use() -> None:
    """Print what the first replay and the first diagnosis compile: announced, processor time and wall time."""
    code = "import sys, rw_ekf.compile_ahead as c; c.compile_all(getattr(c, sys.argv[1]))"
    for verb, kernels in (("replay, fit", "FIT"), ("diagnose", "DIAGNOSIS")):
        announced = compile_ahead.seconds_of(getattr(compile_ahead, kernels))
        with tempfile.TemporaryDirectory() as folder:
            begun = time.monotonic()
            spent = spent_by(("env", f"RW_EKF_CACHE_DIR={folder}", sys.executable, "-c", code, kernels)).processor_s
            took = time.monotonic() - begun
        print(f"{verb:<22}announced {announced:4.0f} s   took {took:4.1f} s   processor time {spent:4.1f} s")


def _processor_of(pid: int) -> float:
    """Processor time of a running process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@contextmanager
def _wheel() -> Iterator[tuple[subprocess.Popen[str], Path]]:
    """A simulated wheel behind a pty and a configuration for it."""
    with tempfile.TemporaryDirectory(prefix="rw-ekf-measure-") as name:
        link, config = Path(name) / "wheel", Path(name) / "wheel.yaml"
        config.write_text(f"wheel: {{port: {link}}}\nlimits: {{current_A: 0.6}}\n", encoding="utf-8")
        process = subprocess.Popen([*_PROGRAM, "simulate", "--link", str(link)], stdout=subprocess.PIPE, text=True)
        try:
            assert process.stdout is not None
            process.stdout.readline()
            yield process, config
        finally:
            process.terminate()
            process.communicate(timeout=10)


if __name__ == "__main__":
    sys.exit(main())
