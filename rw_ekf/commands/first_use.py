"""What a verb does before it computes for the first time: compile, with a word about it."""

from __future__ import annotations

import sys
from collections.abc import Sequence


def make_ready(kernels: Sequence[str]) -> None:
    """Compile what the cache on disk lacks of `kernels` (names of `rw_ekf.compile_ahead`); silent where nothing lacks.

    One line on standard error says what and how long; the bar below it moves; an interrupt ends it at once.
    """
    from rw_ekf.compile_ahead import cold, compile_in_children, seconds_of

    missing = cold(kernels)
    if not missing:
        return
    from rw_ekf.compiled import child_environment, never_compiles
    from rw_ekf.console import progress

    if never_compiles():
        sys.stderr.write(
            "rw-ekf: NUMBA_DISABLE_JIT is set: all runs as plain Python, a long log some hundred times slower\n"
        )
        return
    kept = (
        "this time only: no folder for a cache can be written, set NUMBA_CACHE_DIR" if child_environment() else "once"
    )
    sys.stderr.write(
        f"rw-ekf: first use: compiling {len(missing)} numerical routines, about {max(seconds_of(missing), 5.0):.0f} s "
        f"on a desktop computer, longer on a small or busy one ({kept})\n"
    )
    sys.stderr.flush()
    with progress("compiling", len(missing), delay_s=0.0) as bar:
        done = compile_in_children(missing, bar.update)
    if not done:
        sys.stderr.write(
            "rw-ekf: the compiler could not run in its own process; it runs in this one, so Ctrl-C may wait\n"
        )
