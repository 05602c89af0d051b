"""Numerical routines compiled before they are called: compilers side by side, the bar moves, Ctrl-C ends them."""

from __future__ import annotations

import contextlib
import importlib
import os
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rw_ekf.c_code.c_library import Compilation
    from rw_ekf.compiled import Kernel

FILTER = ("rw_ekf.filter.kernel:filter_pass",)
EFFECTS = ("rw_ekf.course.acting_temperature:follow_pass", "rw_ekf.filter.kernel:filter_pass_with_effects")
LEAST_SQUARES = ("rw_ekf.course.free_run:run_free",)
SMOOTHER = ("rw_ekf.filter.smoother:smooth_pass",)
_ONE_STEP = ("rw_ekf.likelihood.one_step:one_step_pass",)
_ONE_STEP_WITH_EFFECTS = ("rw_ekf.likelihood.one_step:one_step_pass_with_effects",)
_AHEAD = ("rw_ekf.course.free_run:run_free_with_effects",)
_LIKELIHOOD = tuple(f"rw_ekf.likelihood.whitening:{name}_pass" for name in ("whitening", "smoothing", "adjoint"))
FIT = (*FILTER, *LEAST_SQUARES, *SMOOTHER, *_LIKELIHOOD, *_ONE_STEP)  # and the judgement of a residual
DIAGNOSIS = (*FIT, *EFFECTS, *_ONE_STEP_WITH_EFFECTS, *_AHEAD)

# Processor time of printing and compiling, on the machine whose loop of plain Python took _LOOP_S
# (tools.measure.startup --first); of those that are not named, _SMALL_S.
_TAKES_S = {**dict.fromkeys(FILTER, 0.9), **dict.fromkeys(EFFECTS, 2.0)} | dict.fromkeys(
    (*_ONE_STEP_WITH_EFFECTS, *_AHEAD), 1.1
)
_SMALL_S = 0.2
_LOOP_S = 0.0095
_POLL_S = 0.02


def kernel(name: str) -> Kernel:
    """The kernel of that name, "module:attribute"."""
    module, attribute = name.split(":")
    found: Kernel = getattr(importlib.import_module(module), attribute)
    return found


def cold(names: Sequence[str]) -> list[str]:
    """Those that the next call would have to compile."""
    return [name for name in dict.fromkeys(names) if not kernel(name).is_ready()]


def seconds_of(names: Sequence[str]) -> float:
    """Roughly how long their compilation takes here [s]: what it took once, by the speed of this machine's Python."""
    each = [_TAKES_S.get(name, _SMALL_S) for name in names]
    return max([sum(each) / len(os.sched_getaffinity(0)), *each]) * _loop_s() / _LOOP_S


def _loop_s() -> float:
    """Seconds that a loop of plain Python takes, the best of three."""
    taken = []
    for _ in range(3):
        begun = time.perf_counter()
        sum(i * i for i in range(200_000))
        taken.append(time.perf_counter() - begun)
    return min(taken)


def compile_all(names: Sequence[str], tick: Callable[[int], object] = lambda done: None) -> None:
    """Compile them, as many at a time as there are cores; tick(n) is called with n more done.

    Whatever is raised meanwhile, an interrupt among it, ends the compilers. Raises CompilerError where one fails.
    """
    names = cold(names)
    cores = len(os.sched_getaffinity(0))
    with contextlib.ExitStack() as stack:
        running: list[tuple[Kernel, Compilation]] = []
        for name in reversed(names):  # the longest come last in the lists above
            while len(running) >= cores:
                running = _without_ended(running, tick)
            running.append((kernel(name), stack.enter_context(kernel(name).begin())))
        while running:
            running = _without_ended(running, tick)


def _without_ended(
    running: Sequence[tuple[Kernel, Compilation]], tick: Callable[[int], object]
) -> list[tuple[Kernel, Compilation]]:
    """Those that are still at work, a moment later."""
    time.sleep(_POLL_S)
    left = []
    for of, compilation in running:
        if compilation.process.poll() is None:
            left.append((of, compilation))
        else:
            of.end(compilation)
            tick(1)
    return left
