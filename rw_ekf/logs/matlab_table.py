"""MATLAB files (v4 to v7): vectors, a matrix, structs within structs, or cells with one segment in each column."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import Any

import numpy as np

from rw_ekf.errors import LogError
from rw_ekf.logs.column_map import ColumnMap
from rw_ekf.logs.column_names import role_of, stated_by
from rw_ekf.logs.labels import labelled_matrix, says_how_large, with_labels
from rw_ekf.logs.log_format import LogFormat, noting_suffix
from rw_ekf.logs.matlab_check import check_skeleton
from rw_ekf.logs.raw_table import MAX_NAMES_SHOWN, RawTable
from rw_ekf.logs.vectors import vector_of, vectors_of

_RUN = re.compile(
    r"(?<![a-z])(runs?|trials?|tests?|exp|experiments?|rec|records?|recordings?|meas\w*|versuch|lauf|messung|sweeps?|"
    r"cycles?|sessions?|segments?|sets?)[_ ]?[\[(]?\d+[\])]?$",
    re.IGNORECASE,
)  # and no wheel, motor or axis


def read_matlab_table(path: Path, name: str, variable: str | None, layout: str) -> RawTable:
    """Read a .mat file.

    variable: None takes every vector of the most common length as a column, of the file or, where it has none, of its
    only struct; else a matrix, a struct or a cell array.
    layout: "columns" (each matrix column is a channel), "rows" (each row is), or "cells": a cell array (channels,
    segments) whose elements are vectors, joined end to end, with a column `segment` added; an element of one value
    holds for its whole segment.
    Raises LogError if the file or the variable cannot be used.
    """
    return table_of_variables(_load(path, name), name, variable, layout)


def table_of_variables(content: dict[str, Any], name: str, variable: str | None, layout: str) -> RawTable:
    """The table of what a file holds, by `read_matlab_table`'s rules.

    content: by name, arrays of at least two dimensions as scipy.io.loadmat gives them: a struct is a record array, a
    cell array one of objects.
    """
    runs: list[tuple[str, Any]] = []
    if variable is None:
        if layout != "columns":
            raise LogError(f"{name}: layout '{layout}' needs `variable`, one of: {', '.join(content) or 'none'}")
        structs = {key: fields for key, value in content.items() if (fields := _fields_of(value, key))}
        if structs and not (len(_vectors(content)) > 1 or labelled_matrix(content)):  # one is a time beside them
            several = len(structs) > 1 and sum(bool(_vectors(fields)) for fields in structs.values()) > 1
            for key, fields in structs.items():  # of each run, say, beside a time for all
                content = content | (fields if several else _fields_of(content[key], ""))
            runs = _runs(content if several else {k: v for fields in structs.values() for k, v in fields.items()})
        columns = runs or _columns_in(content)
        kind = "the file holds no numeric vectors"
    else:
        if variable not in content:
            raise LogError(f"{name}: has no variable '{variable}'; variables: {', '.join(content) or 'none'}")
        columns = _columns_of(content[variable], name, variable, layout)
        kind = f"variable '{variable}' holds no numbers"
    rows = len(columns[0][1]) if columns else 0
    if rows == 0:
        held = ", ".join(list(content)[:MAX_NAMES_SHOWN]) or "none"
        raise LogError(
            f"{name}: {kind}: name the variable that holds the record (`variable` in the column map); variables: {held}"
        )
    names = tuple(column[0] for column in columns)
    table = RawTable(name, names, [column[1] for column in columns], rows, lambda row: f"row {row + 1}")
    if runs:
        table.warnings.append(f"{name}: holds several runs of the same columns: each is a segment")
        reported: dict[str, set[str]] = {}
        for key, value in content.items():
            if says_how_large(last := _in_its_run(key)) and last != key:
                reported.setdefault(last, set()).add(str(np.asarray(value).tolist()))
        if changing := [key for key, values in reported.items() if len(values) > 1]:
            table.doubts = (f"{', '.join(changing)}: not the same in all runs, and the map has one for all.",)
        content = {_in_its_run(key): value for key, value in content.items()}
    elif variable is None and (left := [key for key in _speeds(content) if key not in names]):
        table.warnings.append(f"{name}: {', '.join(left[:MAX_NAMES_SHOWN])}: of another length and left out")
    return with_labels(table, content)


def _fields_of(value: Any, key: str) -> dict[str, Any]:
    """What a struct, an array of structs or a cell array of them holds, by path; nothing for anything else."""
    array = np.asarray(value)
    if array.dtype.names:
        return _fields(array, key)
    cells = list(array.reshape(-1)) if array.dtype.kind == "O" else []
    if not cells or not all(np.asarray(cell).dtype.names for cell in cells):
        return {}
    return {k: v for number, cell in enumerate(cells) for k, v in _fields(np.asarray(cell), f"{key}[{number}]").items()}


def _in_its_run(key: str) -> str:
    """What a path is called within the run that it belongs to; itself where that is none."""
    place, _, last = key.rpartition(".")
    return last if _RUN.search(place) else key


def _speeds(content: dict[str, Any]) -> list[str]:
    """The vectors that are speeds by their names."""
    found = (key for key, value in content.items() if (vector := vector_of(value)) is not None and len(vector) > 1)
    return [key for key in found if role_of(stated_by(key)) == "speed"]


def _runs(content: dict[str, Any]) -> list[tuple[str, Any]]:
    """Columns of runs, `run_1.t`, `run_2.t` or `trial[0].t`, under each other, with their number as `segment`.

    Nothing where there is one, where they have other columns, or are of several wheels by what they are called.
    """
    runs: dict[str, dict[str, Any]] = {}
    for key, value in content.items():
        last, vector = _in_its_run(key), vector_of(value)
        if last != key and vector is not None and len(vector) > 1:
            runs.setdefault(key.removesuffix(last), {})[last] = vector
    names = [list(run) for run in runs.values()]
    alike = len(runs) > 1 and all(each == names[0] for each in names)
    whole = all(len({len(vector) for vector in run.values()}) == 1 for run in runs.values())
    roles = {role_of(stated_by(each)) for each in names[0]} if alike and whole else set()
    if not roles >= {"time", "speed"}:
        return []
    rows = [len(next(iter(run.values()))) for run in runs.values()]
    columns = [(each, np.concatenate([run[each].astype(np.float64) for run in runs.values()])) for each in names[0]]
    return [*columns, ("segment", np.repeat(np.arange(len(rows), dtype=np.float64), rows))]


def _columns_in(content: dict[str, Any]) -> list[tuple[str, Any]]:
    """Vectors of the most common length, with the columns of a matrix that has names for them, or is alone.

    Single numbers are columns only where there is nothing else.
    """
    vectors, matrix = _vectors(content), labelled_matrix(content)
    if not vectors and not matrix:
        return vectors_of(content)
    if not vectors or (matrix and len(matrix[0][1]) > len(vectors[0][1])):
        rows = len(matrix[0][1]) if matrix else 0
        return [*((key, values) for key, values in vectors if len(values) == rows), *matrix]
    if len(vectors) == 1 and not any(
        key for key, _ in matrix
    ):  # a time beside what has several columns and no names for them (Simulink)
        return [*vectors, *_by_number(content, len(vectors[0][1]))]
    return [*vectors, *((key, values) for key, values in matrix if key and len(values) == len(vectors[0][1]))]


def _by_number(content: dict[str, Any], rows: int) -> list[tuple[str, Any]]:
    """The columns of matrices of so many rows, by number from 0: `simout.signals.values[1]`."""
    matrices = {key: np.asarray(value) for key, value in content.items()}
    return [
        (f"{key}[{at}]", column)
        for key, matrix in matrices.items()
        if matrix.dtype.kind in "fiub" and matrix.ndim == 2 and matrix.shape[0] == rows
        and 1 < matrix.shape[1] <= MAX_NAMES_SHOWN
        for at, column in enumerate(matrix.T)
    ]  # fmt: skip


def _vectors(content: dict[str, Any]) -> list[tuple[str, Any]]:
    """Vectors of the most common length, of more than one number."""
    return [(key, values) for key, values in vectors_of(content) if len(values) > 1]


def _load(path: Path, name: str) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        data = path.read_bytes()
        if data.startswith(b"MATLAB 5.0"):
            check_skeleton(data)
        content = loadmat(io.BytesIO(data))
    except NotImplementedError:
        raise LogError(f"{name}: is a MATLAB v7.3 (HDF5) file: save it in MATLAB with save(..., '-v7')") from None
    except Exception as error:  # noqa: BLE001 - scipy raises whatever a damaged file leads it into
        raise LogError(f"{name}: is a damaged MATLAB file, or none ({error}): save it again with -v7") from None
    return {key: value for key, value in content.items() if not key.startswith("__")}


def _columns_of(value: Any, name: str, variable: str, layout: str) -> list[tuple[str, Any]]:
    array = np.asarray(value)
    if layout == "cells":
        return _cells(array, name, variable)
    if array.dtype.names:  # a struct: its fields are columns, those of structs within it too
        return vectors_of(_fields(array))
    if array.dtype.kind not in "fiub" or array.ndim != 2:
        hint = "; it is a cell array: use `layout: cells`" if array.dtype.kind == "O" else ""
        raise LogError(f"{name}: variable '{variable}' is not a matrix of numbers{hint}")
    matrix = array.T if layout == "columns" else array
    return [("", row) for row in matrix]


def _fields(array: Any, path: str = "") -> dict[str, Any]:
    """What a struct or an array of structs holds, and those within it, by path: `X.Data`, `Y[2].Data`, from 0.

    What one holds goes by its name where it has one that no other has: `Name` and `Data` of a dSPACE recording, `label`
    and `values` of Simulink's structure with time.
    """
    records = array.reshape(-1)
    found: dict[str, Any] = {}
    for number, record in enumerate(records):
        place = path if len(records) == 1 else f"{path}[{number}]"
        named = (pair for pair in _NAMED if {*pair} <= {*array.dtype.names} and _text(record[pair[0]]))
        key, data = next(named, ("", ""))
        own = _text(record[key]) if key else ""
        if own and own not in found:
            place = own
        for field in array.dtype.names:
            value, name = np.asarray(record[field]), f"{place}.{field}".lstrip(".")
            cells = list(value.reshape(-1)) if value.dtype.kind == "O" else []
            if value.dtype.names:
                found |= _fields(value, name)
            elif cells and all(np.asarray(cell).dtype.names for cell in cells):  # a cell array of structs
                for cell_number, cell in enumerate(cells):
                    found |= _fields(np.asarray(cell), f"{name}[{cell_number}]")
            else:
                found[own if field == data and place == own else name] = value
    return found


_NAMED = (("Name", "Data"), ("label", "values"), ("title", "values"), ("blockName", "values"))


def _text(value: Any) -> str:
    """What a character array says; nothing for anything else."""
    array = np.asarray(value)
    return str(array.reshape(-1)[0]).strip() if array.dtype.kind in "US" and array.size else ""


def _cells(array: Any, name: str, variable: str) -> list[tuple[str, Any]]:
    """Join the cells of each channel end to end; the segment's number becomes a column."""
    if array.dtype.kind != "O" or array.ndim != 2 or 0 in array.shape:
        raise LogError(
            f"{name}: variable '{variable}' is not a cell array (channels x segments): `layout: cells` needs one"
        )
    channels, segments = array.shape
    joined: list[list[Any]] = [[] for _ in range(channels)]
    numbers = []
    for segment in range(segments):
        vectors = [vector_of(array[channel, segment]) for channel in range(channels)]
        if any(vector is None for vector in vectors):
            raise LogError(f"{name}: variable '{variable}', segment {segment}: a cell is not a vector of numbers")
        rows = max(len(vector) for vector in vectors)
        for channel, vector in enumerate(vectors):
            if len(vector) not in (1, rows):
                raise LogError(
                    f"{name}: variable '{variable}', segment {segment}: channel {channel} has {len(vector)} values, "
                    f"another has {rows}"
                )
            joined[channel].append(np.broadcast_to(vector.astype(np.float64), (rows,)))
        numbers.append(np.full(rows, segment, dtype=np.float64))
    columns = [("", np.concatenate(parts)) for parts in joined]
    return [*columns, ("segment", np.concatenate(numbers))]


# A v4 file has no magic: its first number says byte order and element type.
_MATLAB_4_HEADS = frozenset(number.to_bytes(4, "little") for number in range(0, 60, 10))


def _recognises(head: bytes, suffix: str) -> bool:
    return head.startswith(b"MATLAB 5.0") or (suffix == ".mat" and head[:4] in _MATLAB_4_HEADS)


def _read(path: Path, name: str, columns: ColumnMap) -> RawTable:
    table = read_matlab_table(path, name, columns.variable, columns.layout)
    return noting_suffix(table, path, ".mat", "MATLAB")


FORMAT = LogFormat(_recognises, _read, "the first bytes 'MATLAB 5.0'; version 4 by .mat and its first number")
