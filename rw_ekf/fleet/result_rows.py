"""A row of the results: what is known of one wheel on one day. And the files that hold them.

The columns are fixed (docs/fleet.md lists them), so that any reader of Parquet takes all files as one table. What the
next log continues from stands in the metadata of the file, under `rw_ekf.carry`.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rw_ekf.arrays import Float64Array, scaled_root
from rw_ekf.fleet.between_logs import Starting
from rw_ekf.fleet.log_days import DayOfLog
from rw_ekf.logs.atomic import atomic_path
from rw_ekf.logs.native_file import native_file
from rw_ekf.model.state import PARAMETER_NAMES

if TYPE_CHECKING:
    import pyarrow as pa

    from rw_ekf.filter.belief import Belief
    from rw_ekf.log_replay import Run

OK, FAILED, NOT_DONE = "ok", "failed: ", "not done: "  # the latter two and why; another run tries what is not done
CARRY_KEY, ROWS_KEY = b"rw_ekf.carry", b"rw_ekf.rows"
_NUMBERS = ("nis_mean", "nis_inside_95", "innovation_rms_rpm", "temperature_degC", "speed_rms_rpm", "current_rms_A")
_COUNTS = ("samples", "missing", "rejected", "reseeded", "resets")
# Of a day's readings. A healthy wheel has one in ten thousand beyond the gate, a day of a simulated fleet with drag
# spikes up to three in a hundred. Chosen: with a third less such a day is all but named.
MANY_REJECTED = 0.05


@dataclass(frozen=True)
class LogResult:
    """What a log leaves: a row for each of its days, and what the next one continues from (None: as before it)."""

    rows: tuple[dict[str, Any], ...]
    carry: str  # text of a `Carry`; empty where the wheel has none yet

    @property
    def samples(self) -> int:
        """Of all days."""
        return sum(int(row["samples"]) for row in self.rows)

    @property
    def status(self) -> str:
        """`ok`, or `failed: ` and why."""
        return next((row["status"] for row in self.rows if row["status"] != OK), OK)


def row_of_day(name: str, day: DayOfLog, run: Run, start: Starting, seen: tuple[int, int] | None) -> dict[str, Any]:
    """The row of a day that was filtered. seen: spikes and alarms of a watch, None where nothing watched."""
    statistics, setup = run.statistics, start.setup
    entry = run.entry()
    log = day.log
    spikes, alarms = seen or (None, None)
    # Of what is left when many readings were rejected, nobody can say that it is noise.
    is_noise = run.consistency.is_noise if statistics.rejected <= MANY_REJECTED * statistics.samples else False
    row: dict[str, Any] = {
        "log": name, "status": OK, "begins_utc": day.begins_utc, "ends_utc": day.ends_utc,
        "duration_s": statistics.duration_s, "samples": statistics.samples, "missing": statistics.missing,
        "rejected": statistics.rejected, "reseeded": statistics.reseeded, "resets": run.resets, "spikes": spikes,
        "alarms": alarms,
        "nis_mean": entry["innovation"]["nis_mean"], "nis_inside_95": entry["innovation"]["nis_inside_95"],
        "innovation_rms_rpm": entry["innovation"]["rms_rpm"], "residual_is_noise": is_noise,
        "temperature_degC": _mean(log.channels.get("temperature_degC")),
        "speed_rms_rpm": _rms(log.speed_rad_s) * 30.0 / np.pi, "current_rms_A": _rms(log.current_A),
        "warnings": list(run.warnings),
        "effects": [
            {"effect": effect, "value": found["value"], "std": found["std"], "unit": found["unit"]}
            for effect, found in entry["effects"].items()
        ],
    }  # fmt: skip
    own_mean, own_std = _own(run.belief, setup.prior, start.origin_setup.prior, setup.effects.size)
    for place, parameter in enumerate(PARAMETER_NAMES):
        row[parameter] = entry["state"][parameter]
        row[f"std_{parameter}"] = entry["std"][parameter]
        row[f"own_{parameter}"] = None if run.resets else float(own_mean[place])
        row[f"own_std_{parameter}"] = None if run.resets else float(own_std[place])
        row[f"identifiable_{parameter}"] = entry["identifiable"][parameter]
    return row


def row_of_failure(name: str, begins_utc: Any, reason: str) -> dict[str, Any]:
    """The row of a log that failed, on the day that it begins."""
    counts = dict.fromkeys(_COUNTS, 0)
    return {"log": name, "status": f"{FAILED}{reason}", "begins_utc": begins_utc, "ends_utc": begins_utc, **counts}


def write_rows(path: Path, rows: list[dict[str, Any]], carry: str, total_samples: int) -> None:
    """Write the rows of one file, all or nothing and pushed to the disk. Raises BadInputError where it cannot be."""
    import pyarrow as pa
    from pyarrow import parquet

    described = schema().with_metadata({CARRY_KEY: carry.encode(), ROWS_KEY: str(total_samples).encode()})
    table = pa.Table.from_pylist(rows, schema=described)
    with atomic_path(path, follow=False) as temporary, temporary.open("wb") as stream:
        parquet.write_table(table, stream, compression="zstd", use_dictionary=False, write_statistics=False)


def read_carry(path: Path) -> str:
    """What the log of a result leaves to the next. Raises OSError or ArrowException where it is not to be read."""
    from pyarrow import parquet

    with native_file(path) as stream:
        metadata = parquet.ParquetFile(stream).schema_arrow.metadata or {}
    return metadata[CARRY_KEY].decode() if CARRY_KEY in metadata else ""


def read_status(path: Path) -> tuple[int, str]:
    """Rows of the log whose result stands there, and its status."""
    from pyarrow import parquet

    with native_file(path) as stream:
        file = parquet.ParquetFile(stream)
        rows = int((file.schema_arrow.metadata or {}).get(ROWS_KEY, b"0"))
        stated = file.read(columns=["status"]).column("status").to_pylist()
    return rows, next((status for status in stated if status != OK), OK)


@functools.cache
def schema() -> pa.Schema:
    """The columns of a result; `wheel` and `day` stand in the path."""
    import pyarrow as pa

    utc = pa.timestamp("us", "UTC")
    effect = pa.struct([("effect", pa.string()), ("value", pa.float64()), ("std", pa.float64()), ("unit", pa.string())])
    fields: list[tuple[str, Any]] = [("log", pa.string()), ("status", pa.string())]
    fields += [("begins_utc", utc), ("ends_utc", utc), ("duration_s", pa.float64())]
    fields += [(name, pa.int64()) for name in (*_COUNTS, "spikes", "alarms")]
    fields += [(name, pa.float64()) for name in _NUMBERS]
    fields += [("residual_is_noise", pa.bool_())]
    for prefix in ("", "std_", "own_", "own_std_"):
        fields += [(f"{prefix}{name}", pa.float64()) for name in PARAMETER_NAMES]
    fields += [(f"identifiable_{name}", pa.bool_()) for name in PARAMETER_NAMES]
    fields += [("effects", pa.list_(effect)), ("warnings", pa.list_(pa.string()))]
    return pa.schema(fields)


def _own(belief: Belief, before: Belief, origin: Belief, coefficients: int) -> tuple[Float64Array, Float64Array]:
    try:
        mean, covariance = own_share(*(part.known(coefficients) for part in (before, belief, origin)))
        return mean, np.sqrt(np.diag(covariance))
    except np.linalg.LinAlgError:
        nothing = np.full(len(PARAMETER_NAMES), np.nan)
        return nothing, nothing


def _mean(values: Float64Array | None) -> float | None:
    known = None if values is None else values[np.isfinite(values)]
    return None if known is None or known.size == 0 else float(known.mean())


def _rms(values: Float64Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


def own_share(
    before: tuple[Float64Array, Float64Array],
    after: tuple[Float64Array, Float64Array],
    origin: tuple[Float64Array, Float64Array],
) -> tuple[Float64Array, Float64Array]:
    """What one log alone says, mean (n,) and covariance (n, n): the belief after it less the one before; each a pair.

    A filter that continues from the day before gives estimates that share their data, and a trend through them would be
    too certain. In information form a Gaussian belief is a sum, P1^-1 = P0^-1 + I and P1^-1 m1 = P0^-1 m0 + i, of
    which I and i are the log's own. They are given as the estimate that the log would have given from the origin, whose
    prior keeps apart what the log does not show.

    Directions in which the filter forgets faster than the log teaches have a negative difference: none of it is the
    log's. Raises LinAlgError where a covariance is none.
    """
    m0, P0 = before
    root = scaled_root(P0)
    whitened = np.linalg.solve(root, np.linalg.solve(root, after[1]).T)
    values, vectors = np.linalg.eigh(0.5 * (whitened + whitened.T))
    gained = np.maximum(1.0 / np.maximum(values, np.finfo(float).tiny) - 1.0, 0.0)
    turned = vectors.T @ np.linalg.solve(root, after[0] - m0)
    reported = np.where(gained > 0.0, turned / values, 0.0)
    to_origin = np.linalg.solve(root, origin[0] - m0)
    prior = np.linalg.inv(np.linalg.solve(root, np.linalg.solve(root, origin[1]).T))
    information = vectors @ np.diag(gained) @ vectors.T + 0.5 * (prior + prior.T)
    covariance = np.linalg.inv(information)
    mean = covariance @ (vectors @ reported + prior @ to_origin)
    return m0 + root @ mean, root @ covariance @ root.T
