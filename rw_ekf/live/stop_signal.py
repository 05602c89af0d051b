"""SIGINT, SIGTERM, SIGHUP, SIGQUIT: a request to stop, and a wait that they cut short; others: a word to resume.

SIGUSR1 is for a wheel that its process drives alone, a real-time signal for each wheel of a line: which one, its run
publishes. So no word is for a wheel that nobody named.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Self

from rw_ekf.clock import Clock

STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
RESUME = signal.SIGUSR1
LINE_RESUMES = range(signal.SIGRTMIN, signal.SIGRTMAX + 1)


def resume_signal_of(index: int) -> int | None:
    """The word for one wheel of a line, by its place there; None beyond the 31 that Linux has (RS-485 has 32 loads)."""
    return LINE_RESUMES[index] if index < len(LINE_RESUMES) else None


def stops_heeded() -> list[signal.Signals]:
    """The signals that end a run: SIGHUP is none of them where it was ignored at the start, as `nohup` has it."""
    return [n for n in STOPS if not (n is signal.SIGHUP and signal.getsignal(n) is signal.SIG_IGN)]


class StopSignal:
    """While open, signals to stop only set `requested`, a word to resume calls what `on_resume` gave for it.

    A handler that raised could cut a write to the wheel in half; one that set a threading.Event could deadlock with the
    wait it interrupts. So the handler assigns, and writes one byte to a pipe that the wait watches.
    """

    def __init__(self) -> None:
        self.requested: str | None = None
        self._reader, self._writer = os.pipe()
        os.set_blocking(self._reader, False)
        os.set_blocking(self._writer, False)
        self._before: dict[int, object] = {}
        self._resume: dict[int, Callable[[], None]] = {}

    def on_resume(self, action: Callable[[], None], number: int) -> None:
        """Take what a word to resume calls: from a signal handler, so it may do no more than assign."""
        self._resume[number] = action
        if self._before and number not in self._before:  # none before: not the main thread, which alone may have any
            self._before[number] = signal.signal(number, lambda number, frame: self.resume(number))

    def resume(self, number: int = RESUME) -> None:
        """Say from within the program what a person says by a signal; nothing where no wheel has that word."""
        if number in self._resume:
            self._resume[number]()

    def request(self, why: str) -> None:
        """Request the stop from within the program."""
        self.requested = self.requested or why
        with contextlib.suppress(BlockingIOError, OSError):
            os.write(self._writer, b"!")

    def wait(self, seconds: float, clock: Clock) -> bool:
        """Sleep up to `seconds` of the clock; True as soon as a stop was requested."""
        if self.requested is None and seconds > 0.0:
            clock.sleep(seconds, self._reader)
        return self.requested is not None

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for number in stops_heeded():
                self._before[number] = signal.signal(number, self._note)
            self._before[RESUME] = signal.signal(RESUME, lambda number, frame: self.resume(number))
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        self._before.clear()
        os.close(self._reader)
        os.close(self._writer)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.request(signal.Signals(number).name)


class ForwardedSignals:
    """Those that a process takes for another one: noted by the kernel's handler, passed on when it suits.

    While open, signals to stop and the word to resume only wait here; a descriptor says that one does.
    """

    def __init__(self) -> None:
        self.stops: tuple[signal.Signals, ...] = ()
        self._before: dict[int, object] = {}
        self._reader = self._writer = self._wakeup = -1

    def __enter__(self) -> Self:
        self._reader, self._writer = os.pipe()
        os.set_blocking(self._reader, False)
        os.set_blocking(self._writer, False)
        self._wakeup = signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)
        self.stops = tuple(stops_heeded())
        for number in (*self.stops, RESUME):
            self._before[number] = signal.signal(number, lambda number, frame: None)
        return self

    def __exit__(self, *_: object) -> None:
        self.leave_to_parent()

    def leave_to_parent(self) -> None:
        """Heed signals as before; also in a forked child, where they are for the run. Nothing at the second call."""
        if not self._before:
            return
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        self._before.clear()
        signal.set_wakeup_fd(self._wakeup)
        os.close(self._reader)
        os.close(self._writer)

    def fileno(self) -> int:
        """Readable while a signal waits."""
        return self._reader

    def taken(self) -> list[signal.Signals]:
        """Those that came since the last call, in order."""
        try:
            numbers = os.read(self._reader, 4096)
        except BlockingIOError:
            return []
        heeded = (*self.stops, RESUME)
        return [signal.Signals(number) for number in numbers if number in heeded]
