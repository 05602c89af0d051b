"""`rw-ekf replay`: the filter over logged runs."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.commands.first_use import make_ready
from rw_ekf.commands.inputs import (
    add_log_options,
    read_configuration,
    read_logs,
    read_wheel_model,
    refuse_to_overwrite,
)
from rw_ekf.commands.undrawn import drawn

if TYPE_CHECKING:
    from rw_ekf.logs.wheel_log import WheelLog

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
        help="CSV, Parquet or MATLAB file; a directory of runs: all of them, each from its own start",
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
    from rw_ekf.console import progress
    from rw_ekf.documents import REPLAY_SCHEMA
    from rw_ekf.errors import BadInputError
    from rw_ekf.json_output import print_json
    from rw_ekf.logs.picture_file import check_picture_suffix, save_picture

    if args.smooth and args.out is None:
        raise BadInputError("--smooth adds columns to --out: name a file with --out FILE")
    if args.smooth and args.online:
        raise BadInputError("--smooth needs the whole log at once and --online goes sample by sample: drop one of them")
    if args.as_run and (args.config is not None or args.model is not None):
        raise BadInputError("--as-run takes each run's own configuration and start: leave out --config and --model")
    check_picture_suffix(args.picture)
    if args.out is not None:
        from rw_ekf.logs.tables import check_suffix

        check_suffix(args.out)
    configuration = read_configuration(args)
    model = read_wheel_model(args.model, configuration)
    started = time.perf_counter()
    named = _named(args)
    if args.picture is not None and len(named) != 1:
        raise BadInputError(f"--picture shows one log, {len(named)} are named: replay them one by one")
    refuse_to_overwrite([args.out, args.picture], [*(log for log, _ in named), args.columns, args.config, args.model])
    logs = _read(named, args)
    read_s = time.perf_counter() - started

    from rw_ekf import compile_ahead
    from rw_ekf.log_replay import replay_log, setup_of_run

    setups = [setup_of_run(Path(log.name)) if own else None for log, own in logs]
    started_from = [model.effects] if model is not None else [setup.effects for setup in setups if setup is not None]
    with_effects = any(effects.size > 0 for effects in started_from)
    with_record = (*compile_ahead.FILTER, *(compile_ahead.SMOOTHER if args.smooth else ()))
    make_ready((*with_record, *compile_ahead.EFFECTS) if with_effects else compile_ahead.FIT)
    started = time.perf_counter()
    done = []
    with progress("replay", sum(len(log) for log, _ in logs), " samples") as bar:
        for (log, _), setup in zip(logs, setups, strict=True):
            done.append(
                replay_log(
                    log,
                    configuration,
                    model,
                    setup,
                    with_columns=args.out is not None or args.picture is not None,
                    smooth=args.smooth,
                    online=args.online,
                    advance=bar.update if args.online else lambda n: None,
                )
            )
            if not args.online:
                bar.update(len(log))
    filter_s = time.perf_counter() - started
    started = time.perf_counter()
    if args.out is not None:
        _write(args.out, [(item.log.name, item.columns or {}) for item in done])
    whole = True
    if args.picture is not None:
        whole = drawn(lambda: save_picture(done[0].plot(), args.picture))
    write_s = time.perf_counter() - started
    if args.json:
        seconds = {"read": read_s, "filter": filter_s, "write": write_s}
        print_json({"schema": REPLAY_SCHEMA, "logs": [item.entry() for item in done], "seconds": seconds})
    else:
        sys.stdout.write("".join(f"{item.text()}\n" for item in done))
    return 0 if whole else 1


def _named(args: argparse.Namespace) -> list[tuple[str, bool]]:
    """Each log to replay, and whether from its run's own start; a directory stands for its runs, oldest first."""
    from rw_ekf.console import logger
    from rw_ekf.logs.run_directory import runs_of

    named = []
    for path in args.logs:
        if not Path(path).is_dir():
            named.append((path, args.as_run))
            continue
        runs, left_out = runs_of(Path(path))
        for text in left_out:
            logger().warning("left_out", text=text)
        named += [(str(run), args.config is None and args.model is None) for run in runs]
    return named


def _read(named: list[tuple[str, bool]], args: argparse.Namespace) -> list[tuple[WheelLog, bool]]:
    """Read the logs; a run of a directory that ended before its first row is left out."""
    from rw_ekf.console import logger
    from rw_ekf.errors import EmptyLogError

    logs = []
    for path, own in named:
        try:
            logs.append((read_logs([path], args.columns)[0], own))
        except EmptyLogError as error:
            if path in args.logs:
                raise
            logger().warning("left_out", text=str(error))
    return logs


def _write(path: str, tables: list[tuple[str, dict[str, Any]]]) -> None:
    """Write one table; several logs are stacked under a first column `log`."""
    import numpy as np

    from rw_ekf.console import printable
    from rw_ekf.logs.tables import write_table

    if len(tables) == 1:
        write_table(path, tables[0][1])
        return
    names = [np.full(len(columns["time_s"]), printable(name), dtype=object) for name, columns in tables]
    stacked: dict[str, Any] = {"log": np.concatenate(names)}
    for key in tables[0][1]:
        stacked[key] = np.concatenate([np.asarray(columns[key]) for _, columns in tables])
    write_table(path, stacked)
