"""A running daemon's claim on its port, so that `rw-ekf stop` can find it: a locked file with its process number."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import signal
import tempfile
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from rw_ekf.errors import DriverError


def claim_path(port: str) -> Path:
    """Path of the claim for a port as the configuration names it; the same for `run` and `stop` of one user."""
    name = os.path.abspath(port) if "://" not in port else port
    digest = hashlib.sha256(name.encode()).hexdigest()[:16]
    directory = os.environ.get("XDG_RUNTIME_DIR") or tempfile.gettempdir()
    return Path(directory) / f"rw-ekf-{os.getuid()}-{digest}.lock"


class PortClaim:
    """Held while a daemon runs. The lock dies with the process, however it dies."""

    def __init__(self, port: str) -> None:
        self.port = port
        self.path = claim_path(port)
        self._descriptor: int | None = None

    def __enter__(self) -> Self:
        """Claim the port. Raises DriverError if a running daemon has it."""
        descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            raise DriverError(
                f"{self.port}: a daemon (process {_read_pid(self.path)}) is already running on this port. "
                "Stop it with `rw-ekf stop --config F`."
            ) from None
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)
        self._descriptor = descriptor
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._descriptor is not None:
            os.ftruncate(self._descriptor, 0)
            os.close(self._descriptor)
            self._descriptor = None


def stop_holder(port: str, within_s: float = 5.0) -> int | None:
    """Ask the daemon that holds the port to end, and wait for it; its process number, None if nobody holds the port.

    Raises DriverError if it does not end in time.
    """
    path = claim_path(port)
    pid = _read_pid(path)
    if pid is None or not _is_held(path):
        return None
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, signal.SIGTERM)
    end = time.monotonic() + within_s
    while _is_held(path):
        if time.monotonic() > end:
            raise DriverError(
                f"{port}: the daemon (process {pid}) was told to stop but has not ended in {within_s:g} s"
            )
        time.sleep(0.02)
    return pid


def _read_pid(path: Path) -> int | None:
    try:
        return int(path.read_text())
    except (OSError, ValueError):
        return None


def _is_held(path: Path) -> bool:
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_NOFOLLOW)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False
