"""The logs of a directory by wheel and time: whose each is, when it began, and a checksum of what it holds.

The wheel is what a folder `wheel=W` says, else the metadata of the run, else the name of the folder the log is in. The
beginning is the metadata's first sample, else the date, and time, in the file's name, else the date of a folder.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from rw_ekf.console import printable
from rw_ekf.errors import BadInputError, ConfigError
from rw_ekf.fleet.folder import NAME, FleetFolder
from rw_ekf.logs.atomic import make_folder, write_text
from rw_ekf.logs.metadata import RunMetadata, moment_of, read_metadata, utc_text
from rw_ekf.logs.parts import FORMS, PartName, beside
from rw_ekf.result_display import Shown

SCHEMA = "rw_ekf.fleet_index/1"
_IN_NAME = re.compile(r"(\d{4}-\d{2}-\d{2})(?:[T_ ](\d{2})[-:h]?(\d{2})(?:[-:m]?(\d{2}))?)?")
# Of a row, to guess at how many a log has before it is read: 40 bytes of Parquet or packed text, 80 of text.
_PACKED_BYTES, _PLAIN_BYTES = 40, 80
_BLOCK = 1 << 20


@dataclass(frozen=True)
class FleetLog:
    """A log of the fleet: all parts of one run."""

    wheel: str
    log: str  # below the directory of the logs; a name that `read_log` takes
    files: tuple[str, ...]  # its parts, in their order
    begins_utc: str
    content: str  # sha256 of the parts' bytes, and of the run's events
    bytes: int
    samples: int  # roughly: what tasks are measured out by
    gone: bool = False  # no longer there: what came of it stays
    serial: int | None = None  # number of the wheel that answered, where the run's metadata say so

    @property
    def day(self) -> str:
        """The day that it begins on, in UTC."""
        return self.begins_utc[:10]


@dataclass(eq=False, frozen=True)
class FleetIndex(Shown):
    """The logs of a fleet, each wheel's in the order of time."""

    directory: str  # of the logs, absolute
    logs: tuple[FleetLog, ...]
    left_out: tuple[str, ...] = ()
    stats: Mapping[str, tuple[int, int, str]] | None = None  # of each file: bytes, time of change [ns], sha256

    @property
    def wheels(self) -> dict[str, list[FleetLog]]:
        """Each wheel's logs, oldest first."""
        found: dict[str, list[FleetLog]] = {}
        for log in self.logs:
            found.setdefault(log.wheel, []).append(log)
        return found

    def document(self) -> dict[str, Any]:
        """The document of `fleet build --json`: the logs counted by wheel."""
        return {
            "schema": "rw_ekf.fleet_build/1",
            "directory": self.directory,
            "logs": len(self.logs),
            "bytes": sum(log.bytes for log in self.logs),
            "wheels": [
                {"wheel": wheel, "logs": len(logs), "first_day": logs[0].day, "last_day": logs[-1].day}
                for wheel, logs in self.wheels.items()
            ],
            "left_out": list(self.left_out),
        }

    def text(self) -> str:
        """What `fleet build` prints."""
        wheels = self.wheels
        days = sorted(log.day for log in self.logs)
        first = f"{self.directory}: {len(self.logs)} logs of {len(wheels)} wheels, {days[0]} to {days[-1]}"
        return "\n".join(printable(line) for line in (first, *(f"  left out: {text}" for text in self.left_out)))

    def to_file(self) -> str:
        """As it is written."""
        data = {
            "schema": SCHEMA,
            "directory": self.directory,
            "logs": [asdict(log) for log in self.logs],
            "left_out": list(self.left_out),
            "stats": dict(self.stats or {}),
        }
        return f"{json.dumps(data)}\n"


def built_index(directory: Path, known: FleetIndex | None = None, *, keep_gone: bool = False) -> FleetIndex:
    """Find the logs below a directory. Raises BadInputError where there is no directory, or no log in it.

    known: an earlier index; of files that are as they were the checksum is taken from it. keep_gone: its logs that are
    no longer there stay in it.
    """
    root = Path(os.path.abspath(directory))
    if not root.is_dir():
        raise BadInputError(f"{directory}: is no directory of logs")
    before = {} if known is None or known.stats is None else known.stats
    stats: dict[str, tuple[int, int, str]] = {}
    logs, left_out = [], []
    for folder, stem, files in _runs(root):
        try:
            logs.append(_fleet_log(root, folder, stem, files, before, stats))
        except ConfigError as error:
            left_out.append(error.findings[0])
        except LookupError as error:
            left_out.append(str(error.args[0]))
        except OSError as error:
            left_out.append(f"{error.filename}: cannot be read ({error.strerror})")
    logs, copies = _without_copies(logs)
    left_out += copies
    if keep_gone and known is not None:
        here = {(log.wheel, log.log) for log in logs}
        gone = [log for log in known.logs if (log.wheel, log.log) not in here and not _any_there(root, log.files)]
        logs += [FleetLog(**{**asdict(log), "files": log.files, "gone": True}) for log in gone]
    logs, others = _of_one_wheel_each(logs)
    left_out += others
    if not logs:
        rest = f" ({left_out[0]})" if left_out else ""
        raise BadInputError(
            f"{directory}: holds no log of which it is known whose it is and when it began{rest}: see docs/fleet.md"
        )
    return FleetIndex(
        str(root), tuple(sorted(logs, key=lambda log: (log.wheel, log.begins_utc, log.log))), tuple(left_out), stats
    )


def write_index(folder: FleetFolder, index: FleetIndex) -> None:
    """Write it, all or nothing. Raises BadInputError."""
    make_folder(folder.path)
    write_text(folder.index, index.to_file())


def read_index(folder: FleetFolder) -> FleetIndex | None:
    """The index of an earlier time; None where there is none that can be read: it is made anew from the logs."""
    try:
        data = json.loads(folder.index.read_text(encoding="utf-8"))
        if data["schema"] != SCHEMA:
            return None
        logs = tuple(FleetLog(**{**entry, "files": tuple(entry["files"])}) for entry in data["logs"])
        stats = {name: (int(size), int(time), str(sha)) for name, (size, time, sha) in data["stats"].items()}
        return FleetIndex(str(data["directory"]), logs, tuple(data["left_out"]), stats)
    except (OSError, ValueError, LookupError, TypeError):
        return None


def _runs(root: Path) -> Iterator[tuple[Path, str, list[Path]]]:
    """Each run below a directory: its folder, its stem, its parts in order. The fleet's own folder is passed over."""
    for folder, below, names in os.walk(root):
        below[:] = sorted(name for name in below if not name.startswith(".") and not _is_own(Path(folder), name))
        runs: dict[str, dict[int, tuple[int, Path]]] = {}
        for name in names:
            part = PartName.of(name)
            if part is None or part.estimates or name.startswith("."):
                continue
            form, here = FORMS.index(part.form), runs.setdefault(part.stem, {})
            if part.number not in here or form < here[part.number][0]:
                here[part.number] = form, Path(folder) / name
        for stem in sorted(runs):
            yield Path(folder), stem, [runs[stem][number][1] for number in sorted(runs[stem])]


def _is_own(folder: Path, name: str) -> bool:
    return name == NAME and ((folder / name / "index.json").exists() or (folder / name / "manifest.jsonl").exists())


def _fleet_log(
    root: Path, folder: Path, stem: str, files: list[Path], before: Mapping[str, tuple[int, int, str]],
    stats: dict[str, tuple[int, int, str]],
) -> FleetLog:  # fmt: skip
    """One log. Raises LookupError with a sentence where it is not known whose it is or when it began."""
    log = folder / f"{stem}{FORMS[0]}"
    metadata = read_metadata(log)
    place = folder.relative_to(root).parts
    wheel = _wheel(place, metadata)
    if not wheel:
        raise LookupError(
            f"{files[0]}: nothing says whose it is: put it into a folder of the wheel's name, without `=`"
        )
    begins = _begins(place, stem, metadata)
    if begins is None:
        raise LookupError(f"{files[0]}: nothing says when it began: put the date into its name, as in 2026-01-31.csv")
    sums = [_sum_of(root, file, before, stats) for file in files]
    events = beside(log, "events.jsonl")  # what the watch reported, which stands in the results too
    if metadata is not None and events.is_file():
        sums.append(_sum_of(root, events, before, stats))
    content = sums[0] if len(sums) == 1 else hashlib.sha256("".join(sums).encode()).hexdigest()
    names = tuple(str(file.relative_to(root)) for file in files)
    size = sum(stats[name][0] for name in names)
    per_row = _PLAIN_BYTES if files[0].suffix == FORMS[0] else _PACKED_BYTES
    name = names[0] if len(names) == 1 else str(log.relative_to(root))
    serial = None if metadata is None or metadata.identity is None else metadata.identity.serial_number
    rows = max(size // per_row, 1)
    return FleetLog(wheel, name, names, utc_text(begins), content, size, rows, serial=serial)


def _without_copies(logs: Sequence[FleetLog]) -> tuple[list[FleetLog], list[str]]:
    """Each log once: a copy of one, of the same wheel and time, would count its readings twice. And what is reported.

    The shorter name is the log's: who copies a file adds to its name.
    """
    kept: dict[tuple[str, str, str], FleetLog] = {}
    stated = []
    for log in sorted(logs, key=lambda log: (len(log.log), log.log)):
        first = kept.setdefault((log.wheel, log.begins_utc, log.content), log)
        if first is not log:
            stated.append(f"{log.log}: is a copy of {first.log}")
    return list(kept.values()), stated


def _of_one_wheel_each(logs: Sequence[FleetLog]) -> tuple[list[FleetLog], list[str]]:
    """The logs without those that another wheel left than most of its name, by serial number. And what is reported.

    Of as many on either side the wheel of the oldest log counts. Logs that are gone stay, and count as well.
    """
    serials: dict[str, Counter[int]] = {}
    for log in sorted(logs, key=lambda log: log.begins_utc):
        if log.serial is not None:
            serials.setdefault(log.wheel, Counter())[log.serial] += 1
    usual = {wheel: of_each.most_common(1)[0][0] for wheel, of_each in serials.items()}
    kept, stated = [], []
    for log in logs:
        if log.gone or log.serial in (None, usual.get(log.wheel)):
            kept.append(log)
        else:
            stated.append(
                f"{log.log}: is of the wheel with serial number {log.serial}, and {log.wheel} has {usual[log.wheel]}: "
                "put it into a folder of that wheel's name"
            )
    return kept, stated


def _wheel(place: Iterable[str], metadata: RunMetadata | None) -> str:
    folders = list(place)
    for name in folders:
        if name.startswith("wheel="):
            return unquote(name.removeprefix("wheel="))
    if metadata is not None:
        section = metadata.configuration.get("wheel")
        name = str(section.get("name", "wheel")) if isinstance(section, dict) else "wheel"
        serial = None if metadata.identity is None else metadata.identity.serial_number
        return name if serial is None else f"{name}-{serial}"
    named = [name for name in folders if "=" not in name and _IN_NAME.fullmatch(name) is None]
    return named[-1] if named else ""


def _begins(place: Iterable[str], stem: str, metadata: RunMetadata | None) -> datetime | None:
    if metadata is not None:
        return moment_of(metadata.first_sample_utc)
    for text in (stem, *reversed(list(place))):
        match = _IN_NAME.search(text)
        if match is not None:
            day, *clock = match.groups()
            hour, minute, second = (int(part or 0) for part in clock)
            try:
                return datetime.fromisoformat(day).replace(hour=hour, minute=minute, second=second, tzinfo=UTC)
            except ValueError:
                continue
    return None


def _sum_of(
    root: Path, file: Path, before: Mapping[str, tuple[int, int, str]], stats: dict[str, tuple[int, int, str]]
) -> str:
    """The checksum of a file; one whose size and time are those of an earlier time is not read again."""
    name, stat = str(file.relative_to(root)), file.stat()
    known = before.get(name)
    if known is not None and known[:2] == (stat.st_size, stat.st_mtime_ns):
        stats[name] = known
        return known[2]
    digest = hashlib.sha256()
    with file.open("rb") as stream:
        while block := stream.read(_BLOCK):
            digest.update(block)
    stats[name] = stat.st_size, stat.st_mtime_ns, digest.hexdigest()
    return stats[name][2]


def _any_there(root: Path, files: Iterable[str]) -> bool:
    return any((root / name).exists() for name in files)
