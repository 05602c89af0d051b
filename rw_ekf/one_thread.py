"""One thread for linear algebra: the matrices are 5 x 5 online and tall but narrow in the fits (decision 0005)."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

_VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def ask_for_one_thread() -> None:
    """For this whole process and those it starts, where numpy is not loaded yet; what is set already stays."""
    for name in _VARIABLES:
        os.environ.setdefault(name, "1")


@contextmanager
def one_thread() -> Iterator[None]:
    """While this lasts, in a process that is somebody else's.

    What is loaded later would have all its threads: numpy and scipy bring a library of linear algebra each.
    """
    import scipy.linalg  # noqa: F401
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1, user_api="blas"):
        yield
