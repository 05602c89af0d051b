"""`rw-ekf spikes`: the drag spikes of a directory of runs, and whether they become more frequent."""

from __future__ import annotations

import argparse
import sys
from functools import partial

from rw_ekf.commands.answer import answer
from rw_ekf.commands.inputs import duration_s

HELP = "drag spikes over a directory of runs, and whether their incidence changes"
EXAMPLE = """example:
  rw-ekf spikes runs
  rw-ekf spikes runs --out spikes.png --json

Spikes are what the daemon's watch reported (docs/watch.md); the test of a trend is in docs/watch.md#over-months"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("directory", metavar="DIR", help="directory of runs, as `output.directory` has them")
    parser.add_argument(
        "--train",
        metavar="T",
        type=partial(duration_s, or_zero=True),
        default=3600.0,
        help="spikes so close to the one before count as one train: 3600 or 3600s, 60m, 1h (the default)",
    )
    parser.add_argument(
        "-o", "--out", metavar="FILE", help="picture of sizes and counts over the time watched: .png, .svg or .pdf"
    )


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises LogError or BadInputError."""
    from pathlib import Path

    from rw_ekf.commands.answer import drawn
    from rw_ekf.logs.picture_file import check_picture_suffix
    from rw_ekf.spikes.trending import spikes_document, spikes_of_directory, spikes_text

    check_picture_suffix(args.out)
    found, warnings = spikes_of_directory(Path(args.directory), args.train)
    for text in warnings:
        sys.stderr.write(f"warning: {text}\n")
    whole = True
    if args.out is not None and found:
        from rw_ekf.spikes.spike_picture import spikes_picture

        whole = drawn(lambda: spikes_picture(args.out, found))
    answer(
        args,
        lambda: spikes_document(args.directory, found, args.train, warnings),
        lambda: "\n\n".join(map(spikes_text, found)) or "no run here was watched",
    )
    return 0 if whole else 1
