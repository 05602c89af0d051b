"""How the page ends, and how it stops a wheel: neither waits behind what others ask of it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.page.run_feed import RunFeed
from rw_ekf.page.server import Access, Place
from tests.page.runs import RunOnDisk
from tests.page.test_server import Served

ROOT = Path(__file__).parents[2]
SERVES = """
import os, subprocess, sys, time
from pathlib import Path
from rw_ekf.page.server import Place
from rw_ekf.page.page_process import serve

def stop():
    print("stopping", flush=True)
    time.sleep(1.0)
    child = subprocess.run([sys.executable, "-c", "import os; print(os.nice(0))"], capture_output=True, text=True)
    return {"zero_confirmed": True, "nice": int(child.stdout)}

place = Place([Path(sys.argv[1])], stop)
place.reports._child = subprocess.Popen(["sleep", "600"])
print(os.nice(0), place.reports._child.pid, flush=True)
serve(place, "127.0.0.1", 0, lambda address: print(address, flush=True))
"""


@contextmanager
def serving(folder: Path) -> Iterator[tuple[subprocess.Popen[str], str, str, int, int]]:
    """A process that serves the page: itself, its address and token, its first niceness, what makes a report."""
    command = [sys.executable, "-c", SERVES, str(folder)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as page:
        assert page.stdout is not None
        try:
            nice, child = map(int, page.stdout.readline().split())
            address, _, token = page.stdout.readline().strip().partition("#token=")
            yield page, address, token, nice, child
        finally:
            page.kill()


def posted(address: str, token: str) -> dict[str, Any]:
    """What a stop is answered."""
    request = urllib.request.Request(f"{address}api/stop", method="POST", headers={"x-token": token})
    with urllib.request.urlopen(request, timeout=60) as answer:
        return dict(json.loads(answer.read()))


@pytest.fixture
def run(tmp_path: Path) -> RunOnDisk:
    """A run of 20 rows that lives."""
    run = RunOnDisk(tmp_path / "runs")
    run.add(20)
    run.publish()
    return run


def test_a_stop_does_not_wait_behind_what_others_ask_for(run: RunOnDisk, monkeypatch: pytest.MonkeyPatch) -> None:
    """More clients than the server has threads wait for a history that never comes; the stop is answered meanwhile."""
    waiting, over = threading.Semaphore(0), threading.Event()

    def history(*_: Any) -> dict[str, Any]:
        waiting.release()
        over.wait(60.0)
        return {}

    monkeypatch.setattr(RunFeed, "history", history)
    page = Served(Place([run.folder], lambda: {"zero_confirmed": True}), Access.of("127.0.0.1"))
    asking = [threading.Thread(target=page.get, args=("/api/history",), daemon=True) for _ in range(50)]
    try:
        for thread in asking:
            thread.start()
        for _ in range(40):  # what starlette has
            assert waiting.acquire(timeout=30.0)
        assert posted(f"{page.address}/", page.token) == {"zero_confirmed": True}
        assert not over.is_set()
    finally:
        over.set()
        for thread in asking:
            thread.join(30.0)
        page.close()


def test_what_stops_the_wheel_has_the_priority_that_the_page_gave_up(run: RunOnDisk) -> None:
    """`rw-ekf stop` starts with the niceness that the page was started with, though the page itself has a lower one."""
    with serving(run.folder) as (page, address, token, nice, _):
        assert posted(address, token)["nice"] == nice
        assert os.getpriority(os.PRIO_PROCESS, page.pid) == min(nice + 10, 19)


def test_a_page_that_ends_lets_go_of_all_and_ends_what_it_had_begun(run: RunOnDisk) -> None:
    """SIGTERM with a stream open, a stop under way and a report being made: each is ended in order, nothing is said."""
    with serving(run.folder) as (page, address, token, _, child):
        assert page.stdout is not None
        assert page.stderr is not None
        answers: list[dict[str, Any]] = []
        stopping = threading.Thread(target=lambda: answers.append(posted(address, token)))
        with urllib.request.urlopen(f"{address}api/live", timeout=60) as stream:
            assert stream.readline() == b": hello\n"
            stopping.start()
            assert page.stdout.readline() == "stopping\n"
            page.send_signal(signal.SIGTERM)
            stream.read()  # to its end; a stream that is cut raises IncompleteRead
        stopping.join(30.0)
        assert answers[0]["zero_confirmed"]
        assert page.wait(20) == -signal.SIGTERM
        assert page.stderr.read() == ""
        with pytest.raises(ProcessLookupError):
            os.kill(child, 0)


def test_a_model_that_is_being_replaced_does_not_end_the_watch(run: RunOnDisk, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that is gone between the look for it and the look at it has no time; no error leaves the look."""
    monkeypatch.setattr(RunFeed, "models", lambda feed: {"now": run.folder / "gone.yaml", "began": run.log})
    assert list(RunFeed(run.log).model_times()) == [str(run.log)]
