"""What the kernel says of a process, and a handle on it that cannot end up at another one.

Everything here is read from /proc, because what a file in a directory that all may write to says of a process is a
claim that anyone may have made up.
"""

from __future__ import annotations

import contextlib
import os
import pwd
import re
import select
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from rw_ekf.plain_file import read_plain

_PROC = Path("/proc")
DELETED = " (deleted)"  # behind the name of an open file that has none any more
_DRIVING_VERBS = frozenset({"run", "excite"})
_NAME, _MODULE = "rw-ekf", "rw_ekf"
_IMPORTS_US = re.compile(r"\b(?:import|from)\s+rw_ekf\b")
_SCRIPT_BYTES = 65_536
_WITH_VALUE = ("-W", "-X")  # options of the interpreter whose value is a word of its own


@dataclass(frozen=True)
class ProcessFacts:
    """One process as the kernel knows it."""

    pid: int
    uid: int  # effective
    start_ticks: int  # when it began, since boot: with the number it names one process for all time
    stopped: bool  # by a signal or a debugger
    arguments: tuple[str, ...]

    @property
    def described(self) -> str:
        """For a person: "process 4711 of user anna"."""
        return f"process {self.pid} of user {user_name(self.uid)}"

    @property
    def is_ours(self) -> bool:
        """Whether it is this program: its command, its module, or a script or text that imports it.

        Of the command line only what the interpreter starts counts: any program may have arguments like ours.
        """
        entry, rest = self._entry()
        if _NAME in (os.path.basename(word) for word in (*self.arguments[:1], *rest[:1])):
            return True
        if entry == "-m":
            return rest[:1] in ((_MODULE,), (f"{_MODULE}.cli",))
        text = "".join(rest[:1])
        return _IMPORTS_US.search(text if entry == "-c" else self._text_of(text)) is not None

    @property
    def starts_a_run(self) -> bool:
        """Whether it is this program, with a verb that drives a wheel: whether it does, its claim says."""
        return not _DRIVING_VERBS.isdisjoint(self.arguments) and self.is_ours

    def _entry(self) -> tuple[str, tuple[str, ...]]:
        """How an interpreter was given what to start ("-m", "-c", or "" for a script), and the words from that on."""
        at = 1
        while at < len(self.arguments) and self.arguments[at].startswith("-"):
            word = self.arguments[at]
            at += 2 if word in _WITH_VALUE else 1
            if not word.startswith("--") and word[-1] in "mc":
                return f"-{word[-1]}", self.arguments[at:]
        return "", self.arguments[at:]

    def _text_of(self, script: str) -> str:
        """Beginning of a script that it was started with; nothing where that is no plain file that we may read."""
        try:
            path = os.path.join(_PROC / str(self.pid) / "cwd", script)
            return read_plain(path, most_bytes=_SCRIPT_BYTES).decode("utf-8", "replace")
        except OSError:
            return ""


def facts_of(pid: int) -> ProcessFacts | None:
    """What is known of a process; None if there is none of that number, or the kernel does not show it."""
    try:
        stat = (_PROC / str(pid) / "stat").read_text(encoding="utf-8", errors="replace")
        status = (_PROC / str(pid) / "status").read_text(encoding="utf-8", errors="replace")
        arguments = (_PROC / str(pid) / "cmdline").read_bytes()
        fields = stat[stat.rindex(")") + 1 :].split()  # the name before it may hold anything, spaces and brackets too
        uid = next(int(line.split()[2]) for line in status.splitlines() if line.startswith("Uid:"))
        words = tuple(os.fsdecode(word) for word in arguments.split(b"\0")[:-1])
        return ProcessFacts(pid, uid, int(fields[19]), fields[0] in "Tt", words) if fields[0] not in "ZX" else None
    except (OSError, ValueError, IndexError, StopIteration):
        return None


def own_process() -> dict[str, int | None]:
    """Number and start of this process, which name it for all time."""
    me = facts_of(os.getpid())
    return {"pid": os.getpid(), "start_ticks": None if me is None else me.start_ticks}


def user_name(uid: int) -> str:
    """Name of a user, or the number where there is no name."""
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return str(uid)


def holds_lock(pid: int, file: os.stat_result) -> bool | None:
    """Whether the process has that very file open, locked by flock; None where the kernel does not show it.

    A lock belongs to an open file: fdinfo says so for each, and who took it, also where device numbers are made up.
    """
    try:
        numbers = os.listdir(_PROC / str(pid) / "fd")
    except FileNotFoundError:
        return False
    except OSError:
        return None
    hidden = False
    for number in numbers:
        try:
            if not os.path.samestat(os.stat(_PROC / str(pid) / "fd" / number), file):
                continue
            for line in (_PROC / str(pid) / "fdinfo" / number).read_text().splitlines():
                words = line.split()
                if words[:1] == ["lock:"] and {"FLOCK", "WRITE", str(pid)} <= set(words):
                    return True
        except PermissionError:
            hidden = True
        except OSError:
            continue
    return None if hidden else False


def open_files(pid: int) -> Iterator[tuple[str, str]]:
    """Every file that a process has open, as (a path that opens it, its name); none where the kernel shows none."""
    folder = f"{_PROC}/{pid}/fd"
    try:
        numbers = os.listdir(folder)
    except OSError:
        return
    for number in numbers:
        path = f"{folder}/{number}"  # no Path: there are thousands, and every daemon looks at all as it starts
        with contextlib.suppress(OSError):
            yield path, os.readlink(path)


def has_open(pid: int, device: str) -> bool:
    """Whether the process has the device open; False also where the kernel does not show it."""
    return any(name.removesuffix(DELETED) == device for _, name in open_files(pid))


def other_processes() -> list[int]:
    """Numbers of all other processes."""
    return sorted(int(name) for name in os.listdir(_PROC) if name.isdigit() and int(name) != os.getpid())


def processes_with(device: str) -> list[int]:
    """Numbers of all other processes that have the device open, as far as the kernel shows."""
    return [pid for pid in other_processes() if has_open(pid, device)]


class ProcessHandle:
    """Signals to one process and no other: once opened, its number cannot come to mean another process.

    Raises ProcessLookupError on opening if there is none.
    """

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self._descriptor = os.pidfd_open(pid)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._descriptor)

    def fileno(self) -> int:
        """A descriptor that is readable once the process has ended."""
        return self._descriptor

    def send(self, number: signal.Signals) -> None:
        """Send a signal; nothing where it has ended. Raises PermissionError."""
        try:
            signal.pidfd_send_signal(self._descriptor, number)
        except ProcessLookupError:
            return

    def ended(self, within_s: float = 0.0) -> bool:
        """Whether it has ended, waiting for that so long."""
        return bool(select.select([self._descriptor], [], [], within_s)[0])
