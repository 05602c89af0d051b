"""Files that Arrow reads by itself, without a word of Python's.

Arrow's threads may let go of what they read from after the table has been given. Were that an object of Python's, they
would need the interpreter for it; where the program is at its end by then, the thread is ended amid a destructor, and
the process with it: "terminate called without an active exception" (apache/arrow#34314).
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pyarrow as pa


def native_file(path: Path) -> pa.NativeFile:
    """Open a file for Arrow. Raises OSError as `open` does."""
    import pyarrow as pa

    try:  # blocks come and go: memory that the C library keeps for the next one takes .96 of a row's time
        return pa.OSFile(os.fspath(path), memory_pool=pa.system_memory_pool())
    except UnicodeEncodeError:  # Arrow knows names in UTF-8 only, and a disk any
        return native_text(path.read_bytes())


def native_text(text: bytes) -> pa.NativeFile:
    """Bytes for Arrow, in its own memory."""
    import pyarrow as pa

    own = pa.allocate_buffer(len(text))
    memoryview(own).cast("B")[:] = text
    return pa.BufferReader(own)
