"""Processor time and memory of a command."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

# What a process had before it became another program counts as that one's, so that a small one has to start it.
_LAUNCH = """import os, sys
_, status, used = os.wait4(os.posix_spawnp(sys.argv[2], sys.argv[2:], os.environ), 0)
with open(sys.argv[1], "w") as found:
    found.write(f"{used.ru_utime + used.ru_stime} {used.ru_maxrss}")
sys.exit(os.waitstatus_to_exitcode(status))"""


class Spent(NamedTuple):
    """What a command took, with its children."""

    processor_s: float  # user and system
    peak_MB: float  # the most memory that it, or one of its children, had at once


def spent(command: Sequence[str], root: Path | None = None) -> Spent:
    """Run a command.

    root: of the checkout whose code it shall run; None: this one's. Raises SystemExit where the command fails.
    """
    environment = None if root is None else {**os.environ, "PYTHONPATH": str(root)}
    with tempfile.NamedTemporaryFile("r") as found:
        launched = [sys.executable, "-I", "-S", "-c", _LAUNCH, found.name, *command]
        done = subprocess.run(launched, cwd=root, env=environment, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise SystemExit(f"{' '.join(command)}: status {done.returncode}: {done.stderr.strip()}")
        seconds, kilobytes = found.read().split()
    return Spent(float(seconds), float(kilobytes) / 1024.0)


def add_other_checkout(parser: argparse.ArgumentParser) -> None:
    """Declare --against."""
    parser.add_argument("--against", metavar="DIR", type=Path, help="root of another checkout")


def trees_of(parser: argparse.ArgumentParser, options: argparse.Namespace) -> list[Path]:
    """Roots of this checkout and, where --against names one, of the other. Ends the program where that is none."""
    other: Path | None = options.against
    if other is not None and not (other / "rw_ekf").is_dir():
        parser.error(f"{other}: no checkout (it has no folder rw_ekf): give its root to --against")
    return [Path(__file__).resolve().parents[2], *([] if other is None else [other.resolve()])]
