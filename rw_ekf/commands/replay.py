"""`rw-ekf replay`: the filter over logged runs (`rw_ekf.commands.log_replays`)."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from rw_ekf.commands.answer import drawn
from rw_ekf.commands.inputs import (
    add_log_options,
    read_column_map,
    read_configuration,
    read_wheel_model,
    refuse_to_overwrite,
)
from rw_ekf.errors import BadInputError

if TYPE_CHECKING:
    from rw_ekf.commands.log_replays import NamedLog

HELP = "filter logged runs"
EXAMPLE = """example:
  rw-ekf replay runs/2026-11-21.csv --out estimates.csv --picture run.png
  rw-ekf replay runs --json
  rw-ekf replay carriage.csv --columns columns-emps.yaml --json"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "logs",
        nargs="+",
        metavar="LOG",
        help="a log; or a directory: its runs, each from its own start, or its logs where no run wrote them",
    )
    add_log_options(parser)
    parser.add_argument("--model", metavar="F", help="model YAML to start from, as `fit --out` or a run writes it")
    parser.add_argument("--prior", dest="model", metavar="F", help=argparse.SUPPRESS)
    parser.add_argument(
        "--as-run",
        action="store_true",
        help="start each log as its run did, by the .start.yaml and .meta.yaml beside it",
    )
    parser.add_argument("-o", "--out", metavar="FILE", help="one row per sample, CSV, Parquet or .mat by its ending")
    parser.add_argument(
        "--picture", metavar="FILE", help="speed, innovation, parameters of one log: .png, .svg or .pdf"
    )
    parser.add_argument(
        "--smooth", action="store_true", help="add smoothed states (the whole log's hindsight) to --out"
    )
    parser.add_argument("--online", action="store_true", help="through the daemon's own loop, not the compiled pass")


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    from rw_ekf.commands.log_replays import LogReplays
    from rw_ekf.documents import REPLAY_SCHEMA
    from rw_ekf.json_output import print_json
    from rw_ekf.logs.in_parts import UnsoundError
    from rw_ekf.logs.picture_file import save_picture

    _check(args)
    configuration = read_configuration(args)
    model = read_wheel_model(args.model, configuration)
    named = _named(args)
    if args.picture is not None and len(named) != 1:
        raise BadInputError(f"--picture shows one log, {len(named)} are named: replay them one by one")
    refuse_to_overwrite([args.out, args.picture], [*(log.path for log in named), args.columns, args.config, args.model])
    work = LogReplays(args, configuration, model, read_column_map(args.columns), named)
    try:
        done = work.replay(in_parts=not (args.smooth or args.online or (args.out or "").lower().endswith(".mat")))
    except UnsoundError:
        done = work.replay(in_parts=False)
    whole = True
    run = done[0].run if done else None
    if run is not None:
        started = time.perf_counter()
        whole = drawn(lambda: save_picture(run.plot(), args.picture))
        work.seconds["write"] += time.perf_counter() - started
    if args.json:
        print_json({"schema": REPLAY_SCHEMA, "logs": [item.entry for item in done], "seconds": work.seconds})
    else:
        sys.stdout.write("".join(f"{item.text}\n" for item in done))
    return 0 if whole else 1


def _check(args: argparse.Namespace) -> None:
    """Raise BadInputError for options that go ill together."""
    from rw_ekf.logs.picture_file import check_picture_suffix
    from rw_ekf.logs.tables import check_suffix

    if args.smooth and args.out is None:
        raise BadInputError("--smooth adds columns to --out: name a file with --out FILE")
    if args.smooth and args.online:
        raise BadInputError("--smooth needs the whole log at once and --online goes sample by sample: drop one of them")
    if args.as_run and (args.config is not None or args.model is not None):
        raise BadInputError("--as-run takes each run's own configuration and start: leave out --config and --model")
    check_picture_suffix(args.picture)
    if args.out is not None:
        check_suffix(args.out)


def _named(args: argparse.Namespace) -> list[NamedLog]:
    """Each log to replay; a directory stands for its runs, oldest first, or for its logs where none is a run's."""
    from rw_ekf.commands.log_replays import NamedLog
    from rw_ekf.console import logger
    from rw_ekf.logs.parts import files_of_bag
    from rw_ekf.logs.run_directory import no_run, runs_of

    named = []
    for path in args.logs:
        if not Path(path).is_dir() or files_of_bag(Path(path)):
            named.append(NamedLog(path, args.as_run, must_have_rows=True))
            continue
        runs, others = runs_of(Path(path))
        for log in others if runs else ():
            logger().warning("left_out", text=no_run(log))
        from_own_start = args.as_run or bool(runs and args.config is None and args.model is None)
        named += [NamedLog(str(log), from_own_start, must_have_rows=False) for log in runs or others]
    return named
