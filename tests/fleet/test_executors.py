"""The executors keep their protocol, both by the same tests."""

from __future__ import annotations

import gc
import os
import re
import signal
import time
from pathlib import Path
from typing import Any

import pytest
import yaml

from rw_ekf.errors import BadInputError
from rw_ekf.fleet.executors import Executor, ProcessExecutor, WorkerLostError, executor_of
from tests.live.bench import wait_for

pytestmark = pytest.mark.xdist_group("fleet")


def square(number: int) -> int:
    return number * number


def refuses(number: int) -> int:
    raise ValueError(f"{number} is refused")


def dies_once(marker: str) -> str:
    """Kill its own worker, the first time."""
    path = Path(marker)
    if not path.exists():
        path.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "done"


def dies(number: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return number


def naps(seconds: float) -> float:
    time.sleep(seconds)
    return seconds


def results(executor: Executor) -> dict[str, Any]:
    return {done.key: done.error or done.result for done in executor.as_completed()}


def test_what_is_submitted_comes_back_under_its_name(executor: Executor) -> None:
    """All of it, in any order, and then no more."""
    for number in range(10):
        executor.submit(str(number), square, number)
    assert results(executor) == {str(number): number**2 for number in range(10)}
    assert results(executor) == {}
    wait_for(lambda: executor.cores == 2)  # a worker may come later than the first one's results


def test_what_is_submitted_meanwhile_comes_back_too(executor: Executor) -> None:
    """As each is done the next is begun, as a bounded window does."""
    executor.submit("0", square, 0)
    seen = []
    for done in executor.as_completed():
        seen.append(done.result)
        if len(seen) < 5:
            executor.submit(str(len(seen)), square, len(seen))
    assert seen == [0, 1, 4, 9, 16]


def test_what_a_task_raises_is_given_back(executor: Executor) -> None:
    """An error of one task ends neither the others nor the executor."""
    executor.submit("bad", refuses, 3)
    executor.submit("good", square, 3)
    found = results(executor)
    assert found["good"] == 9
    assert isinstance(found["bad"], ValueError)
    assert "3 is refused" in str(found["bad"])


def test_a_worker_that_is_killed_loses_nothing(executor: Executor, tmp_path: Path) -> None:
    """What was in flight is done again, by another."""
    executor.submit("dies", dies_once, str(tmp_path / "marker"))
    for number in range(6):
        executor.submit(str(number), square, number)
    found = results(executor)
    assert found.pop("dies") == "done"
    assert found == {str(number): number**2 for number in range(6)}


@pytest.mark.slow
def test_a_task_that_kills_every_worker_ends_by_itself(executor: Executor) -> None:
    """It is told as lost, the others are done."""
    executor.submit("dies", dies, 1)
    for number in range(6):
        executor.submit(str(number), square, number)
    found = results(executor)
    assert isinstance(found.pop("dies"), WorkerLostError)
    assert found == {str(number): number**2 for number in range(6)}


def test_processes_end_with_the_executor() -> None:
    """Where something is raised, work under way is not waited for, and no process stays."""
    executor = ProcessExecutor(2)
    executor.submit("nap", naps, 60.0)
    pool = executor._pool
    assert pool is not None
    processes = list((pool._processes or {}).values())
    executor.__exit__(KeyboardInterrupt, KeyboardInterrupt(), None)
    assert processes
    assert not any(process.is_alive() for process in processes)


@pytest.mark.filterwarnings("error::pytest.PytestUnraisableExceptionWarning")
def test_no_scheduler_is_bad_input() -> None:
    """Nobody listens there, or it is no address, without a traceback later; and workers are not counted twice."""
    pytest.importorskip("distributed")
    with pytest.raises(BadInputError, match="leave out one"):
        executor_of(2, "tcp://127.0.0.1:1")
    for address in ("nonsense", "nonsense://x:1", "tcp://", "", "tcp://127.0.0.1:1"):
        with pytest.raises(BadInputError, match="no Dask scheduler answers"):
            executor_of(None, address)
    gc.collect()  # what is left of a client speaks then


def test_the_settings_that_are_advised_are_dask_s() -> None:
    """The page says what is measured with, and Dask knows every one of the keys."""
    dask = pytest.importorskip("dask")
    pytest.importorskip("distributed")
    from rw_ekf.fleet.dask_executor import DASK_SETTINGS

    page = (Path(__file__).parents[2] / "docs" / "fleet.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```yaml\n(distributed:.*?)```", page, re.DOTALL)
    advised = yaml.safe_load(block)
    for key, value in DASK_SETTINGS.items():
        dask.config.get(key)  # raises KeyError for one that it does not have
        assert dask.config.get(key, config=advised) == value

    def leaves(node: object) -> int:
        return sum(map(leaves, node.values())) if isinstance(node, dict) else 1

    assert leaves(advised) == len(DASK_SETTINGS)
