"""Processor time and memory of a command."""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple


class Spent(NamedTuple):
    """What a command took, with its children."""

    processor_s: float  # user and system
    peak_MB: float  # the most memory that it, or one of its children, had at once


def spent(command: Sequence[str], root: Path | None = None) -> Spent:
    """Run a command.

    root: of the checkout whose code it shall run; None: this one's. Raises SystemExit where the command fails.
    """
    environment = None if root is None else {**os.environ, "PYTHONPATH": str(root)}
    with tempfile.TemporaryFile() as said:
        process = subprocess.Popen(command, cwd=root, env=environment, stdout=subprocess.DEVNULL, stderr=said)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        if process.returncode != 0:
            raise SystemExit(f"{' '.join(command)}: status {process.returncode}: {said.read().decode().strip()}")
    return Spent(usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0)


def add_other_checkout(parser: argparse.ArgumentParser) -> None:
    """Declare --against."""
    parser.add_argument("--against", metavar="DIR", type=Path, help="root of another checkout")


def trees_of(parser: argparse.ArgumentParser, options: argparse.Namespace) -> list[Path]:
    """Roots of this checkout and, where --against names one, of the other. Ends the program where that is none."""
    other: Path | None = options.against
    if other is not None and not (other / "rw_ekf").is_dir():
        parser.error(f"{other}: no checkout (it has no folder rw_ekf): give its root to --against")
    return [Path(__file__).resolve().parents[2], *([] if other is None else [other.resolve()])]
