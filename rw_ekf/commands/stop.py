"""`rw-ekf stop`: zero current from outside, whoever runs the wheel."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from rw_ekf.commands.answer import answer
from rw_ekf.commands.inputs import add_config_option

if TYPE_CHECKING:
    from rw_ekf.clock import Clock
    from rw_ekf.live.running_daemon import HolderReport
    from rw_ekf.settings.stop_settings import LineConfiguration

HELP = "zero current: ends a running daemon of that configuration's port, then writes zero itself"
EXAMPLE = """example:
  rw-ekf stop --config my-wheel.yaml"""

_TRY_S = 1.0
_WITHIN_S = 5.0  # a daemon of one wheel ends, from the request to stop


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    add_config_option(parser, "only its line is read", required=True, one_wheel=False)


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError that says what was done and what could not be.

    Of the configuration only the port, baud rate, reply timeout and wire map are used: other mistakes are warnings.
    """
    from rw_ekf.clock import SystemClock
    from rw_ekf.errors import DriverError
    from rw_ekf.live.guard import STAND_DOWN_S
    from rw_ekf.live.running_daemon import stop_holder
    from rw_ekf.settings.stop_settings import read_line

    clock = SystemClock()
    line = read_line(args.config)
    port = line.wheels[0].wheel.port
    if line.findings:
        _warn([*line.findings, "the configuration has mistakes; stop used its port and went on", *line.doubts])
    report = stop_holder(port, clock, _WITHIN_S + STAND_DOWN_S * (len(line.wheels) - 1))
    _warn(report.notes)
    confirmed = _zero(line, report, clock)
    if not all(confirmed):
        doubts = "".join(f"; {doubt}" for doubt in line.doubts)
        raise DriverError(
            f"{port}: {_done(report)}zero was sent but {_who(line, confirmed)} confirmed it within {_TRY_S:g} s{doubts}"
            "; check the port, try again, or cut its power" + _still(report)
        )
    unsure = [*line.doubts, *_indistinguishable(line)]
    if unsure and (len(line.wheels) > 1 or line.names_wheels):  # of one wheel the confirmation is its own
        why = "; ".join(text.rstrip(".") for text in unsure)
        raise DriverError(
            f"{port}: {_done(report)}zero was confirmed by whoever answered, but not every wheel may have had it: "
            f"{why}. Mend that and stop again, or cut the power" + _still(report)
        )
    if report.remaining:
        raise DriverError(f"{port}: {_done(report)}zero was sent and confirmed, but does not last" + _still(report))
    document = {
        "schema": "rw_ekf.stop/1",
        "port": port,
        "zero_confirmed": True,
        "daemon": report.ended[0] if report.ended else None,
        "killed": bool(report.killed),
        "warnings": [*line.findings, *line.doubts, *report.notes],
    }
    of = "" if len(line.wheels) == 1 else f" by all {len(line.wheels)} wheels"
    answer(args, lambda: document, lambda: f"{port}: {_done(report)}zero current confirmed{of}")
    return 0


def _indistinguishable(line: LineConfiguration) -> list[str]:
    """Wheels of the line that one zero may have been for two of."""
    from rw_ekf.attach.wire import beyond_line, spoken_by

    if len(line.wheels) < 2:
        return []
    return [text for _, _, text in beyond_line(line.wheels, [spoken_by(wheel) for wheel in line.wheels])]


def _who(line: LineConfiguration, confirmed: list[bool]) -> str:
    """Who has not confirmed a zero, before that word: `no wheel`, or of several the names."""
    silent = [wheel.wheel.name for wheel, done in zip(line.wheels, confirmed, strict=True) if not done]
    return "no wheel" if len(silent) == len(line.wheels) else f"of several wheels not {', '.join(silent)}"


def _zero(line: LineConfiguration, report: HolderReport, clock: Clock) -> list[bool]:
    """Zero over the line, for ourselves, or beside a daemon that is still there; which wheels confirmed it.

    Raises RwEkfError with what was done.
    """
    from rw_ekf.attach.opening import opener
    from rw_ekf.attach.wire import spoken_by
    from rw_ekf.errors import ConfigError, DriverError
    from rw_ekf.live.guard import zero_each
    from rw_ekf.live.running_daemon import others_with

    port = line.wheels[0].wheel.port
    try:
        # Without a probe: zero goes out even where the wheel's answers are lost.
        openers = [
            (opener(wheel, spoken_by(wheel), clock, probe=False, exclusive=not report.remaining), wheel.limits)
            for wheel in line.wheels
        ]
    except ConfigError as error:
        stated = (
            f"{port}: {_done(report)}zero could not be written, because the wire map cannot be used{_still(report)}"
        )
        raise ConfigError([*error.findings, stated]) from None
    try:
        return zero_each(openers, clock, _TRY_S, lambda event, text: _warn([text]))
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
    """Who continues to drive the wheel all the same."""
    return "".join(f"; {text}" for text in report.remaining)


def _warn(texts: list[str]) -> None:
    for text in texts:
        sys.stderr.write(f"rw-ekf: warning: {text}\n")
