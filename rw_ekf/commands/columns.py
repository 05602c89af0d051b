"""`rw-ekf columns`: the column map of a foreign log, guessed, with reasons and with questions."""

from __future__ import annotations

import argparse
import sys

HELP = "write the column map of a foreign log: what was guessed, why, and what is asked"
EXAMPLE = """example:
  rw-ekf columns lab.csv                           look at the map
  rw-ekf columns lab.csv --out lab.map.yaml        write it; then: rw-ekf replay lab.csv --columns lab.map.yaml
  rw-ekf columns lab.csv --set current=3 --set current.unit=mA --set speed=n:rpm"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", metavar="LOG", help="a log of any form that is read (docs/logs.md)")
    parser.add_argument("-o", "--out", metavar="MAP", help="file to write (YAML)")
    parser.add_argument(
        "--set",
        metavar="NAME=COLUMN",
        action="append",
        default=[],
        help="answer: a column by name or number from 0 (`current=3`, `speed=n:rpm`, `current=none`), or what else a"
        " map says of one (`current.unit=mA`, `speed.pole_pairs=7`, `current.scale=-1`); `only=wheel_id:2`: the rows of"
        " one wheel",
    )
    parser.add_argument(
        "--columns", metavar="MAP", help="a map that says only how the file is laid out, or its `variable`"
    )


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises LogError, ConfigError or BadInputError."""
    from rw_ekf.commands.inputs import refuse_to_overwrite
    from rw_ekf.errors import BadInputError
    from rw_ekf.foreign_columns import guessed_columns
    from rw_ekf.json_output import print_json

    odd = next((text for text in args.set if not all(text.partition("="))), None)
    if odd is not None:
        raise BadInputError(f"--set {odd}: must be NAME=COLUMN, such as current=3 or current.unit=mA")
    refuse_to_overwrite([args.out], [args.log, args.columns])
    found = guessed_columns(args.log, dict(text.split("=", 1) for text in args.set), args.columns)
    for text in found.warnings:
        sys.stderr.write(f"warning: {text}\n")
    if args.out is not None:
        found.save(args.out)
    if args.json:
        print_json({**found.document(), "out": args.out})
    elif args.out is None:
        sys.stdout.write(found.text())
    else:
        open_questions = len(found.guess.questions) + len(found.doubts)
        left = "" if not open_questions else f"; {open_questions} asked in it"
        sys.stdout.write(f"{args.out}: {len(found.guess.lines)} columns{left}\n")
    return 0
