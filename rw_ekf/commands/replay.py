"""`rw-ekf replay`: the filter over logged runs."""

from __future__ import annotations

import argparse
import sys
import time
from typing import Any

from rw_ekf.commands.first_use import make_ready
from rw_ekf.commands.inputs import (
    add_log_options,
    read_configuration,
    read_logs,
    read_wheel_model,
    refuse_to_overwrite,
)

HELP = "filter logged runs"
EXAMPLE = """example:
  rw-ekf replay runs/2026-11-21.csv --out estimates.csv --picture run.png
  rw-ekf replay carriage.csv --columns columns-emps.yaml --json"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("logs", nargs="+", metavar="LOG", help="CSV, Parquet or MATLAB file")
    add_log_options(parser)
    parser.add_argument("--model", metavar="F", help="model YAML to start from, as `fit --out` or a run writes it")
    parser.add_argument("--prior", dest="model", metavar="F", help=argparse.SUPPRESS)
    parser.add_argument("--out", metavar="FILE", help="one row per sample, CSV, Parquet or .mat by its ending")
    parser.add_argument("--picture", metavar="PNG", help="speed, innovation and parameters of one log as a picture")
    parser.add_argument(
        "--smooth", action="store_true", help="add smoothed states (the whole log's hindsight) to --out"
    )
    parser.add_argument("--online", action="store_true", help="through the daemon's own loop, not the compiled pass")


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    from rw_ekf.console import progress
    from rw_ekf.documents import REPLAY_SCHEMA, entry_text, log_entry
    from rw_ekf.errors import BadInputError
    from rw_ekf.json_output import print_json
    from rw_ekf.units import rpm_from_rad_s

    if args.smooth and args.out is None:
        raise BadInputError("--smooth adds columns to --out: name a file with --out FILE")
    if args.smooth and args.online:
        raise BadInputError("--smooth needs the whole log at once and --online goes sample by sample: drop one of them")
    if args.picture is not None and len(args.logs) != 1:
        raise BadInputError(f"--picture shows one log, {len(args.logs)} are named: replay them one by one")
    if args.out is not None:
        from rw_ekf.logs.tables import check_suffix

        check_suffix(args.out)
    refuse_to_overwrite([args.out, args.picture], [*args.logs, args.columns, args.config, args.model])
    configuration = read_configuration(args.config)
    model = read_wheel_model(args.model, configuration)
    started = time.perf_counter()
    logs = read_logs(args.logs, args.columns)
    read_s = time.perf_counter() - started

    from rw_ekf import compile_ahead
    from rw_ekf.replay import replay_log

    with_effects = model is not None and model.effects.size > 0
    with_record = (*compile_ahead.FILTER, *(compile_ahead.SMOOTHER if args.smooth else ()))
    make_ready((*with_record, *compile_ahead.EFFECTS) if with_effects else compile_ahead.FIT)
    started = time.perf_counter()
    done = []
    with progress("replay", sum(len(log) for log in logs), " samples") as bar:
        for log in logs:
            done.append(
                replay_log(
                    log,
                    configuration,
                    model,
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
    if args.picture is not None:
        from rw_ekf.pictures import run_picture

        item = done[0]
        wheel_units = item.setup.inertia_kg_m2 is not None
        run_picture(args.picture, item.log, item.columns or {}, wheel_units=wheel_units)
    write_s = time.perf_counter() - started
    entries = [log_entry(item.log.name, item.statistics, item.belief, item.setup, item.warnings) for item in done]
    if args.json:
        seconds = {"read": read_s, "filter": filter_s, "write": write_s}
        print_json({"schema": REPLAY_SCHEMA, "logs": entries, "seconds": seconds})
    else:
        for entry, item in zip(entries, done, strict=True):
            sys.stdout.write(entry_text(entry, item.belief, item.setup) + "\n")
            if configuration is None:
                noise = rpm_from_rad_s(item.setup.constants.speed_noise_rad_s)
                source = "the record" if model is None else "the model"
                sys.stdout.write(f"  speed noise {noise:.3g} rpm taken from {source}; --config gives the run's own\n")
    return 0


def _write(path: str, tables: list[tuple[str, dict[str, Any]]]) -> None:
    """Write one table; several logs are stacked under a first column `log`."""
    import numpy as np

    from rw_ekf.logs.tables import write_table

    if len(tables) == 1:
        write_table(path, tables[0][1])
        return
    names = [np.full(len(columns["time_s"]), name, dtype=object) for name, columns in tables]
    stacked: dict[str, Any] = {"log": np.concatenate(names)}
    for key in tables[0][1]:
        stacked[key] = np.concatenate([np.asarray(columns[key]) for _, columns in tables])
    write_table(path, stacked)
