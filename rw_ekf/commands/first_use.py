"""What a verb does before it computes for the first time: compile, with a word about it."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from rw_ekf.console import STATUS


def make_ready(kernels: Sequence[str]) -> None:
    """Compile what is lacking of `kernels` (names of `rw_ekf.compile_ahead`); silent where nothing is.

    One line on standard error says what and how long; the bar below it moves; an interrupt ends it at once. Where
    nothing can be compiled another says why, and all runs as plain Python.
    """
    from rw_ekf.compile_ahead import cold, compile_all, kernel, seconds_of

    missing = cold(kernels)
    if not missing:
        STATUS.tell(f"{len(kernels)} numerical routines are compiled already")
        return
    from rw_ekf.c_code.c_library import FOLDER_VARIABLE, CompilerError, compiler
    from rw_ekf.compiled import stay_plain
    from rw_ekf.console import progress

    try:
        compiler()  # before anything is printed
        sys.stderr.write(
            f"rw-ekf: first use: compiling {len(missing)} numerical routines, about "
            f"{max(seconds_of(missing), 1.0):.0f} s on a desktop computer, longer on a small or busy one (once)\n"
        )
        sys.stderr.flush()
        with progress("compiling", len(missing), delay_s=0.0) as bar:
            compile_all(missing, bar.update)
        if not all(kernel(name).is_kept() for name in missing):
            sys.stderr.write(f"rw-ekf: for this time only, as no folder can keep them: set {FOLDER_VARIABLE} to one\n")
    except CompilerError as error:
        sys.stderr.write(f"rw-ekf: all runs as plain Python, a long log some hundred times slower: {error}\n")
        stay_plain()
