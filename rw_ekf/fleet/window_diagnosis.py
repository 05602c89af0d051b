"""What a worker does for a window: read the day of the log, diagnose it, write what was found.

As with results, the name of a file has the checksum of all that it depends on, and the file that says that the window
is done comes last; so a run that was killed continues, and the same window done again writes the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.errors import LogError, RwEkfError
from rw_ekf.fleet.index import FleetLog
from rw_ekf.fleet.result_rows import FAILED, OK
from rw_ekf.json_output import json_text

if TYPE_CHECKING:
    from rw_ekf.logs.column_map import ColumnMap

VERSION = 1  # of what stands in such a file
SCHEMA = "rw_ekf.fleet_window/1"


@dataclass(frozen=True)
class WindowTask:
    """One window, in plain data that any process can be sent."""

    directory: str  # of the logs
    path: str  # of the document, which is written last; the model stands beside it
    log: FleetLog
    day: str
    model: Mapping[str, Any] | None = None  # document of what is known of the wheel already
    configuration: Mapping[str, Any] | None = None
    columns: ColumnMap | None = None


def diagnose_window(task: WindowTask) -> str:
    """Do a window; the status, `ok` or `failed: ` and why, which stands in its document as well.

    Raises MovedInputError where the log changed since it was indexed, BadInputError where nothing can be written.
    """
    from rw_ekf.fleet.task import check_inputs
    from rw_ekf.logs.atomic import make_folder, write_text
    from rw_ekf.one_thread import one_thread

    check_inputs(task.directory, task.log)
    path = Path(task.path)
    make_folder(path.parent)
    found: dict[str, Any] = {"schema": SCHEMA, "status": OK, "diagnosis": None, "model": None}
    model = None
    try:
        with one_thread():
            found["diagnosis"], model = _diagnosed(task)
    except (RwEkfError, ArithmeticError, ValueError) as error:  # the latter two from the depths of the linear algebra
        found["status"] = f"{FAILED}{str(error).replace(f'{task.directory}/', '')}"
    if model is not None:
        beside = path.with_name(f"{path.stem}.model.yaml")
        write_text(beside, model, follow=False)
        found["model"] = beside.name
    write_text(path, json_text(found), follow=False)
    return str(found["status"])


def _diagnosed(task: WindowTask) -> tuple[dict[str, Any], str | None]:
    """The document of the diagnosis, and the model it found. Raises RwEkfError where it cannot be made."""
    from rw_ekf.diagnosis.log_diagnosis import diagnose_log
    from rw_ekf.fleet.log_days import days_of_log
    from rw_ekf.fleet.task import given
    from rw_ekf.logs.metadata import moment_of
    from rw_ekf.logs.reader import read_log

    configuration, model = given(task.configuration, task.model)
    begins_utc = moment_of(task.log.begins_utc)
    assert begins_utc is not None
    log = read_log(Path(task.directory) / task.log.log, task.columns)
    day = next((each for each in days_of_log(log, begins_utc) if each.day == task.day), None)
    if day is None:
        raise LogError(f"{task.log.log}: has no row of {task.day}")
    found = diagnose_log(day.log, configuration, model)
    return found.document(), None if found.model is None else found.model.to_text()
