"""`rw-ekf compile`: what is compiled at a first use, now."""

from __future__ import annotations

import argparse
import sys

HELP = "compile the numerical routines now, so that no later command has to: for an image or a small computer"
EXAMPLE = """example:
  rw-ekf compile"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """No options of its own."""


def execute(args: argparse.Namespace) -> int:
    """Run the verb: status 1 where some routine is not kept compiled."""
    from rw_ekf.commands.first_use import make_ready
    from rw_ekf.compile_ahead import DIAGNOSIS, cold, kernel
    from rw_ekf.json_output import print_json

    found = cold(DIAGNOSIS)
    make_ready(found)
    left = [name for name in found if not kernel(name).is_kept()]
    if args.json:
        print_json(
            {"schema": "rw_ekf.compile/1", "compiled": [name for name in found if name not in left], "left": left}
        )
    else:
        sys.stdout.write(f"{len(DIAGNOSIS) - len(left)} of {len(DIAGNOSIS)} numerical routines are compiled\n")
    return int(bool(left))
