"""numpy's files: .npz as a MATLAB file of the same variables would be read, .npy as the one array that it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.errors import LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.format_library import foreign_format
from rw_ekf.logs.matlab_table import table_of_variables
from rw_ekf.logs.raw_table import RawTable

_NPY, _ZIP = b"\x93NUMPY", b"PK\x03\x04"
_NAME_AT = 30  # of the first file in a zip archive


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """By the rules of `rw_ekf.logs.matlab_table`. Raises LogError for what holds Python's own objects only."""
    objects: list[str] = []
    with path.open("rb") as stream:
        held = np.load(stream, allow_pickle=False)
        arrays = {"array": held} if isinstance(held, np.ndarray) else _arrays(held, objects)
    content = {column: values for key, array in arrays.items() for column, values in _columns(key, array).items()}
    stated = f"{', '.join(objects)}: an object of Python, which is not unpacked, for that could run anything"
    if objects and not content:
        raise LogError(f"{name}: holds nothing but {stated}: save its arrays by name, np.savez(file, t=t, speed=speed)")
    table = table_of_variables(content, name, columns.variable, columns.layout)
    if objects:
        table.warnings.append(f"{name}: left out {stated}")
    return table


def _arrays(held: Any, objects: list[str]) -> dict[str, Any]:
    """The arrays of an archive by name; the names of those that are objects go into `objects`."""
    found = {}
    for key in held.files:
        try:
            found[key] = held[key]
        except ValueError as error:
            if "allow_pickle" not in str(error):
                raise
            objects.append(f"'{key}'")
    return found


def _columns(key: str, array: Any) -> dict[str, Any]:
    """One array by its name, or the fields of a structured one by theirs; dates as seconds since 1970."""
    if array.dtype.names:
        return {field: values for part in array.dtype.names for field, values in _columns(part, array[part]).items()}
    if array.dtype.kind == "M":
        return {key: array.astype("datetime64[ns]").astype(np.int64) / 1.0e9}
    return {key: array}


FORMAT = foreign_format(
    "a numpy file",
    lambda head, suffix: head.startswith(_NPY) or (head.startswith(_ZIP) and b".npy" in head[_NAME_AT:]),
    "the first bytes of .npy; a zip archive that begins with one",
    _read,
    otherwise="save it as CSV",
)
