"""numba, and a cache on disk that notices a change in any module whose functions are compiled in.

numba's own cache watches only the file of the function that is decorated; the equations live in other files. A stale
kernel would be silently wrong physics, so the stamp here is a digest over all of them (docs/decisions/0003).
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import hashlib
import inspect
import os
import pickle
import shutil
import sys
import tempfile
import types
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import numba
from numba.core import caching
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.runtime import rtsys
from numba.extending import register_jitable

_DIGEST_BYTES = hashlib.sha256().digest_size


def source_digest(modules: list[ModuleType]) -> str:
    """SHA-256 over the sources of `modules`, hexadecimal."""
    digest = hashlib.sha256()
    for module in modules:
        digest.update(inspect.getsource(module).encode())
    return digest.hexdigest()


class _LinkedOnly(JITCodeLibrary):
    """What a function is compiled to that only kernels call: it is linked into them and optimised there, once.

    numba would optimise each one with all that it calls, and make machine code of it that nobody runs: that was half
    of the time of a first use.
    """

    def _optimize_final_module(self) -> None:
        """Leave that to the kernel."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Null: there is no machine code."""
        return 0

    @property
    def codegen(self) -> _LinkedOnly:
        """What is asked to `set_env` in the machine code."""
        return self

    def set_env(self, name: str, env: object) -> None:
        """Nothing to set."""


class _CompileToLink(Compiler):
    """numba's compiler, into a library of that kind."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.state.library = _LinkedOnly(self.state.targetctx.codegen(), "linked only")


class _CompileApart(Compiler):
    """numba's compiler, for arrays that share no memory: what was read of one stays read when another is written."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.state.flags.noalias = True


class _CompileApartToLink(_CompileToLink, _CompileApart):
    """Both: such arrays, into a library that is only linked."""


def make_jitable(functions: list[Callable[..., Any]], *, inlined: bool = False, apart: bool = False) -> None:
    """Let compiled code call these plain Python functions, which stay plain Python otherwise.

    They make no arrays: they use what they are handed, and count no references to it. Counting takes as long as a step
    of the flow, for a table of effects and the pieces of a current several times that.
    inlined: into each caller. A state, a table of effects and the pieces of a current are handed over in a hundred
    words, which takes as long as a step of the flow: worth its room for what every interval, or every column, calls.
    apart: see `compile_cached`; said of the function that holds a kernel's loop.
    """
    for function in functions:
        register_jitable(
            error_model="numpy",
            nogil=True,
            forceinline=inlined,
            _nrt=False,
            no_cfunc_wrapper=True,
            pipeline_class=_CompileApartToLink if apart else _CompileToLink,
        )(function)


class Kernel:
    """A function that numba compiles at its first call, or takes from the cache on disk.

    Ask `is_ready` before a call that a person waits for: the compiler takes seconds, holds the interpreter meanwhile,
    and does not answer a signal (`rw_ekf.compile_ahead` lets a child process do it).
    """

    interpreting = False  # of all kernels, see `interpreted`

    def __init__(
        self, plain: Callable[..., Any], dispatcher: Any, example: Callable[[], tuple[Any, ...]] | None, *, apart: bool
    ) -> None:
        """dispatcher: numba's of the plain function, or that function itself where nothing is to be compiled.

        example: gives arguments of the types that every call has; None where nobody compiles ahead. apart: what it
        writes shares no memory with another argument.
        """
        self.apart = apart
        self.dispatcher = dispatcher
        self.plain = plain
        self._example = example

    def __call__(self, *args: Any) -> Any:
        """Compute, in plain Python within `interpreted()` or `never_compiles()`."""
        return self.plain(*args) if Kernel.interpreting else self.dispatcher(*args)

    @property
    def signature(self) -> tuple[Any, ...]:
        """Numba's types of the arguments. Raises ValueError for a kernel without an example."""
        if self._example is None:
            raise ValueError(f"{self.plain.__name__}: no example of its arguments is known")
        return tuple(self.dispatcher.typeof_pyval(value) for value in self._example())

    def is_ready(self) -> bool:
        """Whether the next call runs at once: compiled in this process, or whole in the cache on disk."""
        if never_compiles():
            return False
        signature = self.signature
        if signature in self.dispatcher.overloads:
            return True
        cache = self.dispatcher._cache
        if not isinstance(cache, caching.FunctionCache):
            return False
        key = cache._index_key(signature, self.dispatcher.targetctx.codegen())
        return bool(cache._cache_file.is_whole(key))

    def compile(self) -> None:
        """Compile for the example's types, or load that from the cache."""
        self.dispatcher.compile(self.signature)


class _Sealed(caching.IndexDataCacheFile):
    """numba's cache of one function, each file behind a digest of it, of numba's version and of the sources.

    A file that a loss of power has torn, or that is of other sources or another version, is none, and so written anew.
    numba itself takes what it finds: machine code with a flipped bit ends the process, or computes something else.
    """

    def is_whole(self, key: Any) -> bool:
        """Whether there is code for these types that can be loaded."""
        name = self._load_index().get(key)
        try:
            return name is not None and bool(self._unsealed(self._data_path(name)))
        except OSError:
            return False

    def _load_index(self) -> dict[Any, str]:
        try:
            found: dict[Any, str] = self._load(self._index_path)
        except OSError:
            return {}
        return found

    def _save_index(self, overloads: dict[Any, str]) -> None:
        self._save(self._index_path, overloads)

    def _load_data(self, name: str) -> Any:
        return self._load(self._data_path(name))

    def _save_data(self, name: str, data: Any) -> None:
        self._save(self._data_path(name), data)

    def _load(self, path: str) -> Any:
        """What a file holds. Raises OSError where it is damaged, stale or names types that are no more."""
        try:
            return pickle.loads(self._unsealed(path))
        except (ValueError, AttributeError, ImportError, pickle.PickleError) as error:
            raise OSError(f"{path}: {error}") from None

    def _unsealed(self, path: str) -> bytes:
        """The content behind the digest. Raises OSError where the digest is another's."""
        with open(path, "rb") as file:
            digest, content = file.read(_DIGEST_BYTES), file.read()
        if digest != self._digest(content):
            raise OSError(f"{path}: damaged, or of other sources")
        return content

    def _save(self, path: str, found: Any) -> None:
        content = self._dump(found)
        with self._open_for_write(path) as file:
            file.write(self._digest(content) + content)

    def _digest(self, content: bytes) -> bytes:
        return hashlib.sha256(f"{self._version} {self._source_stamp}\n".encode() + content).digest()


@contextlib.contextmanager
def interpreted() -> Iterator[None]:
    """Within this, kernels run as plain Python: some hundred times slower, and never compiled."""
    Kernel.interpreting = True
    try:
        yield
    finally:
        Kernel.interpreting = False


def never_compiles() -> bool:
    """Whether numba is told to compile nothing (NUMBA_DISABLE_JIT): kernels are plain Python, and never ready."""
    return bool(numba.config.DISABLE_JIT)


@functools.cache
def private_folder() -> str:
    """Folder for the caches of this process and its children alone, where nowhere else can be written; removed at exit.

    Raises OSError where there is no room for temporary files either.
    """
    folder = tempfile.mkdtemp(prefix="rw-ekf-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def child_environment() -> dict[str, str]:
    """What a child process needs in its environment to fill the same caches."""
    return {"NUMBA_CACHE_DIR": private_folder()} if private_folder.cache_info().currsize else {}


def compile_cached(
    function: Callable[..., Any],
    modules: list[ModuleType],
    example: Callable[[], tuple[Any, ...]] | None = None,
    *,
    name: str | None = None,
    apart: bool = False,
) -> Kernel:
    """Compile `function`, cached on disk until the source of any of `modules` changes.

    The cache lies beside the source, or, where that cannot be written, with the user, or in a folder of the process.
    Division follows IEEE (no exception, so that loops stay tight) and no fused or reordered arithmetic is allowed, so
    that compiled and plain Python results agree to rounding. example: arguments of the types that calls have; name: of
    the cache, where one function makes two kernels (two processes that write one index would lose each other's entry).
    """
    stamp = source_digest([*modules, sys.modules[__name__]])  # and how they are compiled

    class Provided(caching.UserProvidedCacheLocator):
        def get_source_stamp(self) -> object:
            return stamp

    class InTree(caching.InTreeCacheLocator):
        def get_source_stamp(self) -> object:
            return stamp

    class UserWide(caching.UserWideCacheLocator):
        def get_source_stamp(self) -> object:
            return stamp

    class Private(caching.UserWideCacheLocator):
        def __init__(self, py_func: Any, py_file: str) -> None:
            super().__init__(py_func, py_file)
            self._cache_path = os.path.join(private_folder(), self.get_suitable_cache_subpath(py_file))

        def get_source_stamp(self) -> object:
            return stamp

    class Implementation(caching.CompileResultCacheImpl):
        _locator_classes = [Provided, InTree, UserWide, Private]  # noqa: RUF012 - the name and kind are numba's

    class Cache(caching.FunctionCache):
        _impl_class = Implementation

        def __init__(self, py_func: Any) -> None:
            super().__init__(py_func)
            self._cache_file.__class__ = _Sealed

        def load_overload(self, sig: Any, target_context: Any) -> Any:
            # What is loaded needs numba's runtime. Its own version reads in all that could be compiled besides: 0.3 s.
            rtsys.initialize(target_context)
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)

        def save_overload(self, sig: Any, data: Any) -> None:
            with contextlib.suppress(OSError):  # a full disk costs the cache, not the run
                super().save_overload(sig, data)

    if name is not None:
        function = _renamed(function, name)
    dispatcher = numba.njit(error_model="numpy", pipeline_class=_CompileApart if apart else Compiler)(function)
    if not never_compiles():
        with contextlib.suppress(RuntimeError, OSError):  # no folder is writable: compile in memory, every time
            dispatcher._cache = Cache(function)
    return Kernel(function, dispatcher, example, apart=apart)


def _renamed(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    """A copy under another name."""
    assert isinstance(function, types.FunctionType)
    copy = types.FunctionType(function.__code__, function.__globals__, name, function.__defaults__)
    copy.__qualname__, copy.__doc__, copy.__module__ = name, function.__doc__, function.__module__
    copy.__annotations__ = function.__annotations__
    return copy
