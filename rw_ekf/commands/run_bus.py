"""`rw-ekf run` of a configuration with several wheels: one process, one line, each wheel with its own report."""

from __future__ import annotations

import contextlib
import faulthandler
import os
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse

    from rw_ekf.live.bus import BusWheel
    from rw_ekf.live.oversight import Heartbeat
    from rw_ekf.live.resume import Resumed
    from rw_ekf.settings.schema import Configuration

SCHEMA = "rw_ekf.bus/1"


def execute_bus(configurations: tuple[Configuration, ...], args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    from rw_ekf.errors import BadInputError
    from rw_ekf.page.beside_run import page_beside

    if args.model is not None:
        raise BadInputError("--model: it would be every wheel's: give filter.model in each entry of wheels instead")
    if args.resume and (resumed := _resumed(configurations, args)):
        return 0 if all(one.left_safe for one in resumed) else 1
    if args.view is not None:
        from rw_ekf.commands.view import host_and_port

        host_and_port(args.view)  # a mistake in it is told before the run
    with page_beside(configurations[0].output.directory, args.config, args.view):
        return _supervised(configurations, args) if args.supervise else _run(configurations, args)


def _resumed(configurations: tuple[Configuration, ...], args: argparse.Namespace) -> list[Resumed]:
    """Tell the daemon of the line to let every wheel leave SAFE; what became of each, nothing where none is running."""
    from rw_ekf.json_output import print_json
    from rw_ekf.live.resume import resume_daemon

    told = [(configuration.wheel.name, resume_daemon(configuration)) for configuration in configurations]
    found = [(name, resumed) for name, resumed in told if resumed is not None]
    if args.json and found:
        wheels = [{"wheel": name, **resumed.document()} for name, resumed in found]
        print_json({"schema": "rw_ekf.bus_resume/1", "wheels": wheels})
    elif found:
        sys.stdout.write("".join(f"{name}: {resumed.text}\n" for name, resumed in found))
    return [resumed for _, resumed in found]


def _supervised(configurations: tuple[Configuration, ...], args: argparse.Namespace) -> int:
    """The supervisor; and each run that it starts, which comes here too, in a process of its own."""
    from rw_ekf.attach import checked_protocol
    from rw_ekf.clock import SystemClock
    from rw_ekf.console import logger
    from rw_ekf.errors import BadInputError, RwEkfError
    from rw_ekf.live.supervisor import Patience, Supervisor

    if "NOTIFY_SOCKET" in os.environ:
        raise BadInputError("--supervise: systemd watches this process already (NOTIFY_SOCKET is set): leave it out")
    wheels = tuple((configuration, checked_protocol(configuration)) for configuration in configurations)
    patience = Patience.of(configurations[0], len(configurations))
    born = Supervisor(wheels, logger(args.log_format), SystemClock(), patience).supervise()
    if isinstance(born, int):
        return born
    if args.duration is not None:
        args.duration = max(args.duration - born.elapsed_s, 1.0 / configurations[0].loop.rate_hz)
    try:
        return _run(configurations, args, born.heartbeat, keep_safe=args.keep_safe or born.before > 0)
    except RwEkfError:
        born.heartbeat.told()
        raise


def _run(
    configurations: tuple[Configuration, ...],
    args: argparse.Namespace,
    heartbeat: Heartbeat | None = None,
    *,
    keep_safe: bool = False,
) -> int:
    """Run the daemon of all wheels and print what each came to; as `run_and_report` for one."""
    from rw_ekf.clock import SystemClock
    from rw_ekf.live.claim import PortClaim
    from rw_ekf.live.stop_signal import StopSignal
    from rw_ekf.live.stop_word import TOLD_TO_STOP, told_to_stop

    clock, port = SystemClock(), configurations[0].wheel.port
    with StopSignal() as stop, PortClaim(port, clock):
        if told_to_stop(port):
            if heartbeat is not None:
                heartbeat.told()
            sys.stderr.write(f"rw-ekf: {TOLD_TO_STOP}\n")
            return 0
        with contextlib.suppress(OSError, ValueError, RuntimeError, AttributeError):  # where there is no standard error
            faulthandler.enable()  # a crash in compiled code says where
        from rw_ekf.attach import SharedLine, checked_protocol
        from rw_ekf.commands.inputs import given_model
        from rw_ekf.console import abandon_output, logger
        from rw_ekf.live.bus import Bus, BusWheel
        from rw_ekf.live.oversight import Oversight
        from rw_ekf.live.published_state import safe_before
        from rw_ekf.live.systemd import systemd_of
        from rw_ekf.sinks.run_files import state_path

        log = logger(args.log_format)
        line = SharedLine(configurations, [checked_protocol(one) for one in configurations], clock)
        paths = [state_path(configuration) for configuration in configurations]
        before = safe_before(paths) if keep_safe else [None] * len(paths)
        wheels = [
            BusWheel(
                configuration,
                protocol,
                given_model(configuration, args),
                log.bind(wheel=configuration.wheel.name),
                safe,
            )
            for configuration, protocol, safe in zip(configurations, line.protocols, before, strict=True)
        ]
        if heartbeat is not None:
            heartbeat.on_orphaned(stop, log)
        watchdogs = tuple(one for one in (heartbeat, systemd_of(os.environ, clock)) if one is not None)
        Bus(wheels, line, stop, clock, Oversight(watchdogs), args.duration).run()
        try:
            return _report(wheels, json=args.json)
        except OSError as error:  # the terminal, or who read us, has gone; the runs are well, and their files are there
            abandon_output()
            log.warning("report_lost", reason=str(error))
            return _status(wheels)


def _report(wheels: list[BusWheel], *, json: bool) -> int:
    from rw_ekf.commands.run_report import report_document, report_text, warnings_of
    from rw_ekf.json_output import print_json

    found = [(wheel, None if wheel.outcome is None else warnings_of(wheel.outcome)) for wheel in wheels]
    if json:
        entries = [
            {
                "wheel": wheel.name,
                "failure": wheel.failure,
                "run": None if wheel.outcome is None else report_document(wheel.outcome, warnings or []),
            }
            for wheel, warnings in found
        ]
        print_json({"schema": SCHEMA, "wheels": entries})
    else:
        for wheel, warnings in found:
            said = f"  {wheel.failure}\n" if wheel.outcome is None else report_text(wheel.outcome, warnings or [])
            sys.stdout.write(f"{wheel.name}\n{said}")
    return _status(wheels)


def _status(wheels: list[BusWheel]) -> int:
    """The gravest of the wheels' exit statuses: failed (1) before SAFE (5) before done."""
    from rw_ekf.commands.run_report import exit_status

    statuses = [1 if wheel.outcome is None else exit_status(wheel.outcome) for wheel in wheels]
    return 1 if 1 in statuses else max(statuses)
