"""The diagnosed windows of a fleet: choose them, do what is not done, report what was found; and read it back."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from rw_ekf.console import printable
from rw_ekf.errors import BadInputError
from rw_ekf.fleet.executors import Executor
from rw_ekf.fleet.folder import FleetFolder, diagnosis_path, part_path
from rw_ekf.fleet.index import FleetIndex
from rw_ekf.fleet.plan import FleetSettings, PlannedLog, plan_of
from rw_ekf.fleet.result_rows import FAILED, NOT_DONE, OK
from rw_ekf.fleet.wheel_trends import WheelTrend
from rw_ekf.fleet.window_diagnosis import SCHEMA as WINDOW_SCHEMA
from rw_ekf.fleet.window_diagnosis import VERSION, WindowTask, diagnose_window
from rw_ekf.fleet.windows import Window, windows_of
from rw_ekf.learning.learned_file import fingerprint
from rw_ekf.logs.atomic import write_text
from rw_ekf.plain_file import json_of
from rw_ekf.result_display import Shown
from rw_ekf.version import __version__

SCHEMA = "rw_ekf.fleet_diagnoses/1"
_NAMED = 5  # wheels in a line of text; the document has all


@dataclass(frozen=True)
class WindowFinding:
    """What the diagnosis of a window came to; kind and what follows are of the verdict, None where there is none."""

    wheel: str
    day: str
    log: str
    result: str  # checksum of the result that called for it, and so of the log, the model and the settings
    why: str
    status: str  # `ok`, `failed: ` and why, or `not done: ` and why
    kind: str | None = None
    effects: tuple[str, ...] = ()
    statement: str | None = None
    diagnosis: str | None = None  # file below the fleet's folder
    model: str | None = None

    def document(self) -> dict[str, Any]:
        """As it stands in documents."""
        return {**asdict(self), "effects": list(self.effects)}

    @property
    def text(self) -> str:
        """As a person reads it, without the wheel."""
        stated = f"{self.kind}: {self.statement}" if self.status == OK else self.status
        return f"{self.day} ({self.why}): {stated}"


@dataclass(eq=False, frozen=True)
class Diagnoses(Shown):
    """The windows of a fleet, in the order of their urgency."""

    folder: str
    windows: tuple[WindowFinding, ...]
    computed: int
    left_out: int  # windows that qualified as well, beyond the number that was allowed
    seconds: float
    without_results: tuple[str, ...] = ()  # wheels that were passed over: no result is of these settings
    without_model: tuple[str, ...] = ()  # wheels that start from their first log, where others are given a model

    @property
    def whole(self) -> bool:
        """Whether every window has a diagnosis."""
        return all(window.status == OK for window in self.windows)

    def document(self) -> dict[str, Any]:
        """The document of `fleet diagnose --json`."""
        return {
            "schema": SCHEMA,
            "folder": self.folder,
            "windows": [window.document() for window in self.windows],
            "computed": self.computed,
            "left_out": self.left_out,
            "without_results": list(self.without_results),
            "without_model": list(self.without_model),
            "seconds": self.seconds,
        }

    def text(self) -> str:
        """What `fleet diagnose` prints."""
        lines = [f"{self.folder}: {len(self.windows)} windows, of which {self.computed} were diagnosed now"]
        lines += [f"  {printable(f'{window.wheel} {window.text}')}" for window in self.windows]
        if not self.windows:
            lines.append("  no alarm, residual or trend asks for one")
        if self.left_out:
            lines.append(f"  {self.left_out} windows more ask: --most has them done")
        if self.without_results:
            lines.append(
                f"  {_some(self.without_results)} passed over, for no result of theirs is of these settings: "
                "`fleet run` first, with the same --config, --wheel, --model and --columns"
            )
        if self.without_model:
            lines.append(f"  {_some(self.without_model)} without a model in --model: judged from their first log on")
        return "\n".join(lines)


def _some(wheels: Sequence[str]) -> str:
    """How many wheels, and the first of them by name."""
    more = "" if len(wheels) <= _NAMED else ", ..."
    return f"{len(wheels)} wheel{'s' if len(wheels) > 1 else ''} ({printable(', '.join(wheels[:_NAMED]))}{more})"


@dataclass(eq=False, frozen=True)
class Diagnosable:
    """The logs of a fleet that have a result as they and the settings are now, by wheel and log."""

    folder: FleetFolder
    index: FleetIndex
    settings: FleetSettings
    planned: Mapping[tuple[str, str], PlannedLog]

    @classmethod
    def of(cls, folder: FleetFolder, index: FleetIndex, settings: FleetSettings) -> Diagnosable:
        """Look which they are."""
        planned = {
            (item.log.wheel, item.log.log): item
            for logs in plan_of(index, settings).values()
            for item in logs
            if item.path(folder.results).is_file()
        }
        return cls(folder, index, settings, planned)

    @property
    def without_results(self) -> tuple[str, ...]:
        """Wheels of which nothing can be diagnosed, because no result is of these settings."""
        having = {wheel for wheel, _ in self.planned}
        return tuple(wheel for wheel in self.index.wheels if wheel not in having)

    @property
    def without_model(self) -> tuple[str, ...]:
        """Wheels that are given no model where others are."""
        if not self.settings.models:
            return ()
        return tuple(wheel for wheel in self.index.wheels if self.settings.model(wheel) is None)

    def result(self, window: Window) -> str:
        """The checksum of the result that calls for a diagnosis."""
        return self.planned[window.wheel, window.log].input_hash

    def task(self, window: Window) -> WindowTask:
        """What a worker is sent, with the place of what it is to write."""
        log, settings = self.planned[window.wheel, window.log].log, self.settings
        model, configuration = settings.plain(log.wheel)
        name = fingerprint(VERSION, __version__, settings.hash(log.wheel), log.content, log.begins_utc, window.day)
        path = diagnosis_path(self.folder.diagnoses.absolute(), log.wheel, window.day, name)
        return WindowTask(self.index.directory, str(path), log, window.day, model, configuration, settings.columns)

    def has(self, window: Window) -> bool:
        """Whether it can be diagnosed: where its log is gone, only if that is done already."""
        item = self.planned.get((window.wheel, window.log))
        return item is not None and (not item.log.gone or _document(self.task(window).path) is not None)


def windows_wanted(logs: Diagnosable, wheels: Sequence[WheelTrend], most: int) -> tuple[list[Window], int]:
    """The windows of these wheels, the worst first, at most so many, and how many more qualify.

    Raises BadInputError where no result is of these logs and settings.
    """
    if not logs.planned:
        raise BadInputError(
            f"{logs.folder.path}: no result in it is of these logs with these settings: `rw-ekf fleet run` first, with "
            "the same --config, --wheel, --model and --columns"
        )
    return windows_of(wheels, most, logs.has)


def diagnose_windows(
    logs: Diagnosable,
    wanted: tuple[Sequence[Window], int],
    executor: Executor,
    tick: Callable[[int], object] = lambda n: None,
) -> Diagnoses:
    """Diagnose the windows that have no diagnosis yet. wanted: as `windows_wanted` gives them.

    tick(n): n windows more are done. Raises BadInputError where the folder cannot be written, RwEkfError where the
    executor is lost.
    """
    began_s = time.perf_counter()
    windows, left_out = wanted
    folder = logs.folder
    tasks = {window: logs.task(window) for window in windows}
    missing = {task.path: task for task in tasks.values() if _document(task.path) is None}
    tick(len(windows) - len(missing))
    waiting: dict[str, str] = {}
    for path, task in missing.items():
        executor.submit(path, diagnose_window, task)
    for done in executor.as_completed():
        tick(1)
        if done.error is not None:
            waiting[done.key] = str(done.error) or type(done.error).__name__
    findings = [
        _finding(folder, window, logs.result(window), Path(task.path), waiting) for window, task in tasks.items()
    ]
    found = Diagnoses(
        str(folder.path), tuple(findings), len(missing) - len(waiting), left_out,
        round(time.perf_counter() - began_s, 3), logs.without_results, logs.without_model,
    )  # fmt: skip
    known = {(window.wheel, window.day, window.log) for window in findings}
    earlier = [window for window in _still_true(folder) if (window.wheel, window.day, window.log) not in known]
    write_text(folder.diagnosed, replace(found, windows=(*findings, *earlier)).to_json())
    return found


def read_diagnoses(folder: FleetFolder) -> dict[str, list[WindowFinding]]:
    """What `fleet diagnose` found, by wheel: of days whose results are still what it stands on."""
    found: dict[str, list[WindowFinding]] = {}
    for window in _still_true(folder):
        found.setdefault(window.wheel, []).append(window)
    return found


def _still_true(folder: FleetFolder) -> list[WindowFinding]:
    """The diagnosed windows of the document; none of one that is damaged, which the next `fleet diagnose` replaces."""
    try:
        data = json_of(folder.diagnosed.read_bytes())
        if data["schema"] != SCHEMA:
            return []
        windows = [WindowFinding(**{**entry, "effects": tuple(entry["effects"])}) for entry in data["windows"]]
    except (OSError, LookupError, TypeError):
        return []
    return [
        window
        for window in windows
        if window.status == OK and part_path(folder.results, window.wheel, window.day, window.result).is_file()
    ]


def _finding(folder: FleetFolder, window: Window, result: str, path: Path, waiting: Mapping[str, str]) -> WindowFinding:
    base = WindowFinding(window.wheel, window.day, window.log, result, window.why, OK)
    data = _document(str(path))
    if data is None:
        return replace(base, status=f"{NOT_DONE}{waiting.get(str(path), 'the run was ended before it')}")
    beside = os.path.relpath(path.parent, folder.path.absolute())
    if str(data["status"]).startswith(FAILED):
        return replace(base, status=data["status"])
    verdict = data["diagnosis"]["verdict"]
    return replace(
        base,
        kind=verdict["kind"],
        effects=tuple(verdict["effects"]),
        statement=verdict["statement"],
        diagnosis=f"{beside}/{path.name}",
        model=None if data["model"] is None else f"{beside}/{data['model']}",
    )


def _document(path: str) -> dict[str, Any] | None:
    """Of a window that is done; None where it is not there, or damaged."""
    try:
        data = json_of(Path(path).read_bytes())
    except OSError:
        return None
    return data if isinstance(data, dict) and data.get("schema") == WINDOW_SCHEMA else None
