"""`rw-ekf export`: a log in another format, under the names and units of docs/contract.md#logs."""

from __future__ import annotations

import argparse
import sys

HELP = "convert a log: CSV, Parquet, MATLAB"
EXAMPLE = """example:
  rw-ekf export runs/2026-11-21.csv run.parquet
  rw-ekf export carriage.csv carriage.mat --columns columns-emps.yaml"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("log", metavar="LOG", help="CSV, Parquet or MATLAB file")
    parser.add_argument("out", metavar="OUT", help="file to write: .csv, .parquet or .mat")
    parser.add_argument("--columns", metavar="MAP", help="column map (YAML) of a foreign log; see docs/logs.md")


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises LogError or BadInputError."""
    from rw_ekf.commands.inputs import read_logs, refuse_to_overwrite
    from rw_ekf.json_output import print_json
    from rw_ekf.logs.export import export_log
    from rw_ekf.logs.tables import check_suffix

    check_suffix(args.out)
    refuse_to_overwrite([args.out], [args.log, args.columns])
    (log,) = read_logs([args.log], args.columns)
    export_log(log, args.out)
    for text in log.warnings:
        sys.stderr.write(f"warning: {text}\n")
    if args.json:
        print_json(
            {
                "schema": "rw_ekf.export/1",
                "log": log.name,
                "out": args.out,
                "samples": len(log),
                "warnings": log.warnings,
            }
        )
    else:
        sys.stdout.write(f"{args.out}: {len(log)} samples\n")
    return 0
