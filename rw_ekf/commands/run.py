"""`rw-ekf run`: the daemon."""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import os
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from rw_ekf.commands.inputs import add_config_option, duration_s

if TYPE_CHECKING:
    from rw_ekf.control.commanders import Commander
    from rw_ekf.live.oversight import Heartbeat
    from rw_ekf.settings.schema import Configuration

HELP = "attach to a wheel: estimate, log and publish until a signal"
EXAMPLE = """example:
  rw-ekf check-config my-wheel.yaml && rw-ekf run --config my-wheel.yaml --duration 600"""


class Planned(NamedTuple):
    """What a run is to command, in place of its configuration's profile, and what is said of it at the end."""

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
        help="tell the daemon of this port to leave SAFE; where none is running, an ordinary start",
    )


def add_run_options(parser: argparse.ArgumentParser) -> None:
    """Options that `excite` shares."""
    add_config_option(parser, required=True)
    parser.add_argument(
        "--duration", metavar="T", type=duration_s, help="end after samples of so long: 90 or 90s, 10m, 2h"
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
    from rw_ekf.settings.load import load_configurations, one_of_wheels

    configurations = load_configurations(args.config)
    if args.wheel is None and len(configurations) > 1:
        from rw_ekf.commands.run_bus import execute_bus

        return execute_bus(configurations, args)
    if args.resume and len(configurations) > 1:
        from rw_ekf.errors import UsageError

        raise UsageError("--resume is for all wheels of a line, which one daemon drives: leave out --wheel")
    configuration = one_of_wheels(configurations, args.config, args.wheel)
    if args.resume:
        from rw_ekf.live.resume import resume_daemon

        resumed = resume_daemon(configuration)
        if resumed is not None:
            if args.json:
                from rw_ekf.json_output import print_json

                print_json(resumed.document())
            else:
                sys.stdout.write(resumed.text + "\n")
            return 0 if resumed.left_safe else 1
    from rw_ekf.page.beside_run import page_beside

    if args.view is not None:
        from rw_ekf.commands.view import host_and_port

        host_and_port(args.view)  # a mistake in it is told before the run
    with page_beside(configuration.output.directory, args.config, args.view):
        if args.supervise:
            return _supervised(configuration, args)
        return run_and_report(configuration, args, keep_safe=args.keep_safe)


def _supervised(configuration: Configuration, args: argparse.Namespace) -> int:
    """The supervisor; and each run that it starts, which comes here too, in a process of its own."""
    from rw_ekf.attach import checked_protocol
    from rw_ekf.clock import SystemClock
    from rw_ekf.console import logger
    from rw_ekf.errors import BadInputError, RwEkfError
    from rw_ekf.live.supervisor import Patience, Supervisor

    if "NOTIFY_SOCKET" in os.environ:
        raise BadInputError("--supervise: systemd watches this process already (NOTIFY_SOCKET is set): leave it out")
    log = logger(args.log_format).bind(wheel=configuration.wheel.name)
    protocol = checked_protocol(configuration)
    wheels = ((configuration, protocol),)
    born = Supervisor(wheels, log, SystemClock(), Patience.of(configuration)).supervise()
    if isinstance(born, int):
        return born
    if args.duration is not None:
        args.duration = max(args.duration - born.elapsed_s, 1.0 / configuration.loop.rate_hz)
    try:
        return run_and_report(
            configuration, args, heartbeat=born.heartbeat, keep_safe=args.keep_safe or born.before > 0
        )
    except RwEkfError:
        born.heartbeat.told()
        raise


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
    A signal ends the run in order from here on, and a second one does not disturb the report. The port is claimed
    before anything takes time, so that `stop` finds who is about to drive it.
    """
    from rw_ekf.clock import SystemClock
    from rw_ekf.live.claim import PortClaim
    from rw_ekf.live.stop_signal import StopSignal
    from rw_ekf.live.stop_word import TOLD_TO_STOP, told_to_stop

    clock = SystemClock()
    with StopSignal() as stop, PortClaim(configuration.wheel.port, clock) as claim:
        if told_to_stop(configuration.wheel.port):
            if heartbeat is not None:
                heartbeat.told()
            sys.stderr.write(f"rw-ekf: {TOLD_TO_STOP}\n")
            return 0
        with contextlib.suppress(OSError, ValueError, RuntimeError, AttributeError):  # where there is no standard error
            faulthandler.enable()  # a crash in compiled code says where
        from rw_ekf.attach import checked_protocol
        from rw_ekf.commands.inputs import given_model
        from rw_ekf.commands.run_report import exit_status, report_document, report_text, warnings_of
        from rw_ekf.console import abandon_output, logger
        from rw_ekf.json_output import print_json
        from rw_ekf.live.daemon import run_daemon
        from rw_ekf.live.oversight import Oversight
        from rw_ekf.live.published_state import crashed_in_safe
        from rw_ekf.live.systemd import systemd_of
        from rw_ekf.sinks.run_files import state_path

        protocol = checked_protocol(configuration)
        given = given_model(configuration, args)
        log = logger(args.log_format).bind(wheel=configuration.wheel.name)
        if heartbeat is not None:
            heartbeat.on_orphaned(stop, log)
        oversight = Oversight(
            tuple(watchdog for watchdog in (heartbeat, systemd_of(os.environ, clock)) if watchdog is not None),
            crashed_in_safe(state_path(configuration)) if keep_safe else None,
        )
        outcome = run_daemon(
            configuration,
            protocol,
            given,
            args.duration,
            log,
            stop,
            clock,
            oversight,
            None if planned is None else planned.commander,
            claim,
        )
        warnings = warnings_of(outcome)
        try:
            if args.json:
                print_json(report_document(outcome, warnings, None if planned is None else planned.document))
            else:
                sys.stdout.write(report_text(outcome, warnings, None if planned is None else planned.afterwards))
        except OSError as error:  # the terminal, or who read us, has gone; the run is well, and its files are there
            abandon_output()
            log.warning("report_lost", reason=str(error))
        return exit_status(outcome)
