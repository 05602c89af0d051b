"""Measure how fast the filter is: an online tick, and the compiled pass over a million samples of several courses.

    python -m tools.measure.speed
    python -m tools.measure.speed --against ../before    whole commands, by turns with the code of another folder

Online and compiled are held against each other on the way. Exit status 1 if they differ.
"""

from __future__ import annotations

import argparse
import math
import platform
import sys
import time
from typing import Any

import numpy as np
from tqdm import tqdm

from rw_ekf.arrays import Float64Array
from rw_ekf.control.profiles import make_profile, sample_profile
from rw_ekf.course.course import Course
from rw_ekf.filter.belief import DEFAULT_PRIOR
from rw_ekf.filter.estimator import Estimator
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.records import IssuedCommand, WheelSample
from rw_ekf.units import RAD_S_PER_RPM
from tools.measure.against import show_against
from tools.measure.estimator import run_of
from tools.measure.processor import add_other_checkout, trees_of
from tools.measure.runs import constants_for, free_run_of
from tools.measure.table import Row, at_most, show

MILLION = 1_000_000
COURSES = ("identification", "sine 0.1 A, 30 s", "P1", "P2", "S1", "at rest")


def measure_online(advance: tqdm[Any]) -> list[Row]:
    """Online against compiled on the same log, and the time of an online tick."""
    rows = []
    for profile in ("P1", "S2"):
        run, constants = run_of(profile, 1), constants_for()
        found = filter_log(run.course, constants, DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance, keep_states=True)
        estimator = Estimator(constants, DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
        worst, ticks = 0.0, []
        for i in range(run.time_s.size):
            sample = WheelSample(float(run.time_s[i]), float(run.reading_rad_s[i]))
            started = time.perf_counter()
            result = estimator.step(sample)
            estimator.command_issued(IssuedCommand(float(run.current_A[i])))
            ticks.append(time.perf_counter() - started)
            worst = max(worst, float(np.max(np.abs(np.array(result.values) - found.states[i]) / found.stds[i])))
        rows.append(at_most(f"{profile}  online against compiled, worst difference in sigma", worst, 1e-6))
        middle, late = (1e6 * float(np.quantile(ticks, q)) for q in (0.5, 0.999))
        rows.append(Row(f"{profile}  online tick, median and 99.9 %", f"{middle:.0f} and {late:.0f} us"))
        advance.update()
    return rows


def long_run(name: str) -> tuple[Float64Array, Float64Array]:
    """Times and currents of a million samples at 10 Hz."""
    time_s = np.linspace(0.0, 0.1 * (MILLION - 1), MILLION)
    if name == "sine 0.1 A, 30 s":
        return time_s, 0.1 * np.sin(2.0 * np.pi * time_s / 30.0)
    if name == "at rest":
        return time_s, np.zeros(MILLION)
    _, current = sample_profile(make_profile(name, seed=1), 10.0)
    return time_s, np.resize(np.array(current), MILLION)


def measure_kernel(advance: tqdm[Any]) -> list[Row]:
    """Nanoseconds per sample of the compiled pass, best of three."""
    rows = []
    for name in COURSES:
        time_s, current_A = long_run(name)
        speed = free_run_of(Course.of(time_s, np.zeros(MILLION), current_A), 0.0).path_rad_s
        reading = speed + RAD_S_PER_RPM * np.random.default_rng(1).standard_normal(MILLION)
        course = Course.of(time_s, reading, current_A)
        best = math.inf
        for _ in range(3):
            started = time.perf_counter()
            filter_log(course, constants_for(), DEFAULT_PRIOR.mean, DEFAULT_PRIOR.covariance)
            best = min(best, time.perf_counter() - started)
        rows.append(Row(f"compiled pass, 1e6 samples, {name}", f"{1e9 * best / MILLION:.0f} ns/sample"))
        advance.update()
    return rows


def main() -> int:
    """Measure and print; exit status 1 if a mark is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_other_checkout(parser)
    parser.add_argument("--turns", type=int, default=5, help="of each command beside another checkout; default 5")
    options = parser.parse_args()
    trees = trees_of(parser, options)
    if len(trees) > 1:
        show_against(trees, options.turns)
        return 0
    with tqdm(total=2 + len(COURSES), unit="run", file=sys.stderr) as advance:
        rows = [*measure_online(advance), *measure_kernel(advance)]
    print(f"Python {platform.python_version()}\n")
    show(rows)
    return 1 if any(row.met is False for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
