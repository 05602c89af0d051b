"""The printed C, compiled by the system's compiler and called sample by sample: what tests hold against Python."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array, Int64Array
from rw_ekf.c_code.c_library import CompilerError, compiler
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.constants import FilterConstants
from rw_ekf.flight.c_files import Estimator, header, printed, source
from rw_ekf.flight.exportable import estimator_of
from rw_ekf.model.state import STATE_NAMES
from rw_ekf.starting_point import FilterSetup
from rw_ekf.wheel.effect_table import NO_EFFECTS, EffectSet
from tests.filter.replay import Columns

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror"]
EXACT = ["-O2", "-ffp-contract=off", "-fno-tree-loop-distribute-patterns"]
LIBM = {"exp", "expm1", "log", "log1p", "sqrt", "sin", "cos", "floor", "fabs", "copysign"}


def _has_compiler() -> bool:
    try:
        return bool(compiler())
    except CompilerError:
        return False


needs_compiler = pytest.mark.skipif(not _has_compiler(), reason="no C compiler on this machine")
needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc on this machine")

_HARNESS = """
#include "rw_ekf.h"
static struct rw_onboard held;
void run(int n, const double *row, const int *begins, int *outcome, int *health, double *x, double *P, double *asked);
void run(int n, const double *row, const int *begins, int *outcome, int *health, double *x, double *P, double *asked)
{
    const int m = RW_EKF_STATES;
    rw_ekf_start(&held);
    for (int i = 0; i < n; ++i, row += 9) {
        const struct rw_reading reading = {
            row[0], (rw_real)row[1], begins[i] != 0, (rw_real)row[2], (rw_real)row[3],
            {{(rw_real)row[4], (rw_real)row[5], (rw_real)row[6]}}};
        const struct rw_taken taken = rw_ekf_step(&held, reading);
        outcome[i] = taken.outcome;
        health[i] = taken.trouble;
        for (int j = 0; j < m; ++j) {
            x[i * m + j] = (double)held.x[j];
            for (int k = 0; k < m; ++k) {
                P[(i * m + j) * m + k] = (double)held.P[j][k];
            }
        }
        ASKED
        (void)rw_ekf_command(&held, (rw_real)row[7], (rw_real)row[8]);
    }
}
"""


@dataclass(frozen=True)
class InC:
    """What the C made of a log of n samples: (n,) outcomes and troubles, (n, m) means, (n, m, m) covariances."""

    outcome: Int64Array
    trouble: Int64Array
    mean: Float64Array
    covariance: Float64Array
    wanted_A: Float64Array


def setup_for(
    constants: FilterConstants, belief: Belief, effects: EffectSet = NO_EFFECTS, drift: Float64Array | None = None
) -> Estimator:
    """What would be exported of a filter that starts like that."""

    class Setup(FilterSetup):
        @property
        def effect_drift(self) -> Float64Array:
            return np.zeros(effects.size) if drift is None else drift

    return estimator_of(Setup(constants, belief, None, effects=effects), "model", single=False)


def write_c(folder: Path, estimator: Estimator, *, single: bool = False) -> None:
    """rw_ekf.h and rw_ekf.c."""
    program = printed(estimator, single=single)
    (folder / "rw_ekf.h").write_text(header(program, estimator, "a test"))
    (folder / "rw_ekf.c").write_text(source(program, estimator, "a test"))


def gcc(folder: Path, *arguments: str) -> None:
    """Compile in a folder; what the compiler says is the failure."""
    done = subprocess.run(["gcc", *arguments], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def compiled(folder: Path, estimator: Estimator, *, single: bool = False, wanted: str = "asked[i] = 0.0;") -> Any:
    """The library, compiled with every warning an error."""
    write_c(folder, estimator, single=single)
    (folder / "harness.c").write_text(_HARNESS.replace("ASKED", wanted))
    gcc(folder, *STRICT, *EXACT, "-fPIC", "-shared", "rw_ekf.c", "harness.c", "-o", "rw_ekf.so", "-lm")
    return ctypes.CDLL(str(folder / "rw_ekf.so"))


def in_c(
    library: Any, log: Columns, size: int = len(STATE_NAMES), temperature: Float64Array | None = None,
    angle: Float64Array | None = None,
) -> InC:  # fmt: skip
    """A log through the C."""
    log = log.complete()
    n = log.time_s.size
    nothing = np.full(n, np.nan)
    rows = np.column_stack([
        log.time_s, log.speed_rad_s, nothing if temperature is None else temperature,
        nothing if angle is None else angle, nothing, nothing, nothing, log.current_A, log.delay_s,
    ])  # fmt: skip
    begins = np.diff(log.segment, prepend=log.segment[0]).astype(np.int32)
    outcome, trouble = np.zeros(n, np.int32), np.zeros(n, np.int32)
    mean, covariance, wanted = np.zeros((n, size)), np.zeros((n, size, size)), np.zeros(n)
    arrays = (np.ascontiguousarray(rows), begins, outcome, trouble, mean, covariance, wanted)
    library.run(n, *(array.ctypes.data_as(ctypes.c_void_p) for array in arrays))
    return InC(outcome.astype(np.int64), trouble.astype(np.int64), mean, covariance, wanted)


def same_bits(one: Float64Array, other: Float64Array) -> bool:
    """Whether two arrays have the same bits, one NaN being as good as another."""
    return bool(np.array_equal(one, other, equal_nan=True))


# For fuzzers in C: numbers from a seed, and now and then a wild one.
WILD = """
static uint64_t state = 88172645463325252u;
static double next(void)
{
    state ^= state << 13; state ^= state >> 7; state ^= state << 17;
    return (double)(state >> 11) / 9007199254740992.0;
}
static double odd(double usual)
{
    static const double wild[] = {NAN, INFINITY, -INFINITY, 1e308, -1e308, 1e30, -1e30, 1e-300, 0.0, -0.0, 1e9, -5.0};
    return next() < 0.05 ? wild[(int)(next() * 12.0)] : usual;
}
"""
