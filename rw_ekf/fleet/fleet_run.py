"""A run of the fleet: what is not done yet, wheel beside wheel, the logs of one wheel in their order."""

from __future__ import annotations

import heapq
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rw_ekf.console import printable
from rw_ekf.fleet.executors import Done, Executor
from rw_ekf.fleet.folder import FleetFolder
from rw_ekf.fleet.index import FleetIndex
from rw_ekf.fleet.manifest import ManifestLine, read_manifest, write_manifest
from rw_ekf.fleet.plan import FleetSettings, PlannedLog, groups_of, plan_of
from rw_ekf.fleet.result_rows import FAILED, NOT_DONE, read_status
from rw_ekf.fleet.task import Record, Task, work
from rw_ekf.logs.atomic import make_folder
from rw_ekf.plain_file import append_line
from rw_ekf.result_display import Shown

SCHEMA = "rw_ekf.fleet_run/1"
WINDOW = 4  # tasks in flight for each core: enough that none waits, few enough that memory does not grow with the fleet
_SHOWN_FAILURES = 20


@dataclass(eq=False, frozen=True)
class FleetRun(Shown):
    """What a run did, and how the whole fleet stands."""

    folder: str
    wheels: int
    entries: tuple[ManifestLine, ...]  # of every log of the fleet
    computed: int  # logs, in this run
    samples: int  # of them
    seconds: float
    cores: int
    left_out: tuple[str, ...] = ()

    @property
    def failed(self) -> list[ManifestLine]:
        """Logs that failed."""
        return [entry for entry in self.entries if entry.status.startswith(FAILED)]

    @property
    def not_done(self) -> list[ManifestLine]:
        """Logs that another run has to do."""
        return [entry for entry in self.entries if entry.status.startswith(NOT_DONE)]

    @property
    def whole(self) -> bool:
        """Whether every log has a result that is none of a failure."""
        return not self.failed and not self.not_done

    def document(self) -> dict[str, Any]:
        """The document of `fleet run --json`."""
        return {
            "schema": SCHEMA,
            "folder": self.folder,
            "wheels": self.wheels,
            "logs": len(self.entries),
            "done": len(self.entries) - len(self.failed) - len(self.not_done),
            "failed": [_reported(entry) for entry in self.failed],
            "not_done": [_reported(entry) for entry in self.not_done],
            "computed": self.computed,
            "samples": self.samples,
            "seconds": self.seconds,
            "cores": self.cores,
            "left_out": list(self.left_out),
        }

    def text(self) -> str:
        """What `fleet run` prints."""
        rate = f", {self.samples / self.seconds:.3g} samples/s" if self.samples and self.seconds else ""
        lines = [
            f"{self.folder}: {self.wheels} wheels, {len(self.entries)} logs, of which {self.computed} were computed "
            f"now ({self.samples} samples, {self.seconds:.1f} s on {self.cores} cores{rate})"
        ]
        for entries, what in ((self.failed, "failed"), (self.not_done, "not done; run again")):
            if entries:
                lines.append(f"  {len(entries)} {what}:")
                lines += [f"    {printable(f'{e.wheel} {e.log}: {e.status}')}" for e in entries[:_SHOWN_FAILURES]]
                lines += [f"    and {len(entries) - _SHOWN_FAILURES} more"] if len(entries) > _SHOWN_FAILURES else []
        lines += [f"  left out: {printable(text)}" for text in self.left_out]
        return "\n".join(lines)


def _reported(entry: ManifestLine) -> dict[str, str]:
    return {"wheel": entry.wheel, "day": entry.day, "log": entry.log, "status": entry.status}


@dataclass
class _Account:
    """The manifest while the run lasts."""

    path: Path
    planned: Mapping[str, PlannedLog]
    entries: dict[str, ManifestLine]
    computed: int = 0
    samples: int = 0
    waiting: dict[str, str] = field(default_factory=dict)  # why a wheel's further logs wait, by wheel

    def take(self, record: Record) -> None:
        """Note what a worker says of a log."""
        entry = ManifestLine.of(self.planned[record.input_hash], record, record.status)
        self.entries[record.input_hash] = entry
        append_line(self.path, entry.to_line())
        self.computed += 1
        self.samples += record.rows


def run_fleet(
    folder: FleetFolder,
    index: FleetIndex,
    settings: FleetSettings,
    executor: Executor,
    tick: Callable[[int], object] = lambda n: None,
) -> FleetRun:
    """Do what is not done, and clear away results that nothing in the fleet has any more.

    tick(n): n logs more are done. Raises BadInputError where the folder cannot be written, RwEkfError where the
    executor is lost; what was written stays, and the next run continues from it.
    """
    began_s = time.perf_counter()
    make_folder(folder.results)
    plan = plan_of(index, settings)
    there = _clear(folder.results, {planned.path(folder.results) for logs in plan.values() for planned in logs})
    planned = {item.input_hash: item for logs in plan.values() for item in logs}
    account = _Account(folder.manifest, planned, read_manifest(folder.manifest))
    todo = {wheel: _groups(logs, folder, there) for wheel, logs in plan.items()}
    tick(sum(item.path(folder.results) in there for item in planned.values()))
    for done in _in_order(todo, executor, lambda group: _task(folder, index, settings, plan, group)):
        if done.error is not None:
            account.waiting[done.key] = str(done.error) or type(done.error).__name__
            continue
        for record in done.result:
            account.take(record)
        tick(len(done.result))
    entries = _final(account, folder, plan)
    write_manifest(folder.manifest, entries)
    return FleetRun(
        str(folder.path), len(plan), tuple(entries), account.computed, account.samples,
        round(time.perf_counter() - began_s, 3), executor.cores, index.left_out,
    )  # fmt: skip


def _in_order(
    todo: Mapping[str, list[list[PlannedLog]]], executor: Executor, task_of: Callable[[Sequence[PlannedLog]], Task]
) -> Iterator[Done]:
    """Each task as it ends; of one wheel one at a time, those with the most left first, a bounded window in flight."""
    left = {wheel: list(reversed(groups)) for wheel, groups in todo.items() if groups}
    ready = [(-len(groups), wheel) for wheel, groups in left.items()]
    heapq.heapify(ready)
    flying = 0

    def fill() -> int:
        begun = 0
        while ready and flying + begun < WINDOW * executor.cores:
            _, wheel = heapq.heappop(ready)
            executor.submit(wheel, work, task_of(left[wheel].pop()))
            begun += 1
        return begun

    flying += fill()
    for done in executor.as_completed():
        flying -= 1
        if done.error is None and left[done.key]:
            heapq.heappush(ready, (-len(left[done.key]), done.key))
        yield done
        flying += fill()


def _groups(logs: Sequence[PlannedLog], folder: FleetFolder, there: set[Path]) -> list[list[PlannedLog]]:
    """What is not done of a wheel, in groups without a hole: a worker passes over what has a result in a group."""
    done = [item.path(folder.results) in there for item in logs]
    first = done.index(False) if False in done else len(logs)
    groups = groups_of(logs[first:])
    return [group for group in groups if not all(item.path(folder.results) in there for item in group)]


def _task(
    folder: FleetFolder, index: FleetIndex, settings: FleetSettings, plan: Mapping[str, Sequence[PlannedLog]],
    group: Sequence[PlannedLog],
) -> Task:  # fmt: skip
    wheel = group[0].log.wheel
    place = plan[wheel].index(group[0])
    previous = str(plan[wheel][place - 1].path(folder.results).absolute()) if place else None
    model, configuration = settings.plain(wheel)
    return Task(
        index.directory,
        str(folder.results.absolute()),
        tuple(group),
        previous,
        model,
        configuration,
        settings.columns,
    )


def _clear(results: Path, wanted: set[Path]) -> set[Path]:
    """Remove files that are no result of the fleet as it is now; gives those that are there and wanted.

    A log over several days has a file a day of one name: what counts is the name.
    """
    names = {path.name for path in wanted}
    there = set()
    for place, _, files in os.walk(results):
        for name in files:
            path = Path(place) / name
            if path in wanted:
                there.add(path)
            elif name not in names:
                path.unlink(missing_ok=True)
    return there


def _final(account: _Account, folder: FleetFolder, plan: Mapping[str, Sequence[PlannedLog]]) -> list[ManifestLine]:
    """A line for every log of the fleet, in its order."""
    entries = []
    for wheel, logs in plan.items():
        for item in logs:
            path = item.path(folder.results)
            known = account.entries.get(item.input_hash)
            if not path.is_file():
                why = account.waiting.get(wheel, "the run was ended before it")
                entries.append(ManifestLine.of(item, None, f"{NOT_DONE}{why}"))
            elif known is not None and not known.status.startswith(NOT_DONE):
                entries.append(known)
            else:  # a result that an interrupted run left before it could speak of it
                rows, status = read_status(path)
                entries.append(ManifestLine.of(item, None, status, rows))
    return entries
