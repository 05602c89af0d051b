"""`rw-ekf run` of a configuration with several wheels: one process, one line, each wheel with its own report."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import argparse

    from rw_ekf.live.bus import BusWheel
    from rw_ekf.live.oversight import Heartbeat
    from rw_ekf.settings.schema import Configuration

SCHEMA = "rw_ekf.bus/1"


def run_bus(
    configurations: tuple[Configuration, ...],
    args: argparse.Namespace,
    *,
    heartbeat: Heartbeat | None = None,
    keep_safe: bool = False,
) -> int:
    """Run the daemon of all wheels and print what each came to; as `run_and_report` for one."""
    from rw_ekf.commands.run_process import claimed, reported, warn_of_safe, watched_by

    with claimed(configurations[0].wheel.port, heartbeat) as at:
        if at is None:
            return 0
        from rw_ekf.attach.opening import SharedLine
        from rw_ekf.attach.wire import checked_protocol
        from rw_ekf.commands.inputs import given_model
        from rw_ekf.console import logger
        from rw_ekf.live.bus import Bus, BusWheel
        from rw_ekf.live.published_state import safe_before
        from rw_ekf.sinks.run_files import state_path

        log = logger(args.log_format)
        line = SharedLine(configurations, [checked_protocol(one) for one in configurations], at.clock)
        paths = [state_path(configuration) for configuration in configurations]
        before = safe_before(paths) if keep_safe else [None] * len(paths)
        for configuration, path, safe in zip(configurations, paths, before, strict=True):
            if safe is None:
                warn_of_safe(path, log.bind(wheel=configuration.wheel.name))
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
        Bus(wheels, line, at.stop, at.clock, watched_by(heartbeat, at, log), args.duration).run()
        reported(lambda: _report(wheels, json=args.json), log)
        return _status(wheels)


def _report(wheels: list[BusWheel], *, json: bool) -> None:
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
            stated = f"  {wheel.failure}\n" if wheel.outcome is None else report_text(wheel.outcome, warnings or [])
            sys.stdout.write(f"{wheel.name}\n{stated}")


def _status(wheels: list[BusWheel]) -> int:
    """The gravest of the wheels' exit statuses: failed (1) before SAFE (5) before done."""
    from rw_ekf.commands.run_report import exit_status

    statuses = [1 if wheel.outcome is None else exit_status(wheel.outcome) for wheel in wheels]
    return 1 if 1 in statuses else max(statuses)
