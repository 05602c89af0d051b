"""The results of a fleet as arrays: each wheel's days in their order, with what each day alone says of a parameter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.arrays import BoolArray, Float64Array
from rw_ekf.errors import BadInputError
from rw_ekf.fleet.folder import FleetFolder
from rw_ekf.fleet.result_rows import OK, schema
from rw_ekf.identify.misread import MISREAD
from rw_ekf.model.state import PARAMETER_NAMES

if TYPE_CHECKING:
    import pyarrow as pa

_DAY_S = 86_400.0
_COUNTS = ("samples", "missing", "rejected", "reseeded", "resets", "spikes", "alarms")


@dataclass(eq=False, frozen=True)
class WheelDays:
    """The n rows of one wheel, oldest first; NaN is what is not known."""

    wheel: str
    time_d: Float64Array  # (n,) beginning of each, in days since 1970 [d]
    day: tuple[str, ...]
    log: tuple[str, ...]
    ok: BoolArray  # (n,) whether the log gave a result
    status: tuple[str, ...]
    values: dict[str, Float64Array]  # by parameter: that day alone
    stds: dict[str, Float64Array]
    temperature_degC: Float64Array
    nis_mean: Float64Array
    innovation_rpm: Float64Array  # root mean square
    rejected_share: Float64Array  # of the day's samples
    misread: BoolArray  # (n,) whether no machine's speed and drive go together as this log's do
    not_noise: BoolArray  # (n,) whether the residual was judged to be none
    alarms: Float64Array  # that the daemon's watch raised; NaN where nothing watched
    counts: dict[str, int]  # over all days

    def __len__(self) -> int:
        return len(self.time_d)


def read_days(folder: FleetFolder) -> list[WheelDays]:
    """Read all results. Raises BadInputError where there are none, or one is damaged."""
    import pyarrow as pa
    import pyarrow.dataset as ds

    if not folder.results.is_dir():
        raise BadInputError(f"{folder.path}: has no results yet: `rw-ekf fleet run` makes them")
    text = pa.schema([("wheel", pa.string()), ("day", pa.string())])
    names = [name for name in schema().names if name != "effects"]
    try:
        data = ds.dataset(
            str(folder.results),
            schema=pa.schema([*schema(), *text]),
            format="parquet",
            partitioning=ds.partitioning(text, flavor="hive"),
        )
        table = data.to_table(columns=[*names, "wheel", "day"])
    except (pa.ArrowException, OSError) as error:
        raise BadInputError(f"{folder.results}: cannot be read ({error}): remove that file and run again") from None
    if table.num_rows == 0:
        raise BadInputError(f"{folder.path}: has no results yet: `rw-ekf fleet run` makes them")
    return days_of_table(table)


def days_of_table(table: pa.Table) -> list[WheelDays]:
    """The wheels of a table of results, in the order of their names."""
    table = table.sort_by([("wheel", "ascending"), ("begins_utc", "ascending"), ("log", "ascending")])
    wheels = np.array(table.column("wheel").to_pylist(), dtype=object)
    starts = np.flatnonzero(np.r_[True, wheels[1:] != wheels[:-1]])
    ends = np.append(starts[1:], len(wheels))
    return [_days_of_wheel(str(wheels[a]), table.slice(a, b - a)) for a, b in zip(starts, ends, strict=True)]


def _days_of_wheel(wheel: str, rows: pa.Table) -> WheelDays:
    status = tuple(rows.column("status").to_pylist())
    begins = rows.column("begins_utc").cast("int64").to_numpy() / 1e6
    return WheelDays(
        wheel=wheel,
        time_d=begins / _DAY_S,
        day=tuple(rows.column("day").to_pylist()),
        log=tuple(rows.column("log").to_pylist()),
        ok=np.array([text == OK for text in status]),
        status=status,
        values={name: _numbers(rows, f"own_{name}") for name in PARAMETER_NAMES},
        stds={name: _numbers(rows, f"own_std_{name}") for name in PARAMETER_NAMES},
        temperature_degC=_numbers(rows, "temperature_degC"),
        nis_mean=_numbers(rows, "nis_mean"),
        innovation_rpm=_numbers(rows, "innovation_rms_rpm"),
        rejected_share=_numbers(rows, "rejected") / np.maximum(_numbers(rows, "samples"), 1.0),
        misread=_misread(rows),
        not_noise=np.array([value is False for value in rows.column("residual_is_noise").to_pylist()]),
        alarms=_numbers(rows, "alarms"),
        counts={name: int(np.nansum(_numbers(rows, name))) for name in _COUNTS},
    )


def _misread(rows: pa.Table) -> BoolArray:
    """Whether a warning of a day's log says so, (n,)."""
    from pyarrow import compute

    stated = compute.fill_null(compute.binary_join(rows.column("warnings"), "\n"), "")
    return np.asarray(compute.match_substring(stated, MISREAD).to_numpy(), dtype=bool)


def _numbers(rows: pa.Table, name: str) -> Float64Array:
    values: Any = rows.column(name).cast("float64").to_numpy()
    return np.array(values, dtype=np.float64)
