"""One thread for linear algebra: the matrices are 5 x 5 online and tall but narrow in the fits (decision 0005)."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def ask_for_one_thread() -> None:
    """For this whole process and those it starts, where numpy is not loaded yet; what is set already stays."""
    for name in _VARIABLES:
        os.environ.setdefault(name, "1")


def _let_go() -> None:
    """Leave setting the threads to whoever is next: a newer threadpoolctl obeys who did it first alone."""
    from threadpoolctl import OpenBLASController

    getattr(OpenBLASController, "clear_controlling_thread", lambda: None)()


class _Held:
    """The limit on this process's threads, and how many uses of it there are: calls in several threads overlap."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._uses = 0
        self._limit: Any = None

    def enter(self) -> None:
        with self._lock:
            if self._uses == 0:
                from threadpoolctl import threadpool_limits

                self._limit = threadpool_limits(limits=1, user_api="blas")
                _let_go()
            self._uses += 1

    def leave(self) -> None:
        with self._lock:
            self._uses -= 1
            if self._uses == 0:
                self._limit.restore_original_limits()
                _let_go()


_HELD = _Held()


@contextmanager
def one_thread() -> Iterator[None]:
    """While this lasts, in a process that is somebody else's; what it had comes back when the last one ends.

    What is loaded later would have all its threads: numpy and scipy bring a library of linear algebra each.
    """
    import scipy.linalg  # noqa: F401

    _HELD.enter()
    try:
        yield
    finally:
        _HELD.leave()
