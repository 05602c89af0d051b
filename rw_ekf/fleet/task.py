"""What a worker does: read a group of logs of one wheel, filter them in their order, write each one's result.

The result of a log is written as soon as it is there, the file of its first day last: where that stands, the log is
done. So whatever is killed at any moment loses what was in flight and nothing else, and the same task done again, here
or elsewhere, writes the same bytes.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import time
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.errors import RwEkfError
from rw_ekf.fleet.index import FleetLog
from rw_ekf.fleet.plan import PlannedLog

if TYPE_CHECKING:
    from rw_ekf.fleet.between_logs import Carry
    from rw_ekf.fleet.result_rows import LogResult
    from rw_ekf.logs.column_map import ColumnMap
    from rw_ekf.settings.schema import Configuration
    from rw_ekf.wheel.model_file import WheelModel


# What of freed memory a worker's C library keeps for the next log. A Dask nanny starts its workers with
# MALLOC_TRIM_THRESHOLD_=65536: every array of a log that is freed goes back to the kernel, which clears it anew for the
# next one. glibc itself begins to give back at 128 KiB, and raises that as it goes only where nobody set it. What this
# one choice saves was not measured apart from the rest.
# A log of 1e6 samples has arrays of 8 MB, and some fifty of them are alive at a time: what is kept stays below that.
_TRIM_BYTES, _MMAP_BYTES = 128 << 20, 32 << 20
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3  # of mallopt(3)


@dataclass(frozen=True)
class Task:
    """A group of logs of one wheel, in plain data that any process can be sent."""

    directory: str  # of the logs
    results: str
    logs: tuple[PlannedLog, ...]
    previous: str | None = None  # the result that the first one continues from
    model: Mapping[str, Any] | None = None  # document of the model that the wheel starts from
    configuration: Mapping[str, Any] | None = None
    columns: ColumnMap | None = None


@dataclass(frozen=True)
class Record:
    """What a worker says of one log: some 200 bytes."""

    input_hash: str
    status: str
    rows: int  # of the log
    seconds: float


class MovedInputError(Exception):
    """A log is no longer what the index says: the index has to be made again."""


def work(task: Task) -> list[Record]:
    """Do a task; a record for each log that was not done already. A log that fails is a result as well.

    Raises MovedInputError where a log changed since it was indexed, OSError or BadInputError where results cannot be
    written: nothing of that is a property of the log, and another run does it.
    """
    from rw_ekf.fleet.result_rows import read_carry
    from rw_ekf.one_thread import one_thread

    _settle_memory()
    records = []
    with one_thread():
        configuration, model = given(task.configuration, task.model)
        before = "" if task.previous is None else read_carry(Path(task.previous))
        for planned in task.logs:
            path = planned.path(task.results)
            if path.is_file():
                before = read_carry(path)
                continue
            began_s = time.perf_counter()
            result = _result_of(task, planned, before, configuration, model)
            _write(task.results, planned, result)
            before = result.carry
            seconds = round(time.perf_counter() - began_s, 4)
            records.append(Record(planned.input_hash, result.status, result.samples, seconds))
    return records


@functools.cache
def _settle_memory() -> None:
    """Once in a process; where the C library knows no mallopt, nothing happens."""
    with contextlib.suppress(OSError, AttributeError):
        library = ctypes.CDLL(None)
        library.mallopt(_M_TRIM_THRESHOLD, _TRIM_BYTES)
        library.mallopt(_M_MMAP_THRESHOLD, _MMAP_BYTES)


def given(
    configuration: Mapping[str, Any] | None, model: Mapping[str, Any] | None
) -> tuple[Configuration | None, WheelModel | None]:
    """A configuration and a model from the plain data that a task carries."""
    from rw_ekf.fleet.between_logs import plain_model
    from rw_ekf.settings.load import configuration_of

    read = None if configuration is None else configuration_of(dict(configuration), Path("fleet"))
    return read, None if model is None else plain_model(model)


def _result_of(
    task: Task, planned: PlannedLog, before: str, configuration: Configuration | None, model: WheelModel | None
) -> LogResult:
    from rw_ekf.fleet.between_logs import Carry
    from rw_ekf.fleet.result_rows import LogResult, row_of_failure
    from rw_ekf.logs.metadata import moment_of

    check_inputs(task.directory, planned.log)
    begins_utc = moment_of(planned.log.begins_utc)
    assert begins_utc is not None
    try:
        carry = Carry.of_text(before) if before else None
        return _filtered(task, planned, begins_utc, carry, (configuration, model))
    except (RwEkfError, ArithmeticError, ValueError) as error:  # the latter two from the depths of the linear algebra
        reason = str(error).replace(f"{task.directory}/", "")
        return LogResult((row_of_failure(planned.log.log, begins_utc, reason),), before)


def check_inputs(directory: str, log: FleetLog) -> None:
    """Raises MovedInputError where a log is not as it was indexed."""
    try:
        size = sum((Path(directory) / name).stat().st_size for name in log.files)
    except OSError as error:
        raise MovedInputError(f"{log.log}: cannot be read ({error.strerror})") from None
    if size != log.bytes:
        raise MovedInputError(f"{log.log}: changed while the fleet ran")


def _filtered(
    task: Task, planned: PlannedLog, begins_utc: datetime, carry: Carry | None,
    given: tuple[Configuration | None, WheelModel | None],
) -> LogResult:  # fmt: skip
    """Filter a log, day by day. Raises RwEkfError where it cannot be read or filtered."""
    from rw_ekf.fleet.between_logs import Carry, first_start, next_start, with_noise_of
    from rw_ekf.fleet.log_days import days_of_log
    from rw_ekf.fleet.result_rows import LogResult, row_of_day
    from rw_ekf.log_replay import replay_log
    from rw_ekf.logs.reader import read_log

    configuration, model = given
    path = Path(task.directory) / planned.log.log
    log = read_log(path, task.columns)
    watched = _watched(path)
    rows = []
    for day in days_of_log(log, begins_utc):
        if carry is None:
            start = first_start(day.log, configuration, model)
        else:
            start = next_start(day.log, configuration, carry, day.begins_utc)
        run = replay_log(day.log, setup=start.setup)
        noisier = None if configuration is not None else with_noise_of(start, day.log, run)
        if noisier is not None:
            start = noisier
            run = replay_log(day.log, setup=start.setup)
        seen = None if watched is None else watched.on(day.day)
        rows.append({"day": day.day, **row_of_day(planned.log.log, day, run, start, seen)})
        # Through its text, as a run that continues from the file would read it.
        carry = Carry.of_text(Carry(run.model, start.origin, day.ends_utc).to_text())
    assert carry is not None
    return LogResult(tuple(rows), carry.to_text())


@dataclass(frozen=True)
class _Watched:
    """What the daemon's watch reported of a run: when each spike, and each alarm of any kind, began (UTC)."""

    spikes: tuple[str, ...]
    alarms: tuple[str, ...]

    def on(self, day: str) -> tuple[int, int]:
        """Spikes and alarms of a day."""
        spikes, alarms = (sum(utc[:10] == day for utc in times) for times in (self.spikes, self.alarms))
        return spikes, alarms


def _watched(path: Path) -> _Watched | None:
    """None where nothing watched, or its word is torn."""
    from rw_ekf.logs.metadata import metadata_path
    from rw_ekf.spikes.run_events import read_run

    if not metadata_path(path).is_file():
        return None
    try:
        run = read_run(path)
    except RwEkfError:
        return None
    return None if run is None else _Watched(tuple(spike.utc for spike in run.spikes), tuple(run.alarms))


def _write(results: str, planned: PlannedLog, result: LogResult) -> None:
    """The first day last: its file says that all of the log is done."""
    from rw_ekf.fleet.folder import part_path
    from rw_ekf.fleet.result_rows import write_rows
    from rw_ekf.logs.atomic import make_folder

    by_day: dict[str, list[dict[str, Any]]] = {planned.log.day: []}
    for row in result.rows:
        by_day.setdefault(row.get("day", planned.log.day), []).append(row)
    for day, rows in reversed(by_day.items()):
        path = part_path(results, planned.log.wheel, day, planned.input_hash)
        make_folder(path.parent)
        columns = [{name: value for name, value in row.items() if name != "day"} for row in rows]
        write_rows(path, columns, result.carry, result.samples)
