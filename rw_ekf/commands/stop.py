"""`rw-ekf stop`: zero current from outside, whoever runs the wheel."""

from __future__ import annotations

import argparse
import sys

HELP = "zero current: ends a running daemon of that configuration, then writes zero itself"
EXAMPLE = """example:
  rw-ekf stop --config my-wheel.yaml"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--config", metavar="F", required=True, help="configuration file")


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError, among them DriverError when the wheel does not confirm zero."""
    from rw_ekf.errors import DriverError
    from rw_ekf.json_output import print_json
    from rw_ekf.loop.claim import stop_holder
    from rw_ekf.loop.safety import CurrentGuard, SafetyLimits
    from rw_ekf.settings.load import load_configuration
    from rw_ekf.wheels import load_wire_map, serial_opener

    configuration = load_configuration(args.config)
    port = configuration.wheel.port
    trouble: DriverError | None = None
    pid = None
    try:
        pid = stop_holder(port)
    except DriverError as error:  # zero is tried all the same
        trouble = error
    # Without a probe: zero goes out even where the wheel's answers are lost.
    driver = serial_opener(configuration, load_wire_map(configuration.wheel.protocol), probe=False)(None)
    try:
        confirmed = CurrentGuard(driver, SafetyLimits.of(configuration.limits)).zero(1.0)
    finally:
        driver.close()
    if not confirmed:
        raise DriverError(
            f"{port}: zero was sent but no wheel confirmed it within 1 s; check the port, try again, or cut its power"
        )
    if trouble is not None:
        raise trouble
    if args.json:
        print_json({"schema": "rw_ekf.stop/1", "port": port, "zero_confirmed": True, "daemon": pid})
    else:
        ended = f"daemon {pid} ended; " if pid is not None else ""
        sys.stdout.write(f"{port}: {ended}zero current confirmed\n")
    return 0
