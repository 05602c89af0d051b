"""The executors that there are: processes of this machine, or a Dask cluster."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from typing import Any, Protocol

from rw_ekf.errors import BadInputError
from rw_ekf.worker_pool import cores, kill_pool, started_pool


class WorkerLostError(Exception):
    """A worker died each time it had this task: out of memory, as a rule."""


@dataclass(frozen=True)
class Done:
    """A task that came to an end: what it returned, or what was raised."""

    key: str
    result: Any = None
    error: BaseException | None = None


class Executor(Protocol):
    """Takes tasks and gives them back as they are done, in any order; it decides where they are done, never what.

    A task is a function of a module and one argument that pickles; what comes back is small, for the results are files
    that the task itself writes.
    """

    @property
    def cores(self) -> int:
        """How many tasks run at a time."""

    def submit(self, key: str, function: Callable[[Any], Any], argument: Any) -> None:
        """Start a task; key: names it, and is not in flight."""

    def as_completed(self) -> Iterator[Done]:
        """Each task as it ends, with those submitted meanwhile, until none is in flight."""

    def __enter__(self) -> Executor:
        """Begin."""

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """End; tasks under way are dropped where something was raised."""


@dataclass
class InFlight:
    """A task that was submitted and has not ended. losses: of the workers, or of the results, that it has seen."""

    key: str
    function: Callable[[Any], Any]
    argument: Any
    losses: int = 0
    alone: bool = False  # to see whose fault a worker's death is


_SUSPECT_AFTER = 2  # deaths of a worker that a task was in flight at: from then on it runs alone, to see whose fault


@dataclass
class _InPool(InFlight):
    pool: ProcessPoolExecutor | None = None


class ProcessExecutor:
    """Processes of this machine. One that dies takes its pool along: a new one gets what was in flight."""

    def __init__(self, count: int | None = None) -> None:
        self._count = max(count if count is not None else cores(), 1)
        self._pool: ProcessPoolExecutor | None = None
        self._running: dict[Future[Any], _InPool] = {}
        self._suspects: deque[_InPool] = deque()

    @property
    def cores(self) -> int:
        """Processes."""
        return self._count

    def submit(self, key: str, function: Callable[[Any], Any], argument: Any) -> None:
        """Start a task in one of the processes."""
        self._start(_InPool(key, function, argument))

    def as_completed(self) -> Iterator[Done]:
        """Each task as it ends; a task that a worker dies of when it runs alone ends with WorkerLostError."""
        while self._running or self._suspects:
            if not self._running:
                suspect = self._suspects.popleft()
                suspect.alone = True
                self._start(suspect)
            ended = wait(self._running, return_when=FIRST_COMPLETED).done
            lost = []
            for future in ended:
                task = self._running.pop(future)
                error = future.exception()
                if isinstance(error, BrokenExecutor):
                    lost.append(task)
                else:
                    yield Done(task.key, None if error is not None else future.result(), error)
            yield from self._again(lost)

    def __enter__(self) -> ProcessExecutor:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if self._pool is not None:
            if kind is None and not self._running:
                self._pool.shutdown(wait=True)
            else:
                kill_pool(self._pool)
            self._pool = None

    def _start(self, task: _InPool) -> None:
        while True:
            if self._pool is None:
                self._pool = started_pool(self._count)
            try:
                future = self._pool.submit(task.function, task.argument)
            except BrokenExecutor:  # a worker has died since; what was in flight says so by itself
                self._pool = None
            else:
                task.pool = self._pool
                self._running[future] = task
                return

    def _again(self, lost: list[_InPool]) -> Iterator[Done]:
        """Begin what was in flight anew; each that has seen several deaths alone."""
        for task in lost:
            if self._pool is task.pool:
                self._pool = None
            task.losses += 1
            if task.alone:
                yield Done(task.key, None, WorkerLostError(f"its worker died {task.losses} times"))
            elif task.losses >= _SUSPECT_AFTER:
                self._suspects.append(task)
            else:
                self._start(task)


def executor_of(workers: int | None, scheduler: str | None) -> Executor:
    """Processes of this machine, or the cluster of a Dask scheduler. Raises BadInputError where there is none."""
    if scheduler is None:
        return ProcessExecutor(workers)
    if workers is not None:
        raise BadInputError("--workers counts processes of this machine, and --scheduler has its own: leave out one")
    try:
        from rw_ekf.fleet.dask_executor import DaskExecutor
    except ImportError as error:
        raise BadInputError(
            f'Dask distributed is not installed ({error}): pip install "rw-ekf[fleet]", also where the workers run'
        ) from None
    return DaskExecutor(scheduler)
