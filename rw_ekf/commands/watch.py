"""`rw-ekf watch`: a run on one screen of a terminal, over any line."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import time
from typing import TYPE_CHECKING

from rw_ekf.commands.inputs import add_config_option

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rw_ekf.settings.schema import Configuration

HELP = "show what the daemon of a configuration is doing, on one screen"
EXAMPLE = """example:
  rw-ekf watch --config my-wheel.yaml
  rw-ekf watch --config my-wheel.yaml --once"""
_EVERY_S = 1.0
_OF_SEVERAL = 6  # lines of each of several wheels: who, why, the line, a gap, speed, current
_CLEAR, _HOME_AND_CLEAR_REST = "\x1b[2J", "\x1b[H\x1b[J"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_config_option(parser, required=True)
    parser.add_argument("--once", action="store_true", help="one picture, and no more")


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError. Ends with q, Ctrl-C or a reader that goes."""
    from rw_ekf.settings.load import load_configurations, one_of_wheels

    configurations = load_configurations(args.config)
    if args.wheel is not None:
        configurations = (one_of_wheels(configurations, args.config, args.wheel),)
    if args.json:
        return _as_json(configurations)
    changing = sys.stdout.isatty() and os.environ.get("TERM") != "dumb" and not args.once
    if changing:
        sys.stdout.write(_CLEAR)
    while True:
        text = _picture(configurations)
        sys.stdout.write(f"{_HOME_AND_CLEAR_REST if changing else ''}{text}\n")
        sys.stdout.flush()
        if args.once:
            return 0
        time.sleep(_EVERY_S if changing else 10.0 * _EVERY_S)


def _picture(configurations: Sequence[Configuration]) -> str:
    """The screen of one wheel; of several what comes first of each."""
    from rw_ekf.page.text_screen import picture_of

    pictures = [picture_of(_published(configuration), _width()) for configuration in configurations]
    if len(pictures) == 1:
        return pictures[0]
    return "\n\n".join("\n".join(picture.split("\n")[:_OF_SEVERAL]) for picture in pictures)


def _published(configuration: Configuration) -> tuple[dict[str, object] | None, str]:
    """What the run publishes, with its last rows, and where."""
    from rw_ekf.live.published_state import published_place, read_published
    from rw_ekf.page.run_feed import RunFeed, shown

    place = published_place(configuration)
    found = read_published(place)
    if found is None:
        return None, str(place)
    document: dict[str, object] = shown(found)
    log = found.document.get("log")
    if isinstance(log, str):
        from rw_ekf.errors import RwEkfError

        with contextlib.suppress(RwEkfError):  # the state file may outlive the log
            document["recent"] = RunFeed(place.parent / log).recent()
    return document, str(place)


def _as_json(configurations: Sequence[Configuration]) -> int:
    from rw_ekf.json_output import print_json

    found = []
    for configuration in configurations:
        document, place = _published(configuration)
        found.append({"place": place, "run": document})
    if len(found) == 1:
        print_json({"schema": "rw_ekf.watch/1", **found[0]})
    else:
        print_json({"schema": "rw_ekf.bus_watch/1", "wheels": found})
    return 0


def _width() -> int:
    import shutil

    return max(40, min(shutil.get_terminal_size().columns, 120))
