"""`rw-ekf compare`: two models of a wheel, number by number, and what a third log says of both."""

from __future__ import annotations

import argparse

from rw_ekf.commands.answer import answer
from rw_ekf.commands.inputs import read_logs

HELP = "hold two models of a wheel, or what two runs learned, against each other"
EXAMPLE = """example:
  rw-ekf compare january.model.yaml june.model.yaml
  rw-ekf compare runs/2026-01-10.csv diagnosis --on runs/2026-06-02.csv"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    what = "a model file, the log of a run, whose model lies beside it, or the folder of a diagnosis"
    parser.add_argument("first", metavar="A", help=what)
    parser.add_argument("second", metavar="B", help="the same")
    parser.add_argument("--on", metavar="LOG", help="a log that says which of the two is likelier")
    parser.add_argument("--columns", metavar="F", help="column map of that log")


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    from rw_ekf.logs.run_directory import model_of
    from rw_ekf.model_comparison import compared
    from rw_ekf.wheel.model_file import read_model

    first, second = (read_model(model_of(name)) for name in (args.first, args.second))
    log = None
    if args.on is not None:
        from rw_ekf.commands.first_use import make_ready
        from rw_ekf.compile_ahead import EFFECTS, FIT

        (log,) = read_logs([args.on], args.columns)
        make_ready((*FIT, *EFFECTS) if first.effects.terms or second.effects.terms else FIT)
    found = compared(first, second, log)
    answer(args, found.document, found.text)
    return 0
