"""Options of the whole suite, kernels compiled before it begins, and the order in which several processes take it."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
import time
from collections.abc import Iterator

import pytest

from rw_ekf.one_thread import ask_for_one_thread

ask_for_one_thread()  # before numpy is loaded

_BEGAN_S = time.time()
_SETTLED_S = 60.0
_WAITING = 1  # two more were no faster beside other work, and a reply was late


def pytest_addoption(parser: pytest.Parser) -> None:
    """--refresh-golden: write the golden numbers anew; in a commit of its own that says why."""
    parser.addoption("--refresh-golden", action="store_true", help="write tests/golden/ anew instead of comparing")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int | None:
    """What `-n auto` means here: more processes than cores, for many tests wait for a daemon's time to pass.

    With as many as cores, two cores had a load of .1 to 1.3 in the second half of the suite. A process takes half a
    gigabyte, or one where it reads a million samples, so that a machine of many cores gets no more of them than that.
    """
    if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ:
        return None  # as pytest-xdist reads it
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return cores + _WAITING


def pytest_configure(config: pytest.Config) -> None:
    """Under nohup hang-ups stay without effect here, but what the tests start does not inherit that."""
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:
        signal.signal(signal.SIGHUP, lambda *_: None)  # a handler, other than SIG_IGN, ends where a program begins


def pytest_sessionstart(session: pytest.Session) -> None:
    """Tests begin with a warm cache, as every use but the first does; what a cold one says has tests of its own.

    Where pytest-xdist distributes the tests, only the process that starts the others compiles.
    """
    if hasattr(session.config, "workerinput") or session.config.option.collectonly:
        return
    from rw_ekf.compile_ahead import DIAGNOSIS, cold, compile_all

    missing = cold(DIAGNOSIS)
    if missing:
        compile_all(missing)


@pytest.fixture(scope="module", autouse=True)
def _no_thousands_of_claims() -> Iterator[None]:
    """Remove the lock files that tests have left: every daemon looks at all there are as it starts.

    Those that are empty, as a daemon leaves them; one written within the last minute may be about to be locked again.
    """
    yield
    claim = sys.modules.get("rw_ekf.live.port_claim")
    if claim is None:
        return
    for path in claim.shared_directory().glob(f"rw-ekf-{os.geteuid()}-*.lock"):
        with contextlib.suppress(OSError):  # another process was first
            file = path.stat()
            if file.st_size == 0 and _BEGAN_S < file.st_mtime < time.time() - _SETTLED_S:
                path.unlink()


def pytest_collection_finish() -> None:
    """What the collection made stays to the end: no collection of garbage looks through it again and again."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(tryfirst=True)  # before pytest-xdist reads the groups
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Where several processes share the tests, long ones come first: none is left alone with one at the end.

    Groups with a slow test, of which one process has the whole, then slow tests, then groups, then all others.
    """
    if hasattr(config, "workerinput"):
        for item in items:
            if item.get_closest_marker("xdist_group") is None and _shares_with_its_module(item):
                item.add_marker(pytest.mark.xdist_group(item.nodeid.partition("::")[0]))
        items.sort(key=lambda item: [item.get_closest_marker(name) is None for name in ("slow", "xdist_group")])


def _shares_with_its_module(item: pytest.Item) -> bool:
    """Whether it takes what is made once for all tests of its file, which each process would make for itself."""
    assert isinstance(item, pytest.Function)
    of_file = item.nodeid.partition("::")[0]
    made = (fixtures[-1] for fixtures in item._fixtureinfo.name2fixturedefs.values())
    return any(fixture.scope == "module" and fixture.baseid == of_file for fixture in made)
