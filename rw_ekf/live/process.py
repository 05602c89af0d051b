"""What the kernel says of a process, and a handle on it that cannot end up at another one.

Everything here is read from /proc, because what a file in a directory that all may write to says of a process is a
claim that anyone may have made up.
"""

from __future__ import annotations

import os
import pwd
import re
import select
import signal
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

_PROC = Path("/proc")
_DRIVING_VERBS = frozenset({"run", "excite"})
_IMPORTS_US = re.compile(r"\b(?:import|from)\s+rw_ekf\b")


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
    def drives(self) -> bool:
        """Whether its command line is this program's, driving a wheel: "... run ... --config F", however started."""
        verbs = [i for i, word in enumerate(self.arguments) if word in _DRIVING_VERBS]
        options = [word.split("=")[0] for i in verbs[:1] for word in self.arguments[i:]]
        return any(word.startswith("--c") and "--config".startswith(word) for word in options)

    @property
    def is_ours(self) -> bool:
        """Whether it may hold a claim: it drives a wheel, or is a script on the command line that imports this."""
        pairs = zip(self.arguments, self.arguments[1:], strict=False)
        return self.drives or any(word == "-c" and _IMPORTS_US.search(text) for word, text in pairs)


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
    """Whether the process has that very file open, locked by flock; None where the kernel does not tell us.

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


def has_open(pid: int, device: str) -> bool:
    """Whether the process has the device open; False also where the kernel does not tell us."""
    try:
        numbers = os.listdir(_PROC / str(pid) / "fd")
    except OSError:
        return False
    for number in numbers:
        try:
            if os.readlink(_PROC / str(pid) / "fd" / number).removesuffix(" (deleted)") == device:
                return True
        except OSError:
            continue
    return False


def processes_with(device: str) -> list[int]:
    """Numbers of all other processes that have the device open, as far as the kernel tells us."""
    numbers = (int(name) for name in os.listdir(_PROC) if name.isdigit())
    return sorted(pid for pid in numbers if pid != os.getpid() and has_open(pid, device))


class ProcessHandle:
    """Signals to one process and no other: once opened, its number cannot come to mean another process.

    Raises ProcessLookupError on opening if there is none.
    """

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self._descriptor = os.pidfd_open(pid)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
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
