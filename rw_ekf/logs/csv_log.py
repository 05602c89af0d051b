"""CSV logs, as they stand or compressed with gzip or zstd, held against their checksums where a run left some."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

from rw_ekf.errors import EmptyLogError, LogError
from rw_ekf.logs.checksums import Sums, damage_of, sums_of, sums_path
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.csv_table import csv_in_parts, read_csv_table
from rw_ekf.logs.in_parts import InParts, UnsoundError
from rw_ekf.logs.log_columns import READABLE_COLUMNS
from rw_ekf.logs.log_format import LogFormat
from rw_ekf.logs.log_text import LogText, Packing
from rw_ekf.logs.raw_table import RawTable

_PACKED: tuple[tuple[bytes, Packing], ...] = ((b"\x1f\x8b", "gzip"), (b"\x28\xb5\x2f\xfd", "zstd"))
_NUMBERS = frozenset(READABLE_COLUMNS) - {"status"}  # which may be words, in somebody else's log


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    packing = _packing_of(path)
    text = LogText(path) if packing is None else LogText.unpack(path, packing, name)
    sums = sums_of(path)
    text, stated = _checked(text, sums, name)
    table = read_csv_table(
        text, columns.csv, lambda number, column: column in _NUMBERS or columns.uses(number, column), name
    )
    table.torn = text.torn is not None or (sums.rows > 0 and stated is not None and table.rows < sums.rows)
    if table.torn and table.rows < sums.rows:
        stated = f"{stated or f'{name}: is torn'}; {sums.rows - table.rows} rows that were written are missing"
    table.warnings += [*([] if stated is None else [stated]), *([] if sums.damaged is None else [sums.damaged])]
    return table


def _packing_of(path: Path) -> Packing | None:
    with path.open("rb") as stream:
        head = stream.read(4)
    return next((packing for magic, packing in _PACKED if head.startswith(magic)), None)


def _in_parts(path: Path, name: str, columns: ColumnMap, carried: Collection[str] | None) -> InParts | None:
    """A text that is as its run wrote it, or that no run wrote; a packed one is unpacked as a whole."""
    if _packing_of(path) is not None:
        return None
    text, sums = LogText(path), sums_of(path)
    if sums.damaged is not None:
        return None

    def numeric(number: int, column: str) -> bool:
        return column in _NUMBERS or column in (carried or ()) or columns.uses(number, column)

    parts = csv_in_parts(text, columns.csv, numeric, name, with_others=carried is None)
    if parts is None:
        return None
    stated = cache(lambda: _checked(text, sums, name)[1])  # reads all of it: not of a text that turns out to be short

    def tables() -> Iterator[RawTable]:
        if stated() is not None:
            raise UnsoundError(stated())
        yield from parts.tables()

    return parts._replace(tables=tables)


def _checked(text: LogText, sums: Sums, name: str) -> tuple[LogText, str | None]:
    """Hold a run's text against its checksums, and say where it differs.

    A compressed part is read up to there: nobody has edited it. A plain one may have been, and is read as it stands.
    Raises LogError for a compressed part whose damage has no place.
    """
    if not sums.blocks:
        if text.sealed is False and text.torn is None:
            raise LogError(
                f"{name}: does not unpack to what was packed (its checksum differs), and {sums_path(text.path).name} "
                "is not there to say where: take a copy of this file, or unpack it and look at its rows yourself"
            )
        return text, None
    content = text.path.read_bytes() if text.unpacked is None else text.unpacked
    damage = damage_of(content, sums)
    if damage is None:
        return text, None
    if text.unpacked is not None:
        good = content[: damage.begin]
        if not good:
            raise EmptyLogError(f"{name}: is damaged from its beginning on (its checksum differs): nothing was read")
        return replace(
            text, unpacked=good, torn=text.torn or f"its checksum differs from line {damage.first_line} on"
        ), None
    if damage.cut and damage.last_line >= sums.lines:
        what = f"is {sums.blocks[-1].end - len(content)} bytes shorter than it was written"
        return text, f"{name}: {what}, and not the same from line {damage.first_line} on: read as it stands"
    lines = f"lines {damage.first_line} to {damage.last_line}"
    return text, (
        f"{name}: {lines} are not as they were written (their checksum differs): somebody changed them, or the disk "
        "did; they were read as they stand"
    )


FORMAT = LogFormat(
    lambda head, suffix: True, _read, "nothing: takes what no other format has taken", in_parts=_in_parts
)
