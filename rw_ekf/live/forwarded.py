"""Signals that a process takes for another one: noted by the kernel's handler, passed on when it suits."""

from __future__ import annotations

import os
import signal
from typing import Self

from rw_ekf.live.stop_signal import RESUME, stops_heeded


class ForwardedSignals:
    """While open, signals to stop and the word to resume only wait here; a descriptor says that one does."""

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
