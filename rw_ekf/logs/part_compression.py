"""Compresses a part of a log that grows no more: python -P -m rw_ekf.logs.part_compression FILE.csv -> FILE.csv.zst.

The daemon starts this as a process of its own, so that neither its loop nor its memory knows of it. The compressed file
is on the disk under its name, and has been read back and found the same, before the plain one goes: whatever ends this
in between leaves a part that reads, once or twice. FILE.mcap keeps its name (`rw_ekf.logs.mcap_file`).
"""

from __future__ import annotations

import contextlib
import os
import signal
import struct
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

_SEAL = struct.Struct("<IIQI")  # a frame that zstd skips: its magic number, its size; then bytes and CRC-32 of the text
_SEAL_HEAD = (0x184D2A5E, 12)
_AT_ONCE = 1 << 20
_NICE = 15


def packed_path(part: Path) -> Path:
    """Where the compressed part goes."""
    return Path(f"{part}.zst")


def seal_of(packed: bytes) -> tuple[int, int] | None:
    """Length [bytes] and CRC-32 of the text that was packed, as the file's last bytes say; None where they do not."""
    if len(packed) < _SEAL.size:
        return None
    magic, size, length, crc = _SEAL.unpack(packed[-_SEAL.size :])
    return (length, crc) if (magic, size) == _SEAL_HEAD else None


def pack(part: Path) -> None:
    """Compress a part with zstd, its checksum behind it, and remove the plain one.

    Raises BadInputError; the plain one then stays.
    """
    import pyarrow as pa

    from rw_ekf.errors import BadInputError
    from rw_ekf.logs.atomic import atomic_path

    target = packed_path(part)
    if os.path.lexists(target):
        raise BadInputError(f"{target}: exists already and is not overwritten")
    with atomic_path(target, follow=False) as temporary:
        length = crc = 0
        # Opened by hand: pyarrow takes a path for UTF-8, and would find another file where names are not.
        with part.open("rb") as plain, temporary.open("wb") as file, pa.CompressedOutputStream(file, "zstd") as stream:
            while piece := plain.read(_AT_ONCE):
                stream.write(piece)
                length, crc = length + len(piece), zlib.crc32(piece, crc)
        with temporary.open("ab") as end:
            end.write(_SEAL.pack(*_SEAL_HEAD, length, crc))
        with (
            part.open("rb") as plain,
            temporary.open("rb") as packed,
            pa.CompressedInputStream(packed, "zstd") as stream,
        ):
            while piece := plain.read(_AT_ONCE):
                if stream.read(len(piece)) != piece:
                    raise BadInputError(f"{target}: does not read back as what was written: {part.name} stays")
            if stream.read(1):
                raise BadInputError(f"{target}: does not read back as what was written: {part.name} stays")
    part.unlink()


def _work_for(name: str) -> Callable[[Path], None]:
    if not name.endswith(".mcap"):
        return pack
    from rw_ekf.logs.mcap_file import chunk

    return chunk


def main(names: list[str]) -> int:
    """Compress each file named; 1 where one could not be."""
    with contextlib.suppress(OSError, ValueError):
        os.nice(_NICE)
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that no temporary file stays behind
    failed = 0
    for name in names:
        try:
            _work_for(name)(Path(name))
        except Exception as error:  # noqa: BLE001 - whatever it is: the plain part is there, and the daemon says so
            sys.stderr.write(f"{error}\n")
            failed = 1
    return failed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
