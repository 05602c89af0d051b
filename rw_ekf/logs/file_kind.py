"""What kind of file a log is, by its first bytes: names lie, content does not."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from rw_ekf.errors import EmptyLogError, LogError

FileKind = Literal["csv", "parquet", "matlab", "gzip", "zstd"]  # compressed: CSV inside

# A v4 file has no magic: its first number says byte order and element type.
_MATLAB_4_HEADS = frozenset(number.to_bytes(4, "little") for number in range(0, 60, 10))
_FOREIGN = (
    (b"BZh", "compressed with bzip2: unpack it first"),
    (b"\xfd7zXZ", "compressed with xz: unpack it first"),
    (b"PK\x03\x04", "a zip archive or a spreadsheet: unpack it, or save the sheet as CSV"),
    (b"ARROW1", "an Arrow (Feather) file: save it as Parquet or CSV"),
)


def file_kind(path: Path, name: str) -> FileKind:
    """Tell the kind of file; `name` stands for it in messages. Raises LogError if it is none that can be read."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise LogError(f"{name}: is a device or pipe, which can be read only once: save the log to a file first")
    try:
        with path.open("rb") as stream:
            head = stream.read(128)
    except FileNotFoundError:
        raise LogError(f"{name}: no such file") from None
    except IsADirectoryError:
        raise LogError(f"{name}: is a directory: give the log file in it") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise LogError(f"{name}: cannot be read ({reason})") from None
    suffix = path.suffix.lower()
    if not head:
        raise EmptyLogError(f"{name}: the file is empty")
    if head.startswith(b"\x1f\x8b"):
        return "gzip"
    if head.startswith(b"\x28\xb5\x2f\xfd"):
        return "zstd"
    if head.startswith(b"PAR1"):
        return "parquet"
    if head.startswith(b"\x89HDF\r\n\x1a\n") or head.startswith(b"MATLAB 7.3"):
        raise LogError(f"{name}: is a MATLAB v7.3 (HDF5) file: save it in MATLAB with save(..., '-v7')")
    if head.startswith(b"MATLAB 5.0") or (suffix == ".mat" and head[:4] in _MATLAB_4_HEADS):
        return "matlab"
    if suffix in (".parquet", ".mat"):
        kind = "Parquet" if suffix == ".parquet" else "MATLAB"
        raise LogError(
            f"{name}: is called {suffix} but is no {kind} file (it begins with {head[:8]!r}): rename it to what it is, "
            "or write it again"
        )
    for magic, what in _FOREIGN:
        if head.startswith(magic):
            raise LogError(f"{name}: is {what}")
    return "csv"
