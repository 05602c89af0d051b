"""`rw-ekf compile`: what is compiled at a first use, now."""

from __future__ import annotations

import argparse

HELP = "compile the numerical routines now, so that no later command has to: for an image or a small computer"
EXAMPLE = """example:
  rw-ekf compile"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """No options of its own."""


def execute(args: argparse.Namespace) -> int:
    """Run the verb: status 1 where some routine is not kept compiled."""
    from rw_ekf.commands.answer import answer
    from rw_ekf.commands.first_use import make_ready
    from rw_ekf.compile_ahead import DIAGNOSIS, cold, kernel

    found = cold(DIAGNOSIS)
    make_ready(found)
    left = [name for name in found if not kernel(name).is_kept()]
    document = {"schema": "rw_ekf.compile/1", "compiled": [name for name in found if name not in left], "left": left}
    text = f"{len(DIAGNOSIS) - len(left)} of {len(DIAGNOSIS)} numerical routines are compiled"
    answer(args, lambda: document, lambda: text)
    return int(bool(left))
