"""numba, and a cache on disk that notices a change in any module whose functions are compiled in.

numba's own cache watches only the file of the function that is decorated; the equations live in other files. A stale
kernel would be silently wrong physics, so the stamp here is a digest over all of them (docs/decisions/0003).
"""

from __future__ import annotations

import contextlib
import hashlib
import inspect
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numba
from numba.core import caching
from numba.extending import register_jitable


def source_digest(modules: list[ModuleType]) -> str:
    """SHA-256 over the sources of `modules`, hexadecimal."""
    digest = hashlib.sha256()
    for module in modules:
        digest.update(inspect.getsource(module).encode())
    return digest.hexdigest()


def make_jitable(functions: list[Callable[..., Any]]) -> None:
    """Let compiled code call these plain Python functions, which stay plain Python for everyone else."""
    for function in functions:
        register_jitable(error_model="numpy", nogil=True)(function)


def compile_cached(function: Callable[..., Any], modules: list[ModuleType]) -> Callable[..., Any]:
    """Compile `function`, cached on disk until the source of any of `modules` changes.

    Division follows IEEE (no exception, so that loops stay tight) and no fused or reordered arithmetic is allowed, so
    that compiled and plain Python results agree to rounding.
    """
    stamp = source_digest(modules)

    class Provided(caching.UserProvidedCacheLocator):
        def get_source_stamp(self) -> object:
            return stamp

    class InTree(caching.InTreeCacheLocator):
        def get_source_stamp(self) -> object:
            return stamp

    class UserWide(caching.UserWideCacheLocator):
        def get_source_stamp(self) -> object:
            return stamp

    class Implementation(caching.CompileResultCacheImpl):
        _locator_classes = [Provided, InTree, UserWide]  # noqa: RUF012 - the name and kind are numba's

    class Cache(caching.FunctionCache):
        _impl_class = Implementation

        def save_overload(self, sig: Any, data: Any) -> None:
            with contextlib.suppress(OSError):  # a full disk costs the cache, not the run
                super().save_overload(sig, data)

    dispatcher = numba.njit(error_model="numpy")(function)
    with contextlib.suppress(RuntimeError):  # no folder is writable: compile in memory, every time
        dispatcher._cache = Cache(function)
    return dispatcher  # type: ignore[no-any-return]
