"""What people see besides results: progress and log lines, on standard error only."""

from __future__ import annotations

import contextlib
import io
import logging
import math
import os
import sys
import time
from collections.abc import Iterator, MutableMapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO, cast

_TICK_S = 0.5
_LINE_S = 10.0  # until the first line of progress where no line can be taken back, then twice as long each time
_LONGEST_S = 60.0  # and no longer than this
_LONG = 1.0e5  # beyond it, times mostly, six digits would lose the unit
_TURNS = (0x61C, 0x200E, 0x200F, *range(0x2028, 0x202F), *range(0x2066, 0x206A))  # and ends of lines that are none
_UNSEEN = {code: f"\\u{code:04x}" for code in (*range(0x20), *range(0x7F, 0xA0), *_TURNS) if chr(code) not in "\n\t"}
_LEAST_COLUMNS, _USUAL_COLUMNS = 10, 80  # a terminal that says it is narrower knows nothing of its width


class Status:
    """One line at the bottom of standard error's terminal that keeps changing; log lines go above it."""

    def __init__(self) -> None:
        self._shown = ""
        self.tells = False  # what is done, as it is done: -v

    @property
    def is_terminal(self) -> bool:
        """Whether anybody could see it, on a terminal that can take a line back (TERM=dumb says that it cannot)."""
        try:
            return sys.stderr.isatty() and os.environ.get("TERM") != "dumb"
        except (ValueError, AttributeError):
            return False

    @property
    def has_colour(self) -> bool:
        """Whether lines may be coloured (https://no-color.org)."""
        return self.is_terminal and not os.environ.get("NO_COLOR")

    def columns(self) -> int:
        """Width of the terminal as it is now."""
        try:
            columns = os.get_terminal_size(sys.stderr.fileno()).columns
        except (OSError, ValueError, AttributeError):
            columns = 0
        return columns if columns > _LEAST_COLUMNS else _USUAL_COLUMNS

    def show(self, line: str) -> None:
        """Replace what is shown. The line must be shorter than the terminal is wide, or each one scrolls."""
        self._put(f"\r{printable(line)}\x1b[K")
        self._shown = line

    def say(self, text: str) -> None:
        """Write lines that stay, above the changing one."""
        if not self._shown:
            self._put(f"{text}\n")
        else:
            self._put(f"\r\x1b[K{text}\n{self._shown}")

    def tell(self, text: str) -> None:
        """Say what is done, where -v is given."""
        if self.tells:
            self.say(printable(f"rw-ekf: {text}"))

    def leave(self) -> None:
        """Let the line stay as it is and begin a new one."""
        if self._shown:
            self._put("\n")
            self._shown = ""

    def _put(self, text: str) -> None:
        with contextlib.suppress(OSError, ValueError):
            _bare(sys.stderr).write(text)
            sys.stderr.flush()


STATUS = Status()


class _Quiet:
    """Standard error that may vanish with its terminal without taking the program along; lines go above `STATUS`."""

    def __init__(self) -> None:
        self._begun = ""

    def write(self, text: str) -> int:
        *lines, self._begun = (self._begun + text).split("\n")
        for line in lines:
            STATUS.say(line)
        return len(text)

    def flush(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            sys.stderr.flush()


def open_streams() -> None:
    """Make the standard streams such that no text fails: to nowhere where they were closed, and `printable`."""
    for name, number in (("stdout", 1), ("stderr", 2)):
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, number)  # also so that no file of ours is opened under that number
            setattr(sys, name, os.fdopen(number, "w", closefd=False))
        stream = getattr(sys, name)
        if isinstance(stream, io.TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")


def printable(text: str) -> str:
    r"""A text that does nothing but stand there, and that UTF-8 can hold.

    Names, headers and reasons come from anywhere: what would move a terminal's cursor, colour it or turn the direction
    of reading stands as in JSON, as \u001b, and so does a byte of a file's name that is no UTF-8.
    """
    return text.translate(_UNSEEN).encode(errors="backslashreplace").decode()


class _Printable:
    """A standard stream all of whose text is `printable`."""

    def __init__(self, bare: TextIO) -> None:
        self.bare = bare
        self.used = False

    def write(self, text: str) -> int:
        self.used = self.used or text != ""
        return self.bare.write(printable(text))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.bare, name)


def _bare(stream: TextIO) -> TextIO:
    """The stream itself, for our own control of a terminal."""
    return stream.bare if isinstance(stream, _Printable) else stream


@contextmanager
def printable_streams() -> Iterator[None]:
    """Let nothing from outside act on the terminal, whoever writes it; a JSON document stays what it is."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (cast(TextIO, _Printable(_bare(stream))) for stream in before)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def nothing_printed() -> bool:
    """Whether a verb has written nothing to standard output so far."""
    return not (isinstance(sys.stdout, _Printable) and sys.stdout.used)


def shown_path(path: str | Path) -> str:
    """A path as a person can type it from where they stand, quoted for a shell where it has to be."""
    import shlex

    absolute = Path(path).absolute()
    try:
        return shlex.quote(str(absolute.relative_to(Path.cwd())))
    except (ValueError, OSError):  # elsewhere, or the present folder is gone
        return shlex.quote(str(absolute))


def abandon_output(stream: TextIO | None = None) -> None:
    """Send standard output, or another stream, nowhere from now on: its reader, or its terminal, has gone."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), (sys.stdout if stream is None else stream).fileno())


def settle_errors() -> None:
    """Let nothing wait to be written to standard error: where it has gone, Python would end with status 120 for it."""
    try:
        sys.stderr.flush()
    except (OSError, ValueError):
        abandon_output(sys.stderr)


def _for_people(_logger: object, _name: str, entry: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
    """Six digits are enough for a line that people read, the log file has them all; and text is printable."""
    for key, value in entry.items():
        if isinstance(value, str):
            entry[key] = printable(value)
        if isinstance(value, float) and math.isfinite(value):
            entry[key] = float(f"{value:.6g}") if abs(value) < _LONG else round(value, 1)
    return entry


def logger(log_format: str = "text") -> Any:
    """Return a structlog logger on standard error: readable lines, or one JSON object a line ("json")."""
    import structlog

    renderer: Any
    if log_format == "json":
        renderer = structlog.processors.JSONRenderer()
    else:
        renderer = structlog.dev.ConsoleRenderer(colors=STATUS.has_colour, sort_keys=False)
    structlog.configure(
        processors=[
            structlog.contextvars.merge_contextvars,
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.format_exc_info,
            _for_people,
            renderer,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(logging.INFO),
        logger_factory=structlog.PrintLoggerFactory(file=_Quiet()),  # type: ignore[arg-type]
        cache_logger_on_first_use=False,
    )
    return structlog.get_logger()


class _Lines:
    """What a bar is where no line can be taken back, in a pipe say: how far the work is, in a line now and then."""

    def __init__(self, title: str, total: int | None, unit: str) -> None:
        self.title, self.total, self.unit, self.n = title, total, unit, 0
        self._begun = time.monotonic()

    def update(self, n: int = 1) -> None:
        self.n += n

    def set_description(self, text: str) -> None:
        self.title = text

    def __str__(self) -> str:
        of = "" if self.total is None else f" of {self.total}"
        return f"{self.title}: {self.n}{of}{self.unit}, {time.monotonic() - self._begun:.0f} s"

    def refresh(self) -> None:
        STATUS.say(printable(f"rw-ekf: {self}"))


@contextmanager
def progress(title: str, total: int | None, unit: str = "", *, delay_s: float = 2.0) -> Iterator[Any]:
    """Progress on standard error: a bar after delay_s, or lines where no terminal shows one. Yields a tqdm to update.

    Its clock runs on while nothing is updated.
    """
    import threading

    ended, moves = threading.Event(), STATUS.is_terminal
    bar: Any = _Lines(title, total, unit)
    if moves:
        from tqdm import tqdm

        bar = tqdm(total=total, desc=title, unit=unit, delay=delay_s, file=_bare(sys.stderr), leave=False)

    def tick() -> None:
        if moves and ended.wait(delay_s):
            return
        wait_s = _TICK_S if moves else _LINE_S
        while not ended.wait(wait_s):
            bar.refresh()
            wait_s = wait_s if moves else min(2.0 * wait_s, _LONGEST_S)

    clock = threading.Thread(target=tick, name="progress-clock", daemon=True)
    clock.start()
    try:
        yield bar
    finally:
        ended.set()
        clock.join()
        if moves:
            bar.close()
