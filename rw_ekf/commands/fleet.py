"""`rw-ekf fleet`: many wheels over years, from their logs to trends and a page."""

from __future__ import annotations

import argparse
import functools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rw_ekf.commands.answer import answer
from rw_ekf.commands.first_use import make_ready
from rw_ekf.commands.inputs import add_config_option

if TYPE_CHECKING:
    from rw_ekf.fleet.fleet_api import Diagnoses, FleetRun

HELP = "filter the logs of many wheels over years, and say which wheels age or are unlike the others"
EXAMPLE = """example:
  rw-ekf simulate fleet --out logs --wheels 20 --days 60 --seed 1
  rw-ekf fleet run logs
  rw-ekf fleet run logs --scheduler tcp://10.0.0.5:8786
  rw-ekf fleet diagnose logs --most 10
  rw-ekf fleet trends logs --limit coulomb=+50%
  rw-ekf fleet view logs

Whose a log is and when it began is told by its folder, name or metadata: docs/fleet.md"""
ACTIONS = {
    "build": "index the logs by wheel and day",
    "run": "filter what is not done yet",
    "diagnose": "what the model lacks on days that an alarm, the residual or a trend asks for",
    "trends": "ageing, changes, siblings, remaining time",
    "view": "one page of the fleet",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    stated = "; ".join(f"{name}: {what}" for name, what in ACTIONS.items())
    parser.add_argument("action", choices=list(ACTIONS), help=stated)
    parser.add_argument("directory", metavar="DIR", help="directory of logs, or the fleet's folder in it")
    parser.add_argument("-o", "--out", metavar="DIR", help="the fleet's folder (default: `fleet` in the directory)")
    parser.add_argument("--columns", metavar="MAP", help="column map (YAML) of foreign logs; see docs/logs.md")
    add_config_option(parser, "noise, prior, Stribeck speed; without it each wheel's model or first log tells")
    parser.add_argument(
        "--model", metavar="F", help="model to start from, or a folder of WHEEL.yaml for a wheel and default.yaml"
    )
    parser.add_argument("--workers", metavar="N", type=int, help="processes of this machine (default: its cores)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="a Dask scheduler, tcp://HOST:PORT, in their place")
    parser.add_argument(
        "--most", metavar="N", type=int, help="diagnose: windows, the worst wheels' first (default: 20)"
    )
    parser.add_argument(
        "--limit",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="of a parameter: coulomb=0.9, or coulomb=+50%% of where it began; `trends` says how long it takes",
    )


def execute(args: argparse.Namespace) -> int:
    """Run the verb; raises RwEkfError. Status 1 where a log failed or is not done."""
    from rw_ekf.errors import BadInputError

    if args.workers is not None and args.workers < 1:
        raise BadInputError(f"--workers {args.workers}: give 1 or more")
    if args.limit and args.action not in ("trends", "view"):
        raise BadInputError("--limit is asked of `fleet trends` and `fleet view`: leave it out")
    if args.most is not None and (args.action != "diagnose" or args.most < 1):
        raise BadInputError(f"--most {args.most}: counts the windows of `fleet diagnose`, 1 or more")
    return {"build": _build, "run": _run, "diagnose": _diagnose, "trends": _trends, "view": _view}[args.action](args)


def _build(args: argparse.Namespace) -> int:
    from rw_ekf.fleet.fleet_api import build

    found = build(args.directory, args.out)
    answer(args, found.document, found.text)
    return 0


def _run(args: argparse.Namespace) -> int:
    from rw_ekf.compile_ahead import EFFECTS, FIT
    from rw_ekf.fleet.fleet_api import run

    needed = (*FIT, *EFFECTS) if args.model is not None or args.config is not None else FIT
    return _worked(args, run, " logs", needed)


def _diagnose(args: argparse.Namespace) -> int:
    from rw_ekf.compile_ahead import DIAGNOSIS
    from rw_ekf.fleet.fleet_api import MOST_WINDOWS, diagnose

    return _worked(args, functools.partial(diagnose, most=args.most or MOST_WINDOWS), " windows", DIAGNOSIS)


def _worked(
    args: argparse.Namespace, work: Callable[..., FleetRun | Diagnoses], unit: str, needed: Sequence[str]
) -> int:
    """Have it done by the workers, with a bar; status 1 where a part of it failed or is not done."""
    from rw_ekf.commands.inputs import map_path, read_configuration
    from rw_ekf.console import progress

    configuration = read_configuration(args)
    if args.scheduler is None:
        make_ready(needed)
    with progress("fleet", None, unit) as bar:
        done = work(
            args.directory,
            args.out,
            model=args.model,
            configuration=configuration,
            columns=None if args.columns is None else map_path(args.columns),
            workers=args.workers,
            scheduler=args.scheduler,
            tick=bar.update,
        )
    answer(args, done.document, done.text)
    return 0 if done.whole else 1


def _trends(args: argparse.Namespace) -> int:
    from rw_ekf.fleet.fleet_api import trends

    found = trends(args.directory, args.out, limits=args.limit)
    answer(args, found.document, found.text)
    return 0


def _view(args: argparse.Namespace) -> int:
    from rw_ekf.console import shown_path
    from rw_ekf.fleet.fleet_api import view

    page = view(args.directory, args.out, limits=args.limit)
    answer(args, lambda: {"schema": "rw_ekf.fleet_view/1", "page": str(page)}, lambda: shown_path(Path(page)))
    return 0
