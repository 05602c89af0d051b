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
from rw_ekf.console import shown_path
from rw_ekf.records import RunState

if TYPE_CHECKING:
    from rw_ekf.control.commanders import Commander
    from rw_ekf.live.outcome import RunOutcome
    from rw_ekf.live.oversight import Heartbeat
    from rw_ekf.settings.schema import Configuration

HELP = "attach to a wheel: estimate, log and publish until a signal"
EXAMPLE = """example:
  rw-ekf check-config my-wheel.yaml && rw-ekf run --config my-wheel.yaml --duration 600"""
SAFE_STATUS = 5


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
    from rw_ekf.settings.load import load_configuration

    configuration = load_configuration(args.config)
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
    born = Supervisor(configuration, protocol, log, SystemClock(), Patience.of(configuration)).supervise()
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
        from rw_ekf.console import abandon_output, logger
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
        warnings = _warnings(outcome)
        try:
            _print(outcome, warnings, planned, json=args.json)
        except OSError as error:  # the terminal, or who read us, has gone; the run is well, and its files are there
            abandon_output()
            log.warning("report_lost", reason=str(error))
        return exit_status(outcome)


def exit_status(outcome: RunOutcome) -> int:
    """What a run's exit says: a lost line (1) comes before a safety stop (5), which a line that is lost brings on."""
    no_sample = outcome.statistics.samples == 0 and outcome.stopped_by is None
    if outcome.lost or no_sample or not outcome.zero_confirmed:
        return 1
    if outcome.halted is not None or outcome.state.state is RunState.SAFE:
        return SAFE_STATUS
    return 1 if outcome.unwritten else 0


def _said_while_running(outcome: RunOutcome) -> list[str]:
    """Sentences for the document that a person has already read on standard error, as they came."""
    unconfirmed = "the wheel did not confirm zero current at the end; `rw-ekf stop --config F` tries again"
    return [*([] if outcome.zero_confirmed else [unconfirmed]), *outcome.alarms]


def _warnings(outcome: RunOutcome) -> list[str]:
    """Judge the last hour of the run; a run's own numbers never fail because of this."""
    from rw_ekf.errors import RwEkfError
    from rw_ekf.log_replay import consistency_now

    found = _said_while_running(outcome)
    if outcome.lost:
        found.append("the link to the wheel was lost to the end of the run")
    if outcome.link.reconnects > 0 and not outcome.lost:
        found.append(
            f"the link was lost and taken up again {outcome.link.reconnects} times; the log has a gap each time"
        )
    if outcome.unwritten:
        found.append(outcome.unwritten.text())
    found += [f"{ticks} ticks went nowhere from output.{name}" for name, ticks in outcome.unwritten.not_sent.items()]
    if outcome.state.state is RunState.SAFE:
        found.append(
            f"the run ended in SAFE, only zero was written since {outcome.state.since_utc}: {outcome.state.reason}"
        )
    found += outcome.findings
    if outcome.statistics.samples == 0:
        return [*found, "no sample came from the wheel"]
    refused = outcome.statistics.gate_finding(outcome.setup.constants.gate)
    if refused is not None:
        found.append(refused)
    log = shown_path(outcome.files.log)
    try:
        course = outcome.recent.course()
        judged, _ = consistency_now(course, outcome.setup, outcome.belief)
    except (RwEkfError, ArithmeticError, ValueError, LookupError) as error:
        return [*found, f"the run's residual could not be judged: {error}"]
    stretch = (
        "" if outcome.recent.is_whole else f" (Judged over the last {course.duration_s / 60.0:.3g} min of the run.)"
    )
    # A command that is named can be run from here, as it stands.
    return [*found, *(text.replace(" LOG", f" {log}") + stretch for text in judged.warnings())]


def _print(outcome: RunOutcome, warnings: list[str], planned: Planned | None, *, json: bool) -> None:
    """The result on standard output; as text without what standard error has told already."""
    from rw_ekf.documents import REPLAY_SCHEMA, entry_text, log_entry
    from rw_ekf.json_output import print_json

    entry = log_entry(
        str(outcome.files.log),
        outcome.statistics,
        outcome.belief,
        outcome.setup,
        warnings,
    )
    if not json:
        said = _said_while_running(outcome)
        entry |= {"log": shown_path(outcome.files.log), "warnings": [text for text in warnings if text not in said]}
        lines = [entry_text(entry, outcome.statistics, outcome.belief, outcome.setup)]
        if outcome.alarms:
            lines.append(f"  alarms: {len(outcome.alarms)} lines above, as they came")
        if outcome.model is not None:
            lines.append(f"  model: {shown_path(outcome.model)}  (run, replay and diagnose take it: --model)")
        elif outcome.statistics.samples:
            lines.append("  model: none, because the run learned nothing that its configuration does not say")
        if planned is not None:
            lines.append(planned.afterwards(shown_path(outcome.files.log)))
        sys.stdout.write("\n".join(lines) + "\n")
        return
    link, timing = outcome.link, outcome.timing
    document: dict[str, Any] = {
        "schema": REPLAY_SCHEMA,
        "logs": [entry],
        "seconds": {"read": 0.0, "filter": outcome.statistics.duration_s, "write": 0.0},
        "link": {
            "requests": link.requests,
            "timeouts": link.timeouts,
            "stale": link.stale,
            "damaged": link.damaged,
            "reconnects": link.reconnects,
        },
        "reply": {"mean_ms": link.reply_ms, "jitter_ms": link.reply_jitter_ms, "max_ms": link.reply_ms_max},
        "loop": {
            "ticks": timing.ticks,
            "overruns": timing.overruns,
            "late_ms_p50": timing.percentile_ms(0.50),
            "late_ms_p99": timing.percentile_ms(0.99),
            "late_ms_max": timing.late_ms_max,
        },
        "stopped_by": outcome.stopped_by,
        "state": outcome.state._asdict(),
        "start": outcome.start,
        "model": None if outcome.model is None else str(outcome.model),
        "unwritten": {
            "log_rows": outcome.unwritten.log_rows,
            "estimate_rows": outcome.unwritten.estimate_rows,
            "state_files": outcome.unwritten.state_files,
            "other_files": outcome.unwritten.other_files,
            "not_sent": outcome.unwritten.not_sent,
        },
    }
    print_json(document | ({} if planned is None else planned.document))
