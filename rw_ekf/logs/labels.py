"""Names and units that a file has beside its numbers: lists of texts as long as a matrix is wide, and single texts.

A file of variables (MATLAB, HDF5, numpy, JSON) says what its numbers are in variables or attributes of their own:
`columns = ['t', 'n', 'I']` beside `data`, `speed_unit = 'rpm'` beside `speed`, `units.speed = 'rpm'`.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rw_ekf.logs.channel_blocks import kind_of
from rw_ekf.logs.column_units import unit_of, with_unit
from rw_ekf.logs.raw_table import Factor, RawTable

_REMARK_TAIL = re.compile(r"[._](long_?name|desc\w*|comments?|remarks?|labels?|quantity|sign\w*)$", re.IGNORECASE)
_SAYS_UNIT = re.compile(r"(^|[._])(units?|einheit(en)?)([._]|$)", re.IGNORECASE)  # known or not, it is one
_UNIT_TAIL = re.compile(r"[._]?(units?|einheit(en)?)$|\.(u|uom)$", re.IGNORECASE)
_RATE = re.compile(r"(fs|rate|rate_hz|sampl\w*_?(rate|freq\w*)|f_?s(ample)?|frequency)", re.IGNORECASE)
_STEP = re.compile(r"(dt|ts|t_?s(ample)?|delta_?t|sampl\w*_?(time|period|interval)|period)", re.IGNORECASE)
_LONGEST = 200  # characters of a remark
_ADDED = re.compile(r"add_?offset$", re.IGNORECASE)  # cfconventions.org, packed data: scale_factor * x + add_offset
_VALUE = frozenset(["value", "values", "val", "v", "data", "wert"])  # what one of several beside a unit is called


def unit_and_remark(stated: Mapping[str, object]) -> tuple[str, str]:
    """The unit that a file says of a column among whatever else it says, by key; and that, as one remark."""
    unit = next((str(text) for key, text in stated.items() if key.lower() in ("unit", "units", "unit_string")), "")
    rest = (f"{key}: {text}" for key, text in stated.items() if text and str(text) != unit)
    return unit, "; ".join(rest)


def texts_of(value: Any) -> list[str] | None:
    """The texts of a list, of rows of characters or of a cell array of texts; None for anything else."""
    array = np.asarray(value)
    if array.dtype.kind == "S":
        return [cell.decode("utf-8", "replace").strip() for cell in array.reshape(-1)]
    if array.dtype.kind == "U":
        return [str(cell).strip() for cell in array.reshape(-1)]
    if array.dtype.kind != "O" or array.size == 0:
        return None
    cells = [text_of(cell) for cell in array.reshape(-1)]
    return None if None in cells else [cell for cell in cells if cell is not None]


def text_of(value: Any) -> str | None:
    """The one text that a value is; None for anything else."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace").strip()
    if isinstance(value, str):
        return value.strip()
    array = np.asarray(value)
    if array.dtype.kind not in "USO" or array.size != 1 or (array.dtype.kind == "O" and array.reshape(-1)[0] is value):
        return None
    return text_of(array.reshape(-1)[0])


def labelled_matrix(content: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Columns (name, vector) of the only matrix, the longer side for time; named by a list of texts as long as wide.

    A matrix that no list fits has columns without names; no matrix, or several, have none.
    """
    matrices = [array for array in map(np.asarray, content.values()) if array.dtype.kind in "fiu" and array.ndim == 2]
    matrices = [array for array in matrices if min(array.shape) > 1]
    if len(matrices) != 1:
        return []
    matrix = matrices[0]
    lists = [texts for value in content.values() if (texts := texts_of(value)) is not None and len(texts) > 1]
    fits = [width for width in matrix.shape if any(len(texts) == width for texts in lists)]
    width = fits[0] if len(fits) == 1 else min(matrix.shape)
    columns = matrix.T if matrix.shape[1] == width else matrix
    lists = sorted((texts for texts in lists if len(texts) == width), key=_units_among)
    names = lists[0] if lists and _units_among(lists[0]) < 0.5 * width else [""] * width
    if len(lists) > 1 and any(names):
        names = list(map(with_unit, names, lists[-1] if _units_among(lists[-1]) else [""] * width))
    return list(zip(names, columns, strict=True))


def are_units(cells: Sequence[str]) -> bool:
    """Whether a row holds units: most cells are known ones, and not of one kind with names, or all are in brackets."""
    filled = [cell for cell in cells if cell]
    known = [unit for cell in filled if (unit := unit_of(cell)) is not None]
    if filled and all(cell[0] in "[({" and cell[-1] in "])}" for cell in filled):
        return True
    return len(known) > 0.5 * len(filled) and any(unit != unit_of("rpm") for unit in known)


def held_to_the_right(cells: Sequence[str]) -> tuple[str, ...]:
    """What a row above the names says of several columns each: `;set-point;;measured`; nothing where it is a title."""
    several = sum(map(bool, cells)) > 1
    return tuple(itertools.accumulate(cells, lambda before, cell: cell or before)) if several else ()


def _units_among(texts: list[str]) -> int:
    return sum(unit_of(text) is not None and text not in {"t", "n", "i"} for text in texts)


def with_labels(table: RawTable, content: Mapping[str, Any]) -> RawTable:
    """A table with the units, remarks, factors and further lines that stand beside its numbers.

    content: by name, all that the file holds. What is stated of `speed` holds for a column `speed.value` too.
    """
    table = replace(table, units=_units(content), remarks=_remarks(content), factors={})
    heard = {key for key, value in content.items() if _scales(table, key, value, content)}
    for name in table.names:
        owner, _, last = name.rpartition(".")
        alone = sum(other.startswith(f"{owner}.") for other in table.names) == 1
        if owner in table.units and (alone or last.lower() in _VALUE):
            table.units.setdefault(name, table.units[owner])
    return replace(table, preamble=stated_beside({key: value for key, value in content.items() if key not in heard}))


def _scales(table: RawTable, key: str, value: Any, content: Mapping[str, Any]) -> bool:
    """Whether a variable is what columns are times or have added, `speed_scale_factor`; it is added to the table then.

    A list has one for each column. A number of a whole array, or of nothing by its name, becomes a question about any.
    """
    array, (owner, kind) = np.asarray(value).reshape(-1), owner_of(key)
    if not kind or array.dtype.kind not in "fiu" or not array.size:
        return False
    texts = [f"{number:.15g}" for number in array.tolist()]
    own = [name for name in table.names if name and name in (owner, owner.rpartition(".")[2])][: len(texts)]
    if len(texts) == len(own) or (all(table.names) and 1 < len(texts) == len(table.names)):
        for name, text in zip(own or table.names, texts, strict=True):
            before = table.factors.get(name, Factor("", ""))
            added = before._replace(offset=text, is_added=_ADDED.search(key) is not None)
            table.factors[name] = before._replace(factor=text) if kind == "factor" else added
        return True
    odd = [text for text in texts if text != ("1" if kind == "factor" else "0")]
    if not odd or (owner and np.size(content.get(owner, 0)) < 2):
        return False
    for name in table.names:
        table.remarks[name] = "; ".join(filter(None, (table.remarks.get(name), f"{kind} {odd[0]}")))
    return True


def says_how_large(key: str) -> bool:
    """Whether a name is that of a unit, a factor or an offset."""
    return bool(_UNIT_TAIL.search(key) or owner_of(key)[1])


def owner_of(key: str) -> tuple[str, str]:
    """Whose factor or offset a name says that it is, and which of both; a `gain` alone is more often a controller's."""
    for cut in re.finditer(r"^|[._]", key):
        word = key[cut.end() :]
        if (kind := kind_of(word)) in ("factor", "offset") and word.lower() != "gain":
            return key[: cut.start()], kind
    return "", ""


def _units(content: Mapping[str, Any]) -> dict[str, str]:
    """Units by name, of texts that are called after what they are the unit of: `speed_unit`, `units.speed`."""
    found: dict[str, str] = {}
    for key, value in content.items():
        text = (text_of(value) or "").partition(" since ")[0]  # cfconventions.org: minutes since 2026-03-04
        if not text or (unit_of(text) is None and not _SAYS_UNIT.search(key)):
            continue
        before, _, last = key.rpartition(".")
        if _UNIT_TAIL.search(key) and (owner := _UNIT_TAIL.sub("", key)):
            found[owner] = text
        elif _UNIT_TAIL.fullmatch(before.rpartition(".")[2]):
            found[last] = text
    return found


def _remarks(content: Mapping[str, Any]) -> dict[str, str]:
    """What is stated of columns, by name, of texts that are called after these: `i_motor_long_name`."""
    found: dict[str, str] = {}
    for key, value in content.items():
        text = text_of(value)
        if text and (owner := _REMARK_TAIL.sub("", key)) != key:
            found[owner] = f"{found[owner]}; {text}" if owner in found else text
    return found


def stated_beside(content: Mapping[str, Any]) -> tuple[str, ...]:
    """What single texts and numbers say, as the lines `key: value` that might stand above a table of text."""
    lines = []
    for key, value in content.items():
        text, array = text_of(value), np.asarray(value)
        if text is not None:
            lines.append(f"{key}: {text[:_LONGEST]}")
        elif array.dtype.kind in "fiu" and array.size == 1:
            last, number = key.rpartition(".")[2], float(array.reshape(-1)[0])
            hertz = re.search(r"k?hz$", last, re.IGNORECASE)
            stated = f"{number:.12g} {hertz[0] if hertz else 'Hz' if _RATE.fullmatch(last) else ''}".strip()
            if _RATE.fullmatch(last[: hertz.start()].rstrip("_") if hertz else last):
                stated = f"sample rate {stated}"
            elif _STEP.fullmatch(last) and not number.is_integer():  # 10 may be ms, as in a column of times
                stated = f"sample time {stated} s"
            lines.append(f"{key}: {stated}")
    return tuple(lines)
