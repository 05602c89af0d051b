"""What has to be done: each log with the checksum of all that its result depends on.

That is its own bytes, the model, configuration and column map it is read and filtered with, the version, and the
checksum of the log before it, whose belief it continues from. So a log that changed makes new checksums of what follows
of its wheel, and of nothing else; and a result whose checksum is wanted has been computed from the very same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rw_ekf.errors import BadInputError
from rw_ekf.fleet.folder import part_path
from rw_ekf.fleet.index import FleetIndex, FleetLog
from rw_ekf.learning.learned_file import fingerprint
from rw_ekf.version import __version__

if TYPE_CHECKING:
    from rw_ekf.logs.column_map import ColumnMap
    from rw_ekf.settings.schema import Configuration
    from rw_ekf.wheel.model_file import WheelModel

RESULT_VERSION = 2  # of what stands in a result: another number computes all anew
TASK_SAMPLES = 1_000_000  # of a task, about: a second of work, beside which a task's own cost is nothing
EVERY_WHEEL = ""  # the name under which a model of all wheels stands


@dataclass(frozen=True)
class FleetSettings:
    """What every log of the fleet is read and filtered with. models: by wheel; that of EVERY_WHEEL is for the rest."""

    configuration: Configuration | None = None
    models: Mapping[str, WheelModel] = field(default_factory=dict)
    columns: ColumnMap | None = None
    columns_text: str = ""

    def model(self, wheel: str) -> WheelModel | None:
        """The model that a wheel starts from."""
        return self.models.get(wheel, self.models.get(EVERY_WHEEL))

    def hash(self, wheel: str) -> str:
        """Checksum of all that a wheel's results depend on beside its logs."""
        model, configuration = self.plain(wheel)
        return fingerprint(__version__, RESULT_VERSION, model, configuration, self.columns_text)

    def plain(self, wheel: str) -> tuple[dict[str, Any] | None, dict[str, Any] | None]:
        """The model that a wheel starts from and the configuration, as plain data that any process can be sent."""
        model = self.model(wheel)
        given = None if self.configuration is None else self.configuration.model_dump(mode="json")
        return None if model is None else model.document(), given


@dataclass(frozen=True)
class PlannedLog:
    """A log, and what its result is called."""

    log: FleetLog
    input_hash: str
    model_hash: str

    def path(self, results: str | Path) -> Path:
        """Where its rows of the first day stand, which are written last."""
        return part_path(results, self.log.wheel, self.log.day, self.input_hash)


def plan_of(index: FleetIndex, settings: FleetSettings) -> dict[str, list[PlannedLog]]:
    """Each wheel's logs in their order."""
    plan = {}
    for wheel, logs in index.wheels.items():
        model_hash, before = settings.hash(wheel), ""
        planned = []
        for log in logs:
            before = fingerprint(before, log.content, log.begins_utc, model_hash)
            planned.append(PlannedLog(log, before, model_hash))
        plan[wheel] = planned
    return plan


def groups_of(logs: Sequence[PlannedLog]) -> list[list[PlannedLog]]:
    """The logs of a wheel in groups that make a task each. How they are grouped changes no result."""
    groups: list[list[PlannedLog]] = []
    samples = 0
    for planned in logs:
        if not groups or samples + planned.log.samples > TASK_SAMPLES:
            groups.append([])
            samples = 0
        groups[-1].append(planned)
        samples += planned.log.samples
    return groups


def models_of(path: str | Path | None) -> dict[str, WheelModel]:
    """A model file for all wheels, or a folder of `WHEEL.yaml`, one a wheel, and `default.yaml` for the rest.

    Raises ConfigError for what is no model, BadInputError where the folder holds none.
    """
    from rw_ekf.wheel.model_file import read_model

    if path is None:
        return {}
    place = Path(path)
    if not place.is_dir():
        return {EVERY_WHEEL: read_model(place)}
    found = {
        EVERY_WHEEL if file.stem == "default" else file.stem: read_model(file) for file in sorted(place.glob("*.yaml"))
    }
    if not found:
        raise BadInputError(f"{path}: is a folder without a model in it: WHEEL.yaml for a wheel, default.yaml for all")
    return found
