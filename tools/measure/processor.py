"""Processor time of a command."""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
from collections.abc import Sequence
from pathlib import Path


def processor_s(command: Sequence[str], root: Path | None = None) -> float:
    """User and system time of a command, its children included [s].

    root: of the checkout whose code it shall run; None: this one's. Raises SystemExit where the command fails.
    """
    environment = None if root is None else {**os.environ, "PYTHONPATH": str(root)}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, cwd=root, env=environment, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(command)}: status {done.returncode}: {done.stderr.strip()}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def add_other_checkout(parser: argparse.ArgumentParser) -> None:
    """Declare --against."""
    parser.add_argument("--against", metavar="DIR", type=Path, help="root of another checkout")


def trees_of(parser: argparse.ArgumentParser, options: argparse.Namespace) -> list[Path]:
    """Roots of this checkout and, where --against names one, of the other. Ends the program where that is none."""
    other: Path | None = options.against
    if other is not None and not (other / "rw_ekf").is_dir():
        parser.error(f"{other}: no checkout (it has no folder rw_ekf): give its root to --against")
    return [Path(__file__).resolve().parents[2], *([] if other is None else [other.resolve()])]
