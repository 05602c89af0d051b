"""Prove the diagnosis on undeclared effects: simulate, log, diagnose, and tabulate what was named.

    python -m tools.proof.prove                      all marks: about a thousand logs, hours on two cores
    python -m tools.proof.prove --quick              40 logs
    python -m tools.proof.prove --only healthy,effect:drag_spike --cases 60 --json out.json
    python -m tools.proof.prove --tty --cases 8      the whole way: simulate, excite and diagnose over a pty
    python -m tools.proof.prove --save-log id-1rpm-004-viscous_temperature log.csv

The wheels are those of rw_ekf.drivers.sim.plant_batch and of MuJoCo, which share no line with the estimator. Every case
depends on its name and --seed alone. Exit status 1 if a mark is missed.
"""

from __future__ import annotations

import argparse
import importlib
import json
import multiprocessing
import platform
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from tqdm import tqdm

from rw_ekf.drivers.sim.plant_effects import CATALOGUE_IDS
from rw_ekf.errors import BadInputError
from rw_ekf.logs.wheel_log import WheelLog
from tools.proof import tables as proof_tables
from tools.proof.cases import Case
from tools.proof.detectable import detectable_of
from tools.proof.judge import Record, as_json, failure_of, record_of
from tools.proof.marks import MARKS, case_called, cases_of
from tools.proof.plants import log_of, save_log
from tools.proof.reliability import reliability_table
from tools.proof.tty import SPEED_FACTOR, TtyError, diagnose_over_tty, tty_cases

DIAGNOSIS = "rw_ekf.diagnosis.log_diagnosis:diagnose_log"
_REPORTED = "fit_told"  # beside it: fit_told(log, effect_ids) -> free-run RMS [rpm] or None
_TTY_CASES = 8
_SAVE_EVERY = 25
_warm: set[str] = set()  # of this process: a first diagnosis loads, and may compile, what all others find ready


@dataclass(frozen=True)
class Job:
    """What a worker needs to know besides the case."""

    diagnosis: str = DIAGNOSIS
    reported: bool = True
    tty: str | None = None  # directory for the runs over a tty
    speed_factor: float = SPEED_FACTOR  # of the wheel's time there


def prove(case: Case, job: Job) -> Record:
    """Make the case's log, have it diagnosed, judge the verdict. Never raises: what breaks is an outcome."""
    began = time.perf_counter()
    facts: dict[str, Any] = {}
    try:
        facts = detectable_of(case)._asdict()
        log: WheelLog | None = None
        if job.tty is not None:
            document, seconds, _ = diagnose_over_tty(case, Path(job.tty) / case.name, job.speed_factor)
        else:
            log = log_of(case)
            diagnose = _found(job.diagnosis)
            began = time.perf_counter()
            document = diagnose(log).document()
            seconds = time.perf_counter() - began
            facts["cold"] = job.diagnosis not in _warm
            _warm.add(job.diagnosis)
        reported = _reported(case, log, job) if log is not None and job.reported else None
        return record_of(case, document, seconds, reported_free_run_rpm=reported, **facts)
    except TtyError as error:
        return failure_of(case, str(error), time.perf_counter() - began, facts)
    except Exception:  # noqa: BLE001 - whatever a diagnosis raises is a finding about it, and the proof goes on
        return failure_of(case, traceback.format_exc(limit=-6), time.perf_counter() - began, facts)


def _found(path: str) -> Callable[..., Any]:
    """The function named MODULE:FUNCTION."""
    module, _, name = path.partition(":")
    function: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return function


def _reported(case: Case, log: WheelLog, job: Job) -> float | None:
    """Free-run error of a fit that is told the true effects; None where the diagnosis offers no such fit."""
    if case.expects != "effects":
        return None
    module = importlib.import_module(job.diagnosis.partition(":")[0])
    fit = getattr(module, _REPORTED, None)
    found = None if fit is None else fit(log, list(case.expected))
    return None if found is None else float(found)


def chosen_cases(only: Sequence[str], seed: int, count: int | None, *, quick: bool) -> list[Case]:
    """Cases of the marks in `only` (all, if empty); `effect:ID` takes the wheels with that effect alone.

    Raises BadInputError for a mark or an effect that does not exist.
    """
    marks = [word for word in only if not word.startswith("effect:")]
    effects = [word.removeprefix("effect:") for word in only if word.startswith("effect:")]
    known = {"marks": [*MARKS], "effects": [*CATALOGUE_IDS]}
    for kind, words in (("marks", marks), ("effects", effects)):
        strange = [word for word in words if word not in known[kind]]
        if strange:
            raise BadInputError(f"--only: there is no {strange[0]!r}; {kind}: {', '.join(known[kind])}")
    cases: list[Case] = []
    for mark in marks or ([] if effects else MARKS):
        usual = MARKS[mark].quick if quick else MARKS[mark].count
        cases += cases_of(mark, usual if count is None else count, seed)
    if effects:
        found = [
            case
            for mark in ("id-1rpm", "id-5rpm", "p12-1rpm")
            for case in cases_of(mark, MARKS[mark].count, seed)
            if case.expected and case.expected[0] in effects
        ]
        cases += found if count is None else found[:count]
    return cases


def prove_all(cases: Sequence[Case], job: Job, jobs: int, keep: Callable[[list[Record]], None]) -> list[Record]:
    """Records in the order of the cases; `keep` is told of all so far now and then."""
    records: dict[str, Record] = {}
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context) as pool, tqdm(total=len(cases), unit="log", disable=None) as bar:
        waiting: list[Future[Record]] = [pool.submit(prove, case, job) for case in cases]
        try:
            for done in as_completed(waiting):
                record = done.result()
                records[record.case] = record
                bar.set_postfix_str(f"{record.case}: {record.outcome}")
                bar.update()
                if len(records) % _SAVE_EVERY == 0:
                    keep(_in_order(cases, records))
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            print(f"interrupted after {len(records)} of {len(cases)} logs", file=sys.stderr)
    return _in_order(cases, records)


def _in_order(cases: Sequence[Case], records: dict[str, Record]) -> list[Record]:
    return [records[case.name] for case in cases if case.name in records]


def write_json(path: str, records: Sequence[Record], seed: int) -> None:
    """One object per case."""
    document = {"schema": "rw_ekf.proof/1", "seed": seed, "cases": [as_json(record) for record in records]}
    Path(path).write_text(json.dumps(document, indent=1, default=float) + "\n", encoding="utf-8")


def markdown_text(records: Sequence[Record], seed: int, command: str) -> str:
    """The tables for docs/diagnosis-proof.md."""
    now = datetime.now(UTC).strftime("%Y-%m-%d")
    parts = [
        f"Made {now} by `{command}`, seed {seed}, {len(records)} logs, Python {platform.python_version()}.",
        "## Marks",
        proof_tables.as_markdown(proof_tables.marks_table(records)),
        "## Probabilities",
        "Of what was stated with a probability, how often it was so: all entries of a verdict, and its likeliest.",
        proof_tables.as_markdown(reliability_table(records)),
        "## Outcomes",
        proof_tables.as_markdown(proof_tables.outcomes_table(records)),
    ]
    for mark in dict.fromkeys(record.mark for record in records if record.mark != "pairs"):
        title = MARKS[mark].title if mark in MARKS else "over a tty"
        mine = [record for record in records if record.mark == mark]
        parts += [f"## Injected and named: {title}", proof_tables.as_markdown(proof_tables.confusion_table(mine))]
    parts += ["## By effect", proof_tables.as_markdown(proof_tables.effects_table(records))]
    parts += ["## What was not right", proof_tables.as_markdown(proof_tables.not_right_table(records))]
    return "\n\n".join(parts) + "\n"


def print_tables(records: Sequence[Record]) -> None:
    """All tables, the marks last."""
    sections = (
        ("what was not right", proof_tables.not_right_table(records)),
        ("by effect", proof_tables.effects_table(records)),
        ("injected and named", proof_tables.confusion_table(records)),
        ("outcomes", proof_tables.outcomes_table(records)),
        ("probabilities", reliability_table(records)),
        ("marks", proof_tables.marks_table(records)),
    )
    for title, table in sections:
        print(f"\n{title}\n\n{proof_tables.as_text(table)}")
    for record in records:
        if record.error is not None:
            print(f"\n{record.case} failed:\n{record.error}", file=sys.stderr)
            break


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="about 40 logs")
    parser.add_argument("--only", action="append", default=[], metavar="MARK", help=f"{', '.join(MARKS)}, effect:ID")
    parser.add_argument("--cases", type=int, metavar="N", help="logs per mark")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2, help="worker processes, one thread each")
    parser.add_argument("--json", metavar="FILE", help="one record per case")
    parser.add_argument("--markdown", metavar="FILE", help="the tables for docs/diagnosis-proof.md")
    parser.add_argument("--save-log", nargs=2, metavar=("CASE", "FILE"), help="write one case's log and leave")
    parser.add_argument("--list", action="store_true", help="print the cases and leave")
    parser.add_argument("--tty", action="store_true", help=f"over a pty; {_TTY_CASES} cases by default")
    parser.add_argument("--speed-factor", type=float, default=SPEED_FACTOR, metavar="X", help="of the tty's wheel")
    parser.add_argument("--no-told", action="store_true", help="do not fit with the true effect for comparison")
    parser.add_argument("--diagnosis", default=DIAGNOSIS, metavar="MODULE:FUNCTION", help="what is put to the proof")
    return parser.parse_args()


def main() -> int:
    """Run what was asked for; returns the exit status."""
    args = arguments()
    try:
        if args.save_log:
            name, path = args.save_log
            save_log(log_of(case_called(name, args.seed)), path)
            return 0
        only = [word for text in args.only for word in text.split(",")]
        cases = (
            tty_cases(args.cases or _TTY_CASES, args.seed)
            if args.tty
            else chosen_cases(only, args.seed, args.cases, quick=args.quick)
        )
    except BadInputError as error:
        print(f"prove_diagnosis: {error}", file=sys.stderr)
        return 2
    if args.list:
        for case in cases:
            print(f"{case.name}  {case.profile}  {case.noise_rpm:.2g} rpm  {' '.join(case.effects)}")
        return 0

    def keep(so_far: list[Record]) -> None:
        if args.json:
            write_json(args.json, so_far, args.seed)

    with tempfile.TemporaryDirectory(prefix="rw-ekf-proof-") as directory:
        job = Job(args.diagnosis, not args.no_told, directory if args.tty else None, args.speed_factor)
        records = prove_all(cases, job, args.jobs, keep)
    keep(records)
    if args.markdown:
        command = " ".join(["python", "-m", "tools.proof.prove", *sys.argv[1:]])
        Path(args.markdown).write_text(markdown_text(records, args.seed, command), encoding="utf-8")
    print_tables(records)
    return 1 if any(share.met is False for share in proof_tables.shares(records)) else 0


if __name__ == "__main__":
    sys.exit(main())
