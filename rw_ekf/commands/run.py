"""`rw-ekf run`: the daemon."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from rw_ekf.commands.inputs import add_config_option, duration_s

if TYPE_CHECKING:
    from rw_ekf.commands.run_process import Run
    from rw_ekf.control.commanders import Commander
    from rw_ekf.live.oversight import Heartbeat
    from rw_ekf.settings.schema import Configuration

HELP = "attach to a wheel: estimate, log and publish until a signal"
EXAMPLE = """example:
  rw-ekf check-config my-wheel.yaml && rw-ekf run --config my-wheel.yaml --duration 600"""


class Planned(NamedTuple):
    """What a run is to command, in place of its configuration's profile, and what is reported of it at the end."""

    commander: Commander
    document: dict[str, Any]  # keys beside those of the run's own document
    afterwards: Callable[[str], str]  # a line for a person, from the log's name


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_run_options(parser)
    from rw_ekf.commands.view import add_listen_option

    add_listen_option(parser, "--view")
    parser.add_argument(
        "--supervise",
        action="store_true",
        help="stay beside the run as a parent that writes zero and starts it again when it crashes or hangs",
    )
    parser.add_argument(
        "--keep-safe",
        action="store_true",
        help="begin in SAFE where the run before crashed in SAFE: for a start that no person made",
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="tell the daemon of this port to leave SAFE, of a line with the one wheel of --wheel; where none is "
        "running, an ordinary start",
    )


def add_run_options(parser: argparse.ArgumentParser) -> None:
    """Options that `excite` shares."""
    add_config_option(parser, required=True)
    parser.add_argument(
        "--duration", metavar="T", type=duration_s, help="end after samples of so long: 90 or 90s, 10m, 2h, 1d, 1h30m"
    )
    parser.add_argument(
        "--model", metavar="F", help="model YAML to start from, effects included, instead of the configuration's"
    )
    parser.add_argument(
        "--fresh",
        action="store_true",
        help="start from the configuration, not from what earlier runs learned",
    )
    parser.add_argument(
        "--other-wheel", action="store_true", help="drive this wheel although the model is of another one"
    )
    parser.add_argument("--log-format", choices=("text", "json"), default="text", help="of the lines on standard error")


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    from rw_ekf.commands.run_process import supervised
    from rw_ekf.errors import BadInputError
    from rw_ekf.page.beside_run import page_beside
    from rw_ekf.settings.load import load_configurations, one_of_wheels

    configurations = load_configurations(args.config)
    of_line = len(configurations) > 1
    if args.resume:  # of a line it is for the one that is named
        wheel = one_of_wheels(configurations, args.config, args.wheel)
        status = _resumed(wheel, args, of_line=of_line)
        if status is not None:
            return status
    together = of_line and args.wheel is None
    if together and args.model is not None:
        raise BadInputError("--model: it would be every wheel's: give filter.model in each entry of wheels instead")
    if not together:
        configurations = (one_of_wheels(configurations, args.config, args.wheel),)
    if args.view is not None:
        from rw_ekf.commands.view import host_and_port

        host_and_port(args.view)  # a mistake in it is reported before the run
    run: Run = partial(run_and_report, configurations[0], args)
    if together:
        from rw_ekf.commands.run_bus import run_bus

        run = partial(run_bus, configurations, args)
    folders = dict.fromkeys(configuration.output.directory for configuration in configurations)
    with page_beside(folders, args.config, args.view):
        return supervised(configurations, args, run) if args.supervise else run(keep_safe=args.keep_safe)


def _resumed(configuration: Configuration, args: argparse.Namespace, *, of_line: bool) -> int | None:
    """Tell the daemon to let its wheel leave SAFE; None where none is running, and a run of this wheel may begin.

    Raises DriverError where none is running and the wheel is one of several: a run of it alone would keep them out.
    """
    from rw_ekf.commands.answer import answer
    from rw_ekf.errors import DriverError
    from rw_ekf.live.resume import resume_daemon

    resumed = resume_daemon(configuration, of_line=of_line)
    if resumed is None and of_line:
        raise DriverError(f"{configuration.wheel.port}: no run drives this line: nothing to resume")
    if resumed is None:
        return None
    answer(args, resumed.document, lambda: resumed.text)
    return 0 if resumed.left_safe else 1


def run_and_report(
    configuration: Configuration,
    args: argparse.Namespace,
    *,
    heartbeat: Heartbeat | None = None,
    keep_safe: bool = False,
    planned: Planned | None = None,
) -> int:
    """Run the daemon and print what it came to. keep_safe: begin in SAFE where the run before crashed in SAFE.

    Exit status 1 if the link was lost, or the wheel silent, to the end, if the wheel did not confirm the last zero, or
    if a part of what it was to leave could not be written; 5 if the run ended in SAFE, or because another wheel came.
    """
    from rw_ekf.commands.run_process import claimed, reported, warn_of_safe, watched_by

    with claimed(configuration.wheel.port, heartbeat) as at:
        if at is None:
            return 0
        from rw_ekf.attach.wire import checked_protocol
        from rw_ekf.commands.inputs import given_model
        from rw_ekf.commands.run_report import exit_status, report_document, report_text, warnings_of
        from rw_ekf.console import logger
        from rw_ekf.json_output import print_json
        from rw_ekf.live.daemon import Task, run_daemon
        from rw_ekf.live.published_state import crashed_in_safe
        from rw_ekf.sinks.run_files import state_path

        protocol = checked_protocol(configuration)
        given = given_model(configuration, args)
        log = logger(args.log_format).bind(wheel=configuration.wheel.name)
        before = state_path(configuration)
        begin_safe = crashed_in_safe(before) if keep_safe else None
        if begin_safe is None:
            warn_of_safe(before, log)
        outcome = run_daemon(
            Task(configuration, protocol, given, args.duration, None if planned is None else planned.commander),
            log,
            at.stop,
            at.clock,
            watched_by(heartbeat, at, log, begin_safe),
            at.claim,
        )
        warnings = warnings_of(outcome)

        def say() -> None:
            if args.json:
                print_json(report_document(outcome, warnings, None if planned is None else planned.document))
            else:
                sys.stdout.write(report_text(outcome, warnings, None if planned is None else planned.afterwards))

        reported(say, log)
        return exit_status(outcome)
