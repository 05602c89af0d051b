"""What a verb says when it is done: one JSON document with --json, else text; and of undrawn pictures."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping
from typing import Any

from rw_ekf.errors import PictureError


def answer(args: argparse.Namespace, document: Callable[[], Mapping[str, Any]], text: Callable[[], str]) -> None:
    """Print the one that is requested, at once; the other is not made. text: without the newline at its end."""
    from rw_ekf.json_output import print_json

    if args.json:
        print_json(document())
    else:
        sys.stdout.write(f"{text()}\n")
        sys.stdout.flush()


def drawn(draw: Callable[[], object]) -> bool:
    """Draw; False where that failed, which is then reported on standard error."""
    try:
        draw()
    except PictureError as error:
        sys.stderr.write(f"rw-ekf: error: {error}; all else is as it should be\n")
        return False
    return True
