"""The list of faults on a line of four wheels: those of the port, the clock, the disk and the files of one of them.

That the others go on, and that every wheel gets its zero, is asserted of each. With `test_bus_rows.py`, which has the
faults of the wheel and of the line, and `tests/live/test_bus_from_outside.py`, which has the process's, no row is left.
"""

from __future__ import annotations

import os
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime, timedelta
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import serial

from rw_ekf.attach.opening import SharedLine
from rw_ekf.attach.wire import checked_protocol
from rw_ekf.clock import SystemClock, VirtualClock
from rw_ekf.drivers.sim.fault_text import parse_faults
from rw_ekf.errors import DriverError
from rw_ekf.logs.reader import read_log
from tests.faults.ports import Failing
from tests.faults.test_bus_rows import assert_recovered
from tests.faults.test_network_ports import URLS, Bridge
from tests.faults.test_opening import Reported
from tests.faults.test_other_readers import MODEM_MANAGER
from tests.faults.test_spikes_and_time import HostClock
from tests.faults.test_unplugged import ERRORS
from tests.live.bench import program, wait_for
from tests.live.bus import FAMILIES, NAMES, BusBench, BusRan, make_bus, run_bus, served_bus, write_bus
from tests.live.test_blind_wheel import wrong_map
from tests.live.test_bus_from_outside import is_driven

EACH_FAMILY = pytest.mark.parametrize("family", FAMILIES)
STRUCK, OTHERS = "rw-y", tuple(name for name in NAMES if name != "rw-y")
LONG_S = 60.0


def assert_undisturbed(bench: BusBench, ran: BusRan, names: tuple[str, ...] = OTHERS) -> None:
    """None of these lost a turn or a row, and each is at zero, confirmed."""
    for name in names:
        assert ran.outcome(name).timing.overruns == 0
        assert ran.outcome(name).statistics.missing == 0
        assert ran.notes[name].states[-1] == "TRACKING"
        assert max(map(abs, bench[name].currents_A)) > 0.05
        assert bench[name].electronics.command_A == 0.0
        assert ran.outcome(name).zero_confirmed


@pytest.mark.slow
@pytest.mark.parametrize("error", [ERRORS[0], ERRORS[-1]], ids=lambda error: type(error).__name__)
def test_any_call_of_the_shared_port_may_fail(tmp_path: Path, error: BaseException) -> None:
    """On a line, row 3: at some of thousands of calls: opened once anew, all tracked, then zero.

    Before any wheel has answered it ends the run, and nothing was written.
    """
    went_on = 0
    for at_call in (1, 5, 148, 403, 700, 1103, 1801, 2600, 3000, 3905):
        directory = tmp_path / str(at_call)
        directory.mkdir()
        ports: list[Failing] = []

        def wrap(port: Any, at_call: int = at_call, ports: list[Failing] = ports) -> Any:
            ports.append(Failing(port, at_call if not ports else -1, error))
            return ports[-1]

        bench = make_bus(directory, "nowhere")
        try:
            ran = run_bus(
                bench, 3.0 + at_call / 750.0, wrap=wrap
            )  # some hundreds of calls a second, and time to recover
        except DriverError:  # at the start, as where the port of one wheel cannot be opened
            assert not any(wheel.written for wheel in bench.wheels)
            continue
        went_on += 1
        assert ports[0].raised
        assert len(ports) == 2
        for name in NAMES:
            assert ran.notes[name].states[-1] == "TRACKING", (at_call, name, ran.notes[name].stated)
            assert ran.outcome(name).zero_confirmed
            assert bench[name].electronics.command_A == 0.0
    assert went_on >= 6


@EACH_FAMILY
def test_wheels_that_an_opening_has_reset_are_found(family: str, tmp_path: Path) -> None:
    """On a line, row 6: all restart while the port is out: zero first to each, said, a new segment, driven again."""
    bench = make_bus(tmp_path, "nowhere", family, "echo,hangup@10s:3s")

    def restart(_: Any) -> None:
        for wheel in bench.wheels:
            wheel.electronics.restart()

    ran = run_bus(bench, 30.0, (12.9, restart))
    assert_recovered(bench, ran, NAMES)
    for name in NAMES:
        assert next(current for at_s, current in bench[name].written if at_s > 12.9) == 0.0
        assert "wheel_restarted" in ran.notes[name].events
        assert np.unique(read_log(ran.outcome(name).files.log).segment).size >= 2


@pytest.mark.parametrize("field", ["speed", "current_command"])
@EACH_FAMILY
def test_a_sign_that_is_wrong_for_one_wheel_never_sees_its_profile(family: str, field: str, tmp_path: Path) -> None:
    """On a line, row 19: the one whose map has it is in SAFE within the move, and at zero; the others are driven."""
    protocol = wrong_map(tmp_path, field, -1.0, family)
    moved: dict[str, Any] = {"command": {"confirm_sign": True}}
    entries = {NAMES[0]: moved, STRUCK: moved | {"protocol": protocol}}
    bench = make_bus(tmp_path, "nowhere", family, wheels=entries)
    ran = run_bus(bench, 40.0)
    assert_undisturbed(bench, ran)
    assert "sign_confirmed" in ran.notes[NAMES[0]].events
    assert "wrong_sign" in ran.notes[STRUCK].events
    assert ran.outcome(STRUCK).state.state.value == "SAFE"
    assert {current for at_s, current in bench[STRUCK].written if at_s > 13.0} == {0.0}  # a move lasts no longer
    assert bench[STRUCK].electronics.command_A == 0.0


def test_the_hour_is_a_label_for_every_wheel(tmp_path: Path) -> None:
    """On a line, row 21: set by one either way in a run: every reading, estimate and state is as without it."""
    ran = []
    for later in (0.0, 1.0, -1.0):
        directory = tmp_path / f"{later:g}"
        directory.mkdir()
        clock = HostClock()
        set_hour = lambda _, clock=clock, later=later: clock.set_hour(timedelta(hours=later))  # noqa: E731
        bench = make_bus(directory, "nowhere")
        ran.append(run_bus(bench, 20.0, (10.0, set_hour), clock=clock))
        assert_undisturbed(bench, ran[-1], NAMES)
    for name, stepped in product(NAMES, ran[1:]):
        logs = [read_log(one.outcome(name).files.log) for one in (ran[0], stepped)]
        assert np.array_equal(logs[0].time_s, logs[1].time_s)
        assert np.array_equal(logs[0].speed_rad_s, logs[1].speed_rad_s)
        assert np.array_equal(ran[0].outcome(name).belief.mean, stepped.outcome(name).belief.mean)
        assert ran[0].notes[name].states == stepped.notes[name].states


def test_a_folder_that_vanishes_is_one_wheel_s_loss(tmp_path: Path) -> None:
    """On a line, row 26: its own directory is removed, and made again: counted and said once for it, not for others."""
    own = tmp_path / "own"
    bench = make_bus(tmp_path, "nowhere", wheels={STRUCK: {"output": {"directory": str(own)}}})
    ran = run_bus(
        bench, 30.0, (10.0, lambda _: shutil.rmtree(own.rename(tmp_path / "gone"))), (20.0, lambda _: own.mkdir())
    )
    assert_undisturbed(bench, ran, NAMES)
    assert ran.notes[STRUCK].events.count("not_written") == 1
    assert ran.outcome(STRUCK).unwritten.log_rows > 0
    for name in OTHERS:
        assert "not_written" not in ran.notes[name].events
        assert ran.outcome(name).unwritten.log_rows == 0
        assert len(read_log(ran.outcome(name).files.log)) == ran.outcome(name).statistics.samples


def test_a_folder_that_vanishes_for_all_ends_no_run(tmp_path: Path) -> None:
    """On a line, row 26: the one folder of all four: every wheel is driven on, and counts its own."""
    bench = make_bus(tmp_path, "nowhere")
    ran = run_bus(bench, 20.0, (10.0, lambda _: shutil.rmtree((tmp_path / "runs").rename(tmp_path / "gone"))))
    assert_undisturbed(bench, ran, NAMES)
    for name in NAMES:
        assert ran.notes[name].events.count("not_written") == 1
        assert 0 < ran.outcome(name).unwritten.log_rows < ran.outcome(name).statistics.samples


@pytest.fixture(scope="module")
def first_minute(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What a first run of a minute leaves, made once for the tests of what is learned, which share a process."""
    directory = tmp_path_factory.mktemp("first-minute")
    run_bus(make_bus(directory, "nowhere"), 60.0)
    return directory / "runs"


@pytest.mark.xdist_group("learned on a line")
def test_what_was_learned_of_one_wheel_is_not_taken_for_another(tmp_path: Path, first_minute: Path) -> None:
    """On a line, row 28: two have changed their addresses: both begin from the configuration, the others go on."""
    shutil.copytree(first_minute, tmp_path / "runs")
    bench = make_bus(tmp_path, "nowhere")
    bench["rw-y"].electronics._serial_number, bench["rw-z"].electronics._serial_number = 3, 2
    ran = run_bus(bench, 20.0, clock=VirtualClock(datetime(2000, 1, 1, 1, tzinfo=UTC)))
    assert_undisturbed(bench, ran, NAMES)
    began = {name: ran.outcome(name).start["from"] for name in NAMES}
    assert began == {"rw-x": "learned", "rw-y": "configuration", "rw-z": "configuration", "rw-skew": "learned"}
    assert "it is of the wheel with serial number" in str(ran.outcome(STRUCK).start["learned_not_used"])


@pytest.mark.xdist_group("learned on a line")
def test_a_learned_file_that_is_none_is_its_own_wheel_s_affair(tmp_path: Path, first_minute: Path) -> None:
    """On a line, row 28: torn, it is not used for that wheel, with the reason; the others go on from theirs."""
    shutil.copytree(first_minute, tmp_path / "runs")
    (path,) = (tmp_path / "runs").glob(f"{STRUCK}*.learned.yaml")
    path.write_text(path.read_text(encoding="utf-8")[:200], encoding="utf-8")
    bench = make_bus(tmp_path, "nowhere")
    ran = run_bus(bench, 20.0, clock=VirtualClock(datetime(2000, 1, 1, 1, tzinfo=UTC)))
    assert_undisturbed(bench, ran, NAMES)
    assert {name: ran.outcome(name).start["from"] for name in OTHERS} == dict.fromkeys(OTHERS, "learned")
    assert ran.outcome(STRUCK).start["from"] == "configuration"


@pytest.mark.xdist_group("learned on a line")
def test_a_model_of_another_wheel_drives_none(tmp_path: Path, first_minute: Path) -> None:
    """On a line, row 28: given to one of four: its run is refused, it is sent zero alone; the others are driven."""
    shutil.copytree(first_minute, tmp_path / "runs")
    (model,) = (tmp_path / "runs").glob("*_rw-z.model.yaml")
    bench = make_bus(tmp_path, "nowhere", wheels={STRUCK: {"filter": {"model": str(model)}}})
    ran = run_bus(bench, 20.0, clock=VirtualClock(datetime(2000, 1, 1, 1, tzinfo=UTC)))
    assert_undisturbed(bench, ran)
    assert "would drive a wheel with a model of another" in (ran.wheels[STRUCK].failure or "")
    assert set(bench[STRUCK].currents_A) <= {0.0}
    assert bench[STRUCK].electronics.command_A == 0.0


def _answers(line: SharedLine, index: int) -> bool:
    try:
        line.opener(index)(None).close()
    except DriverError:  # a boot loader that refuses, or a slot that is over
        return False
    return True


# --- on a tty, from outside ---------------------------------------------------------------------------------------


@contextmanager
def driven_line(directory: Path) -> Iterator[tuple[BusBench, Callable[[], None]]]:
    """A daemon that drives all four, and what asserts that it drives them again; at the end it is told to stop.

    Its zeroes are confirmed then, by every wheel.
    """
    with served_bus(directory) as bench:
        with program("run", "--config", str(bench.path)) as run:

            def drives() -> None:
                counts = {name: len(bench[name].written) for name in NAMES}
                wait_for(lambda: all(len(bench[name].written) > counts[name] + 5 for name in NAMES), LONG_S)
                wait_for(lambda: all(is_driven(bench, name) for name in NAMES), LONG_S)

            drives()
            yield bench, drives
            run.terminate()
            _, errors = run.communicate(timeout=LONG_S)
        assert run.returncode == 0, errors
        assert "Traceback" not in errors
        assert {wheel.electronics.command_A for wheel in bench.wheels} == {0.0}


@pytest.mark.slow
def test_the_port_comes_back_as_another_device(tmp_path: Path) -> None:
    """On a line, row 2: the old number is taken, the link leads to a new one: opened there, zero to every wheel."""
    with driven_line(tmp_path) as (bench, drives):
        link = tmp_path / "bus"
        old, counts = os.readlink(link), {name: len(bench[name].written) for name in NAMES}
        bench.line.faults.put(*parse_faults(["hangup"]))
        wait_for(lambda: not link.is_symlink(), LONG_S)
        bench.line.faults.put(*parse_faults(["echo"]))
        wait_for(lambda: link.is_symlink() and os.readlink(link) != old, LONG_S)
        drives()
        for name in NAMES:
            assert 0.0 in bench[name].currents_A[counts[name] :]


@pytest.mark.slow
def test_a_thief_of_answers_costs_readings_and_no_wheel(tmp_path: Path) -> None:
    """On a line, row 4: another process reads the port for seconds: what is missed is missed; then all are driven."""
    with driven_line(tmp_path) as (_, drives):
        over, stolen = threading.Event(), []
        thief = os.open(tmp_path / "bus", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

        def steal() -> None:
            while not over.is_set():
                with suppress(BlockingIOError):
                    stolen.append(os.read(thief, 64))
                over.wait(0.0005)

        thread = threading.Thread(target=steal)
        thread.start()
        wait_for(lambda: len(stolen) > 100, LONG_S)
        over.set()
        thread.join()
        os.close(thief)
        drives()
    for path in (tmp_path / "runs").glob("*_rw-?.csv"):
        assert np.nanmax(np.abs(read_log(path).speed_rad_s)) < 200.0  # none is wrong


@pytest.mark.slow
def test_a_second_daemon_and_a_second_opening_are_told(tmp_path: Path) -> None:
    """On a line, row 4: of the line, and of one of its wheels: refused while the first drives, which goes on."""
    with driven_line(tmp_path) as (_, drives):
        for one in ([], ["--wheel", "rw-y"]):
            with program("run", "--config", str(tmp_path / "bus.yaml"), *one) as second:
                _, errors = second.communicate(timeout=LONG_S)
            assert second.returncode == 1
            assert "already running on this port" in errors
        drives()


@pytest.mark.slow
def test_what_a_modem_manager_writes_costs_no_wheel(tmp_path: Path) -> None:
    """On a line, row 5: AT commands on the line from both ends while four wheels are driven: they are driven on."""
    with driven_line(tmp_path) as (_, drives):
        stranger = os.open(tmp_path / "bus", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        for _ in range(20):
            os.write(stranger, MODEM_MANAGER)
            time.sleep(0.05)
        os.close(stranger)
        drives()


@pytest.mark.slow
def test_the_modem_lines_of_a_shared_port_are_set_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a line, row 6: before it is opened, for all wheels; no wheel that comes later touches them."""
    made: list[Reported] = []

    def for_url(url: str, do_not_open: bool = False, **options: Any) -> Reported:
        made.append(Reported(None, **options))
        made[-1].port = url
        return made[-1]

    monkeypatch.setattr(serial, "serial_for_url", for_url)
    with served_bus(tmp_path, wheel={"dtr": False, "rts": True}) as bench:
        protocols = [checked_protocol(one) for one in bench.configurations]
        line = SharedLine(bench.configurations, protocols, SystemClock())
        for index in range(len(NAMES)):
            wait_for(lambda index=index: _answers(line, index), LONG_S)  # type: ignore[misc]
        line.close()
    assert len(made) == 1
    assert made[0].calls == [("open", None), ("dtr", False), ("rts", True), ("low_latency", True)]


@pytest.mark.slow
@pytest.mark.parametrize("kind", URLS)
@pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")  # pyserial 3.5 calls them
def test_a_terminal_server_of_a_line_that_restarts(kind: str, tmp_path: Path) -> None:
    """On a line, row 30: killed twice under four wheels: opened anew, every wheel is sent zero and driven again."""
    with served_bus(tmp_path) as bench:
        bridge = Bridge(str(tmp_path / "bus"), 0, kind == "rfc2217")
        port = bridge.port
        config = write_bus(tmp_path, URLS[kind].format(port), loop={"rate_hz": 5.0, "reply_timeout_ms": 90.0})

        def was_sent_zero(since: dict[str, int]) -> bool:
            return all(0.0 in bench[name].currents_A[since[name] :] for name in NAMES)

        with program("run", "--config", str(config)) as run:
            for _ in range(2):
                wait_for(lambda: all(is_driven(bench, name) for name in NAMES), LONG_S)
                bridge.stop()
                counts = {name: len(bench[name].written) for name in NAMES}
                bridge = Bridge(str(tmp_path / "bus"), port, kind == "rfc2217")
                wait_for(lambda counts=counts: was_sent_zero(counts), LONG_S)  # type: ignore[misc]
            wait_for(lambda: all(is_driven(bench, name) for name in NAMES), LONG_S)
            run.terminate()
            _, errors = run.communicate(timeout=LONG_S)
        bridge.stop()
        assert run.returncode == 0, errors
        assert {wheel.electronics.command_A for wheel in bench.wheels} == {0.0}
