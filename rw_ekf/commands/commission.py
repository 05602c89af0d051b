"""`rw-ekf commission`: from an unknown wheel on a port to its configuration, its model and a page about it."""

from __future__ import annotations

import argparse
import contextlib
import math
import select
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rw_ekf.live.stop_signal import StopSignal

HELP = "from an unknown wheel on a port to its configuration, its model and a page about it"
EXAMPLE = """example:
  rw-ekf commission --port /dev/ttyUSB0
  rw-ekf commission --port /dev/ttyUSB0 --current-limit 0.5 --speed-limit 4000 --speed-ratio 1 --yes --json
  rw-ekf run --config commission/wheel.yaml"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--port", metavar="P", help="the wheel's serial port or URL; default: every one that is found")
    parser.add_argument(
        "--protocol", metavar="M", help="wire map, a shipped name or a file; default: all that come with the program"
    )
    parser.add_argument("--baud", type=int, metavar="B", help="line speed; default: the map's, then the usual ones")
    parser.add_argument("--current-limit", type=_above_zero, metavar="A", help="largest current the wheel is given [A]")
    parser.add_argument("--speed-limit", type=_above_zero, metavar="RPM", help="largest true speed [rpm]")
    parser.add_argument(
        "--temperature-limit", type=_number, metavar="DEGC", help="above it only zero is written [degC], default 50"
    )
    parser.add_argument(
        "--speed-ratio",
        type=_above_zero,
        metavar="R",
        help="true speed over what the wheel tells through the map, in place of a tachometer; 1: the map is right",
    )
    parser.add_argument("--yes", action="store_true", help="agree to the move within the limits that are given")
    parser.add_argument(
        "-o", "--out", metavar="DIR", default="commission", help="what is left; a rerun goes on there; commission"
    )


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    from rw_ekf.live.stop_signal import StopSignal

    with StopSignal() as stop:  # from here on: loading the rest takes a second
        return _commissioned(args, stop)


def _commissioned(args: argparse.Namespace, stop: StopSignal) -> int:
    from rw_ekf.clock import SystemClock
    from rw_ekf.commands.answer import drawn
    from rw_ekf.commands.first_use import make_ready
    from rw_ekf.commissioning.dialogue import Stopped
    from rw_ekf.commissioning.progress import Progress
    from rw_ekf.commissioning.step_context import Options, Work
    from rw_ekf.commissioning.step_order import commission
    from rw_ekf.compile_ahead import DIAGNOSIS
    from rw_ekf.console import logger, progress, shown_path
    from rw_ekf.errors import BadInputError
    from rw_ekf.json_output import print_json

    if args.baud is not None and not 50 <= args.baud <= 4_000_000:
        raise BadInputError(f"--baud {args.baud}: give one from 50 to 4000000")
    options = Options(
        args.port, args.protocol, args.baud, args.current_limit, args.speed_limit, args.temperature_limit,
        args.speed_ratio, args.yes,
    )  # fmt: skip
    found = Progress.of(Path(args.out))
    dialogue = Terminal(as_json=args.json)
    work = Work(options, found, dialogue, SystemClock(), stop, logger())
    whole = True
    with contextlib.ExitStack() as shown:
        bars: list[Any] = []

        def computing() -> None:
            make_ready(DIAGNOSIS)
            bars.append(shown.enter_context(progress("model", None)))

        def advance(text: str) -> None:
            bars[0].set_description(text)
            bars[0].update(1)

        try:
            whole = drawn(lambda: commission(work, computing, advance))
        except Stopped:
            out = shown_path(args.out)
            dialogue.say("stopped", f"by a signal, with zero current; the same command with --out {out} goes on")
    if args.json:
        print_json(found.document())
    elif found["done"]:
        for what, path in found["files"].items():
            sys.stdout.write(f"  {what.replace('_', ' '):<13} {shown_path(path)}\n")
        sys.stdout.write(f"next: rw-ekf run --config {shown_path(found['files']['configuration'])}\n")
    return 0 if whole else 1


class Terminal:
    """Tells on standard output (with --json on standard error) and asks on a terminal, where there is one."""

    def __init__(self, *, as_json: bool) -> None:
        self._out = sys.stderr if as_json else sys.stdout
        self._is_there = _is_terminal()

    def say(self, step: str, text: str) -> None:
        """Tell a finding, in one line."""
        with contextlib.suppress(OSError, ValueError):  # who read us has gone: the wheel is more important
            self._out.write(f"{step}: {text}\n")
            self._out.flush()

    def number(self, question: str, suggested: float) -> float | None:
        """Ask for a number above zero; what is suggested is taken with Enter."""
        while self._is_there:
            answer = self._wanted(f"{question} [{suggested:g}]: ")
            if answer is None:
                return None
            if not answer:
                return suggested
            try:
                return _above_zero(answer)
            except argparse.ArgumentTypeError as error:
                self._put(f"{error}\n")
        return None

    def choose(self, question: str, names: Sequence[str]) -> int | None:
        """Ask for one of several, by its number."""
        listed = "\n".join(f"  {number}: {name}" for number, name in enumerate(names, 1))
        while self._is_there:
            answer = self._wanted(f"{question}\n{listed}\nnumber: ")
            if not answer:
                return None
            if answer.isdecimal() and 1 <= int(answer) <= len(names):
                return int(answer) - 1
        return None

    def agree(self, question: str) -> bool | None:
        """Ask for a yes, in full."""
        answer = self._wanted(f"{question} [yes/no]: ") if self._is_there else None
        return None if answer is None else answer.lower() in ("y", "yes")

    def tachometer(self, question: str) -> Callable[[], float | str | None] | None:
        """Ask without waiting: the wheel turns meanwhile."""
        if not self._is_there:
            return None
        wanted = False

        def poll() -> float | str | None:
            nonlocal wanted
            if not wanted:
                wanted = True
                self._put(f"{question}: ")
            if not select.select([sys.stdin], [], [], 0.0)[0]:
                return None
            answer = sys.stdin.readline().strip()
            if not answer:
                return ""
            try:
                return _above_zero(answer)
            except argparse.ArgumentTypeError:
                wanted = False
                return None

        return poll

    def _wanted(self, question: str) -> str | None:
        self._put(question)
        answer = sys.stdin.readline()
        return answer.strip() if answer else None

    def _put(self, text: str) -> None:
        sys.stderr.write(text)
        sys.stderr.flush()


def _is_terminal() -> bool:
    try:
        return sys.stdin.isatty() and sys.stderr.isatty()
    except (AttributeError, ValueError):
        return False


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is no number")
    return value


def _above_zero(text: str) -> float:
    value = _number(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} is not above zero")
    return value
