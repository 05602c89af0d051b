"""Tasks on a Dask cluster: `Client.submit` and `as_completed`, and nothing else of it.

Every worker needs rw_ekf of the same version, and sees logs and results under the same paths.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Any

from distributed import Client, Future, KilledWorker, as_completed

from rw_ekf.errors import BadInputError, RwEkfError
from rw_ekf.fleet.executors import Done, WorkerLostError

_CONNECTS_WITHIN_S = 10.0


class DaskExecutor:
    """The workers of a scheduler. One that dies is the scheduler's affair: what it had goes to another."""

    def __init__(self, address: str) -> None:
        """Connect. Raises BadInputError where nobody answers there."""
        self._address = address
        try:
            self._client = Client(address, set_as_default=False, timeout=_CONNECTS_WITHIN_S)
        except (OSError, ValueError) as error:
            raise BadInputError(
                f"--scheduler {address}: no Dask scheduler answers ({str(error).splitlines()[0]}): start one with "
                "`dask scheduler`, workers with `dask worker ADDRESS`"
            ) from None
        self._running: dict[str, tuple[str, Future]] = {}
        self._added: list[Future] = []

    @property
    def cores(self) -> int:
        """Threads of all workers that are there now; one at least, for workers may come yet."""
        return max(sum(self._client.nthreads().values()), 1)

    def submit(self, key: str, function: Callable[[Any], Any], argument: Any) -> None:
        """Send a task; a name of its own keeps Dask from taking it for one that it has done before."""
        future = self._client.submit(function, argument, key=f"rw-ekf-{uuid.uuid4().hex}", pure=False)
        self._running[future.key] = key, future
        self._added.append(future)

    def as_completed(self) -> Iterator[Done]:
        """Each task as it ends. Raises RwEkfError where the scheduler is lost."""
        while self._added:
            with self._client.as_current():
                waiting = as_completed(self._added)
            self._added = []
            for future in waiting:
                if future.status in ("lost", "pending"):  # its result went with a worker: the scheduler has it redone
                    waiting.add(future)
                    continue
                key, _ = self._running.pop(future.key)
                yield self._done(key, future)
                future.release()
                waiting.update(self._added)
                self._added = []

    def __enter__(self) -> DaskExecutor:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._client.cancel([future for _, future in self._running.values()])
        self._client.close()

    def _done(self, key: str, future: Future) -> Done:
        if future.status == "finished":
            return Done(key, future.result())
        if future.status == "cancelled":
            raise RwEkfError(
                f"{self._address}: the Dask scheduler is lost: start it again and run again; what is written stays"
            )
        error = future.exception()
        if isinstance(error, KilledWorker):
            error = WorkerLostError(str(error).splitlines()[0])
        return Done(key, None, error)
