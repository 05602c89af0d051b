"""How a worker's C library holds memory between tasks: it keeps what the next log needs again.

A Dask nanny starts its workers with MALLOC_TRIM_THRESHOLD_=65536: every array of a log that is freed goes back to the
kernel, which clears it anew for the next one. glibc itself begins to give back at 128 KiB, and raises that as it goes
only where nobody set it. What this one choice saves was not measured apart from the rest.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # of mallopt(3)
# A log of 1e6 samples has arrays of 8 MB, and some fifty of them are alive at a time: what is kept stays below that.
_TRIM_BYTES, _MMAP_BYTES = 128 << 20, 32 << 20


@functools.cache
def settle_memory() -> None:
    """Once in a process; where the C library knows no mallopt, nothing happens."""
    with contextlib.suppress(OSError, AttributeError):
        library = ctypes.CDLL(None)
        library.mallopt(_M_TRIM_THRESHOLD, _TRIM_BYTES)
        library.mallopt(_M_MMAP_THRESHOLD, _MMAP_BYTES)
