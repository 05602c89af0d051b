"""A CSV file that another process is still writing: whole rows as they come, or all there are, thinned."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rw_ekf.arrays import Float64Array

Columns = dict[str, list[float | None]]

_AT_ONCE = 1 << 20  # bytes that are read in one go
_TRUTH = {"true": 1.0, "false": 0.0}


class GrowingTable:
    """Follows the rows of a file from where it was opened on; a file that is cut or replaced is begun again."""

    def __init__(self, path: Path, wanted: Sequence[str] = (), *, last_bytes: int | None = None) -> None:
        """wanted: the columns that are read; empty: all. last_bytes: begin so far before the end, not at the start."""
        self.path = path
        self._wanted = frozenset(wanted)
        self._names: list[str] = []
        self._inode = 0
        self._offset = 0
        self._rest = b""
        self._last_bytes = last_bytes

    def rows(self) -> Columns:
        """Whole rows that have come since the last call, by column; the last line may still be growing."""
        try:
            with self.path.open("rb") as stream:
                about = self.path.stat()
                if about.st_ino != self._inode or about.st_size < self._offset:
                    self._inode, self._offset, self._rest, self._names = about.st_ino, 0, b"", []
                if self._last_bytes is not None and about.st_size > 2 * self._last_bytes:
                    self._names = stream.readline().decode("utf-8", "replace").strip().split(",")
                    stream.seek(about.st_size - self._last_bytes)
                    stream.readline()  # to the begin of a row
                    self._offset = stream.tell()
                self._last_bytes = None
                stream.seek(self._offset)
                data = stream.read(_AT_ONCE)
        except OSError:
            return {}
        self._offset += len(data)
        *lines, self._rest = (self._rest + data).split(b"\n")
        texts = [line.decode("utf-8", "replace") for line in lines]
        if not self._names and texts:
            self._names = [name.strip() for name in texts.pop(0).split(",")]
        return self._columns(texts)

    def _columns(self, texts: list[str]) -> Columns:
        kept = [number for number, name in enumerate(self._names) if not self._wanted or name in self._wanted]
        cells = [row for text in texts if len(row := text.split(",")) == len(self._names)]
        return {self._names[number]: [number_of(row[number]) for row in cells] for number in kept} if cells else {}


def number_of(cell: str) -> float | None:
    """A cell's number, 1 or 0 for a truth; None for a gap or a word."""
    try:
        value = float(cell)
    except ValueError:
        return _TRUTH.get(cell)
    return value if np.isfinite(value) else None


def read_thinned(paths: Sequence[Path], wanted: Sequence[str], points: int, span_s: tuple[float, float]) -> Columns:
    """The columns of parts of a table within a span of time, thinned to so many points.

    Of each column the value that stands furthest from the middle of its stretch is kept, so that no spike is lost;
    times are evenly picked. Files that are gone or damaged are left out.
    """
    parts = [part for path in paths if (part := _part(path, wanted, span_s))]
    if not parts:
        return {}
    names = list(dict.fromkeys(name for part in parts for name in part))
    sizes = [len(part["time_s"]) for part in parts]
    whole = {
        name: np.concatenate([part.get(name, np.full(size, np.nan)) for part, size in zip(parts, sizes, strict=True)])
        for name in names
    }
    rows = sum(sizes)
    step = max(1, -(-rows // max(points, 2)))
    return {
        name: _listed(values[::step] if name == "time_s" else _outermost(values, step))
        for name, values in whole.items()
    }


def _part(path: Path, wanted: Sequence[str], span_s: tuple[float, float]) -> dict[str, Float64Array]:
    from rw_ekf.errors import RwEkfError
    from rw_ekf.logs.column_map import ColumnMap
    from rw_ekf.logs.reader import read_table

    try:
        table = read_table(path, ColumnMap())
        time = table.floats(table.names.index("time_s"))
    except (RwEkfError, ValueError):
        return {}
    kept = (time >= span_s[0]) & (time <= span_s[1])
    if not kept.any():
        return {}
    found = {}
    for name in wanted:
        if name in table.names:
            try:
                found[name] = table.floats(table.names.index(name))[kept]
            except RwEkfError:
                continue
    return found


def _outermost(values: Float64Array, step: int) -> Float64Array:
    """Of each stretch of so many values (n,) the one furthest from the stretch's mean."""
    if step == 1:
        return values
    rows = -(-len(values) // step)
    padded = np.full(rows * step, np.nan)
    padded[: len(values)] = values
    stretch = padded.reshape(rows, step)
    known = np.isfinite(stretch)
    counts = np.maximum(known.sum(axis=1, keepdims=True), 1)
    middle = np.where(known, stretch, 0.0).sum(axis=1, keepdims=True) / counts
    off = np.where(known, np.abs(stretch - middle), -1.0)
    return np.asarray(stretch[np.arange(rows), off.argmax(axis=1)], dtype=np.float64)


def _listed(values: Float64Array) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values.tolist()]
