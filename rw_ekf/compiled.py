"""Passes over a log, compiled: plain functions of Python printed as C (`rw_ekf.c_code`), for this machine's compiler.

A library is stale as soon as the source of any module whose functions are in it changes: the stamp is a digest over all
of them (docs/decisions/0052). Where there is no compiler all runs as plain Python, some hundred times slower.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
import inspect
import platform
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from rw_ekf.c_code import c_library, packing
from rw_ekf.c_code.c_library import Compilation, CompilerError, Native, compiler, kept


@functools.cache
def _source_digest(module: ModuleType) -> str:
    return hashlib.sha256(inspect.getsource(module).encode()).hexdigest()


@functools.cache
def _printer_digest() -> str:
    """Of what prints them, and of how that is compiled."""
    files = sorted(Path(c_library.__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()


def source_digest(modules: Sequence[ModuleType]) -> str:
    """SHA-256 over the sources of `modules`, hexadecimal."""
    return hashlib.sha256("".join(map(_source_digest, modules)).encode()).hexdigest()


class Kernel:
    """A plain function that runs compiled, for arguments of the types of an example.

    Query `is_ready` before a call that a person waits for (`rw_ekf.compile_ahead` compiles several at once).
    """

    interpreting = False  # of all kernels, see `interpreted`

    def __init__(
        self,
        plain: Callable[..., Any],
        modules: Sequence[ModuleType],
        example: Callable[[], Sequence[Any]],
        variant: str = "",
        *,
        result: Any = None,
        sizes_known: bool = False,
    ) -> None:
        """modules: all whose functions are compiled in. example: arguments; what is None there is None in every call.

        variant: of the name, where one function makes two kernels. result: an example of what is returned.
        sizes_known: rows and matrices of numbers that are not empty in the example have their size in every call, for
        which loops over them are written out.
        """
        self.plain = plain
        home = plain.__module__.rpartition(".")[2]
        self.name = "_".join(part for part in (home, plain.__name__.strip("_"), variant) if part)
        self._modules, self._example, self._result = modules, example, packing.Result(result)
        self._sizes_known = sizes_known
        self._native: Native | None = None

    def __call__(self, *given: Any) -> Any:
        """Compute; in plain Python within `interpreted()`, and where nothing can be compiled."""
        if Kernel.interpreting:
            return self.plain(*given)
        if self._native is None:
            try:
                self.compile()
            except CompilerError as error:
                warnings.warn(
                    f"rw_ekf runs as plain Python, some hundred times slower than compiled: {error}",
                    RuntimeWarning, stacklevel=2,
                )  # fmt: skip
                stay_plain()
                return self.plain(*given)
        assert self._native is not None
        try:
            words = self._layout.pack(given)
        except packing.ScatteredError:
            return self._call_with_copies(given)
        result = ctypes.create_string_buffer(self._result.size)
        self._native(words, result)
        return self._result.unpack(result)

    def _call_with_copies(self, given: Sequence[Any]) -> Any:
        """A call with every second element of something, or a column: what is written is written back."""
        copies: list[tuple[Any, Any]] = []
        result = self(*(packing.in_order(value, copies) for value in given))
        for array, copy in copies:
            if array.flags.writeable:
                array[...] = copy
        return result

    @functools.cached_property
    def _layout(self) -> packing.Layout:
        return packing.Layout(self._example(), sizes_known=self._sizes_known)

    @functools.cached_property
    def stamp(self) -> str:
        """Digest of all that the library is made of."""
        parts = [source_digest(self._modules), _printer_digest(), platform.machine(), sys.platform]
        return hashlib.sha256("\n".join([self.name, *parts]).encode()).hexdigest()

    def is_ready(self) -> bool:
        """Whether the next call runs at once: loaded, or whole on disk."""
        if self._native is None:
            self._native = kept(self.name, self.stamp)
        return self._native is not None

    def is_kept(self) -> bool:
        """Whether the next process finds it on disk."""
        return kept(self.name, self.stamp) is not None

    def begin(self) -> Compilation:
        """Let a compiler begin. Raises CompilerError where there is none, or where what it calls has no C."""
        compiler()  # before anything is printed
        from rw_ekf.c_code.c_kernel import kernel_text
        from rw_ekf.c_code.c_types import NotPrintableError

        sizes = self._layout.size, self._result.size
        try:
            text = kernel_text(self.plain, self._example(), *sizes, sizes_known=self._sizes_known)
        except NotPrintableError as error:  # an effect of somebody else's
            raise CompilerError(f"this has no C: {error}") from None
        return Compilation(self.name, self.stamp, text)

    def compile(self) -> None:
        """Load, or compile and load. Raises CompilerError where that does not work."""
        if self.is_ready():
            return
        with self.begin() as compilation:
            self.end(compilation)

    def end(self, compilation: Compilation) -> None:
        """Wait for a compiler, and load what it made. Raises CompilerError."""
        self._native = compilation.finish()


def stay_plain() -> None:
    """From now on this process runs all kernels as plain Python."""
    Kernel.interpreting = True


@contextlib.contextmanager
def interpreted() -> Iterator[None]:
    """Within this, kernels run as plain Python: some hundred times slower, and never compiled."""
    before, Kernel.interpreting = Kernel.interpreting, True
    try:
        yield
    finally:
        Kernel.interpreting = before
