"""`rw-ekf fit`: parameters (and noises) of a wheel from a whole log."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import get_args

from rw_ekf.checking.choices import FitMethod
from rw_ekf.commands.answer import answer
from rw_ekf.commands.first_use import make_ready
from rw_ekf.commands.inputs import (
    add_log_options,
    read_configuration,
    read_logs,
    read_wheel_model,
    refuse_to_overwrite,
    wheel_of_logs,
)

HELP = "fit the parameters to a whole log by least squares, or by dedicated experiments"
EXAMPLE = """example:
  rw-ekf fit runs/2026-11-21.csv --noise --out wheel.model.yaml
  rw-ekf fit runs/coast-1.csv runs/coast-2.csv
  rw-ekf replay runs/2026-11-22.csv --model wheel.model.yaml"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("logs", metavar="LOG", nargs="+", help="a log of any form, or several of one wheel")
    add_log_options(parser)
    parser.add_argument(
        "--prior", metavar="F", help="model YAML that serves as the a priori; its effects are fitted too"
    )
    parser.add_argument(
        "--method",
        choices=get_args(FitMethod),
        default="least-squares",
        help="least squares over everything (default), or coast-downs and driven stretches one by one",
    )
    parser.add_argument("--noise", action="store_true", help="tune speed and acceleration noise by maximum likelihood")
    parser.add_argument("-o", "--out", metavar="FILE", help="write the result as a model YAML")


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    from rw_ekf.batch_fit import fit_record
    from rw_ekf.compile_ahead import DIAGNOSIS, FIT
    from rw_ekf.console import progress
    from rw_ekf.logs.joined import one_log

    refuse_to_overwrite([args.out], [*args.logs, args.columns, args.config])
    configuration = read_configuration(args)
    prior = read_wheel_model(args.prior, configuration)
    log = one_log(read_logs(args.logs, args.columns))
    with_effects = prior is not None and prior.effects.terms and args.method != "deterministic"
    make_ready(DIAGNOSIS if with_effects else FIT)
    with progress("fit", None, " evaluations") as bar:
        found = fit_record(
            log, configuration, prior,
            method=args.method, with_noise=args.noise, wheel=wheel_of_logs(args.logs), advance=bar.update,
        )  # fmt: skip
    refused = args.out is not None and found.refusal is not None
    if refused:
        stated = f"{args.out} was not written, because {found.refusal}"
        found = replace(found, warnings=(*found.warnings, stated))
    elif args.out is not None:
        found.save(args.out)
    answer(args, found.document, found.text)
    return int(refused)
