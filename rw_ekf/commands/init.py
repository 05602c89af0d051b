"""`rw-ekf init`: a configuration to begin with, for the serial port that is found."""

from __future__ import annotations

import argparse

from rw_ekf.commands.answer import answer

HELP = "write a commented configuration for the serial port that is found"
EXAMPLE = """example:
  rw-ekf init
  rw-ekf init --port /dev/serial/by-id/usb-FTDI_FT232R_A50285BI-if00-port0 --out my-wheel.yaml"""

_PLACEHOLDER = "/dev/serial/by-id/NAME-OF-YOUR-ADAPTER"
_PORT_LINE = "  port: /dev/ttyUSB0  "  # as the shipped example begins it
_LIMIT_LINE = "  current_A: 0.6\n"
# What may move a wheel nobody but its owner can say: the file does not run before it is given.
_NO_LIMIT_LINE = "  current_A:                  # to be set: the largest current ever commanded [A]\n"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--port", metavar="P", help="the wheel's serial port or URL; default: the first that is found")
    parser.add_argument(
        "-o", "--out", metavar="F", default="my-wheel.yaml", help="file to write, never over another; my-wheel.yaml"
    )


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises BadInputError where the file is there already or cannot be written."""
    from rw_ekf.console import shown_path
    from rw_ekf.live.port_name import serial_ports

    found = [] if args.port is not None else serial_ports()
    port = args.port or (found[0] if found else _PLACEHOLDER)
    _write_new(args.out, _text(port, found[1:]))
    stated = f"wheel.port is {port}"
    if port == _PLACEHOLDER:
        stated = f"no serial port was found: wheel.port is a placeholder, {port}"
    elif len(found) > 1:
        stated = f"{len(found)} serial ports were found: {stated}, and the others stand beside it"
    out = shown_path(args.out)
    then = f"set limits.current_A in it and look at the rest; then: rw-ekf check-config {out}"
    document = {"schema": "rw_ekf.init/1", "out": args.out, "port": port, "found": found}
    answer(args, lambda: document, lambda: f"{out} written; {stated}\n{then}")
    return 0


def _text(port: str, others: list[str]) -> str:
    """The shipped example with this port in it, and others in a comment."""
    import json

    from rw_ekf.settings.resources import config_resource

    lines = [f"  port: {json.dumps(port, ensure_ascii=False)}  "]
    before, after = config_resource("example").read_text(encoding="utf-8").split(_PORT_LINE)
    comment, rest = after.lstrip().split("\n", 1)
    lines[0] += comment
    lines += [f"  # also found: {other}" for other in others]
    return before + "\n".join(lines) + "\n" + rest.replace(_LIMIT_LINE, _NO_LIMIT_LINE)


def _write_new(path: str, text: str) -> None:
    from rw_ekf.errors import BadInputError

    try:
        with open(path, "x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise BadInputError(f"{path}: is there already and is left alone: name another with --out") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise BadInputError(f"{path}: cannot be written ({reason}): name another with --out") from None
