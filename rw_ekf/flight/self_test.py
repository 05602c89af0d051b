"""test_rw_ekf.c: recorded readings with the estimator's answers, and a program that holds the C against them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rw_ekf.flight.recorded import Recorded

SIGMAS = 0.05  # by which single precision may differ from the estimator; measured 0.012 at most (docs/flight.md)

_MAIN = """
static int is_same(double one, double other)
{
    return (one == other) || ((one != one) && (other != other));
}

int main(void)
{
    static struct rw_onboard held;
    int wrong = 0;
FURTHEST    rw_ekf_start(&held);
    for (int i = 0; i < SAMPLES; ++i) {
        const double *row = told[i];
        const struct rw_reading reading = {
            row[0], (rw_real)row[1], begins[i] != 0, (rw_real)row[2], (rw_real)row[3],
            {{(rw_real)row[4], (rw_real)row[5], (rw_real)row[6]}}
        };
        const struct rw_taken taken = rw_ekf_step(&held, reading);
        int same = (taken.outcome == outcomes[i]) && (taken.trouble == troubles[i]);
        for (int j = 0; j < RW_EKF_STATES; ++j) {
            const double mean = (double)held.x[j];
            const double sigma = (double)rw_ekf_std(&held, j);
CHECK
        }
        if (!same) {
            wrong += 1;
            if (wrong <= 3) {
                printf("sample %d: outcome %d, expected %d; speed %.17g rad/s, expected %.17g\\n", i,
                       taken.outcome, outcomes[i], (double)held.x[0], means[i][0]);
            }
        }
        if (!rw_ekf_command(&held, (rw_real)row[7], (rw_real)row[8])) {
            wrong += 1;
        }
    }
    printf("%d of %d samples as the estimator has themSUMMARY\\n", COUNTS);
    return (wrong == 0) ? 0 : 1;
}
"""
_EXACT = """            if (!is_same(mean, means[i][j]) || !is_same(sigma, sigmas[i][j])) {
                same = 0;
            }"""
_WITHIN = """            const double off = fabs(mean - means[i][j]);
            const double unit = sigmas[i][j] + SMALLEST;
            if (!is_same(mean, means[i][j]) && !(off <= SIGMAS * unit)) {
                same = 0;
            }
            if (!(fabs(sigma - sigmas[i][j]) <= SIGMAS * unit)) {
                same = 0;
            }
            if (off / unit > furthest) {
                furthest = off / unit;
            }"""


def self_test(run: Recorded, origin: str, *, single: bool) -> str:
    """The file."""
    rows = np.column_stack([
        run.time_s, run.speed_rad_s, run.temperature_degC, run.angle_rad, run.columns, run.current_A, run.delay_s,
    ])  # fmt: skip
    main = _MAIN.replace("FURTHEST", "    double furthest = 0.0;\n" if single else "")
    main = main.replace("CHECK", _WITHIN if single else _EXACT)
    main = main.replace("SUMMARY", f", furthest %.2g of {SIGMAS:g} sigmas" if single else ", bit by bit")
    main = main.replace("COUNTS", "SAMPLES - wrong, SAMPLES, furthest" if single else "SAMPLES - wrong, SAMPLES")
    return f"""/* {origin}
 *
 * Recorded readings, and what the estimator made of them. Exits with 0 only where this library does the same
 * {"within the bound of single precision" if single else "bit by bit"}.
 */
#include "rw_ekf.h"

#include <math.h>
#include <stdio.h>

#define SAMPLES {run.time_s.size}
#define SIGMAS {SIGMAS!r}
#define SMALLEST 1.0e-9

/* Time [s], speed [rad/s], temperature [degC], angle [rad], three columns, then the current [A] that is commanded
 * behind the reading, and how late it acts [s].
 */
{_table("double", "told", rows)}
{_table("int", "begins", run.begins)}
{_table("int", "outcomes", run.outcome)}
{_table("int", "troubles", run.trouble)}
{_table("double", "means", run.mean)}
{_table("double", "sigmas", run.std)}
{main}"""


def _table(kind: str, name: str, values: Any) -> str:
    if values.ndim == 1:
        shape, rows = f"[{values.size}]", [", ".join(_number(v) for v in part) for part in _parts(values)]
    else:
        shape = f"[{values.shape[0]}][{values.shape[1]}]"
        rows = [f"{{{', '.join(_number(v) for v in row)}}}" for row in values.tolist()]
    body = ",\n".join(f"    {row}" for row in rows)
    return f"static const {kind} {name}{shape} = {{\n{body}\n}};\n"


def _parts(values: Any) -> list[list[float]]:
    flat = values.tolist()
    return [flat[i : i + 20] for i in range(0, len(flat), 20)]


def _number(value: float) -> str:
    if isinstance(value, int):
        return str(value)
    return "NAN" if math.isnan(value) else value.hex()
