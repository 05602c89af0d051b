"""Measured records: what a diagnosis says of each, and what three rivals reach on the same blocks.

python -m tools.proof.measured --data ../shared/data --out DIR

Each record is read through its shipped column map and diagnosed. Rivals (`tools.proof.rivals`) are fitted to the
blocks that the figures' numbers come from and run free over the held-out ones, each stretch from the speed that the
diagnosis's own run began with, scored on the same readings. Prints a table in markdown; `--out` leaves measured.json
and measured.md. Where the folder of records is not there it says so, and that is no failure: the records are not part
of the project.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.diagnosis.log_diagnosis import diagnose_log
from rw_ekf.diagnosis.result import Diagnosis
from rw_ekf.json_output import json_text
from rw_ekf.logs.column_map_file import load_column_map
from rw_ekf.logs.reader import read_log
from rw_ekf.settings.resources import config_resource
from rw_ekf.units import rad_s_from_rpm
from tools.proof.measured_table import MOST, table
from tools.proof.rival_changes import Blocks, start_speed_rad_s
from tools.proof.rival_terms import Rows
from tools.proof.rivals import fitted_rivals

_FIGURES = ("one_step_rms_rpm", "horizon_1s_rms_rpm", "horizon_20s_rms_rpm", "free_run_rms_rpm")


class Measured(NamedTuple):
    """A record of the folder and the map that reads it."""

    name: str
    path: str
    columns: str


RECORDS = (
    Measured("emps", "emps/DATA_EMPS.mat", "emps-mat"),
    Measured("odrive 3, compensated", "odrive_cogging/accel_tests/spinup_3_comp.mat", "odrive-mat"),
    Measured("odrive 4", "odrive_cogging/accel_tests/spinup_4_nocomp.mat", "odrive-mat"),
    Measured("odrive 5", "odrive_cogging/accel_tests/spinup_5_nocomp.mat", "odrive-mat"),
    Measured("dyno_motor", "dyno_motor/data_concat.csv", "dyno-motor"),
    Measured("prbs_motor", "prbs_motor/DCmotor_prbs_open_exp.csv", "prbs-motor"),
    Measured("pendulum", "pendulum/measured_data.csv", "pendulum"),
    Measured("dspace_motor", "dspace_motor/dataset.mat", "dspace-motor"),
)


def judged(record: Measured, folder: Path) -> dict[str, Any]:
    """What is said of a record, and what rivals reach, speeds in rad/s (m/s of a carriage)."""
    log = read_log(folder / record.path, load_column_map(config_resource(f"columns-{record.columns}")))
    began = time.process_time()
    diagnosis = diagnose_log(log)
    seconds = time.process_time() - began
    began = time.process_time()
    blocks, heldout = blocks_of(diagnosis)
    rivals = fitted_rivals(blocks)
    missed = [rival.missed_rad_s(blocks, heldout) for rival in rivals]
    ours = own_free_run_rad_s(diagnosis, heldout)
    ratio = None if ours is None else ours / min(missed)
    document = diagnosis.document()
    return {
        "record": record.name,
        "samples": document["samples"],
        "rate_hz": document["rate_hz"],
        "verdict": document["verdict"],
        "before": _in_rad_s(document["before"]),
        "after": _in_rad_s(document["after"]),
        "cpu_s": seconds,
        "ours_free_run_rad_s": ours,
        "rivals": [
            {
                "rival": rival.name,
                "free_run_rad_s": error,
                "how": rival.how,
                "coefficients": {n: c for n, c in zip(rival.terms.names, rival.coefficients, strict=True) if c != 0.0},
            }
            for rival, error in zip(rivals, missed, strict=True)
        ],
        "rivals_cpu_s": time.process_time() - began,
        "ours_over_best": ratio,
        "holds": None if ratio is None else ratio <= MOST,
        "warnings": document["warnings"],
    }


def blocks_of(diagnosis: Diagnosis) -> tuple[Blocks, BoolArray]:
    """The record as rivals get it, and the rows (n,) that all are scored on.

    A stretch begins where the diagnosis's own run did, with its speed there; where nothing was diagnosed, at each
    span of the split, by a line through the first readings.
    """
    rows = Rows.of_log(diagnosis.log)
    heldout, trace = diagnosis.heldout, diagnosis.after or diagnosis.before
    begins = np.diff(heldout.astype(int), prepend=-1) != 0
    begins |= np.diff(rows.segment, prepend=-1) != 0
    if trace is None:
        start = np.zeros(heldout.size)
        for i in np.flatnonzero(begins):
            start[i] = start_speed_rad_s(rows, int(i))
        return Blocks(rows, ~heldout, begins, start), heldout
    run = trace.free_run_rad_s
    there = np.isfinite(run)
    begins = there & (begins | ~np.concatenate(([False], there[:-1])))
    # A run's first rows may be left to the filter to settle: what begins a stretch is the first row that has a speed.
    return Blocks(rows, there & ~heldout, begins, np.where(there, run, 0.0)), there & heldout


def own_free_run_rad_s(diagnosis: Diagnosis, part: BoolArray) -> float | None:
    """Root mean square by which the diagnosis's model, run free, misses readings of a part (n,); None without one."""
    trace = diagnosis.after or diagnosis.before
    if trace is None:
        return None
    error: Float64Array = (trace.free_run_rad_s - diagnosis.log.speed_rad_s)[part]
    return float(np.sqrt(np.nanmean(error**2)))


def _in_rad_s(figures: dict[str, Any]) -> dict[str, Any]:
    found = {
        name.replace("_rpm", "_rad_s"): None if figures[name] is None else rad_s_from_rpm(figures[name])
        for name in _FIGURES
    }
    return found | {"nis_mean": figures["nis_mean"]}


def main(arguments: Sequence[str] | None = None) -> int:
    """Judge the records that are there; 0 also where there are none."""
    parser = argparse.ArgumentParser(description="measured records and what rivals reach on them")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"), help="folder of the measured records")
    parser.add_argument("--only", nargs="*", default=[], help="records whose names begin so")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, help="directory for measured.json and measured.md")
    requested = parser.parse_args(arguments)
    wanted = [
        one for one in RECORDS if not requested.only or any(one.name.startswith(begin) for begin in requested.only)
    ]
    there = [one for one in wanted if (requested.data / one.path).is_file()]
    if not there:
        print(f"Skipped: the measured records are not here ({requested.data}); --data names their folder.")
        return 0
    for one in wanted:
        if one not in there:
            print(f"{one.name}: {one.path} is not there, left out.", file=sys.stderr)
    found = []
    with ProcessPoolExecutor(requested.jobs) as pool:
        for item in pool.map(judged, there, [requested.data] * len(there)):
            found.append(item)
            print(f"{item['record']}: {item['verdict']['kind']}, {item['cpu_s']:.0f} s", file=sys.stderr, flush=True)
    text = table(found)
    print(text)
    if requested.out is not None:
        requested.out.mkdir(parents=True, exist_ok=True)
        (requested.out / "measured.json").write_text(json_text({"schema": "rw_ekf.measured/1", "records": found}))
        (requested.out / "measured.md").write_text(text + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
