"""`rw-ekf stop`: zero current from outside, whoever runs the wheel."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from rw_ekf.commands.inputs import add_config_option

if TYPE_CHECKING:
    from rw_ekf.clock import Clock
    from rw_ekf.driver import WheelDriver
    from rw_ekf.live.holder import HolderReport
    from rw_ekf.settings.line import LineConfiguration

HELP = "zero current: ends a running daemon of that configuration's port, then writes zero itself"
EXAMPLE = """example:
  rw-ekf stop --config my-wheel.yaml"""

_TRY_S = 1.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_config_option(parser, "only its line is read", required=True)


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError that says what was done and what could not be.

    Of the configuration only the port, baud rate, reply timeout and wire map are used: other mistakes are warnings.
    """
    from rw_ekf.clock import SystemClock
    from rw_ekf.errors import DriverError
    from rw_ekf.json_output import print_json
    from rw_ekf.live.guard import zero_and_close
    from rw_ekf.live.holder import stop_holder
    from rw_ekf.settings.line import read_line

    clock = SystemClock()
    line = read_line(args.config)
    port = line.configuration.wheel.port
    if line.findings:
        _warn([*line.findings, "the configuration has mistakes; stop used its port and went on", *line.doubts])
    report = stop_holder(port, clock)
    _warn(report.notes)
    driver = _open(line, report, clock)
    if not zero_and_close(driver, line.configuration.limits, clock, _TRY_S, lambda event, text: _warn([text])):
        doubts = "".join(f"; {doubt}" for doubt in line.doubts)
        raise DriverError(
            f"{port}: {_done(report)}zero was sent but no wheel confirmed it within {_TRY_S:g} s{doubts}; check the "
            "port, try again, or cut its power" + _still(report)
        )
    if report.remaining:
        raise DriverError(f"{port}: {_done(report)}zero was sent and confirmed, but does not last" + _still(report))
    if args.json:
        document = {
            "schema": "rw_ekf.stop/1",
            "port": port,
            "zero_confirmed": True,
            "daemon": report.ended[0] if report.ended else None,
            "killed": bool(report.killed),
            "warnings": [*line.findings, *line.doubts, *report.notes],
        }
        print_json(document)
    else:
        sys.stdout.write(f"{port}: {_done(report)}zero current confirmed\n")
    return 0


def _open(line: LineConfiguration, report: HolderReport, clock: Clock) -> WheelDriver:
    """The wheel's line, for ourselves, or beside a daemon that is still there. Raises RwEkfError with what was done."""
    from rw_ekf.attach import load_protocol, opener
    from rw_ekf.errors import ConfigError, DriverError
    from rw_ekf.live.holder import others_with

    configuration = line.configuration
    port = configuration.wheel.port
    try:
        protocol = load_protocol(configuration.wheel.protocol)
    except ConfigError as error:
        said = f"{port}: {_done(report)}zero could not be written, because the wire map cannot be used{_still(report)}"
        raise ConfigError([*error.findings, said]) from None
    # Without a probe: zero goes out even where the wheel's answers are lost.
    try:
        return opener(configuration, protocol, clock, probe=False, exclusive=not report.remaining)(None)
    except DriverError as error:
        others = "".join(f"; it is open in {other}" for other in others_with(port))
        raise DriverError(f"{_done(report)}zero could not be written: {error}{others}{_still(report)}") from None


def _done(report: HolderReport) -> str:
    """What became of the daemons, to stand before what came of the zero."""
    return "".join(
        f"daemon {pid} did not end when told and was killed; " if pid in report.killed else f"daemon {pid} ended; "
        for pid in report.ended
    )


def _still(report: HolderReport) -> str:
    """Who goes on driving the wheel all the same."""
    return "".join(f"; {text}" for text in report.remaining)


def _warn(texts: list[str]) -> None:
    for text in texts:
        sys.stderr.write(f"rw-ekf: warning: {text}\n")
