"""The claim of a port: one daemon at a time, found by `stop`, and gone with its process however that ends."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from rw_ekf.errors import DriverError
from rw_ekf.loop.claim import PortClaim, claim_path, stop_holder
from tests.loop.bench import ROOT, wait_for

HOLDER = """
import signal, sys, time
from rw_ekf.loop.claim import PortClaim
signal.signal(signal.SIGTERM, lambda *_: sys.exit(0) if sys.argv[2] == "obeys" else None)
with PortClaim(sys.argv[1]):
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
    assert stop_holder(port) is None
    with PortClaim(port):
        assert claim_path(port).exists()
    assert stop_holder(port) is None


def test_a_second_claim_is_refused_and_the_first_goes_on(port: str) -> None:
    """The refusal names the process that holds the port; when that is over the port is free."""
    with PortClaim(port):
        with pytest.raises(DriverError, match=r"process \d+.* already running"), PortClaim(port):
            pass
        with pytest.raises(DriverError, match="already running"), PortClaim(port):
            pass
    with PortClaim(port):
        pass


def test_stop_ends_the_holder_and_waits_for_it(port: str) -> None:
    """The holder gets SIGTERM; its number is returned when it is gone."""
    process = holder(port, "obeys")
    assert stop_holder(port) == process.pid
    assert process.wait(5) == 0


def test_a_holder_that_does_not_end_is_reported(port: str) -> None:
    """In time the caller learns that the daemon has not ended, and which one it is."""
    process = holder(port, "ignores")
    try:
        with pytest.raises(DriverError, match=f"process {process.pid}"):
            stop_holder(port, within_s=0.3)
    finally:
        process.kill()
        process.wait()


def test_a_killed_holder_holds_nothing(port: str) -> None:
    """After SIGKILL its number still stands in the file; nobody is signalled and the port can be claimed."""
    process = holder(port, "obeys")
    process.kill()
    process.wait()
    assert claim_path(port).read_text() == f"{process.pid}\n"
    assert stop_holder(port) is None
    with PortClaim(port):
        pass


def test_a_port_is_the_same_by_any_spelling(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Relative and absolute names of one port are one claim; two ports are two, and URLs are taken as they are."""
    monkeypatch.chdir(tmp_path)
    assert claim_path("wheel") == claim_path(str(tmp_path / "wheel")) == claim_path("./x/../wheel")
    assert claim_path("wheel") != claim_path("wheel2")
    assert claim_path("socket://a:1") != claim_path("socket://a:2")


def test_a_claim_that_cannot_be_made_is_an_error_with_its_path(port: str) -> None:
    """Something else stands where the lock file should be: a DriverError names it, nothing is followed or replaced."""
    path = claim_path(port)
    path.symlink_to("/etc/hostname")
    try:
        with pytest.raises(DriverError, match=str(path)), PortClaim(port):
            pass
        assert stop_holder(port) is None
    finally:
        path.unlink()
    wait_for(lambda: not path.exists())
