"""HDF5: MATLAB v7.3 files, read as those of v7 are, and plain HDF5, whose groups are structs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.errors import LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.foreign.format_library import Library, foreign_format
from rw_ekf.logs.matlab_table import table_of_variables
from rw_ekf.logs.raw_table import RawTable

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_DEEPEST = 32  # groups within groups: links may go in circles
_OPAQUE = 3  # MATLAB_object_decode of what is written as a number into a table of objects


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    """By the rules of `rw_ekf.logs.matlab_table`; `variable` may be a path, `group/dataset` or `group.dataset`.

    Raises LogError for a file or a variable that holds no record, or holds it as an object that only MATLAB opens.
    """
    import h5py

    with path.open("rb") as stream, h5py.File(stream, "r") as file:
        wanted = columns.variable
        if wanted is not None and wanted not in file:
            wanted = wanted.replace(".", "/")
        keys = [key for key in file if not key.startswith("#")] if wanted is None or wanted not in file else [wanted]
        opaque = {key: _class_of(file[key]) for key in keys if _is_opaque(file[key])}
        content = {key: _value(file, file[key], 0) for key in keys if key not in opaque}
        content |= {stated: text for key in content for stated, text in _attributes(key, file[key]).items()}
        content |= _attributes("", file)
        if columns.variable is not None and wanted in file:
            content = {columns.variable: content[wanted]} if wanted in content else {}
    stated = "; ".join(_how_to_save(key, kind) for key, kind in opaque.items())
    if opaque and (not content or columns.variable in opaque):
        raise LogError(f"{name}: {stated}")
    table = table_of_variables(content, name, columns.variable, columns.layout)
    if opaque:
        table.warnings.append(f"{name}: {stated}; the other variables were read")
    return table


def _value(file: Any, item: Any, depth: int) -> Any:
    """What an HDF5 object holds, as scipy.io.loadmat would give it: a struct is a record array."""
    import h5py

    if depth > _DEEPEST:
        raise ValueError(f"{item.name} goes deeper than {_DEEPEST} groups")
    if isinstance(item, h5py.Group):
        fields = {key: _value(file, item[key], depth + 1) for key in item}
        if not _class_of(item):
            fields |= {stated: text for key in list(fields) for stated, text in _attributes(key, item[key]).items()}
        return _struct(_elements(fields) if _is_struct_array(item) else [fields])
    if _is_opaque(item) or item.attrs.get("MATLAB_empty", 0) or item.shape is None:
        return np.empty((0, 0))
    values = np.atleast_1d(item[()])
    matlab = _class_of(item)
    if values.dtype.names:  # a table of rows; a complex number in MATLAB's
        return _struct([{key: values[key] for key in values.dtype.names}])
    if h5py.check_ref_dtype(values.dtype) is not None:
        cells = np.empty(values.shape, dtype=object)
        for place, reference in np.ndenumerate(values):
            cells[place] = _value(file, file[reference], depth + 1) if reference else np.empty((0, 0))
        return cells.T
    if matlab == "char":
        return np.array(["".join(map(chr, row)) for row in values.T])
    return values.T if matlab else values  # MATLAB counts dimensions from the other end


def _attributes(key: str, item: Any) -> dict[str, Any]:
    """Attributes of an object as variables beside it: `speed_unit`; a list of them for the fields of a table.

    Those of a group are as what it holds: `run.sample_rate`.
    """
    found: dict[str, Any] = {}
    between = "_" if hasattr(item, "dtype") else "."
    fields = getattr(getattr(item, "dtype", None), "names", None) or ()
    for stated, value in item.attrs.items():
        if len(fields) == np.size(value) > 1:
            found |= {f"{key}.{field}_{stated}": np.asarray(each) for field, each in zip(fields, value, strict=True)}
        elif "MATLAB" not in stated:
            found[f"{key}{between}{stated}".lstrip("_.")] = np.asarray(value)
    return found


def _is_struct_array(group: Any) -> bool:
    """Whether every field of a MATLAB struct is a reference to each element's value."""
    import h5py

    return _class_of(group) == "struct" and all(
        isinstance(item, h5py.Dataset) and h5py.check_ref_dtype(item.dtype) and not _class_of(item)
        for item in group.values()
    )


def _elements(fields: dict[str, Any]) -> list[dict[str, Any]]:
    count = max((field.size for field in fields.values()), default=0)
    return [{key: field.reshape(-1)[number] for key, field in fields.items()} for number in range(count)]


def _struct(records: list[dict[str, Any]]) -> Any:
    """A struct (1, n) of n records with the same fields; nothing for no fields."""
    if not records or not records[0]:
        return np.empty((0, 0))
    struct = np.empty((1, len(records)), dtype=[(key, object) for key in records[0]])
    for number, record in enumerate(records):
        for key, value in record.items():
            struct[0, number][key] = value
    return struct


def _class_of(item: Any) -> str:
    kind = item.attrs.get("MATLAB_class", b"")
    return kind.decode("ascii", "replace") if isinstance(kind, bytes) else str(kind)


def _is_opaque(item: Any) -> bool:
    return int(item.attrs.get("MATLAB_object_decode", 0)) == _OPAQUE


def _how_to_save(key: str, kind: str) -> str:
    """What to type in MATLAB for an object that HDF5 has as a number only."""
    if kind in ("table", "timetable"):
        how = f"write{kind}({key}, 'log.csv')"
    elif kind == "timeseries":
        how = f"s.time_s = {key}.Time; s.value = squeeze({key}.Data); save('log.mat', '-struct', 's')"
    else:
        how = "save its numbers as vectors"
    return f"'{key}' is a {kind or 'class'} object, which only MATLAB can open: there {how}"


FORMAT = foreign_format(
    "a MATLAB v7.3 (HDF5) file",
    lambda head, suffix: head.startswith((_SIGNATURE, b"MATLAB 7.3")),
    "the first bytes of HDF5, or 'MATLAB 7.3'",
    _read,
    Library("hdf5", ("h5py",)),
    "save it in MATLAB with save(..., '-v7')",
)
