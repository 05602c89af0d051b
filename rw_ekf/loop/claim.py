"""A running daemon's claim on its port, so that `rw-ekf stop` can find it: a locked file with its process number."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import signal
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from rw_ekf.errors import DriverError

_DIRECTORIES = ("/run/lock", "/tmp")  # fixed: an environment variable may differ between `run` and `stop`


def claim_path(port: str) -> Path:
    """Path of the claim for a port as the configuration names it; the same for `run` and `stop` of one user."""
    name = os.path.abspath(port) if "://" not in port else port
    digest = hashlib.sha256(name.encode()).hexdigest()[:16]
    directory = next((d for d in _DIRECTORIES if os.access(d, os.W_OK | os.X_OK)), _DIRECTORIES[-1])
    return Path(directory) / f"rw-ekf-{os.getuid()}-{digest}.lock"


class PortClaim:
    """Held while a daemon runs. The lock dies with the process, however it dies."""

    def __init__(self, port: str) -> None:
        self.port = port
        self.path = claim_path(port)
        self._descriptor: int | None = None

    def __enter__(self) -> Self:
        """Claim the port. Raises DriverError if a running daemon has it."""
        try:
            descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
        except OSError as error:
            raise DriverError(
                f"{self.port}: its lock file {self.path} cannot be made ({error.strerror}): without it `rw-ekf stop` "
                "could not find this run. Remove the file, or give its directory back its rights"
            ) from None
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
    if not _is_held(path):
        return None
    pid = _pid_of_holder(path)
    if pid is None:
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


def _pid_of_holder(path: Path) -> int | None:
    """Process number in a claim that is held; a daemon that just took it writes its own within an instant."""
    for _ in range(50):
        pid = _read_pid(path)
        if pid is not None or not _is_held(path):
            return pid
        time.sleep(0.01)
    return None


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
