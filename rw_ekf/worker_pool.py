"""Processes for work of one's own: spawned, without the main module, dead when this one dies, deaf to Ctrl-C."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from types import ModuleType

from rw_ekf.one_thread import ask_for_one_thread
from rw_ekf.parent_process import die_with_parent


def cores() -> int:
    """How many processors this process may use."""
    return len(os.sched_getaffinity(0))


@contextmanager
def workers(most: int) -> Iterator[ProcessPoolExecutor]:
    """Processes, one for each core but no more than `most`; killed at once where something is raised."""
    pool = started_pool(max(min(cores(), most), 1))
    try:
        yield pool
    except BaseException:
        kill_pool(pool)  # an interrupt shall not wait for runs under way
        raise
    # A pool that is left without waiting for it can keep the program from ever exiting (CPython 3.11).
    pool.shutdown(wait=True)


def started_pool(count: int) -> ProcessPoolExecutor:
    """A pool whose processes have all been started."""
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(count, mp_context=context, initializer=_begin)
    try:
        with _interrupts_held(), _no_main_module():
            for _ in range(count):  # each starts a process, for none is idle yet
                pool.submit(die_with_parent)
    except BaseException:
        kill_pool(pool)
        raise
    return pool


def _begin() -> None:
    """In each process, before anything is loaded that has threads of its own."""
    die_with_parent()
    ask_for_one_thread()


def kill_pool(pool: ProcessPoolExecutor) -> None:
    """End a pool at once, whatever its processes do."""
    for process in list((pool._processes or {}).values()):
        process.kill()
    pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _no_main_module() -> Iterator[None]:
    """What is started meanwhile does not import the program's main module, which may be a script without a guard."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """What is started meanwhile never takes one: that of a terminal is the parent's affair, and comes after.

    A process inherits which signals its starter's thread blocks. Another thread of the parent may still take the
    signal, and Python then interrupts the main thread wherever it is: so the handler only notes it meanwhile.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)  # one that waited is noted now
        signal.signal(signal.SIGINT, handler)
        if came:
            signal.raise_signal(signal.SIGINT)
