"""`rw-ekf replay`: the filter over logged runs."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.commands.first_use import make_ready
from rw_ekf.commands.inputs import (
    add_log_options,
    read_column_map,
    read_configuration,
    read_wheel_model,
    refuse_to_overwrite,
    tell_of_log,
)
from rw_ekf.commands.undrawn import drawn
from rw_ekf.errors import BadInputError

if TYPE_CHECKING:
    from rw_ekf.log_replay import Run
    from rw_ekf.logs.column_map import ColumnMap
    from rw_ekf.logs.long_log import LongLog
    from rw_ekf.logs.wheel_log import WheelLog
    from rw_ekf.long_replay import Writer
    from rw_ekf.settings.schema import Configuration
    from rw_ekf.starting_point import FilterSetup
    from rw_ekf.wheel.model_file import WheelModel

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
    refuse_to_overwrite([args.out, args.picture], [*(log for log, _ in named), args.columns, args.config, args.model])
    work = _Work(args, configuration, model, named)
    try:
        done = work.replay(in_parts=not (args.smooth or args.online or (args.out or "").lower().endswith(".mat")))
    except UnsoundError:
        done = work.replay(in_parts=False)
    whole = True
    if args.picture is not None:
        started = time.perf_counter()
        whole = drawn(lambda: save_picture(done[0].plot(), args.picture))
        work.seconds["write"] += time.perf_counter() - started
    if args.json:
        print_json({"schema": REPLAY_SCHEMA, "logs": [item.entry() for item in done], "seconds": work.seconds})
    else:
        sys.stdout.write("".join(f"{item.text()}\n" for item in done))
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


def _named(args: argparse.Namespace) -> list[tuple[str, bool]]:
    """Each log to replay, and whether from its run's own start; a directory stands for its runs, oldest first."""
    from rw_ekf.console import logger
    from rw_ekf.logs.parts import files_of_bag
    from rw_ekf.logs.run_directory import runs_of

    named = []
    for path in args.logs:
        if not Path(path).is_dir() or files_of_bag(Path(path)):
            named.append((path, args.as_run))
            continue
        runs, left_out = runs_of(Path(path))
        for text in left_out:
            logger().warning("left_out", text=text)
        named += [(str(run), args.config is None and args.model is None) for run in runs]
    return named


@dataclass
class _Work:
    """What is asked for, and how long it took."""

    args: argparse.Namespace
    configuration: Configuration | None
    model: WheelModel | None
    named: list[tuple[str, bool]]  # logs, and whether from their runs' own starts
    seconds: dict[str, float] = field(default_factory=dict)

    def replay(self, *, in_parts: bool) -> list[Run]:
        """Read, filter and write one log after the other. Raises UnsoundError where one cannot be read in parts."""
        from rw_ekf import compile_ahead
        from rw_ekf.console import progress

        self.seconds = dict.fromkeys(("read", "filter", "write"), 0.0)
        setups = [_setup_of_run(path) if own else None for path, own in self._there()]
        starts = [self.model, *setups]
        with_effects = any(start is not None and start.effects.size > 0 for start in starts)
        with_record = (*compile_ahead.FILTER, *(compile_ahead.SMOOTHER if self.args.smooth else ()))
        columns = read_column_map(self.args.columns)
        needed = (*with_record, *compile_ahead.EFFECTS) if with_effects else compile_ahead.FIT
        done: list[Run] = []
        with self._writer() as write:
            for (path, _), setup in zip(self.named, setups, strict=True):
                log = self._read(path, columns, setup, in_parts=in_parts)
                if log is None:
                    continue
                if not done:  # not before the first log is known to be one
                    make_ready(needed)
                with progress("replay", len(log), " samples") as bar, self._timed("filter"):
                    done.append(self._filtered(log, setup, write, bar.update))
        return done

    def _there(self) -> list[tuple[str, bool]]:
        """The logs. Raises LogError where one is not there, or is of no known form: before work is done on others."""
        from rw_ekf.logs.formats import format_of
        from rw_ekf.logs.parts import parts_of

        for path, _ in self.named:
            for file in parts_of(Path(path)).files[:1]:
                format_of(file, str(file))
        return self.named

    def _read(
        self, path: str, columns: ColumnMap, setup: FilterSetup | None, *, in_parts: bool
    ) -> WheelLog | LongLog | None:
        """A log; None for a run of a directory that ended before its first row."""
        from rw_ekf.console import logger
        from rw_ekf.errors import EmptyLogError
        from rw_ekf.logs.long_log import long_log_of
        from rw_ekf.logs.reader import read_log

        start = setup or self.model
        with self._timed("read"):
            try:
                carried = () if start is None else start.effects.columns
                long = long_log_of(Path(path), columns, carried) if in_parts else None
                log = long or read_log(path, columns)
                tell_of_log(log)
                return log
            except EmptyLogError as error:
                if path in self.args.logs:
                    raise
                logger().warning("left_out", text=str(error))
        return None

    def _filtered(
        self, log: WheelLog | LongLog, setup: FilterSetup | None, write: Writer | None, advance: Callable[[int], object]
    ) -> Run:
        from rw_ekf.log_replay import replay_log
        from rw_ekf.logs.long_log import LongLog
        from rw_ekf.logs.thinned import ThinnedRows
        from rw_ekf.long_replay import replay_long

        if isinstance(log, LongLog):
            rows = ThinnedRows(len(log)) if self.args.picture is not None else None
            takers = [taker for taker in (write, rows) if taker is not None]
            run = replay_long(log, self.configuration, self.model, setup, writers=takers, advance=advance)
            return run if rows is None else replace(run, picture_rows=rows.taken())
        run = replay_log(
            log, self.configuration, self.model, setup,
            with_columns=write is not None or self.args.picture is not None,
            smooth=self.args.smooth,
            online=self.args.online,
            advance=advance if self.args.online else lambda rows: None,
        )  # fmt: skip
        if write is not None and run.columns is not None:
            write(log, run.columns)
        return run

    @contextmanager
    def _writer(self) -> Iterator[Writer | None]:
        """What writes the table of all logs, if one is asked for; several are under a first column `log`."""
        import numpy as np

        from rw_ekf.console import printable
        from rw_ekf.logs.tables import table_writer

        if self.args.out is None:
            yield None
            return
        with table_writer(self.args.out) as write:

            def written(log: WheelLog, columns: dict[str, Any]) -> None:
                of_log = {"log": np.full(len(log), printable(log.name), dtype=object)} if len(self.named) > 1 else {}
                with self._timed("write"):
                    write({**of_log, **columns})

            yield written

    @contextmanager
    def _timed(self, what: str) -> Iterator[None]:
        started = time.perf_counter()
        yield
        self.seconds[what] += time.perf_counter() - started


def _setup_of_run(path: str) -> FilterSetup:
    from rw_ekf.log_replay import setup_of_run

    return setup_of_run(Path(path))
