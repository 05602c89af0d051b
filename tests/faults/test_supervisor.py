"""A run with a parent that stays when it dies: zero from outside, a new start, and no start that nobody wants."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from tests.faults.supervised import is_there, kill, running
from tests.live.bench import Bench, driven, rw_ekf

CRASH = """
import os, signal
from rw_ekf.sinks.all_sinks import StatisticsSink
good, turns = StatisticsSink.write, 0
def bad(self, tick):
    global turns
    turns += 1
    if turns == {turn}:
        {deed}
    good(self, tick)
StatisticsSink.write = bad
"""
QUICKLY = "import rw_ekf.live.supervisor as s\ns._FIRST_PAUSE_S = 0.01\n"


def test_a_daemon_that_is_killed_leaves_the_wheel_at_zero_and_runs_again(bench: Bench) -> None:
    """Row 27: SIGKILL in mid-run: the supervisor writes zero before the next run begins, which drives the wheel again.

    `stop` then ends both, and nothing is started after it.
    """
    with running(bench, "--supervise") as run:
        first = run.child()
        run.wait(driven(bench))
        kill(first)
        run.wait(lambda: bench.registers.command_A == 0.0)
        assert len(bench.logs()) == 1, "zero came from the supervisor, not from the next run"
        run.wait(lambda: len(run.stated("daemon_died")) == 1)
        (died,) = run.stated("daemon_died")
        assert (died["pid"], died["zero_current"]) == (first, "confirmed")
        assert "SIGKILL" in died["how"]
        second = run.child(besides=(first,))
        run.wait(driven(bench))
        assert len(bench.logs()) == 2
        done = rw_ekf("stop", "--config", run.config)
        assert (run.ended(), done.returncode) == (0, 0)
        assert f"daemon {run.pid} ended" in done.stdout
        assert bench.registers.command_A == 0.0
        assert not is_there(second)
        assert len(run.stated("supervising")) == 2, "no start after a stop"


@pytest.mark.slow
@pytest.mark.parametrize(
    "deed", ["os.kill(os.getpid(), signal.SIGSEGV)", "raise RuntimeError('sabotage')", "os._exit(0)"]
)
def test_a_daemon_that_crashes_is_started_again(bench: Bench, deed: str) -> None:
    """Row 27: a segmentation fault (with a dump of where), an exit that nobody asked for: zero, and TRACKING again.

    An exception in a sink is no crash: that run goes on.
    """
    with running(bench, "--supervise", sabotage=QUICKLY + CRASH.format(turn=15, deed=deed)) as run:
        first = run.child()
        if "raise" in deed:
            run.wait(lambda: len(run.stated("sink_failed")) == 1)
            assert run.child() == first
        else:
            second = run.child(besides=(first,))
            assert second != first
            assert run.stated("daemon_died")[0]["zero_current"] == "confirmed"
            assert ("Segmentation fault" in run.text()) == ("SIGSEGV" in deed)
        run.wait(driven(bench))
        kill(run.pid, signal.SIGTERM)
        assert run.ended() == (1 if "raise" in deed else 0)
    assert bench.registers.command_A == 0.0


@pytest.mark.slow
def test_an_unhandled_exception_is_a_crash_and_too_many_end_it(bench: Bench) -> None:
    """Row 25: the estimator raises in every run: zero and a traceback each time, and after five restarts exit 1."""
    sabotage = QUICKLY + (
        "import rw_ekf.live.daemon as d\ndef bad(*a, **k): raise RuntimeError('sabotage')\nd.Estimator.step = bad\n"
    )
    with running(bench, "--supervise", sabotage=sabotage) as run:
        assert run.ended() == 1
        assert [line["zero_current"] for line in run.stated("daemon_died")] == ["confirmed"] * 6
        assert len(run.stated("supervising")) == 6
        assert len(run.stated("given_up")) == 1
        assert run.text().count("RuntimeError: sabotage") == 6
    assert bench.registers.command_A == 0.0


def test_no_room_for_a_process_is_waited_out(bench: Bench) -> None:
    """The first two forks fail, and so does one after a crash: said, tried again, and the wheel is driven again."""
    sabotage = QUICKLY + (
        "s._LONGEST_PAUSE_S = 0.05\n"
        "import os, errno\nfork, tries = os.fork, 0\n"
        "def bad():\n    global tries\n    tries += 1\n"
        "    if tries in (1, 2, 4): raise OSError(errno.EAGAIN, 'Resource temporarily unavailable')\n"
        "    return fork()\nos.fork = bad\n"
    )
    with running(bench, "--supervise", sabotage=sabotage) as run:
        first = run.child()
        assert [line["reason"] for line in run.stated("not_started")] == ["Resource temporarily unavailable"] * 2
        kill(first)
        second = run.child(besides=(first,))
        assert len(run.stated("not_started")) == 3
        assert run.stated("daemon_died")[0]["zero_current"] == "confirmed"
        kill(run.pid, signal.SIGTERM)
        assert run.ended() == 0
        assert not is_there(second)
    assert bench.registers.command_A == 0.0


@pytest.mark.slow
def test_a_daemon_that_hangs_is_killed_and_the_wheel_stopped(bench: Bench) -> None:
    """Row 29: SIGSTOP holds the whole process while the wheel is driven: killed, zero, and TRACKING again."""
    with running(bench, "--supervise") as run:
        first = run.child()
        run.wait(driven(bench))
        kill(first, signal.SIGSTOP)
        run.wait(lambda: bench.registers.command_A == 0.0)
        second = run.child(besides=(first,))
        assert "hung" in run.stated("daemon_died")[0]["how"]
        assert not is_there(first)
        run.wait(driven(bench))
        kill(second, signal.SIGSTOP)  # and `stop` while it hangs
        done = rw_ekf("stop", "--config", run.config)
        assert done.returncode == 0
        assert run.ended() == 1
        assert not is_there(second)
    assert bench.registers.command_A == 0.0


@pytest.mark.slow
def test_a_block_in_a_sink_within_the_turn_is_a_hang(bench: Bench) -> None:
    """Row 29: a sink never returns, and with it the loop: killed, zero, and TRACKING again."""
    sabotage = CRASH.format(turn=15, deed="import time; time.sleep(1e6)")
    with running(bench, "--supervise", sabotage=sabotage) as run:
        first = run.child()
        run.wait(lambda: len(run.stated("daemon_died")) == 1)
        assert run.stated("daemon_died")[0]["zero_current"] == "confirmed"
        run.child(besides=(first,))


def test_the_supervisor_s_death_ends_the_run_in_order(bench: Bench) -> None:
    """Row 27: SIGKILL to the supervisor: the child ends with zero and with its model written, and says why."""
    with running(bench, "--supervise") as run:
        child = run.child()
        run.wait(driven(bench))
        turns = len(bench.recorder.requests)
        run.wait(lambda: len(bench.recorder.requests) > turns + 80)  # some four seconds: something is learned
        kill(run.pid)
        run.process.wait()
        run.wait(lambda: not is_there(child))
        assert bench.registers.command_A == 0.0
        assert len(run.stated("supervisor_died")) == 1
        assert run.stated("ended")[0]["zero_current"] == "confirmed"
        assert run.published()["ended_utc"] is not None
        assert list(bench.runs.glob("*.model.yaml"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT", "SIGHUP", "SIGQUIT"])
def test_signals_to_the_supervisor_end_the_run(bench: Bench, name: str) -> None:
    """Row 27: each is passed on; the run ends in order, and the supervisor with its exit status."""
    with running(bench, "--supervise") as run:
        child = run.child()
        run.wait(driven(bench))
        kill(run.pid, getattr(signal, name))
        assert run.ended() == 0
        assert not is_there(child)
        assert [line["by"] for line in run.stated("ended")] == [name]
    assert bench.registers.command_A == 0.0


def test_safe_survives_a_crash_but_not_a_start_by_hand(bench: Bench) -> None:
    """Row 27: a run that is killed in SAFE begins in SAFE for the same reason until resumed; by hand it does not."""
    safe = {"safe_after_s": 1.0}
    with running(bench, "--supervise", changes={"limits": safe}) as run:
        first = run.child()
        bench.fault("freeze@0s")
        first_reason = (run.child("SAFE"), run.published()["reason"])
        bench.fault("")
        kill(first)
        second = run.child("SAFE", besides=(first,))
        assert (first, run.published()["reason"]) == first_reason
        run.wait(lambda: run.published()["link"]["state"] == "answered")
        assert run.child("SAFE") == second
        assert bench.registers.command_A == 0.0
        resumed = rw_ekf("run", "--resume", "--config", run.config)
        assert resumed.returncode == 0, resumed.stdout
        run.wait(driven(bench))
        bench.fault("freeze@0s")
        run.child("SAFE")
        bench.fault("")
        kill(run.pid, signal.SIGKILL)
        kill(second, signal.SIGKILL)
        run.process.wait()
    with running(bench, changes={"limits": safe}) as run:
        assert run.child(besides=(first, second)) == run.pid


def test_what_ends_in_order_is_not_started_again(bench: Bench) -> None:
    """Row 25: bad input (2), no such port (1), a duration that is over (0): as without a supervisor."""
    with running(bench, "--supervise", "--model", "/nowhere.yaml") as run:
        assert run.ended() == 2
    with running(bench, "--supervise", changes={"wheel": {"port": "/nowhere"}}) as run:
        assert run.ended() == 1
    with running(bench, "--supervise", "--duration", "1") as run:
        assert run.ended() == 0
        assert len(run.stated("supervising")) == 3
        assert not run.stated("restart")
    with running(bench, "--supervise") as run:
        run.child()
        second = rw_ekf("run", "--supervise", "--config", run.config)
        third = rw_ekf("run", "--config", run.config)
        for refused in (second, third):
            assert refused.returncode == 1
            assert "already running on this port" in refused.stderr
        assert run.process.poll() is None


@pytest.mark.slow
def test_a_wheel_that_comes_back_after_the_crash_is_taken_up(bench: Bench) -> None:
    """Row 27: the cable is out when the daemon is killed: tried again until the wheel is there, however often.

    One crash too many would be the second here: starts that find no wheel are none.
    """
    quickly = "import rw_ekf.live.supervisor as s\ns._LONGEST_PAUSE_S = 0.1\ns._MOST_CRASHES = 1\n"
    with running(bench, "--supervise", sabotage=quickly) as run:
        first = run.child()
        bench.unplug()
        kill(first)
        run.wait(lambda: len(run.stated("restart")) >= 4)
        assert {line["zero_current"] for line in run.stated("daemon_died")} == {"NOT confirmed"}
        bench.plug()
        run.child(besides=(first,))
        run.wait(driven(bench))
        assert not run.stated("given_up")


def test_a_run_under_nohup_does_not_end_at_sighup(bench: Bench) -> None:
    """Row 27: SIGHUP ignored at the start stays ignored, supervised and not; SIGTERM ends both as ever."""
    for options in ((), ("--supervise",)):
        with running(bench, *options, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN)) as run:
            child = run.child()
            kill(run.pid, signal.SIGHUP)
            kill(child, signal.SIGHUP)
            reported = bench.recorder.requests[-1][0]
            run.wait(lambda reported=reported: bench.recorder.requests[-1][0] > reported + 0.5)  # type: ignore[misc]
            assert is_there(child)
            kill(run.pid, signal.SIGTERM)
            assert run.ended() == 0
            assert [line["by"] for line in run.stated("ended")][-1] == "SIGTERM"


def test_the_supervisor_stays_light(bench: Bench) -> None:
    """Row 27: the parent has no numerical library in memory: to write zero takes a serial port."""
    with running(bench, "--supervise") as run:
        run.child()
        loaded = Path(f"/proc/{run.pid}/maps").read_text()
        assert not any(name in loaded for name in ("numpy", "scipy", "llvmlite", "pyarrow"))


def test_between_two_runs_the_port_stays_taken_and_stop_ends_it(bench: Bench) -> None:
    """Row 27: in the pause before a new start `status` says dead and who starts it again, no other run gets the port.

    `stop` ends the supervisor, and nothing is started; then the port is free, and a run by hand tracks.
    """
    with running(
        bench, "--supervise", sabotage="import rw_ekf.live.supervisor as s\ns._FIRST_PAUSE_S = 600.0\n"
    ) as run:
        first = run.child()
        kill(first)
        run.wait(lambda: len(run.stated("restart")) == 1)
        status = rw_ekf("status", "--config", run.config)
        assert status.returncode == 4
        assert f"process {run.pid} of user" in status.stdout
        assert "starts it again" in status.stdout
        refused = rw_ekf("run", "--config", run.config)
        assert (refused.returncode, f"process {run.pid}" in refused.stderr) == (1, True)
        stopped = rw_ekf("stop", "--config", run.config)
        assert (stopped.returncode, run.ended()) == (0, 0)
        assert "zero current confirmed" in stopped.stdout
    with running(bench) as run:
        assert run.child(besides=(first,)) == run.pid
