"""`rw-ekf bench`: friction compensations on one attitude bench, side by side."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rw_ekf.checking.choices import MOST_SEEDS, whole_number

HELP = "attitude bench: friction compensations side by side, over a wheel that reverses"
EXAMPLE = """example:
  rw-ekf bench
  rw-ekf bench --schemes all --seeds 30 --out bench
  rw-ekf bench --model runs/augmented-model.yaml --schemes pid_current dmc dmc_diagnosed predictive_crossing
  rw-ekf bench --effect offset_torque:torque_rad_s2=0.06 --seeds 3

docs/compensation.md says when to use which; docs/bench.md has the keys of a scenario"""
_SAMPLE_S = 4.5e-4  # processor time a sample of a run takes: 38 s for the 24 of 3500 that are run by default


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--model", metavar="F", help="model YAML: its wheel, effects and all, is put on the bench")
    parser.add_argument("--scenario", metavar="F", help="scenario YAML; default: the experiment of Carrara & Kuga 2013")
    parser.add_argument(
        "--seeds", metavar="N", type=_seeds, default=1, help="wheels, each with every scheme; default: 1"
    )
    parser.add_argument(
        "--schemes", metavar="ID", nargs="+", help="only these, or all; default: one of each kind, about a minute"
    )
    parser.add_argument(
        "--effect",
        metavar="ID:name=value",
        action="append",
        default=[],
        help="an effect of the true wheel that the first model does not have; may be repeated",
    )
    parser.add_argument(
        "--robustness", action="store_true", help="sweep what no scheme is told, until it does no better than none"
    )
    parser.add_argument("--spikes", action="store_true", help="beside the reversal, a drag spike at a steady speed")
    parser.add_argument("-o", "--out", metavar="DIR", help="write the page, its pictures and the document there")


def _seeds(text: str) -> int:
    try:
        return whole_number(text, MOST_SEEDS)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError."""
    from rw_ekf.attitude_bench.held import count_of_runs, hold_bench
    from rw_ekf.attitude_bench.prepare import scenario_of, schemes_of
    from rw_ekf.commands.answer import answer, drawn
    from rw_ekf.commands.first_use import make_ready
    from rw_ekf.commands.inputs import make_place, read_wheel_model
    from rw_ekf.compile_ahead import DIAGNOSIS
    from rw_ekf.console import progress
    from rw_ekf.worker_pool import cores

    schemes = schemes_of(args.schemes)
    model = read_wheel_model(args.model)
    scenario = scenario_of(args.scenario, model, args.effect)
    if args.out is not None:
        make_place(Path(args.out))
    make_ready(DIAGNOSIS)
    more = {"with_robustness": args.robustness, "with_spikes": args.spikes}
    runs, cycle = count_of_runs(schemes, scenario, args.seeds, **more), scenario.cycle
    about_s = runs * cycle.duration_s * cycle.rate_hz * _SAMPLE_S / min(cores(), runs)
    sys.stderr.write(
        f"rw-ekf: bench: {runs} runs of {cycle.duration_s:g} s with {len(schemes)} schemes, about {about_s:.0f} s on a "
        "desktop computer that does nothing else\n"
    )
    with progress("bench", runs, " runs") as bar:
        found = hold_bench(schemes, scenario, model, args.seeds, **more, advance=lambda of: bar.update(1))
    whole = True
    if args.out is not None:

        def write() -> None:
            for path in found.report(args.out):
                sys.stderr.write(f"rw-ekf: wrote {path}\n")

        whole = drawn(write)
    answer(args, found.document, found.text)
    return 0 if whole else 1
