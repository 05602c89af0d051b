"""What a log's columns cannot say, in a file beside it: when it began, which wheel, configuration and version."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rw_ekf.checking.yaml_loader import load_yaml
from rw_ekf.checking.yaml_text import yaml_text
from rw_ekf.errors import ConfigError
from rw_ekf.logs.atomic import write_text
from rw_ekf.logs.checksums import note_file
from rw_ekf.logs.parts import beside
from rw_ekf.records import WheelIdentity


@dataclass(frozen=True)
class RunMetadata:
    """The metadata of one run."""

    first_sample_utc: str  # ISO 8601 with Z; the log's own time is the wheel's or the host's monotonic one
    source: str = ""  # of the driver: "serial+/dev/ttyUSB0", "sim+..."
    version: str = ""  # of rw_ekf
    identity: WheelIdentity | None = None
    configuration: dict[str, Any] = field(default_factory=dict)  # resolved, as Configuration.model_dump() gives it


def utc_text(moment: datetime) -> str:
    """Write a time with its zone as ISO 8601 in UTC, to the microsecond."""
    return moment.astimezone(UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")


def moment_of(text: Any) -> datetime | None:
    """The time in UTC that an ISO 8601 text means, also one without a zone; None where it means none."""
    try:
        moment = datetime.fromisoformat(str(text))
        return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).astimezone(UTC)
    except (ValueError, OverflowError):  # also a time beyond the first or the last year
        return None


def seconds_between(began: Any, at: Any) -> float | None:
    """Time [s] from one moment in UTC to another, as texts; None where one of them is none."""
    begin, end = moment_of(began), moment_of(at)
    return None if begin is None or end is None else (end - begin).total_seconds()


def after_start(began: Any, at: Any, of: str = "the run's start") -> str:
    """How long after its beginning a moment was, for a person, in front of a bracket; empty where that is not known."""
    seconds = seconds_between(began, at)
    return "" if seconds is None or seconds < 0.0 else f" ({seconds:.1f} s after {of})"


def metadata_path(log: str | Path) -> Path:
    """Path of the metadata that belong to a log, or to a part of it: run.csv, run.part002.csv.zst -> run.meta.yaml."""
    return beside(log, "meta.yaml")


def write_metadata(log: str | Path, metadata: RunMetadata) -> Path:
    """Write the metadata beside `log`, all or nothing; gives their path. Raises BadInputError if it cannot."""
    path = metadata_path(log)
    write_text(path, yaml_text(_plain(asdict(metadata)), allow_unicode=True), follow=False)
    note_file(path)
    return path


def read_metadata(log: str | Path) -> RunMetadata | None:
    """Read the metadata beside `log`; None where there are none. Raises ConfigError if they are damaged."""
    path = metadata_path(log)
    if not path.is_file():
        return None
    document = load_yaml(path)
    data = document.data
    if not isinstance(data, dict) or not isinstance(data.get("first_sample_utc"), str):
        raise ConfigError(f"{document.where()}: first_sample_utc is missing: these are not the metadata of a run")
    known = {name: data[name] for name in ("first_sample_utc", "source", "version", "configuration") if name in data}
    try:
        identity = None if data.get("identity") is None else WheelIdentity(**data["identity"])
    except TypeError:
        raise ConfigError(f"{document.where(('identity',))}: identity has keys that no wheel gives") from None
    return RunMetadata(**known, identity=identity)


def _plain(value: Any) -> Any:
    """Turn tuples into lists: YAML has no tuple."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list | tuple) else value
