"""The text of a CSV log, as it stands in its file or unpacked from a compressed one."""

from __future__ import annotations

import io
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, Literal

from rw_ekf.errors import EmptyLogError, LogError
from rw_ekf.logs.native_file import native_file, native_text
from rw_ekf.logs.part_compression import seal_of

if TYPE_CHECKING:
    import pyarrow as pa

Packing = Literal["gzip", "zstd"]

_AT_ONCE = 1 << 12  # unpacked at a time: of a file that is torn or damaged no more than this is lost
# Every row has a time of its own, which takes 0.2 byte and more when packed: 3 kB of constants a row come to 1600:1.
# zstd can pack nonsense 30000:1, and gzip nothing beyond 1032:1.
_MOST_TIMES, _ALWAYS_BYTES = 4000, 1 << 26
HEAD_BYTES = 1 << 20  # a preamble and a header fit in here


@dataclass(frozen=True)
class LogText:
    """Text that can be read from its beginning as often as it takes."""

    path: Path
    unpacked: bytes | None = None  # None: the file itself is the text
    torn: str | None = None  # what is wrong behind the text that could be unpacked
    sealed: bool | None = None  # whether a checksum in the file says that the text is what was packed; None: no word

    @classmethod
    def unpack(cls, path: Path, packing: Packing, name: str) -> LogText:
        """Unpack a compressed file; one that is torn or damaged as far as it goes, to its last whole line.

        Raises EmptyLogError where not a line is left, LogError where it unpacks to what no log is.
        """
        packed = path.read_bytes()
        text, torn = _unpacked(packed, packing, name)
        if torn is not None:  # blocks that a loss of power left empty would be taken for numbers: none of them, then
            text, _ = _unpacked(packed.rstrip(b"\0"), packing, name)
            text = text[: text.rfind(b"\n") + 1]
            if not text:
                raise EmptyLogError(
                    f"{name}: is a damaged or incomplete {packing} file ({torn}): not a line of it can be read"
                )
        seal = seal_of(packed)
        return cls(path, text, torn, None if seal is None else seal == (len(text), zlib.crc32(text)))

    def open(self) -> BinaryIO:
        """Open the text from its beginning."""
        return self.path.open("rb") if self.unpacked is None else io.BytesIO(self.unpacked)

    def for_arrow(self) -> pa.NativeFile:
        """Open the text for Arrow's readers."""
        return native_file(self.path) if self.unpacked is None else native_text(self.unpacked)


def check_head(head: bytes, name: str) -> None:
    """Raise LogError where the first HEAD_BYTES of a text hold no line end: that is no table of rows."""
    if len(head) >= HEAD_BYTES and b"\n" not in head and b"\r" not in head:
        raise LogError(f"{name}: no line ends within its first {HEAD_BYTES} bytes: this is no log, give one of rows")


def _unpacked(packed: bytes, packing: Packing, name: str) -> tuple[bytes, str | None]:
    """As much text as there is, and what is wrong behind it."""
    import pyarrow as pa

    pieces, most = [], max(_MOST_TIMES * len(packed), _ALWAYS_BYTES)
    try:
        with pa.CompressedInputStream(pa.BufferReader(packed), packing) as stream:
            while piece := stream.read(_AT_ONCE):
                pieces.append(piece)
                most -= len(piece)
                if most < 0:
                    raise LogError(
                        f"{name}: unpacks to more than {_MOST_TIMES} times its size, which no log does: it says next "
                        "to nothing. Unpack it yourself and look at what it is"
                    )
    except (pa.ArrowException, OSError) as error:
        return b"".join(pieces), str(error).splitlines()[0] if str(error) else type(error).__name__
    return b"".join(pieces), None
