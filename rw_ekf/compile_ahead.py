"""Numerical routines compiled ahead, in child processes: the bar moves meanwhile, and Ctrl-C is answered at once.

Numba holds the interpreter while it compiles, and an interrupt raised inside it is lost: so the compiler runs
elsewhere, fills the cache on disk, and can be killed. Whether there is anything to do is read from that cache's index.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rw_ekf.compiled import Kernel

FILTER = ("rw_ekf.filter.kernel:filter_pass",)
EFFECTS = ("rw_ekf.filter.kernel:filter_pass_with_effects",)
LEAST_SQUARES = ("rw_ekf.course.free_run:run_free",)
SMOOTHER = ("rw_ekf.filter.smoother:smooth_pass",)
_ONE_STEP = ("rw_ekf.likelihood.one_step:one_step_pass",)
_ONE_STEP_WITH_EFFECTS = ("rw_ekf.likelihood.one_step:one_step_pass_with_effects",)
_AHEAD = ("rw_ekf.course.free_run:run_free_with_effects",)
_LIKELIHOOD = tuple(f"rw_ekf.likelihood.whitening:{name}" for name in ("whiten", "smooth", "adjoint"))
FIT = (*FILTER, *LEAST_SQUARES, *SMOOTHER, *_LIKELIHOOD, *_ONE_STEP)  # and the judgement of a residual
DIAGNOSIS = (*FIT, *EFFECTS, *_ONE_STEP_WITH_EFFECTS, *_AHEAD)

_WITH_EFFECTS = frozenset((*EFFECTS, *_ONE_STEP_WITH_EFFECTS, *_AHEAD))
# What is compiled in one process: those with effects share two thirds of their work, those of a fit all but a second.
_TOGETHER = (_WITH_EFFECTS, frozenset(FILTER), frozenset(FIT) - {*FILTER, *_WITH_EFFECTS})
# Processor time of what is compiled first in a process, and of each kernel after it, on the machine whose loop of plain
# Python took _LOOP_S (tools.measure.startup --first).
_FIRST_S = (16.5, 11.0, 3.5)
_NEXT_S = (8.2, 0.0, 1.3)
_LOOP_S = 0.0095

_PLAIN = {"NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING": "1"}  # it colours what it might have to say 20,000 times
_POLL_S = 0.2
_CHILD = """
import gc, json, sys
gc.disable()  # a compiler's objects live as long as it does: looking for cycles among them was an eighth of its time
sys.path[:], names = json.loads(sys.argv[1])
from rw_ekf.compile_ahead import compile_all
from rw_ekf.parent import die_with_parent
die_with_parent()
compile_all(names)
"""


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
    each = [_FIRST_S[kind] + _NEXT_S[kind] * (len(group) - 1) for kind, group in _groups(names)]
    cores = len(os.sched_getaffinity(0))
    return max([sum(each) / cores, *each]) * _loop_s() / _LOOP_S


def _loop_s() -> float:
    """Seconds that a loop of plain Python takes, the best of three."""
    taken = []
    for _ in range(3):
        begun = time.perf_counter()
        sum(i * i for i in range(200_000))
        taken.append(time.perf_counter() - begun)
    return min(taken)


def compile_all(names: Sequence[str]) -> None:
    """Compile here, one after the other; what the child process does."""
    for name in names:
        kernel(name).compile()


def compile_in_children(names: Sequence[str], tick: Callable[[int], object]) -> bool:
    """Compile into the cache on disk; tick(n) is called several times a second, with n more kernels done.

    False where that did not work: then the next call compiles in this process. Whatever is raised meanwhile, an
    interrupt among it, kills the children.
    """
    waiting = list(names)
    with contextlib.ExitStack() as stack:
        try:
            children = [stack.enter_context(_child(group)) for _, group in _groups(names)]
        except OSError:
            return False
        while any(child.poll() is None for child in children):
            with contextlib.suppress(subprocess.TimeoutExpired):
                next(child for child in children if child.poll() is None).wait(_POLL_S)
            left = cold(waiting)
            tick(len(waiting) - len(left))
            waiting = left
    return not cold(waiting)


def _groups(names: Sequence[str]) -> list[tuple[int, list[str]]]:
    """What goes into one process each, with its place in _TOGETHER; the longest begins first."""
    groups = [(kind, [name for name in names if name in kinds]) for kind, kinds in enumerate(_TOGETHER)]
    return [(kind, group) for kind, group in groups if group]


@contextlib.contextmanager
def _child(names: Sequence[str]) -> Iterator[subprocess.Popen[bytes]]:
    """A process that compiles; killed where this is left before it has ended."""
    from rw_ekf.compiled import child_environment

    command = [sys.executable or "python3", "-P", "-c", _CHILD, json.dumps([sys.path, list(names)])]
    # A session of its own: Ctrl-C at the terminal is for the parent, which kills what it started.
    child = subprocess.Popen(
        command,
        env=os.environ | child_environment() | _PLAIN,
        start_new_session=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        yield child
    finally:
        child.kill()
        child.wait()
