"""Where tasks run: one small protocol, and what goes through it.

A task is a function of a module and one argument that pickles; what comes back is small, for the results are files
that the task itself writes. An executor never decides what is done, only where.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol


class WorkerLostError(Exception):
    """A worker died each time it had this task: out of memory, as a rule."""


@dataclass(frozen=True)
class Done:
    """A task that came to an end: what it returned, or what was raised."""

    key: str
    result: Any = None
    error: BaseException | None = None


class Executor(Protocol):
    """Takes tasks and gives them back as they are done, in any order."""

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
