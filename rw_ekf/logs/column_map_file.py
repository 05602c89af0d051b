"""What may stand in a column map, key by key; `rw_ekf.logs.column_map` says what it means."""

from __future__ import annotations

import codecs
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, PlainValidator, ValidationInfo, create_model, model_validator
from pydantic import Field as Key

from rw_ekf.checking.findings import checked
from rw_ekf.checking.section import NOT_NULL, Mistake, Section, refuse
from rw_ekf.checking.wording import shown
from rw_ekf.checking.yaml_loader import YamlDocument, load_yaml
from rw_ekf.logs.column_map import ColumnMap, CsvLayout, MatlabLayout, Repeats, Source
from rw_ekf.logs.column_units import OF_COLUMN, Unit, unit_of, units_known
from rw_ekf.logs.log_columns import READABLE_COLUMNS


def _a_column(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, str | int) or value == "":
        refuse([((), f"must be a column's name or number, found {shown(value)}")])
    elif isinstance(value, int) and value < 0:
        refuse([((), f"must be 0 or more, found {value}: columns are counted from 0")])
    return value


def _a_delimiter(value: Any) -> Any:
    value = {"\\t": "\t", "tab": "\t", "blanks": " "}.get(value, value) if isinstance(value, str) else value
    if not isinstance(value, str) or len(value) != 1 or value in '"\r\n' or not value.isascii():
        refuse([((), f'must be one character such as ";" or "\\t", found {shown(value)}')])
    return value


def _an_encoding(value: str | None) -> str | None:
    try:
        return value if value is None else codecs.lookup(value).name
    except LookupError:
        refuse([((), f"must be the name of an encoding such as utf-16 or cp1252, found {shown(value)}")])
        return None


def _unanswered(text: str | None) -> str | None:
    if text is not None:
        refuse([((), f"is not answered yet: {text} Delete this line when what the map says is right")])
    return text


_Column = Annotated[str | int | None, PlainValidator(_a_column)]


class _Entry(Section):
    """What a map says of one log column, in its long form."""

    column: _Column = Key(None, description="name, or number counted from 0")
    constant: Annotated[float | None, NOT_NULL] = None
    derivative_of: _Column = Key(None, description="column whose backward difference over time is taken")
    scale: float = 1.0
    offset: float = 0.0
    unit: str | None = Key(None, description="of the column's numbers: rpm, deg/s, mA, ms, ...")
    counts_per_turn: Annotated[float, Key(gt=0)] = 0.0
    pole_pairs: Annotated[float, Key(gt=0)] = 0.0
    wrap: Annotated[float, Key(gt=0)] = 0.0
    sign_of: _Column | None = Key(None, description="column that has the sign of this one")
    missing: float | None = Key(None, description="number that stands where nothing was measured, as -9999")

    @model_validator(mode="after")
    def _holds(self) -> Self:
        given = self.model_fields_set
        kinds = [name for name in ("column", "constant", "derivative_of") if name in given]
        mistakes: list[Mistake] = []
        if len(kinds) != 1:
            found = " and ".join(kinds) or "none of them"
            mistakes.append(((), f"must have exactly one of column, constant, derivative_of; found {found}"))
        if "constant" in kinds:
            beside = ("scale", "offset", "unit", "wrap", "sign_of", "missing")
            mistakes += [((name,), "has no meaning beside a constant") for name in beside if name in given]
        if self.scale == 0.0:
            mistakes.append((("scale",), "must not be 0, which leaves nothing of it; give a constant"))
        unit = None if self.unit is None else unit_of(self.unit)
        if self.unit is not None and unit is None:
            mistakes.append(
                (("unit",), f"is {shown(self.unit)}, which is no unit that is known; give its `scale` instead")
            )
        if unit is not None and unit.per and not getattr(self, unit.per):
            mistakes.append((("unit",), f"is {shown(self.unit)}: say how many with `{unit.per}`"))
        mistakes += [
            ((name,), f"goes with a unit that is counted so, found unit {shown(self.unit)}")
            for name in ("counts_per_turn", "pole_pairs")
            if name in given and (unit is None or unit.per != name)
        ]
        if "derivative_of" in kinds and self.sign_of is not None:
            mistakes.append((("sign_of",), "must be left out: a derivative has its own sign"))
        refuse(mistakes)
        return self

    def source(self, where: str) -> Source:
        """The same as the reader of a log takes it; where: file:line:column."""
        if self.constant is not None:
            return Source("constant", constant=self.constant, where=where)
        kind: Literal["column", "derivative"] = "column" if self.derivative_of is None else "derivative"
        column = self.column if self.derivative_of is None else self.derivative_of
        scale, offset = self.scale, self.offset
        if self.unit is not None and (unit := unit_of(self.unit)) is not None:
            scale, offset = in_unit(unit, scale, offset, getattr(self, unit.per) if unit.per else 1.0)
        given = bool({"scale", "unit"} & self.model_fields_set)
        return Source(kind, column, 0.0, scale, offset, where, self.wrap, self.sign_of, self.missing, given)


def in_unit(unit: Unit, scale: float, offset: float, per: float) -> tuple[float, float]:
    """Scale and offset of numbers in a unit: scale * (what they are in the log's own) + offset."""
    return scale * unit.factor / per, scale * unit.offset + offset


def _long_form(value: Any) -> Any:
    if isinstance(value, str):
        return _Entry.model_construct(column=value)
    if not isinstance(value, dict):
        refuse([((), f"must be {{column: name or number}} or {{constant: value}}, found {shown(value)}")])
    return value


def _fits(entry: _Entry, info: ValidationInfo) -> _Entry:
    """Whether the log column can come from what the entry names."""
    name = str(info.field_name)
    if entry.constant is not None and name in ("time_s", "segment"):
        refuse([((), "cannot be a constant" + ("; give rate_hz instead" if name == "time_s" else ""))])
    if entry.derivative_of is not None and not name.startswith("speed_"):
        refuse([((), "cannot be a derivative: only a speed can (speed_rad_s or speed_rpm)")])
    _unit_fits(entry, name)
    return entry


def _unit_fits(entry: _Entry, name: str) -> None:
    """Whether a unit measures what the column is."""
    unit = None if entry.unit is None else unit_of(entry.unit)
    if unit is None:
        return
    if name == "speed_rpm":
        refuse([(("unit",), "has no place at speed_rpm, which says rpm: give it to speed_rad_s")])
    wanted = OF_COLUMN["angle_rad" if entry.derivative_of is not None else name] if name in OF_COLUMN else ()
    if unit.quantity not in wanted:
        known = units_known("angle_rad" if entry.derivative_of is not None else name)
        refuse([(("unit",), f"is {shown(entry.unit)}, which is none of {name}: {known}")])


class _Only(Section):
    """Rows of one wheel, where a column distinguishes several."""

    column: Annotated[str | int, PlainValidator(_a_column)]
    value: str | int | float = Key(description="what it has in the rows that are taken")


class _Options(Section):
    """How a file is laid out, and which of its rows are taken."""

    delimiter: Annotated[str | None, PlainValidator(_a_delimiter)] = None
    decimal: Literal[".", ","] | None = None
    encoding: Annotated[str | None, AfterValidator(_an_encoding)] = None
    skip_rows: int = Key(0, ge=0, description="lines before the header")
    header: bool | None = Key(None, description="whether the first row has names; null: unless it holds only numbers")
    rate_hz: float | None = Key(None, gt=0, le=1e6, description="where there is no time column [Hz]")
    decimate: int = Key(1, ge=1, description="keep every n-th row")
    reverse: bool | None = Key(None, description="whether the last row is the first in time")
    current_before: bool = Key(False, description="whether a row's current was in force before it, not after it")
    restarts: bool = Key(False, description="whether a segment begins wherever time falls back to its beginning")
    repeats: Repeats = Key("refuse", description="rows of a time that was there: refuse, drop, or spread")
    variable: str | None = Key(None, min_length=1, description="variable of a MATLAB file")
    layout: MatlabLayout = "columns"
    only: _Only | None = Key(None, description="rows of one wheel: a column, and which of its values")
    dbc: str | None = Key(None, min_length=1, description="database of a CAN log, relative to the map")
    asked: Annotated[str | None, AfterValidator(_unanswered)] = Key(None, description="what the log leaves open")

    @model_validator(mode="after")
    def _together(self) -> Self:
        given, mistakes = self.model_fields_set, []
        if self.rate_hz is not None and "time_s" in given:
            mistakes.append((("rate_hz",), "stands in for a time column, but time_s is mapped too: drop one of them"))
        if {"speed_rpm", "speed_rad_s"} <= given:
            mistakes.append((("speed_rpm",), "is mapped, and speed_rad_s too: drop one of them"))
        refuse(mistakes)
        return self


_Mapped = Annotated[_Entry, BeforeValidator(_long_form), AfterValidator(_fits)]
_MAPPED: dict[str, Any] = dict.fromkeys(READABLE_COLUMNS, (_Mapped, None))
_MapFile = create_model("_MapFile", __base__=_Options, **_MAPPED)


def load_column_map(path: str | Path) -> ColumnMap:
    """Read and check a mapping file. Raises ConfigError with one finding per mistake."""
    return column_map_from(load_yaml(path))


def column_map_from(document: YamlDocument) -> ColumnMap:
    """Check a parsed mapping file. Raises ConfigError with one finding per mistake."""
    found: Any = checked(_MapFile, document.data, "a column map", document.where, document.where_key)
    names = [name for name in document.data if name in READABLE_COLUMNS]
    return ColumnMap(
        path=document.path,
        sources={name: getattr(found, name).source(document.where_key((name,))) for name in names},
        csv=CsvLayout(found.delimiter, found.skip_rows, found.header, found.decimal, found.encoding),
        rate_hz=found.rate_hz,
        decimate=found.decimate,
        reverse=bool(found.reverse),
        current_before=found.current_before,
        restarts=found.restarts,
        repeats=found.repeats,
        variable=found.variable,
        layout=found.layout,
        only=None if found.only is None else (found.only.column, f"{found.only.value}"),
        dbc=None if found.dbc is None else str(Path(document.path).parent / found.dbc),
    )
