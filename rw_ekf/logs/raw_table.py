"""What a file holds before anyone says what it means: named columns, and the place of every row for messages."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rw_ekf.arrays import Float64Array
from rw_ekf.errors import LogError
from rw_ekf.logs.local_time import utc_of_local
from rw_ekf.logs.time_text import past_midnight, seconds_of

if TYPE_CHECKING:
    from zoneinfo import ZoneInfo

MAX_NAMES_SHOWN = 30
_SEGMENTS = 2.0**32  # more than any log has


class Factor(NamedTuple):
    """What a file says that the numbers of a column are times, and what is added, each as it stands there."""

    factor: str
    offset: str
    is_added: bool = False  # whether the offset is added to the product by the convention of its name


@dataclass(eq=False)
class RawTable:
    """Columns of one file in file order. `names` may repeat or be empty; the position is what identifies a column."""

    path: str
    names: tuple[str, ...]
    columns: list[Any]  # pyarrow.Array / ChunkedArray or numpy array, each of `rows` values
    rows: int
    place: Callable[[int], str]  # row index (from 0) -> "line 17", for messages
    warnings: list[str] = field(default_factory=list)
    torn: bool = False  # rows are missing behind the last one
    one_wheel: bool = False  # the wheel that the map names was chosen by groups of the file
    preamble: tuple[str, ...] = ()  # lines of a text above the names, or what stands beside the numbers as `key: value`
    units: dict[str, str] = field(default_factory=dict)  # by name of column, where the file has them beside the names
    remarks: dict[str, str] = field(default_factory=dict)  # by name of column: what the file says of it in prose
    factors: dict[str, Factor] = field(default_factory=dict)  # by name of column
    zone: ZoneInfo | None = None  # of dates that bear none themselves; None: UTC
    parts_of_time: frozenset[str] = frozenset()  # names of columns that one more has put together
    doubts: tuple[str, ...] = ()  # sentences on what its layout leaves open: which cell is whose, what a comma means

    def __post_init__(self) -> None:
        self.columns = [_decoded(column) for column in self.columns]

    def index_of(self, name: str) -> int | None:
        """Position of the column called `name`; None if there is none. Raises LogError if the name is repeated."""
        positions = [index for index, other in enumerate(self.names) if other == name]
        if len(positions) > 1:
            numbers = ", ".join(map(str, positions))
            raise LogError(
                f"{self.path}: column '{name}' appears {len(positions)} times (columns {numbers}, counted from 0): "
                "rename all but one, or pick one by number with --columns"
            )
        return positions[0] if positions else None

    def floats(self, index: int, *, stamps: bool = False) -> Float64Array:
        """Column at `index` as a new float64 array (n,), NaN where empty. Raises LogError if it is not numeric.

        stamps: dates are taken too, as seconds since 1970, times of day, as seconds since midnight, and durations.
        """
        column = self.columns[index]
        if isinstance(column, np.ndarray):
            return np.array(column, dtype=np.float64).reshape(-1)
        import pyarrow as pa

        kind = column.type
        if pa.types.is_boolean(kind) or pa.types.is_decimal(kind):
            column = column.cast(pa.int8() if pa.types.is_boolean(kind) else pa.float64())
        elif stamps and (pa.types.is_timestamp(kind) or pa.types.is_duration(kind)):
            in_ns = pa.duration("ns") if pa.types.is_duration(kind) else pa.timestamp("ns", kind.tz)
            column = column.cast(in_ns, safe=False).cast(pa.int64())
            seconds = np.asarray(1.0e-9 * column.to_numpy(zero_copy_only=False))
            if self.zone is None or pa.types.is_duration(kind) or kind.tz is not None:
                return seconds
            return utc_of_local(seconds, self.zone)
        elif stamps and pa.types.is_time(kind):
            ticks = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}[kind.unit]
            whole = column.cast(pa.int32() if pa.types.is_time32(kind) else pa.int64()).cast(pa.float64())
            return past_midnight(np.asarray(whole.to_numpy(zero_copy_only=False)) / ticks)
        elif (stamps and self.is_text(index)) or pa.types.is_date(kind):
            texts = [None if value is None else str(value) for value in column.to_pylist()]
            found = seconds_of(texts, self.zone)
            if found is None:
                raise LogError(
                    f"{self.path}: column '{self.names[index]}' is to be a time and holds what is no number, "
                    f"date or a time of day, such as {next(text for text in texts if text)!r}: name another column"
                )
            return found
        elif not _is_number(kind):
            raise LogError(
                f"{self.path}: column '{self.names[index]}' holds {kind}, not numbers: convert it to a number "
                "in the unit that its name says"
            )
        if pa.types.is_null(kind):
            return np.full(self.rows, np.nan)
        if not pa.types.is_float64(column.type):  # to cast imports what arrow computes with, which takes a while
            column = column.cast(pa.float64(), safe=False)
        chunks = column.chunks if isinstance(column, pa.ChunkedArray) else [column]
        return np.concatenate([np.empty(0), *map(_float64_of, chunks)])

    def numbers(self, index: int, *, stamps: bool = False) -> Float64Array:
        """The same, and NaN throughout where it is not numeric."""
        try:
            return self.floats(index, stamps=stamps)
        except LogError:
            return np.full(self.rows, np.nan)

    def is_text(self, index: int) -> bool:
        """Whether the column at `index` holds words."""
        column = self.columns[index]
        if isinstance(column, np.ndarray):
            return False
        import pyarrow as pa

        return bool(pa.types.is_string(column.type) or pa.types.is_large_string(column.type))

    def is_truth(self, index: int) -> bool:
        """Whether the column at `index` holds true and false."""
        column = self.columns[index]
        if isinstance(column, np.ndarray):
            return bool(column.dtype == np.bool_)
        import pyarrow as pa

        return bool(pa.types.is_boolean(column.type))

    def is_plain_number(self, index: int) -> bool:
        """Whether the column at `index` holds numbers as such: no date, time of day or words."""
        column = self.columns[index]
        return isinstance(column, np.ndarray) or _is_number(column.type)

    def distinct(self, index: int, most: int) -> list[str]:
        """The different values of the column at `index`, as text in order; none where there are more than `most`."""
        column = self.columns[index]
        if not isinstance(column, np.ndarray) and column.type.num_fields:  # lists and the like
            return []
        values = np.unique(column[np.isfinite(column)]) if isinstance(column, np.ndarray) else column.unique()
        if len(values) > most + 1:
            return []
        held = [value for value in _listed(values) if value is not None and str(value) != "nan"]
        return sorted(_spelt(value) for value in held) if len(held) <= most else []

    def cells(self, index: int) -> list[Any]:
        """The cells of the column at `index`, as Python has them."""
        return _listed(self.columns[index])

    def words(self, most: int = 20) -> list[str]:
        """What stands in columns of words that have few different ones: states, notes."""
        return [text for index in range(len(self.names)) if self.is_text(index) for text in self.distinct(index, most)]

    def of_only(self, key: str | int, value: str) -> RawTable:
        """The rows in which a column, by name or number, has a value. Raises LogError where none has."""
        index = key if isinstance(key, int) else self.index_of(key)
        if index is None or index >= len(self.names):
            raise LogError(f"{self.path}: has no column {key!r} to choose rows by; it has {self.described_columns()}")
        rows = np.flatnonzero([cell is not None and _spelt(cell) == value for cell in self.cells(index)])
        if not rows.size:
            known = ", ".join(self.distinct(index, MAX_NAMES_SHOWN)) or "others"
            raise LogError(f"{self.path}: no row has {value!r} in column {key!r}, which holds {known}")
        return self.at_rows(rows)

    def at_rows(
        self, rows: NDArray[np.intp], names: tuple[str, ...] | None = None, columns: list[Any] | None = None
    ) -> RawTable:
        """The rows at these places (m,) alone; with other names and columns (m,) where these are given."""
        held = [taken(column, rows) for column in self.columns] if columns is None else columns
        return replace(
            self, names=names or self.names, columns=held, rows=len(rows), place=lambda row: self.place(int(rows[row]))
        )

    def begin_segment(self, number: int) -> None:
        """Set the segments apart from those of other tables, where there are any: rows are missing before the first."""
        index = self.index_of("segment")
        if index is not None:
            self.columns[index] = self.floats(index) + _SEGMENTS * number

    def reversed(self) -> RawTable:
        """The rows from the last to the first."""
        return self.at_rows(np.arange(self.rows - 1, -1, -1))

    def described_columns(self) -> str:
        """Describe the columns for a message: `time, v, (unnamed)`."""
        shown = [name or "(unnamed)" for name in self.names[:MAX_NAMES_SHOWN]]
        rest = len(self.names) - len(shown)
        return ", ".join(shown) + (f" and {rest} more" if rest > 0 else "")

    def nearest(self, name: str) -> str:
        """Advice with the nearest column name, or nothing."""
        near = difflib.get_close_matches(name, [other for other in self.names if other], n=1, cutoff=0.6)
        return f" (did you mean '{near[0]}'?)" if near else ""


def stacked(tables: list[RawTable], name: str) -> RawTable:
    """Put the rows of several tables under each other. Raises LogError unless they have the same columns."""
    first = tables[0]
    for other in tables[1:]:
        if other.names != first.names:
            raise LogError(
                f"{other.path}: has other columns ({other.described_columns()}) than {first.path} "
                f"({first.described_columns()}): they are no parts of one log"
            )
    begins = np.cumsum([0, *(table.rows for table in tables)])

    def place(row: int) -> str:
        which = int(np.searchsorted(begins, row, side="right")) - 1
        return f"{tables[which].path}, {tables[which].place(row - int(begins[which]))}"

    columns = [_stacked_column([table.columns[index] for table in tables]) for index in range(len(first.names))]
    warnings = [text for table in tables for text in table.warnings]
    return RawTable(name, first.names, columns, int(begins[-1]), place, warnings)


def _listed(column: Any) -> list[Any]:
    held: list[Any] = column.tolist() if isinstance(column, np.ndarray) else column.to_pylist()
    return held


def _spelt(value: Any) -> str:
    """A cell as a text by which it is found: `1`, be it read as 1.0."""
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


def _decoded(column: Any) -> Any:
    """A column; of one that names its values by number (a pandas Categorical), the values."""
    if isinstance(column, np.ndarray):
        return column
    import pyarrow as pa

    return column.cast(column.type.value_type) if pa.types.is_dictionary(column.type) else column


def _is_number(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_null(kind))


def _float64_of(chunk: Any) -> Float64Array:
    """Values (n,) of a float64 array, NaN where null. Arrow's own to_numpy() imports pandas where that is installed."""
    if len(chunk) == 0:
        return np.empty(0)
    valid, held = chunk.buffers()
    rows = slice(chunk.offset, chunk.offset + len(chunk))
    values: Float64Array = np.frombuffer(held, dtype=np.float64, count=rows.stop)[rows]
    if chunk.null_count == 0:
        return values
    known = np.unpackbits(np.frombuffer(valid, dtype=np.uint8), count=rows.stop, bitorder="little")[rows]
    return np.where(known, values, np.nan)


def taken(column: Any, rows: NDArray[np.intp] | slice) -> Any:
    """The values (m,) of a column at some rows (m,)."""
    return column[rows] if isinstance(column, np.ndarray) or isinstance(rows, slice) else column.take(rows)


def _stacked_column(parts: list[Any]) -> Any:
    """Put columns under each other; what is a number in one part and text in another becomes text."""
    import pyarrow as pa

    tables = [pa.table({"": part}) for part in parts]
    try:
        return pa.concat_tables(tables, promote_options="permissive").column(0)
    except pa.ArrowException:
        return pa.chunked_array([pa.array(map(str, part.to_pylist())) for part in parts])


def number_or_none(text: str) -> float | None:
    """Value of a cell: empty or any spelling of nan is NaN; None if it is no number. Infinity comes back as such."""
    stripped = text.strip()
    if not stripped or stripped.lower() in {"nan", "+nan", "-nan"}:
        return float("nan")
    if "_" in stripped:  # Python's float() takes 1_000; no instrument writes it
        return None
    try:
        return float(stripped)
    except ValueError:
        return None
