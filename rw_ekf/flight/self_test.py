"""test_rw_ekf.c: recorded readings with the estimator's answers, and a program that holds the C against them."""

from __future__ import annotations

import math
from typing import Any

from rw_ekf.flight.recorded import EVERY, Recorded

SIGMAS = 0.05  # by which single precision may differ from the estimator; measured: docs/flight.md

_MAIN = """static struct rw_onboard held;
static struct rw_crossing crossing;
static double furthest = 0.0;

IS_SAME

static int are_same(int i, double dmc, double by_crossing)
{
    int same = 1;
    for (int j = 0; j < RW_EKF_STATES; ++j) {
        const double sigma = (double)rw_ekf_std(&held, j);
        same = same && is_same((double)held.x[j], means[i][j], sigmas[i][j]);
        same = same && is_same(sigma, sigmas[i][j], sigmas[i][j]);
    }
    ASKED
    return same;
}

int main(void)
{
    int wrong = 0;
    rw_ekf_start(&held);
    rw_ekf_crossing_start(&crossing);
    for (int i = 0; i < SAMPLES; ++i) {
        const double *row = told[i];
        const struct rw_reading reading = {
            row[0], (rw_real)row[1], begins[i] != 0, (rw_real)row[2], (rw_real)row[3],
            {{(rw_real)row[4], (rw_real)row[5], (rw_real)row[6]}}
        };
        const struct rw_taken taken = rw_ekf_step(&held, reading);
        const double dmc = (double)rw_ekf_dmc_current(&held, (rw_real)row[9]);
        const double by_crossing =
            (double)rw_ekf_crossing_current(&crossing, &held, (rw_real)row[9], (rw_real)PERIOD_S);
        int same = (taken.outcome == outcomes[i]) && (taken.trouble == troubles[i]);
        same = same && is_same((double)held.x[RW_EKF_SPEED_RAD_S], speeds[i][0], speeds[i][1]);
        if (i % EVERY == 0) {
            same = same && are_same(i / EVERY, dmc, by_crossing);
        }
        if (!rw_ekf_command(&held, (rw_real)row[7], (rw_real)row[8])) {
            same = 0;
        }
        if (!same) {
            wrong += 1;
            if (wrong <= 3) {
                printf("sample %d: outcome %d, expected %d; speed %.17g rad/s, expected %.17g\\n", i,
                       taken.outcome, outcomes[i], (double)held.x[RW_EKF_SPEED_RAD_S], speeds[i][0]);
            }
        }
    }
    printf("%d of %d samples as the estimator has themSUMMARY\\n", COUNTS);
    return (wrong == 0) ? 0 : 1;
}
"""
_EXACT = """#ifdef RW_EKF_OTHER_LIBM
#define HOW "to a millionth of a sigma"
#else
#define HOW "bit by bit"
#endif

static int is_same(double one, double other, double sigma)
{
    const int bits = (one == other) || ((one != one) && (other != other));
#ifdef RW_EKF_OTHER_LIBM
    return bits || (fabs(one - other) <= 1.0e-6 * (sigma + SMALLEST));
#else
    (void)sigma;
    return bits;
#endif
}"""
_WITHIN = """static int is_same(double one, double other, double sigma)
{
    const double off = fabs(one - other) / (sigma + SMALLEST);
    if (off > furthest) {
        furthest = off;
    }
    return ((one != one) && (other != other)) || (off <= SIGMAS);
}"""
_WANTED = """same = same && ((asked[i][0] != asked[i][0]) || is_same(dmc, asked[i][0], fabs(asked[i][0])));
    same = same && ((asked[i][1] != asked[i][1]) || is_same(by_crossing, asked[i][1], fabs(asked[i][1])));"""
_OTHER = """ *
 * With RW_EKF_OTHER_LIBM defined within a millionth of a sigma: where exp, expm1 and log1p are of another C library.
"""
_NOT_WANTED = """(void)dmc;  /* a current jumps where the belief passes rest: in single precision at another reading */
    (void)by_crossing;"""


def self_test(run: Recorded, origin: str, *, single: bool) -> str:
    """The file."""
    main = _MAIN
    for word, text in {
        "static double furthest = 0.0;\n": "static double furthest = 0.0;\n" if single else "",
        "IS_SAME": _WITHIN if single else _EXACT,
        "ASKED": _NOT_WANTED if single else _WANTED,
        "SUMMARY": f", furthest %.2g of {SIGMAS:g} sigmas" if single else ", %s",
        "COUNTS": f"SAMPLES - wrong, SAMPLES, {'furthest' if single else 'HOW'}",
    }.items():
        main = main.replace(word, text)
    wanted = "" if single else _table("double", "asked", run.wanted_A[::EVERY], exact=True)
    speeds = [[mean, std] for mean, std in zip(run.mean[:, 0].tolist(), run.std[:, 0].tolist(), strict=True)]
    return f"""/* {origin}
 *
 * Recorded readings, and what the estimator made of them. Exits with 0 only where this library does the same
 * {"within the bound of single precision" if single else "bit by bit"}: outcome, health and speed at every reading, all
 * states with their standard deviations{"" if single else ", and the compensations' currents,"} at every {EVERY}th.
{_OTHER if not single else ""} */
#include "rw_ekf.h"

#include <math.h>
#include <stdio.h>

#define SAMPLES {run.begins.size}
#define EVERY {EVERY}
#define PERIOD_S {run.period_s!r}
#define SIGMAS {SIGMAS!r}
#define SMALLEST 1.0e-9

/* Time [s], speed [rad/s], temperature [degC], angle [rad], three columns, then the current [A] that is commanded
 * behind the reading, how late it acts [s], and the acceleration [rad/s^2] that is asked of the compensations.
 */
{_table("double", "told", run.reported)}
{_table("int", "begins", run.begins)}
{_table("int", "outcomes", run.outcome)}
{_table("int", "troubles", run.trouble)}
{_rows("double", "speeds", speeds)}
{_table("double", "means", run.mean[::EVERY], exact=True)}
{_table("double", "sigmas", run.std[::EVERY], exact=True)}
{wanted}
{main}"""


def _table(kind: str, name: str, values: Any, *, exact: bool = False) -> str:
    if values.ndim == 2:
        return _rows(kind, name, values.tolist(), exact=exact)
    flat = values.tolist()
    lines = [", ".join(map(str, flat[i : i + 40])) for i in range(0, len(flat), 40)]
    return f"static const {kind} {name}[{len(flat)}] = {{\n    " + ",\n    ".join(lines) + "\n};\n"


def _rows(kind: str, name: str, rows: list[list[float]], *, exact: bool = True) -> str:
    lines = [f"    {{{', '.join(_number(value, exact=exact) for value in row)}}}" for row in rows]
    return f"static const {kind} {name}[{len(rows)}][{len(rows[0])}] = {{\n" + ",\n".join(lines) + "\n};\n"


def _number(value: float, *, exact: bool) -> str:
    """As C has it: hexadecimal, or the shortest decimals that are this number."""
    if math.isnan(value):
        return "NAN"
    return value.hex() if exact else repr(value)
