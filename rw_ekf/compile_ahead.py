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
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rw_ekf.compiled import Kernel

FILTER = ("rw_ekf.filter.kernel:filter_pass",)
EFFECTS = ("rw_ekf.filter.kernel:filter_pass_with_effects",)
LEAST_SQUARES = ("rw_ekf.course.free_run:run_free",)
SMOOTHER = ("rw_ekf.filter.smoother:smooth_pass",)
_ONE_STEP = ("rw_ekf.likelihood.one_step:one_step_pass",)
_AHEAD = ("rw_ekf.course.free_run:run_free_with_effects",)
_LIKELIHOOD = tuple(f"rw_ekf.likelihood.whitening:{name}" for name in ("whiten", "smooth", "adjoint"))
FIT = (*FILTER, *LEAST_SQUARES, *SMOOTHER, *_LIKELIHOOD, *_ONE_STEP)  # and the judgement of a residual
DIAGNOSIS = (*FIT, *EFFECTS, *_AHEAD)

# Those that have the propagation with effects in common, half of the work, are compiled in one process.
_TOGETHER = frozenset((*EFFECTS, *_ONE_STEP, *_AHEAD))
# Seconds of one core of a laptop of about 2020; those together share what the propagation takes.
_SECONDS = {**dict.fromkeys(DIAGNOSIS, 1.0), FILTER[0]: 6.0, EFFECTS[0]: 8.0, _ONE_STEP[0]: 3.0, SMOOTHER[0]: 2.0}
_PROPAGATION_S = 6.0

_POLL_S = 0.2
_CHILD = """
import json, sys
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
    """Roughly how long their compilation takes on a desktop machine with the cores that there are [s]."""
    each = [
        sum(_SECONDS[name] for name in group) + (_PROPAGATION_S if group[0] in _TOGETHER else 0.0)
        for group in _groups(names)
    ]
    return max(each, default=0.0) if len(os.sched_getaffinity(0)) > 1 else sum(each)


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
            children = [stack.enter_context(_child(group)) for group in _groups(names)]
        except OSError:
            return False
        while any(child.poll() is None for child in children):
            with contextlib.suppress(subprocess.TimeoutExpired):
                next(child for child in children if child.poll() is None).wait(_POLL_S)
            left = cold(waiting)
            tick(len(waiting) - len(left))
            waiting = left
    return not cold(waiting)


def _groups(names: Sequence[str]) -> list[list[str]]:
    """What goes into one process each."""
    groups = [[name for name in names if (name in _TOGETHER) is together] for together in (True, False)]
    return [group for group in groups if group]


@contextlib.contextmanager
def _child(names: Sequence[str]) -> Iterator[subprocess.Popen[bytes]]:
    """A process that compiles; killed where this is left before it has ended."""
    from rw_ekf.compiled import child_environment

    command = [sys.executable or "python3", "-P", "-c", _CHILD, json.dumps([sys.path, list(names)])]
    # A session of its own: Ctrl-C at the terminal is for the parent, which kills what it started.
    child = subprocess.Popen(
        command,
        env=os.environ | child_environment(),
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
