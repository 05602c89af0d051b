"""Printed C made a library by the C compiler of this machine, and kept on disk.

A file's name has a digest of all that went into it, and its last bytes one of its content: one that is stale is never
asked for, and one that a loss of power has torn is none, and so made anew.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import functools
import hashlib
import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

ENTRY = "rw_run"
COMPILER_VARIABLE = "RW_EKF_CC"  # a compiler's command; "none": there is none, and all runs as plain Python
FOLDER_VARIABLE = "RW_EKF_CACHE_DIR"
# IEEE arithmetic as Python has it: nothing is fused or reordered, no power becomes a product; what `math` raises is NaN
# or infinite here.
_ARITHMETIC = ("-ffp-contract=off", "-fno-builtin-pow", "-fno-math-errno", "-fno-trapping-math")
FLAGS = ("-std=c11", "-O3", "-fPIC", "-shared", "-w", *_ARITHMETIC)
_COMPILERS = ("cc", "gcc", "clang")
_SEAL_BYTES = hashlib.sha256().digest_size


class CompilerError(Exception):
    """The C compiler did not make a library of what it was given; its text says what it said first."""


def compiler() -> list[str] | None:
    """The command of a C compiler: what is named in the environment, the system's, or the one that pip installs.

    None where there is none, or where none is to be used.
    """
    named = os.environ.get(COMPILER_VARIABLE) or os.environ.get("CC")
    return _found(named, os.environ.get("PATH", ""))


@functools.cache
def _found(named: str | None, path: str) -> list[str] | None:
    if named:
        command = shlex.split(named)
        return command if shutil.which(command[0], path=path) else None
    for name in _COMPILERS:
        if shutil.which(name, path=path):
            return [name]
    if importlib.util.find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc"]
    return None


def folders() -> Iterator[Path]:
    """Where libraries are kept, the first first: as told, beside the program, with the user, with this process."""
    told = os.environ.get(FOLDER_VARIABLE)
    package = Path(__file__).resolve().parents[1]
    if told:
        yield Path(told)
    else:
        yield package / "__pycache__"
        root = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        yield Path(root) / "rw_ekf" / hashlib.sha256(bytes(package)).hexdigest()[:16]
    if private_folder.cache_info().currsize:
        yield private_folder()


@functools.cache
def private_folder() -> Path:
    """A folder for this process alone, removed at its end. Raises OSError where there is no room for that either."""
    folder = tempfile.mkdtemp(prefix="rw-ekf-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def kept_at(name: str, stamp: str) -> Path | None:
    """The whole library of that name and stamp, where one is kept."""
    for folder in folders():
        path = folder / _file_of(name, stamp)
        with contextlib.suppress(OSError):
            content = path.read_bytes()
            if content[-_SEAL_BYTES:] == _seal(stamp, content[:-_SEAL_BYTES]):
                return path
    return None


def load(path: Path) -> Callable[[bytes, object], object]:
    """Its entry. Raises OSError for what cannot be loaded."""
    entry = getattr(ctypes.CDLL(str(path)), ENTRY)
    entry.argtypes, entry.restype = [ctypes.c_char_p, ctypes.c_void_p], None
    found: Callable[[bytes, object], object] = entry
    return found


class Compilation:
    """A compiler at work; killed where this is left before it has ended."""

    def __init__(self, name: str, stamp: str, text: str) -> None:
        """Begin. Raises CompilerError where there is no compiler, or no room for what it writes."""
        command = compiler()
        if command is None:
            raise CompilerError("no C compiler is found")
        self._name, self._stamp, self._command = name, stamp, command[0]
        self._folder = tempfile.TemporaryDirectory(prefix="rw-ekf-", ignore_cleanup_errors=True)
        try:
            source = Path(self._folder.name) / f"{name}.c"
            source.write_text(text, encoding="utf-8")
            self._made = source.with_suffix(".so")
            # A session of its own: Ctrl-C at the terminal is for the parent, which kills what it started.
            self.process = subprocess.Popen(
                [*command, *FLAGS, "-o", str(self._made), str(source), "-lm"],
                stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True,
            )  # fmt: skip
        except OSError as error:
            self._folder.cleanup()
            raise CompilerError(f"{command[0]}: {error.strerror or error}") from None

    def __enter__(self) -> Compilation:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.wait()
        assert self.process.stderr is not None
        self.process.stderr.close()
        self._folder.cleanup()

    def finish(self) -> Path:
        """Wait for it, and keep what it made. Raises CompilerError."""
        _, errors = self.process.communicate()
        if self.process.returncode != 0:
            said = errors.decode(errors="replace").strip().partition("\n")[0]
            raise CompilerError(f"{self._command}: {said or f'status {self.process.returncode}'}")
        try:
            return _keep(self._name, self._stamp, self._made.read_bytes())
        except OSError as error:
            raise CompilerError(f"{self._made}: {error.strerror or error}") from None


def _keep(name: str, stamp: str, content: bytes) -> Path:
    """Write a library where one can be written, and take away what is there of the same name and another stamp."""
    for folder in folders():
        with contextlib.suppress(OSError):
            return _written(folder, name, stamp, content)
    return _written(private_folder(), name, stamp, content)


def _written(folder: Path, name: str, stamp: str, content: bytes) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / _file_of(name, stamp)
    handle, temporary = tempfile.mkstemp(dir=folder, prefix=".rw-ekf-")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content + _seal(stamp, content))
        os.replace(temporary, path)
    except OSError:
        Path(temporary).unlink(missing_ok=True)
        raise
    for other in folder.glob(f"{name}.*.so"):
        if other != path:
            with contextlib.suppress(OSError):
                other.unlink()
    return path


def _file_of(name: str, stamp: str) -> str:
    return f"{name}.{stamp[:24]}.so"


def _seal(stamp: str, content: bytes) -> bytes:
    return hashlib.sha256(stamp.encode() + content).digest()
