"""Tasks on a Dask cluster: `Client.submit` and `as_completed`, and nothing else of it.

Every worker needs rw_ekf of the same version, and sees logs and results under the same paths.
"""

from __future__ import annotations

import re
import uuid
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from distributed import Client, Future, KilledWorker, as_completed

from rw_ekf.errors import BadInputError, RwEkfError
from rw_ekf.fleet.executors import Done, InFlight, WorkerLostError

# For scheduler and workers, which are started by others (docs/fleet.md#on-many-machines): what a Dask process does by
# the clock, and not for a task. As it comes, a worker samples its own stack a hundred times a second, polls its event
# loop fifty times for lateness, and its memory ten times: 5 % of a core beside each task.
DASK_SETTINGS: dict[str, object] = {
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
}
_ADDRESS = re.compile(r"((tcp|tls|wss?)://)?[^\s/]+:\d{1,5}")
_CONNECTS_WITHIN_S = 10.0
_MOST_LOSSES = 5  # of one task's result


@dataclass
class _OnCluster(InFlight):
    future: Future | None = None


class DaskExecutor:
    """The workers of a scheduler. One that dies is the scheduler's affair: what it had goes to another."""

    def __init__(self, address: str) -> None:
        """Connect. Raises BadInputError where nobody answers there."""
        self._address = address
        try:
            if _ADDRESS.fullmatch(address) is None:  # a client of such a one ends in a traceback, 20 s later
                raise ValueError("an address is tcp://HOST:PORT")
            self._client = Client(address, set_as_default=False, timeout=_CONNECTS_WITHIN_S)
        except (OSError, ValueError) as error:
            raise BadInputError(
                f"--scheduler {address}: no Dask scheduler answers ({str(error).splitlines()[0]}): start one with "
                "`dask scheduler`, workers with `dask worker ADDRESS`"
            ) from None
        self._running: dict[str, _OnCluster] = {}
        self._added: list[Future] = []
        self._suspects: deque[_OnCluster] = deque()

    @property
    def cores(self) -> int:
        """Threads of all workers that are there now; one at least, for workers may come yet."""
        return max(sum(int(threads) for threads in self._client.nthreads().values()), 1)

    def submit(self, key: str, function: Callable[[Any], Any], argument: Any) -> None:
        """Send a task; a name of its own keeps Dask from taking it for one that it has done before."""
        self._start(_OnCluster(key, function, argument))

    def as_completed(self) -> Iterator[Done]:
        """Each task as it ends. Raises RwEkfError where the scheduler is lost.

        Dask blames whatever a worker had when it died, and gives up what was there several times: each of those is
        tried once more, alone, to see whose fault it was.
        """
        while self._added or self._suspects:
            if not self._added:
                suspect = self._suspects.popleft()
                suspect.alone = True
                self._start(suspect)
            with self._client.as_current():
                waiting = as_completed(self._added)
            self._added = []
            for future in waiting:
                task = self._running.pop(future.key)
                if future.status not in ("finished", "error"):
                    self._again(task)
                elif not task.alone and _is_blamed(future):
                    self._suspects.append(task)
                else:
                    yield _done(task.key, future)
                    future.release()
                waiting.update(self._added)
                self._added = []

    def __enter__(self) -> DaskExecutor:
        return self

    def __exit__(self, *_: object) -> None:
        self._client.cancel([task.future for task in self._running.values()])
        self._client.close()

    def _start(self, task: _OnCluster) -> None:
        name = f"rw-ekf-{uuid.uuid4().hex}"
        task.future = self._client.submit(task.function, task.argument, key=name, pure=False)
        self._running[name] = task
        self._added.append(task.future)

    def _again(self, task: _OnCluster) -> None:
        """Send a task anew whose result went with the worker that had it. Raises RwEkfError where that is no help."""
        task.losses += 1
        if self._client.status != "running" or task.losses > _MOST_LOSSES:
            raise RwEkfError(
                f"{self._address}: the Dask scheduler is lost: start it again and run again; what is written stays"
            )
        self._start(task)


def _is_blamed(future: Future) -> bool:
    return bool(future.status == "error") and isinstance(future.exception(), KilledWorker)


def _done(key: str, future: Future) -> Done:
    if future.status == "finished":
        return Done(key, future.result())
    error = future.exception()
    if isinstance(error, KilledWorker):
        error = WorkerLostError(str(error).splitlines()[0])
    return Done(key, None, error)
