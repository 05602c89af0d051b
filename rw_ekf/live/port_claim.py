"""A running daemon's claim on its port: a locked file that says who drives the wheel, so that `stop` can find it.

The file lies in a directory that all users share, so it may be anyone's: nothing that stands in it is believed before
the kernel confirms it (running_daemon.py). Each user writes only files of its own; the lock dies with the process.
"""

from __future__ import annotations

import contextlib
import fcntl
import fnmatch
import hashlib
import json
import os
import secrets
import stat
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from rw_ekf.clock import Clock
from rw_ekf.errors import DriverError
from rw_ekf.live.port_name import device_of, names_of, other_names_of, own_name
from rw_ekf.live.process import (
    DELETED,
    ProcessFacts,
    facts_of,
    holds_lock,
    open_files,
    other_processes,
    own_process,
    user_name,
)
from rw_ekf.plain_file import json_of

DIRECTORIES = ("/run/lock", "/tmp")  # fixed: an environment variable may differ between `run` and `stop`
_SHARED = stat.S_ISVTX | stat.S_IWOTH  # all may write, each removes only what is its own
_PATTERN = "rw-ekf-*.lock"
_MOST_BYTES = 65_536
_LOCK_TRIES = 25  # whoever looks whether a file is locked has it locked for an instant
_LOCK_WAIT_S = 0.01
_WRITTEN_WITHIN_S = 0.1


@dataclass(frozen=True)
class Claim:
    """A claim that is held, as its file says: not yet believed."""

    path: Path
    file: os.stat_result
    pid: int | None  # None: nothing that can be read as one
    start_ticks: int | None
    names: tuple[str, ...]  # the first is the one of the configuration
    device: str | None  # where that led when the claim was made
    supervises: bool = False  # it drives nothing itself: it starts who does

    def means(self, names: frozenset[str]) -> bool:
        """Whether one of `names` is this claim's port. Where its own name leads now counts; else where it led."""
        if not self.names:
            return False
        present = device_of(self.names[0])
        own = {self.names[0], present} if present is not None else {*self.names, self.device}
        return bool(own & names)

    def holder(self) -> ProcessFacts | None:
        """The process that made it, where the kernel bears out every word; None otherwise.

        It runs since when the file says, belongs to whom the file belongs, is this program by what its interpreter
        started, and holds the lock (which for another user's process only root can see).
        """
        if self.pid is None or self.pid <= 1:
            return None
        facts = facts_of(self.pid)
        if facts is None or facts.start_ticks != self.start_ticks or facts.uid != self.file.st_uid:
            return None
        if not facts.is_ours or holds_lock(self.pid, self.file) is False:
            return None
        return facts

    @property
    def described(self) -> str:
        """For a person: the file and whose it is."""
        return f"lock file {self.path} of user {user_name(self.file.st_uid)}"


def claim_path(port: str, *, supervises: bool = False) -> Path:
    """Path of this user's claim for a port, and of a supervisor's beside that of the daemon it starts."""
    name = own_name(port)
    digest = hashlib.sha256((device_of(name) or name).encode()).hexdigest()[:16]
    return shared_directory() / f"rw-ekf-{os.geteuid()}-{digest}{'.supervisor' if supervises else ''}.lock"


def held_claims(names: frozenset[str], clock: Clock) -> list[Claim]:
    """Claims of all users on the port of those names that are held at this moment."""
    held = _all_held()
    if any(claim.pid is None for claim in held):  # a daemon that just took it writes its own number within an instant
        clock.sleep(_WRITTEN_WITHIN_S)
        held = _all_held()
    return [claim for claim in held if claim.means(names)]


def is_held(claim: Claim) -> bool:
    """Whether that very file is still locked."""
    again = _held_claim(claim.path)
    return again is not None and os.path.samestat(again.file, claim.file)


class PortClaim:
    """Held while a daemon runs, or its supervisor. The lock dies with the process, however it dies."""

    def __init__(self, port: str, clock: Clock, *, supervises: bool = False) -> None:
        self._clock = clock
        self.port = port
        self.path = claim_path(port, supervises=supervises)
        self._supervises = supervises
        self._descriptor: int | None = None

    def __enter__(self) -> Self:
        """Claim the port; nothing where that has been done. Raises DriverError if a running daemon has it."""
        if self._descriptor is not None:
            return self
        with contextlib.ExitStack() as undo:
            descriptor = self._open()
            undo.callback(os.close, descriptor)
            if not self._lock(descriptor):
                raise self._taken(_read_claim(self.path, descriptor).pid, os.geteuid())
            for other in held_claims(names_of(self.port), self._clock):
                facts = other.holder() if other.path != self.path else None
                if facts is not None and not (other.supervises and facts.pid == os.getppid()):
                    # Under another name, or another user's; our own supervisor's is there for us.
                    raise self._taken(facts.pid, facts.uid)
            name = own_name(self.port)
            device = device_of(name)
            content = {
                **own_process(),
                "names": [name, *other_names_of(name)],
                "device": device,
                "supervises": self._supervises,
            }
            try:
                os.fchmod(descriptor, 0o644)  # another user may read who it is; only we write
                os.ftruncate(descriptor, 0)
                os.pwrite(descriptor, (json.dumps(content) + "\n").encode(), 0)
            except OSError as error:
                raise self._unusable(error.strerror or str(error)) from None
            undo.pop_all()
        self._descriptor = descriptor
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def release(self) -> None:
        """Give the port up; nothing where that has been done."""
        if self._descriptor is not None:
            with contextlib.suppress(OSError):
                os.ftruncate(self._descriptor, 0)
            self.leave_to_parent()

    def leave_to_parent(self) -> None:
        """In a forked child: the claim is the parent's alone, and dies with it."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    def _lock(self, descriptor: int) -> bool:
        for _ in range(_LOCK_TRIES):
            if _locked(descriptor, fcntl.LOCK_EX):
                return True
            self._clock.sleep(_LOCK_WAIT_S)
        return False

    def _open(self) -> int:
        """The user's own file, made if it is not there; whatever else stands in its place is left alone."""
        flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
        try:
            descriptor = os.open(self.path, flags, 0o644)
        except OSError as error:
            raise self._unusable(error.strerror or str(error)) from None
        file = os.fstat(descriptor)
        wrong = None
        if not stat.S_ISREG(file.st_mode) or file.st_nlink != 1:
            wrong = "something that is not a plain file stands there"
        elif file.st_uid != os.geteuid():
            wrong = f"user {user_name(file.st_uid)} has put a file there"
        if wrong is not None:
            os.close(descriptor)
            raise self._unusable(wrong)
        return descriptor

    def _unusable(self, reason: str) -> DriverError:
        return DriverError(
            f"{self.port}: its lock file {self.path} cannot be made ({reason}): without it `rw-ekf stop` "
            "could not find this run. Remove the file, or give its directory back its rights"
        )

    def _taken(self, pid: int | None, uid: int) -> DriverError:
        return DriverError(
            f"{self.port}: a daemon (process {pid if pid is not None else 'unknown'} of user {user_name(uid)}) is "
            "already running on this port. Stop it with `rw-ekf stop --config F`."
        )


def shared_directory() -> Path:
    """The first directory that every user can write to, so that `run` and `stop` of different users look there."""
    for name in DIRECTORIES:
        try:
            if os.stat(name).st_mode & _SHARED == _SHARED:
                return Path(name)
        except OSError:
            continue
    return Path(next((d for d in DIRECTORIES if os.access(d, os.W_OK | os.X_OK)), DIRECTORIES[-1]))


def put_shared(path: Path, content: bytes) -> None:
    """Put a file of our own into the shared directory, whole, for all to read. Raises OSError."""
    fresh = path.with_suffix(f".{os.getpid()}-{secrets.token_hex(4)}")
    try:
        with open(fresh, "xb") as file:
            file.write(content)
        os.chmod(fresh, 0o644)
        os.replace(fresh, path)
    except OSError:
        with contextlib.suppress(OSError):
            fresh.unlink()
        raise


def _all_held() -> list[Claim]:
    """In the directories, and those whose files have been tidied away: who made them has them open all the same."""
    paths: list[str] = []
    for directory in DIRECTORIES:
        with contextlib.suppress(OSError):
            paths += [f"{directory}/{name}" for name in sorted(fnmatch.filter(os.listdir(directory), _PATTERN))]
    for pid in other_processes():
        paths += [path for path, name in open_files(pid) if name.endswith(DELETED) and _is_claim(name)]
    return [claim for claim in map(_held_claim, paths) if claim is not None]


def _is_claim(name: str) -> bool:
    return fnmatch.fnmatchcase(os.path.basename(name.removesuffix(DELETED)), _PATTERN)


def _held_claim(path: str | Path) -> Claim | None:
    """What a lock file says if it is held; a link, a pipe or a directory in its place is no claim."""
    try:
        follow = 0 if str(path).startswith("/proc/") else os.O_NOFOLLOW  # there the link is the kernel's
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | follow | os.O_NONBLOCK)
    except OSError:
        return None
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode) or _locked(descriptor, fcntl.LOCK_SH):
            return None
        return _read_claim(Path(path), descriptor)
    finally:
        os.close(descriptor)


def _locked(descriptor: int, kind: int) -> bool:
    """Take a lock if it is free; whether it was."""
    try:
        fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _read_claim(path: Path, descriptor: int) -> Claim:
    """The content of a lock file; whatever is not as PortClaim writes it comes out as None or nothing."""
    content: Any = None
    with contextlib.suppress(OSError):
        content = json_of(os.pread(descriptor, _MOST_BYTES, 0))
    found: dict[str, Any] = content if isinstance(content, dict) else {}
    names = found.get("names")
    device = found.get("device")
    return Claim(
        path,
        os.fstat(descriptor),
        _whole(found.get("pid")),
        _whole(found.get("start_ticks")),
        tuple(n for n in names if isinstance(n, str)) if isinstance(names, list) else (),
        device if isinstance(device, str) else None,
        found.get("supervises") is True,
    )


def _whole(value: object) -> int | None:
    """A process number or a time in ticks: whole, and small enough to be one."""
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**63 else None
