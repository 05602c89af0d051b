"""What people see besides results: progress and log lines, on standard error only."""

from __future__ import annotations

import contextlib
import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


class _Quiet:
    """Standard error that may vanish with its terminal without taking the program along."""

    def write(self, text: str) -> int:
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.write(text)
        return len(text)

    def flush(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.flush()


def open_missing_streams() -> None:
    """Where the program was started with a standard stream closed, write to nowhere instead of failing."""
    for name, number in (("stdout", 1), ("stderr", 2)):
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, number)  # also so that no file of ours is opened under that number
            setattr(sys, name, os.fdopen(number, "w", closefd=False))


def abandon_output() -> None:
    """Send standard output nowhere from now on: its reader, or its terminal, has gone."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def logger(log_format: str = "text") -> Any:
    """Return a structlog logger on standard error: readable lines, or one JSON object a line ("json")."""
    import structlog

    renderer: Any
    if log_format == "json":
        renderer = structlog.processors.JSONRenderer()
    else:
        renderer = structlog.dev.ConsoleRenderer(colors=sys.stderr.isatty(), sort_keys=False)
    structlog.configure(
        processors=[
            structlog.contextvars.merge_contextvars,
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.format_exc_info,
            renderer,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(logging.INFO),
        logger_factory=structlog.PrintLoggerFactory(file=_Quiet()),  # type: ignore[arg-type]
        cache_logger_on_first_use=False,
    )
    return structlog.get_logger()


@contextmanager
def progress(title: str, total: int | None, unit: str = "") -> Iterator[Any]:
    """Progress bar on standard error after two seconds; silent where that is no terminal. Yields a tqdm to update."""
    from tqdm import tqdm

    with tqdm(total=total, desc=title, unit=unit, delay=2.0, disable=None, file=sys.stderr, leave=False) as bar:
        yield bar
