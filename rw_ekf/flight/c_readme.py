"""README.md and Makefile of an export: interface, memory, time, what was verified how, deviations from MISRA C."""

from __future__ import annotations

from rw_ekf.c_code.c_program import Program
from rw_ekf.c_code.c_types import Array, Row, Scalar, Struct, Type
from rw_ekf.flight.c_files import Estimator
from rw_ekf.flight.self_test import SIGMAS

MAKEFILE = """# make test: the self-test; EXTRA=-DRW_EKF_OTHER_LIBM where the C library is another.
# make strict: every warning an error, and what is linked from outside.
CC ?= cc
WARNINGS = -std=c99 -Wall -Wextra -Wconversion -pedantic -Werror
# No fused or reordered arithmetic; and loops stay loops, where gcc would call memset and memcpy.
EXACT = -O2 -ffp-contract=off $(EXTRA)
EXACT += $(shell $(CC) --version 2>/dev/null | grep -qi clang || echo -fno-tree-loop-distribute-patterns)

test: test_rw_ekf
\t./test_rw_ekf

test_rw_ekf: test_rw_ekf.c rw_ekf.o rw_ekf.h
\t$(CC) $(WARNINGS) $(EXACT) test_rw_ekf.c rw_ekf.o -lm -o test_rw_ekf

rw_ekf.o: rw_ekf.c rw_ekf.h
\t$(CC) $(WARNINGS) $(EXACT) -c rw_ekf.c -o rw_ekf.o

strict: rw_ekf.o
\tnm -u rw_ekf.o

clean:
\trm -f rw_ekf.o test_rw_ekf

.PHONY: test strict clean
"""

_TEXT = """# The wheel's estimator as C99

{origin}: {size} states, {precision}.

| file | what it is |
|---|---|
| `rw_ekf.h`, `rw_ekf.c` | the estimator: put these two into your project |
| `test_rw_ekf.c`, `Makefile` | `make test` replays {samples} recorded readings; exits with 0 only where {same} |

## Use

```c
static struct rw_onboard wheel;      /* {held} bytes: all that it remembers */

rw_ekf_start(&wheel);                /* once */

/* At each reading; NaN for what is not known. */
struct rw_reading reading = {{time_s, speed_rad_s, false, NAN, NAN, {{{{NAN, NAN, NAN}}}}}};
struct rw_taken taken = rw_ekf_step(&wheel, reading);

/* The current that is commanded then, and how much later it acts. */
rw_ekf_command(&wheel, current_A, delay_s);

double gain = wheel.x[RW_EKF_MOTOR_GAIN];
double sigma = rw_ekf_std(&wheel, RW_EKF_MOTOR_GAIN);
```

`rw_ekf_dmc_current` and `rw_ekf_crossing_current` (after `rw_ekf_crossing_start`) give the current for an acceleration
with friction compensated, the latter once after every reading. They add no trust, no limit and no guard: those are
yours. `rw_ekf_crossing_current` takes the model for all there is; it follows no drag beside it.

States, in `x` and `P`: {states}. Speeds are rad/s, torques are per inertia (rad/s^2).
{conditions}
`taken.outcome`: 0 first reading, 1 used, 2 none, 3 refused by the gate, 4 repeated time, 5 time went back, 6 the speed
was seeded anew. `taken.trouble`: 0 well, else what is wrong, and `taken.was_reset` what was reset for it (`rw_ekf.h`).
Where `taken.hopeless` is true, resetting does not help any more. Not believed: readings with a trouble other than 0.

## Memory and time

| | |
|---|---|
| static memory of an estimator, `struct rw_onboard` | {held} bytes |
| of predictive crossing, `struct rw_crossing`, where it is used | {crossing} bytes |
| constants | {constants} bytes |
| heap | none |
| statements of one `rw_ekf_step` at most, every loop at its bound at once | {steps} |

No recursion, no allocation, no loop without a constant bound; from outside only libm{outside}. The bound is a
proof that it ends, no estimate: one reading needs some thousand statements, most where the wheel passes zero.
`gcc -fstack-usage` tells the stack. Two estimators, or two tasks, share nothing but constants.

## What it is the same as

Every function is printed from the Python that the estimator itself runs, with its order of operations; names and
comments are carried over. Compile without fused or reordered arithmetic (`-ffp-contract=off`, never `-ffast-math`).
{verified}
It differs from the estimator in this: an infinite speed counts as a missing one, as other infinite readings do to both,
for there is nobody to raise an error to; a ninth command that waits to take force is refused (`rw_ekf_command` returns
false); and arithmetic that Python refuses (a division by zero) gives NaN, which the estimator's own health check resets
in the same step.

## MISRA C:2012, deviations

| rule | where | why |
|---|---|---|
| 2.7 | parameters that an effect does not need are there, and marked `(void)` | all effects are called alike |
| 8.13 (advisory) | pointers to what is only read are not `const` | a matrix of C99 cannot be handed to one that is |
| 10.5, 10.8 | casts between whole numbers and reals, always written out | indices |
| 12.1 (advisory) | no more parentheses than the order of operations needs | the formula can be read |
| 13.3, 14.2 | `++` as the step of a `for`; a second condition beside the counter | bounds of loops |
| 15.4, 15.5 (advisory) | several `break`, and returns before the end | as in the source that it is printed from |
| 15.7 | `else if` without a last `else` | the same |
| 17.8 (advisory) | parameters are given new values | the same |
| 18.4 | none: no arithmetic on pointers | |
| Dir 4.6 (advisory) | `int`, `float`, `double` | `rw_real` stands for the reals |
| Dir 1.1, floating-point comparison | `==` with numbers that were assigned, never reckoned | flags and exact zeros |

No tool was run that certifies this: the list is from reading the rules against what the printer can write.
"""


def readme(program: Program, estimator: Estimator, origin: str, samples: int, conditions: tuple[str, ...]) -> str:
    """README.md."""
    memory = memory_of(program, estimator)
    if program.single:
        same = f"each state is within {SIGMAS:g} of its sigma"
        verified = (
            f"In single precision the states stay within {SIGMAS:g} of their sigmas of the estimator's; the self-test "
            "asserts that.\nTimes stay in double precision, and within an interval count from its begin. Constants "
            "that float cannot hold are its\nlargest or smallest number.\n"
        )
    else:
        same = "every number is the estimator's, bit by bit"
        verified = (
            "In double precision the results are the same bits, where exp, expm1, log1p and sin of the C library are:\n"
            "the last bit of these is the library's own affair. On another one (newlib's, say) the self-test is\n"
            "compiled with `make test EXTRA=-DRW_EKF_OTHER_LIBM`, and allows a millionth of a sigma.\n"
        )
    reported = ""
    if conditions:
        reported = f"\nThis model needs {', '.join(conditions)} with its readings.\n"
    return _TEXT.format(
        origin=origin,
        size=estimator.size,
        precision="single precision (float)" if program.single else "double precision",
        samples=samples,
        same=same,
        held=memory["estimator_bytes"],
        crossing=memory["crossing_bytes"],
        constants=memory["constant_bytes"],
        steps=f"{memory['statements_at_most']:,}",
        states=", ".join(f"`RW_EKF_{name.upper()}`" for name in estimator.names),
        conditions=reported,
        verified=verified,
        outside=" (in single precision `expf` and the like)" if program.single else "",
    )


def memory_of(program: Program, estimator: Estimator) -> dict[str, int]:
    """Bytes and statements."""
    step = next(found for found in program.functions if found.name == "rw_ekf_step")
    tables = sum(_bytes(of, single=program.single) for _, _, of in program.arrays.values())
    return {
        "estimator_bytes": _bytes(program.hold(estimator.held), single=program.single),
        "crossing_bytes": _bytes(program.hold(estimator.crossing), single=program.single),
        "constant_bytes": tables + _started(program, estimator),
        "statements_at_most": step.cost,
    }


def _started(program: Program, estimator: Estimator) -> int:
    """Bytes of the constants that memory starts from: of all that does not begin with zeros."""

    def of(struct: Struct, value: object) -> int:
        total = 0
        for (_, member), part in zip(struct.members, value, strict=True):  # type: ignore[call-overload]
            if isinstance(member, Struct):
                total += of(member, part)
            elif (part != 0.0).any():
                total += _bytes(member, single=program.single)
        return total

    return of(program.hold(estimator.held), estimator.held)


def _bytes(of: Type, *, single: bool) -> int:
    """Size of a type, without the padding that a compiler may add."""
    if isinstance(of, Scalar):
        return {"bool": 1, "int": 4, "real": 4 if single else 8, "clock": 8}[of.name]
    if isinstance(of, Array):
        total = _bytes(of.item, single=single)
        for count in of.shape:
            total *= count
        return total
    if isinstance(of, Struct):
        return sum(_bytes(member, single=single) for _, member in of.members)
    assert isinstance(of, Row)  # nothing on board has a size that is not known
    return of.count * (4 if single else 8)
