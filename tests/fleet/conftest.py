"""Both executors, each started once for the tests of a file: the cluster's threads must not outlive them."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.fleet.executors import Executor, ProcessExecutor
from tests.fleet.fleets import make_fleet


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """The address of a Dask cluster of two processes on this machine."""
    distributed = pytest.importorskip("distributed")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cluster: Any = distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
        )
        try:
            yield str(cluster.scheduler_address)
        finally:
            cluster.close()


@pytest.fixture(scope="module", params=["processes", "dask"])
def executor(request: pytest.FixtureRequest) -> Iterator[Executor]:
    """Each of the two executors."""
    if request.param == "processes":
        with ProcessExecutor(2) as processes:
            yield processes
    else:
        from rw_ekf.fleet.dask_executor import DaskExecutor

        with DaskExecutor(request.getfixturevalue("scheduler")) as cluster:
            yield cluster


@pytest.fixture(scope="session")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The logs of three wheels over three days; not to be changed."""
    return make_fleet(tmp_path_factory.mktemp("fleet") / "logs")
