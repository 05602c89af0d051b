"""`rw-ekf view`: a run, or the runs of a folder, in a browser."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from rw_ekf.commands.answer import answer
from rw_ekf.commands.inputs import add_config_option

HELP = "show a run, or the runs of a folder, in a browser"
EXAMPLE = """example:
  rw-ekf view runs/
  rw-ekf view runs/2026-11-27T10-20-06Z_wheel.csv --listen 127.0.0.1:8800
  rw-ekf run --config my-wheel.yaml --view"""
DEFAULT_LISTEN = "127.0.0.1:8765"
_STOP_WITHIN_S = 60.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("run", metavar="RUN|DIR", nargs="+", help="log of a run, or the folder of several")
    add_listen_option(parser, "--listen")
    add_config_option(parser, "its wheel can then be stopped from the page", one_wheel=False)
    parser.add_argument("--of-run", action="store_true", help=argparse.SUPPRESS)  # end with the run that started it


def add_listen_option(parser: argparse.ArgumentParser, name: str) -> None:
    """Where the page is served."""
    parser.add_argument(
        name,
        metavar="HOST:PORT",
        nargs="?",
        const=DEFAULT_LISTEN,
        default=None if name == "--view" else DEFAULT_LISTEN,
        help=f"where the page is served (default {DEFAULT_LISTEN}; another machine can ask where it is not loopback, "
        "with the token in the address that is printed; port 0: any that is free)",
    )


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    from rw_ekf.errors import BadInputError
    from rw_ekf.parent_process import die_with_parent

    if args.of_run:
        die_with_parent()
    host, port = host_and_port(args.listen)
    paths = [Path(run) for run in args.run]
    for path in paths:
        if not path.exists():
            raise BadInputError(f"{path}: no such file or folder: give a run's log, or the folder of runs")
    try:
        from rw_ekf.page.page_process import serve
        from rw_ekf.page.server import Place
    except ImportError as error:
        raise BadInputError(f'what serves the page is not installed ({error}): pip install "rw-ekf[view]"') from None
    place = Place(paths)
    if args.config is not None:
        from rw_ekf.settings.stop_settings import read_line

        place = Place(paths, lambda: _stopped(args.config), len(read_line(args.config).wheels))

    def tell(address: str) -> None:
        answer(args, lambda: {"schema": "rw_ekf.view/1", "address": address}, lambda: address)

    serve(place, host, port, reported=tell)
    return 0


def host_and_port(text: str) -> tuple[str, int]:
    """Raises BadInputError for what is no HOST:PORT."""
    from rw_ekf.errors import BadInputError

    host, _, port = text.rpartition(":")
    if not host or not port.isdigit() or int(port) > 65535:
        raise BadInputError(f"{text}: where the page is served is HOST:PORT, such as {DEFAULT_LISTEN}")
    return host.strip("[]"), int(port)


def _stopped(config: str) -> dict[str, Any]:
    """What `rw-ekf stop` of this configuration answers."""
    command = [sys.executable, "-m", "rw_ekf", "stop", "--config", config, "--json"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=_STOP_WITHIN_S)
        answer = json.loads(done.stdout)
    except (OSError, subprocess.TimeoutExpired, ValueError) as error:
        return {"zero_confirmed": False, "error": f"rw-ekf stop gave no answer ({error}): cut the wheel's power"}
    return answer if isinstance(answer, dict) else {"zero_confirmed": False, "error": str(answer)}
