"""The claim of a port: one daemon at a time, found by `stop`, and gone with its process however that ends."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from rw_ekf.clock import SystemClock
from rw_ekf.errors import DriverError
from rw_ekf.live.port_claim import PortClaim, claim_path
from rw_ekf.live.port_name import names_of
from rw_ekf.live.process import facts_of
from rw_ekf.live.running_daemon import HolderReport, holders_of, stop_holder
from tests.live.bench import ROOT, wait_for

CLOCK = SystemClock()
NOBODY = HolderReport()
HOLDER = """
import fcntl, json, os, signal, sys, time
from rw_ekf.clock import SystemClock
from rw_ekf.live.port_claim import PortClaim
signal.signal(signal.SIGTERM, lambda *_: sys.exit(0) if sys.argv[2] == "obeys" else None)
with PortClaim(sys.argv[1], SystemClock()):
    print("held", flush=True)
    while True:
        time.sleep(0.05)
"""


@pytest.fixture
def port(tmp_path: Path) -> str:
    """A port nobody else has."""
    return str(tmp_path / "wheel")


def holder(port: str, manner: str) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, port, manner], stdout=subprocess.PIPE, text=True, cwd=ROOT
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "held\n"
    process.stdout.close()
    return process


def test_nobody_holds_a_port_that_was_never_claimed(port: str) -> None:
    """stop_holder finds nobody, before a claim and after it."""
    assert stop_holder(port, CLOCK) == NOBODY
    with PortClaim(port, CLOCK):
        assert claim_path(port).exists()
    assert stop_holder(port, CLOCK) == NOBODY


def test_a_second_claim_is_refused_and_the_first_goes_on(port: str) -> None:
    """The refusal names the process that holds the port; when that is over the port is free."""
    with PortClaim(port, CLOCK):
        with pytest.raises(DriverError, match=r"process \d+.* already running"), PortClaim(port, CLOCK):
            pass
        with pytest.raises(DriverError, match="already running"), PortClaim(port, CLOCK):
            pass
    with PortClaim(port, CLOCK):
        pass


def test_stop_ends_the_holder_and_waits_for_it(port: str) -> None:
    """The holder gets SIGTERM; its number is returned when it is gone."""
    process = holder(port, "obeys")
    assert stop_holder(port, CLOCK) == HolderReport(ended=[process.pid])
    assert process.wait(5) == 0


def test_a_holder_that_does_not_end_is_killed(port: str) -> None:
    """SIGTERM is ignored: after the wait comes SIGKILL, and the report says so."""
    process = holder(port, "ignores")
    assert stop_holder(port, CLOCK, within_s=0.3) == HolderReport(ended=[process.pid], killed=[process.pid])
    assert process.wait(5) == -signal.SIGKILL


def test_a_holder_that_was_stopped_ends_in_order(port: str) -> None:
    """SIGSTOP keeps SIGTERM from acting: it is continued, so that it ends by itself and not by SIGKILL."""
    process = holder(port, "obeys")
    process.send_signal(signal.SIGSTOP)
    wait_for(lambda: (facts := facts_of(process.pid)) is not None and facts.stopped)
    assert stop_holder(port, CLOCK) == HolderReport(ended=[process.pid])
    assert process.wait(5) == 0


def test_a_killed_holder_holds_nothing(port: str) -> None:
    """After SIGKILL its number still stands in the file; nobody is signalled and the port can be claimed."""
    process = holder(port, "obeys")
    process.kill()
    process.wait()
    assert json.loads(claim_path(port).read_text())["pid"] == process.pid
    assert stop_holder(port, CLOCK) == NOBODY
    with PortClaim(port, CLOCK):
        pass


def test_a_port_is_the_same_by_any_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Relative, absolute and linked names of one port meet; two ports do not; URLs compare by host and port."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wheel").touch()
    (tmp_path / "by-id").symlink_to("wheel")
    assert names_of("wheel") & names_of(str(tmp_path / "wheel")) & names_of("./x/../wheel") & names_of("by-id")
    assert claim_path("by-id") == claim_path("wheel") != claim_path("wheel2")
    assert not names_of("wheel") & names_of("wheel2")
    assert names_of("socket://LOCALHOST:7000?logging=debug") == names_of("rfc2217://127.0.0.1:7000?ign_set_control")
    assert not names_of("socket://a.invalid:1") & names_of("socket://a.invalid:2")
    assert names_of(f"can:slcan:{tmp_path / 'wheel'}") == names_of("wheel")
    assert not names_of("can:socketcan:can0#left") & names_of("can:socketcan:can0#right")


@pytest.mark.parametrize(
    ("number", "other"),
    [
        (7010, "SOCKET://127.1:7010/"),
        (7020, "rfc2217://[::1]:7020?logging=debug"),
        (7030, "socket://[::ffff:127.0.0.1]:7030"),
    ],
)
def test_a_port_on_the_net_is_the_same_by_any_spelling(number: int, other: str) -> None:
    """A second daemon is refused however it writes the address; another port of the same host is another wheel."""
    with PortClaim(f"socket://localhost:{number}", CLOCK):
        with pytest.raises(DriverError, match="already running"), PortClaim(other, CLOCK):
            pass
        with PortClaim(other.replace(str(number), str(number + 1)), CLOCK):
            pass


def test_a_holder_whose_file_was_tidied_away_is_found(port: str) -> None:
    """The file is removed, by hand or by a tidy-up of the directory: a second daemon is refused, and stop ends it."""
    process = holder(port, "obeys")
    claim_path(port).unlink()
    with pytest.raises(DriverError, match="already running"), PortClaim(port, CLOCK):
        pass
    assert stop_holder(port, CLOCK) == HolderReport(ended=[process.pid])
    assert process.wait(5) == 0


@pytest.mark.parametrize("claims", [False, True])
def test_a_foreign_program_with_the_port_open_is_never_signalled(port: str, tmp_path: Path, claims: bool) -> None:
    """A lab's own `labctl run --config x`, which has the port open, lives on; even if it has a lock file like ours."""
    Path(port).touch()
    program = tmp_path / "labctl"
    program.write_text(
        "import fcntl, json, os, sys, time\nwheel = open(sys.argv[3])\nlock = open(sys.argv[4], 'a+')\n"
        "fcntl.flock(lock, fcntl.LOCK_EX)\nstart = open('/proc/self/stat').read().rsplit(')')[1].split()[19]\n"
        "json.dump({'pid': os.getpid(), 'start_ticks': int(start), 'names': [sys.argv[3]], 'device': None}, lock)\n"
        "lock.flush()\nprint('held', flush=True)\ntime.sleep(60)\n"
    )
    path = claim_path(port)
    lock = path if claims else tmp_path / "own.lock"
    words = [sys.executable, str(program), "run", "--config=x", port, str(lock)]
    lab = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    try:
        assert lab.stdout is not None
        assert lab.stdout.readline() == "held\n"
        report = stop_holder(port, CLOCK, within_s=0.3)
        assert (report.ended, report.killed, report.remaining) == ([], [], [])
        assert holders_of(port, CLOCK) == []
        assert len(report.notes) == int(claims)
        assert lab.poll() is None
    finally:
        lab.kill()
        lab.wait()
        assert lab.stdout is not None
        lab.stdout.close()
        lock.unlink()


@pytest.mark.parametrize("vanishes", [False, True])
def test_a_holder_is_found_under_the_other_name(tmp_path: Path, vanishes: bool) -> None:
    """The daemon has the link, stop the device; also once the link is gone with the adapter."""
    (tmp_path / "ttyUSB0").touch()
    (tmp_path / "by-id").symlink_to("ttyUSB0")
    process = holder(str(tmp_path / "by-id"), "obeys")
    if vanishes:
        (tmp_path / "by-id").unlink()
        (tmp_path / "ttyUSB0").unlink()
    with pytest.raises(DriverError, match="already running"), PortClaim(str(tmp_path / "ttyUSB0"), CLOCK):
        pass
    assert stop_holder(str(tmp_path / "ttyUSB0"), CLOCK) == HolderReport(ended=[process.pid])
    assert process.wait(5) == 0


def test_a_link_that_now_leads_elsewhere_is_another_port(tmp_path: Path) -> None:
    """After a replug the device's old name is another wheel's: the daemon behind the link is not ended for it."""
    for name in ("ttyUSB0", "ttyUSB1"):
        (tmp_path / name).touch()
    (tmp_path / "by-id").symlink_to("ttyUSB0")
    process = holder(str(tmp_path / "by-id"), "obeys")
    (tmp_path / "by-id").unlink()
    (tmp_path / "by-id").symlink_to("ttyUSB1")
    assert stop_holder(str(tmp_path / "ttyUSB0"), CLOCK) == NOBODY
    assert stop_holder(str(tmp_path / "ttyUSB1"), CLOCK) == HolderReport(ended=[process.pid])
    assert process.wait(5) == 0


LIAR = """
import fcntl, json, os, sys, time

path, content = sys.argv[1], json.loads(sys.argv[2])
descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
fcntl.flock(descriptor, fcntl.LOCK_EX)
os.pwrite(descriptor, json.dumps(content).encode(), 0)
print("held", flush=True)
time.sleep(60)
"""


@pytest.mark.parametrize("right", [(), ("start_ticks",)])
@pytest.mark.parametrize("victim_argument", ["60", "run --config F"])
def test_a_planted_claim_gets_nobody_killed(
    port: str, tmp_path: Path, right: tuple[str, ...], victim_argument: str
) -> None:
    """A locked file names a process that does not hold it, with a right start time or a wrong one: no signal, said."""
    words = [sys.executable, "-c", "import time; time.sleep(60)", *victim_argument.split()]
    victim = subprocess.Popen(words)
    wait_for(lambda: (facts := facts_of(victim.pid)) is not None and "-c" in facts.arguments)
    facts = facts_of(victim.pid)
    assert facts is not None
    path = claim_path(port)
    start = facts.start_ticks if "start_ticks" in right else 1
    content = {"pid": victim.pid, "start_ticks": start, "names": [port], "device": None}
    liar = subprocess.Popen(
        [sys.executable, "-c", LIAR, str(path), json.dumps(content)], stdout=subprocess.PIPE, text=True
    )
    try:
        assert liar.stdout is not None
        assert liar.stdout.readline() == "held\n"
        report = stop_holder(port, CLOCK, within_s=0.3)
        assert (report.ended, report.killed, report.remaining) == ([], [], [])
        assert str(victim.pid) in report.notes[0]
        assert str(path) in report.notes[0]
        assert victim.poll() is None
        assert liar.poll() is None
    finally:
        for process in (victim, liar):
            process.kill()
            process.wait()
        assert liar.stdout is not None
        liar.stdout.close()
        path.unlink()


@pytest.mark.parametrize("pid", [0, 1, -1, 2**70, True, "1", None])
def test_numbers_that_are_no_process_are_not_signalled(port: str, pid: object) -> None:
    """0 and -1 would mean many processes, 1 the system's own: whatever stands in the file, nobody is signalled."""
    content = {"pid": pid, "start_ticks": 1, "names": [port], "device": None}
    path = claim_path(port)
    liar = subprocess.Popen(
        [sys.executable, "-c", LIAR, str(path), json.dumps(content)], stdout=subprocess.PIPE, text=True
    )
    try:
        assert liar.stdout is not None
        assert liar.stdout.readline() == "held\n"
        assert stop_holder(port, CLOCK, within_s=0.1).ended == []
        assert liar.poll() is None
    finally:
        liar.kill()
        liar.wait()
        assert liar.stdout is not None
        liar.stdout.close()
        path.unlink()


@pytest.mark.parametrize("kind", ["link", "pipe", "directory", "hard link"])
def test_a_claim_that_cannot_be_made_is_an_error_with_its_path(port: str, tmp_path: Path, kind: str) -> None:
    """Something else stands where the lock file should be: an error names it, nothing is followed or waited for."""
    path = claim_path(port)
    if kind == "link":
        path.symlink_to("/etc/hostname")
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "directory":
        path.mkdir()
    else:
        path.touch()
        os.link(path, path.with_suffix(".other"))
    try:
        with pytest.raises(DriverError, match=str(path)), PortClaim(port, CLOCK):
            pass
        assert stop_holder(port, CLOCK) == NOBODY
    finally:
        path.with_suffix(".other").unlink(missing_ok=True)
        path.rmdir() if kind == "directory" else path.unlink()
