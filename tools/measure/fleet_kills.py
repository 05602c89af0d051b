"""Kill workers and clients of a running fleet at random moments, and look whether the results are ever others.

    python -m tools.measure.fleet_kills --times 20 [--seed 1] [--dask]

Each time a fleet is run anew by the command, a worker or the client gets SIGKILL after a random number of results, and
the command runs again. Then every result must be, byte for byte, that of a run that nobody disturbed; what stood at the
kill must not have been written again; and no temporary file may be taken for a result.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from rw_ekf.fleet.fleet_api import simulate
from rw_ekf.fleet.folder import FleetFolder
from tests.fleet.fleets import stamps_of, sums_of

_WHEELS, _DAYS = 4, 15
_AFTER_S = 0.3  # a result takes some 0.2 s: so the kill may be anywhere in the making of one


def main() -> None:
    """Kill and count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--dask", action="store_true", help="with the workers of a Dask cluster")
    args = parser.parse_args()
    rng = random.Random(args.seed)
    with tempfile.TemporaryDirectory() as name, contextlib.ExitStack() as stack:
        logs = Path(name) / "logs"
        simulate(logs, wheels=_WHEELS, days=_DAYS, seed=args.seed, torn_share=0.05)
        cluster = stack.enter_context(_cluster()) if args.dask else None
        more = [] if cluster is None else ["--scheduler", cluster[0]]
        folder = FleetFolder(logs / "fleet")
        began_s = time.perf_counter()
        _run(logs, more).wait()
        lasts_s = time.perf_counter() - began_s
        reference = sums_of(folder)
        print(f"{len(reference)} results, undisturbed in {lasts_s:.1f} s")
        same = twice = midway = killed = 0
        for number in range(args.times):
            shutil.rmtree(folder.path)
            whom = "worker" if number % 2 else "client"
            process = _run(logs, more)
            _wait(process, folder, rng.randrange(len(reference) - 1))
            time.sleep(rng.uniform(0.0, _AFTER_S))
            killed += _kill(process, whom, None if cluster is None else cluster[1], rng)
            if whom == "client":
                process.wait()
                before = stamps_of(folder)
                midway += 0 < len(before) < len(reference)
                _run(logs, more).wait()
                after = stamps_of(folder)
                twice += sum(after.get(name) != stamp for name, stamp in before.items())
            else:
                process.wait()
                _run(logs, more).wait()
            same += sums_of(folder) == reference
            print(
                f"killed {killed} of {number + 1} ({midway} clients midway): byte-identical {same}, written again "
                f"{twice}",
                flush=True,
            )
        if same < args.times:
            raise SystemExit(1)


def _wait(process: subprocess.Popen[bytes], folder: FleetFolder, results: int) -> None:
    """Until so many results are there, or the process has ended."""
    while process.poll() is None and sum(1 for _ in folder.results.rglob("part-*")) < results:
        time.sleep(0.02)


def _run(logs: Path, more: list[str]) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "rw_ekf", "fleet", "run", str(logs), *more]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def _kill(
    client: subprocess.Popen[bytes], whom: str, nannies: subprocess.Popen[bytes] | None, rng: random.Random
) -> bool:
    """SIGKILL to the client, or to one of the workers that are there; whether there was any."""
    if whom == "client":
        alive = client.poll() is None
        client.kill()
        return alive
    parents = [client.pid] if nannies is None else [nannies.pid]
    workers = [pid for parent in parents for pid in _children(parent) if b"spawn_main" in _command(pid)]
    if not workers:
        return False
    with contextlib.suppress(ProcessLookupError):
        os.kill(rng.choice(workers), signal.SIGKILL)
    return True


def _children(pid: int) -> list[int]:
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        with contextlib.suppress(OSError):
            found += [int(child) for child in task.read_text().split()]
    return found


def _command(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


_CLUSTER = """
import sys, time
from distributed import LocalCluster
if __name__ == "__main__":
    cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50)
    print(cluster.scheduler_address, flush=True)
    sys.stdin.read()
    cluster.close()
"""


@contextlib.contextmanager
def _cluster() -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """A Dask cluster of two workers in processes of its own: its address, and the process whose children they are."""
    with tempfile.NamedTemporaryFile("w", suffix=".py") as script:
        script.write(_CLUSTER)
        script.flush()
        process = subprocess.Popen([sys.executable, script.name], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert process.stdout is not None
        try:
            yield process.stdout.readline().decode().strip(), process
        finally:
            process.terminate()
            process.wait()


if __name__ == "__main__":
    main()
