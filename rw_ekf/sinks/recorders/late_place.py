"""A place on a network that may not be up yet, as at boot: taken now, or tried again until it can be had."""

from __future__ import annotations

import errno
import socket
import threading
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from rw_ekf.errors import reason_of
from rw_ekf.sinks.run_files import Note

_TRY_EVERY_S = 5.0
# A name server that does not answer for now, and an address that no interface has. A name that is none stays none.
_NOT_YET = (socket.EAI_AGAIN, errno.EADDRNOTAVAIL)


class _Taken(Protocol):
    def close(self) -> None:
        """Let it go."""
        ...


Had = TypeVar("Had", bound=_Taken)


class LatePlace(Generic[Had]):
    """What was had of a place, once it could be; until then a thread tries, and the run goes on."""

    def __init__(self, sink: str, take: Callable[[], Had], say: Note) -> None:
        """Take it, or say once that it is waited for, and why. Raises OSError for a place that no waiting mends."""
        self._sink, self._take, self._say = sink, take, say
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._reasons: set[str] = set()  # that were said
        self.had: Had | None = None
        self.reason = ""  # why it is not had
        try:
            self.had = take()
        except OSError as error:
            if error.errno not in _NOT_YET:
                raise
            self._wait(error)
            threading.Thread(target=self._try, name=f"{sink}-waits", daemon=True).start()

    def close(self) -> None:
        """Let it go, and try no more. Safe to call twice."""
        with self._lock:
            self._over.set()
            had, self.had = self.had, None
        if had is not None:
            had.close()

    def _wait(self, error: OSError) -> None:
        self.reason = reason_of(error)
        if self.reason not in self._reasons:
            self._reasons.add(self.reason)
            do = f"the run goes on without; it is tried again every {_TRY_EVERY_S:g} s"
            self._say("recorder_waits", sink=self._sink, reason=self.reason, do=do)

    def _try(self) -> None:
        """Until it is had, or nobody wants it any more: a look-up of a name may take long."""
        while not self._over.wait(_TRY_EVERY_S):
            try:
                had = self._take()
            except OSError as error:
                self._wait(error)
                continue
            with self._lock:
                if not self._over.is_set():
                    self.had = had
                    return
            had.close()
