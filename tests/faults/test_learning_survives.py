"""Row 27: a SIGKILL or a power cut at any moment costs a minute of learning at most, and never leaves half a file."""

from __future__ import annotations

import contextlib
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from rw_ekf.learning.learned_file import read_learned
from rw_ekf.settings.load import load_configuration
from rw_ekf.sinks.run_files import RunFiles, learned_path
from tests.faults.rig import BEGAN, LineWheel
from tests.live.bench import ROOT, Bench, document_of, driven, rw_ekf, served_wheel, wait_for, write_config
from tests.live.virtual import USUAL, run, setting

QUICK = (  # the daemon's own command line, saving what it learned twice a second
    "import sys; from rw_ekf.sinks import all_sinks; all_sinks.LEARNED_EVERY_S = 0.5;"
    "from rw_ekf.cli import main; sys.exit(main(sys.argv[1:]))"
)
TRUTH = 15.205


def saved_after(directory: Path, moment: datetime) -> datetime | None:
    """When the file there was saved, once that is later than `moment`; its thread keeps the computer's time."""
    end_s = time.monotonic() + 20.0
    while time.monotonic() < end_s:
        files = list(directory.glob("*.learned.yaml"))
        if len(files) == 1 and read_learned(files[0]).saved >= moment:
            return read_learned(files[0]).saved
        time.sleep(0.002)
    return None


def test_whenever_it_ends_a_minute_is_lost_at_most(tmp_path: Path) -> None:
    """Row 27: twelve moments of an hour, faults in between: what lies on the disk then is whole and a minute old."""
    draw = random.Random(4)
    began = datetime(2000, 1, 1, tzinfo=BEGAN.tzinfo)
    moments = sorted(draw.uniform(70.0, 3500.0) for _ in range(12))
    path = tmp_path / "runs"
    ages: list[float] = []

    def look(at_s: float) -> Any:
        def happen(wheel: object, stop: object) -> None:
            now = began + timedelta(seconds=at_s)
            saved = saved_after(path, now - timedelta(seconds=61.0))
            assert saved is not None
            ages.append((now - saved).total_seconds())

        return happen

    faults = [(1000.2, setting(silent=True)), (1001.9, setting(silent=False))]
    events = sorted([(at, look(at)) for at in moments] + faults, key=lambda event: event[0])
    run(tmp_path, 3600.0, *events, command=USUAL["command"] | {"confirm_sign": True})
    assert len(ages) == 12
    assert max(ages) < 61.0


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A wheel on a pty."""
    with served_wheel(tmp_path, initial_speed_rad_s=0.0) as made:
        yield made


@contextlib.contextmanager
def quick(config: str) -> Iterator[subprocess.Popen[bytes]]:
    """A daemon in a process of its own that saves twice a second."""
    command = [sys.executable, "-W", "ignore", "-c", QUICK, "run", "--config", config]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            yield process
        finally:
            process.kill()


def test_a_killed_daemon_s_learning_is_gone_on_from(bench: Bench) -> None:
    """Row 27: SIGKILL four times over: each start but the first goes on, the file is whole, nothing else is left."""
    config = str(bench.config(command={"confirm_sign": True}))
    path = learned_path(load_configuration(Path(config)))
    since = datetime.now(BEGAN.tzinfo)
    for _ in range(4):
        with quick(config) as daemon:
            wait_for(lambda since=since: path.exists() and read_learned(path).saved > since, 60.0)  # type: ignore[misc]
            daemon.send_signal(signal.SIGKILL)
            daemon.wait()
        since = read_learned(path).saved
    done = rw_ekf("run", "--config", config, "--duration", "1", "--json", timeout=120)
    assert done.returncode == 0, done.stderr
    start = document_of(done.stdout)["start"]
    assert start["from"] == "learned"
    assert start["learned_not_used"] is None
    assert "learned_continued" in done.stderr
    assert read_learned(path).saved > since
    assert [p.name for p in path.parent.iterdir() if p.name.endswith(".learned.yaml")] == [path.name]
    assert bench.registers.command_A == 0.0


def test_two_wheels_of_one_name_learn_apart(tmp_path: Path) -> None:
    """Row 28: one directory, one name, two ports: two learned files and two state files, each of its own wheel."""
    files = {}
    for port in ("/dev/ttyUSB0", "/dev/ttyUSB1", "/dev/serial/by-id/ttyUSB0"):
        configuration = load_configuration(write_config(tmp_path, port))
        named = RunFiles.of_run(configuration, BEGAN)
        files[port] = (named.learned, named.state)
    assert len({name for pair in files.values() for name in pair}) == 6
    assert all(name.parent == tmp_path / "runs" for pair in files.values() for name in pair)
    (one, two) = (tmp_path / name for name in ("one", "two"))
    for place, serial in ((one, 1), (two, 2)):
        place.mkdir()
        LineWheel(place, serial_number=serial).run(30.0, output={"directory": str(tmp_path / "shared")})
    learned = sorted((tmp_path / "shared").glob("*.learned.yaml"))
    assert sorted(read_learned(path).wheel.serial_number or 0 for path in learned) == [1, 2]
    assert not list((tmp_path / "shared").glob("*.replaced.yaml"))


def test_a_new_wheel_on_a_pty_is_moved_and_then_driven(bench: Bench) -> None:
    """Row 19: the program as it is started by hand: the move, said, then the profile; the second run begins with it."""
    config = str(bench.config(command={"confirm_sign": True, "amplitude_A": 0.4}))
    first = rw_ekf("run", "--config", config, "--duration", "9", "--json", timeout=120)
    assert first.returncode == 0, first.stderr
    assert first.stderr.count("confirming_sign") == 1
    assert first.stderr.count("sign_confirmed") == 1
    assert document_of(first.stdout)["start"]["sign_confirmed"] is True
    writes = bench.recorder.writes_A()
    large = next(i for i, current in enumerate(writes) if abs(current) > 0.2)
    assert large >= 20
    assert {1, -1} <= {round(current * 10.0) for current in writes[:large]}
    bench.recorder.requests.clear()
    second = rw_ekf("run", "--config", config, "--duration", "2", "--json", timeout=120)
    assert "confirming_sign" not in second.stderr
    assert driven(bench)() is False
    assert abs(max(bench.recorder.writes_A()[:12], key=abs)) > 0.2
