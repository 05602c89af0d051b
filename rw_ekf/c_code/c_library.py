"""Printed C made a library by the C compiler of this machine, and kept on disk.

A file's name has a digest of all that went into it, and its last bytes one of its content: one that is stale is never
loaded, and one that a loss of power has torn is none, and so made anew.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
import importlib.util
import os
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

ENTRY = "rw_run"
COMPILER_VARIABLE = "RW_EKF_CC"  # a compiler's command; "none": there is none, and all runs as plain Python
FOLDER_VARIABLE = "RW_EKF_CACHE_DIR"
# IEEE arithmetic as Python has it: nothing is fused or reordered, no power becomes a product; what `math` raises is NaN
# or infinite here. The first takes back what the command itself may have requested.
_ARITHMETIC = ("-fno-fast-math", "-ffp-contract=off", "-fno-builtin-pow", "-fno-math-errno", "-fno-trapping-math")
FLAGS = ("-std=c11", "-O3", "-fPIC", "-shared", "-w", *_ARITHMETIC)
_COMPILERS = ("cc", "gcc", "clang")
Native = Callable[[bytes, object], object]
_SEAL_BYTES = hashlib.sha256().digest_size


class CompilerError(Exception):
    """The C compiler did not make a library of what it was given; its text is the first line that it printed."""


def compiler() -> list[str]:
    """The command of a C compiler: what is named in the environment, the system's, or the one that pip installs.

    Raises CompilerError where there is none, or where none is to be used.
    """
    named = os.environ.get(COMPILER_VARIABLE) or os.environ.get("CC")
    command = _found(named, os.environ.get("PATH", ""))
    if command is None:
        reported = f", as {COMPILER_VARIABLE} or CC is {named!r}" if named else ""
        raise CompilerError(
            f"no C compiler is found{reported}: install one (gcc, clang, or pip install ziglang), or name it in "
            f"{COMPILER_VARIABLE}"
        )
    return command


@functools.cache
def _found(named: str | None, path: str) -> list[str] | None:
    if named:
        try:
            command = shlex.split(named)
        except ValueError:  # a quotation that does not end
            return None
        return command if command and shutil.which(command[0], path=path) else None
    for name in _COMPILERS:
        if shutil.which(name, path=path):
            return [name]
    if importlib.util.find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc"]
    return None


def folders() -> Iterator[Path]:
    """Where libraries are kept, the first first: as the variable says, or beside the program, else with the user."""
    reported = os.environ.get(FOLDER_VARIABLE)
    package = Path(__file__).resolve().parents[1]
    if reported:
        yield Path(reported)
    else:
        yield package / "__pycache__"
        with contextlib.suppress(RuntimeError):  # a user without a home
            root = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
            yield Path(root) / "rw_ekf" / hashlib.sha256(bytes(package)).hexdigest()[:16]


def kept(name: str, stamp: str) -> Native | None:
    """The entry of the library of that name and stamp, where a whole one is kept that can be loaded."""
    for folder in folders():
        path = folder / _file_of(name, stamp)
        with contextlib.suppress(OSError):
            content = path.read_bytes()
            if content[-_SEAL_BYTES:] == _seal(stamp, content[:-_SEAL_BYTES]):
                return load(path)
    return None


def load(path: Path) -> Native:
    """Its entry. Raises OSError for what cannot be loaded."""
    entry = getattr(ctypes.CDLL(str(path.absolute())), ENTRY, None)
    if entry is None:
        raise OSError(f"{path}: there is no {ENTRY} in it")
    entry.argtypes, entry.restype = [ctypes.c_char_p, ctypes.c_void_p], None
    found: Native = entry
    return found


class Compilation:
    """A compiler at work; killed where this is left before it has ended."""

    def __init__(self, name: str, stamp: str, text: str) -> None:
        """Begin. Raises CompilerError where there is no compiler, or no room for what it writes."""
        command = compiler()
        self._name, self._stamp, self._command = name, stamp, command[0]
        with contextlib.ExitStack() as stack:
            try:
                folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="rw-ekf-", ignore_cleanup_errors=True))
                source = Path(folder) / f"{name}.c"
                source.write_text(text, encoding="utf-8")
                self._made, self._stated = source.with_suffix(".so"), source.with_suffix(".said")
                # A session of its own: Ctrl-C at the terminal is for the parent, which kills what it started. What it
                # says goes into a file, as nobody reads while it works; what it leaves lies in the folder.
                with self._stated.open("wb") as stated:
                    self.process = subprocess.Popen(
                        [*command, *FLAGS, "-o", str(self._made), str(source), "-lm"], start_new_session=True,
                        stdin=subprocess.DEVNULL, stdout=stated, stderr=stated, env=os.environ | {"TMPDIR": folder},
                    )  # fmt: skip
            except OSError as error:
                raise CompilerError(f"{error.filename or 'TMPDIR'}: {error.strerror or error}") from None
            self._folder = stack.pop_all()

    def __enter__(self) -> Compilation:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)  # with what it has started in turn
            self.process.wait()
        self._folder.close()

    def finish(self) -> Native:
        """Wait for it, and load what it made; for this process only where it cannot be kept. Raises CompilerError."""
        status = self.process.wait()
        try:
            if status != 0 or not self._made.exists():
                stated = self._stated.read_text(encoding="utf-8", errors="replace").strip().partition("\n")[0]
                raise CompilerError(f"{self._command}: {stated or f'status {status}, and no library'}")
            return self._keep(self._made.read_bytes())
        except OSError as error:
            raise CompilerError(f"what {self._command} made: {error.strerror or error}") from None

    def _keep(self, content: bytes) -> Native:
        for folder in folders():
            with contextlib.suppress(OSError):
                return _written(folder, self._name, self._stamp, content)
        return load(self._made)


def _written(folder: Path, name: str, stamp: str, content: bytes) -> Native:
    """Write a library where it can be loaded, and take away what is there of the same name and another stamp."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / _file_of(name, stamp)
    handle, temporary = tempfile.mkstemp(dir=folder, prefix=".rw-ekf-")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content + _seal(stamp, content))
        native = load(Path(temporary))  # programs may not run from there, or it may be none
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    for other in folder.glob(f"{name}.*.so"):
        if other != path:
            with contextlib.suppress(OSError):
                other.unlink()
    return native


def _file_of(name: str, stamp: str) -> str:
    return f"{name}.{stamp[:24]}.so"


def _seal(stamp: str, content: bytes) -> bytes:
    return hashlib.sha256(stamp.encode() + content).digest()
