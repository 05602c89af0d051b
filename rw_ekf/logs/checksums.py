"""Checksums of a run's files, in STEM.sums beside them: a bit that flips on a disk changes no number unseen.

A line each, appended as the file grows: `part001.csv BEGIN END LINES CRC SUM`, CRC-32 of the bytes from BEGIN to END of
the plain text, LINES line ends in them, and a CRC-32 of the line itself. A log has a line for what every ten seconds
brought, so that damage has a place; a YAML file has one for the whole of it. What a killed run wrote last has none.
Names are those without the run's stem, and of a part those before it was compressed: a run may be renamed as a whole.
"""

from __future__ import annotations

import contextlib
import zlib
from pathlib import Path
from typing import NamedTuple

from rw_ekf.logs.parts import PartName
from rw_ekf.plain_file import append_line


class Block(NamedTuple):
    """A stretch of a file as it was written."""

    begin: int  # [bytes]
    end: int
    lines: int  # line ends in it; the first block of a log has the header's too
    crc: int

    def is_whole(self, text: bytes) -> bool:
        """Whether the file's text still has it."""
        return len(text) >= self.end and zlib.crc32(memoryview(text)[self.begin : self.end]) == self.crc


class Sums(NamedTuple):
    """What is known of one file: blocks in order; and whether some lines of the checksums cannot be read."""

    blocks: tuple[Block, ...] = ()
    damaged: str | None = None

    @property
    def lines(self) -> int:
        """Line ends that were written."""
        return sum(block.lines for block in self.blocks)

    @property
    def rows(self) -> int:
        """Rows of a log that were written, beside its header."""
        return max(self.lines - 1, 0)


class Damage(NamedTuple):
    """Where a text is not what was written; lines count from 1."""

    begin: int  # byte from which on it is not
    first_line: int
    last_line: int
    cut: bool  # the text is shorter than it was


def sums_path(file: Path) -> Path:
    """Path of the checksums of a run's file."""
    return file.with_name(f"{_stem_and_key(file)[0]}.sums")


def note_block(file: Path, block: Block) -> None:
    """Append the checksum of a block. Raises OSError; no part of a line stays behind."""
    text = f"{_stem_and_key(file)[1]} {block.begin} {block.end} {block.lines} {block.crc:08x}"
    line = f"{text} {zlib.crc32(text.encode()):08x}\n".encode()
    append_line(sums_path(file), line)


def note_file(file: Path) -> None:
    """Append the checksum of a whole file, as it stands; where that cannot be, the file goes without."""
    with contextlib.suppress(OSError):
        content = file.read_bytes()
        note_block(file, Block(0, len(content), content.count(b"\n"), zlib.crc32(content)))


def sums_of(file: Path) -> Sums:
    """Checksums of one file of a run; none where there are none."""
    return all_sums(file).get(_stem_and_key(file)[1], Sums())


def all_sums(file: Path) -> dict[str, Sums]:
    """Checksums of every file of the run that `file` belongs to, by name without stem; a later line counts."""
    path = sums_path(file)
    try:
        lines = path.read_bytes().split(b"\n") if path.is_file() else [b""]
    except OSError:
        lines = [b""]
    blocks: dict[str, dict[int, Block]] = {}
    damaged = None
    for line in lines[:-1]:  # behind the last line end there is nothing, or what a loss of power left of a line
        found = _block_of(line)
        if found is None:
            damaged = f"{path}: a line of these checksums is damaged: what it was of cannot be checked"
        else:
            blocks.setdefault(found[0], {})[found[1].begin] = found[1]
    known = {name: Sums(tuple(found[begin] for begin in sorted(found)), damaged) for name, found in blocks.items()}
    return known if known or damaged is None else {_stem_and_key(file)[1]: Sums((), damaged)}


def part_key(number: int, *, estimates: bool = False) -> str:
    """Name of a part in the checksums."""
    return f"part{number:03d}{'.estimates' if estimates else ''}.csv"


def damage_of(text: bytes, sums: Sums) -> Damage | None:
    """Where the text of a file is not what was written; None where it is, as far as that is known."""
    line, bad = 0, []
    for block in sums.blocks:
        if not block.is_whole(text):
            bad.append((block, line))
        line += block.lines
    if not bad:
        return None
    (first, before), (last, start) = bad[0], bad[-1]
    return Damage(first.begin, before + 1, start + last.lines, len(text) < sums.blocks[-1].end)


def changed(file: Path) -> str | None:
    """Say that a YAML file is not as its run wrote it; None where it is, or where nobody knows."""
    sums = sums_of(file)
    try:
        content = file.read_bytes() if sums.blocks else b""
    except OSError:
        return None
    if not sums.blocks or (sums.blocks[-1].is_whole(content) and len(content) == sums.blocks[-1].end):
        return sums.damaged
    return f"{file}: is not as its run wrote it (its checksum differs): somebody changed it, or the disk did"


def _stem_and_key(file: Path) -> tuple[str, str]:
    part = PartName.of(file.name)
    if part is not None:
        return part.stem, part_key(part.number, estimates=part.estimates)
    stem, _, kind = file.stem.rpartition(".")
    return stem or file.stem, f"{kind}{file.suffix}"


def _block_of(line: bytes) -> tuple[str, Block] | None:
    """Take a line apart; None where it is not as it was written."""
    try:
        text, _, own = line.decode("ascii").rpartition(" ")
        name, begin, end, lines, crc = text.split(" ")
        block = Block(int(begin), int(end), int(lines), int(crc, 16))
    except ValueError:
        return None
    return (name, block) if own == f"{zlib.crc32(text.encode()):08x}" else None
