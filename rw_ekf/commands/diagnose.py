"""`rw-ekf diagnose`: from a residual to the effect that the model lacks."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import get_args

from rw_ekf.checking.choices import SplitKind
from rw_ekf.commands.answer import answer, drawn
from rw_ekf.commands.first_use import make_ready
from rw_ekf.commands.inputs import (
    add_log_options,
    log_options,
    make_place,
    read_configuration,
    read_logs,
    read_own_effects,
    read_wheel_model,
    refuse_to_overwrite,
    wheel_of_logs,
)

HELP = "find what the model lacks in a log, add it, and prove it"
EXAMPLE = """example:
  rw-ekf diagnose runs/2026-11-21.csv --out diagnosis
  rw-ekf diagnose coast-down-520.csv coast-down-300.csv --out diagnosis
  rw-ekf diagnose carriage.csv --columns columns-emps.yaml --split halves --json
  rw-ekf diagnose runs/2026-11-21.csv --effect-file my-effects.yaml --out diagnosis"""

_STEPS = 12  # that a diagnosis usually announces


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "logs", metavar="LOG", nargs="+", help="CSV, Parquet or MATLAB file; several of one wheel are one diagnosis"
    )
    add_log_options(parser)
    parser.add_argument(
        "--model", metavar="F", help="model YAML to diagnose, effects included; default: the four parameters"
    )
    parser.add_argument(
        "--effect-file",
        metavar="F",
        help="effects by formulas of your own (YAML), judged beside the catalogue; see docs/own-effects.md",
    )
    parser.add_argument(
        "--split",
        choices=get_args(SplitKind),
        default="blocks",
        help="what is held out: every other block (default), or the second half",
    )
    parser.add_argument(
        "-o", "--out", metavar="DIR", help="report.html, pictures, diagnosis.json and augmented-model.yaml"
    )


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    from rw_ekf.compile_ahead import DIAGNOSIS
    from rw_ekf.console import progress
    from rw_ekf.logs.run_directory import DIAGNOSED_MODEL

    directory = None if args.out is None else Path(args.out)
    if directory is not None:
        names = ("report.html", "diagnosis.json", DIAGNOSED_MODEL)
        inputs = [*args.logs, args.columns, args.config, args.effect_file]  # the model may be replaced by a better one
        refuse_to_overwrite([str(directory / name) for name in names], inputs)
    configuration = read_configuration(args)
    model = read_wheel_model(args.model, configuration)
    own = read_own_effects(args.effect_file, model)
    logs = read_logs(args.logs, args.columns, excerpts=True)
    if directory is not None:
        _make_ready(directory)

    from rw_ekf.diagnosis.log_diagnosis import diagnose_log

    make_ready(DIAGNOSIS)
    whole = True
    with progress("diagnose", _STEPS) as bar:

        def advance(text: str) -> None:
            bar.set_description(text)
            bar.total = max(bar.total, bar.n + 2)
            bar.update(1)

        found = diagnose_log(logs, configuration, model, split=args.split, advance=advance, own=own)
        if found.model is not None:
            found = replace(found, model=replace(found.model, wheel=wheel_of_logs(args.logs)))
        if directory is not None:
            advance("drawing the report")
            whole = drawn(lambda: found.report(directory, log_options(args)))
    answer(args, found.document, lambda: found.text(directory))
    return 0 if whole else 1


def _make_ready(directory: Path) -> None:
    """Make the place of the report, or refuse it, before the work that would have nowhere to go."""
    from rw_ekf.diagnosis.report.diagnosis_page import refuse_name_of_page

    refuse_name_of_page(directory)
    make_place(directory)
