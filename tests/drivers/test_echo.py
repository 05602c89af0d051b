"""An adapter that echoes: the echo never counts as a reply, and one that is another or missing is told as trouble."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rw_ekf.attach.opening import opener
from rw_ekf.attach.wire import checked_protocol
from rw_ekf.clock import SystemClock, VirtualClock
from rw_ekf.driver import WheelDriver
from rw_ekf.drivers.line.echo import EchoCheck, EchoError
from rw_ekf.drivers.line.register_protocol import RegisterProtocol
from rw_ekf.drivers.sim.fault_text import parse_faults
from rw_ekf.drivers.sim.faults import FaultInjector
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.virtual_line import VirtualCable
from rw_ekf.errors import DriverError
from rw_ekf.settings.load import load_configuration
from tests.live.bench import served_wheel, write_config

SERIAL_FAMILIES = ("sunspace-wheel", "nsp-wheel", "ascii-wheel", "vesc-wheel")


@given(st.binary(min_size=1, max_size=40), st.binary(max_size=40), st.lists(st.integers(1, 7), max_size=60))
def test_the_echo_is_taken_out_wherever_the_bytes_are_cut(sent: bytes, reply: bytes, cuts: list[int]) -> None:
    """What comes behind the echo comes through whole, whatever it holds, and nothing of the echo does."""
    check, came, left = EchoCheck(), b"", sent + reply
    check.note_sent(sent)
    for size in [*cuts, len(left)]:
        came += check.heard(left[:size])
        left = left[size:]
    assert came == reply
    check.judge()
    assert check.lost == 0


def test_another_echo_lets_nothing_through_and_is_counted() -> None:
    """A bit that is wrong in the echo, and no echo: two are counted, and what came behind is no reply."""
    check = EchoCheck()
    check.note_sent(b"request")
    assert check.heard(b"requesu and a reply") == b""
    check.note_sent(b"again")
    check.judge()
    assert check.lost == 2
    check.note_sent(b"well")
    assert check.heard(b"wellreply") == b"reply"


def test_eight_running_are_an_error_and_one_good_begins_anew() -> None:
    """Seven lost and one good, and no error; eight lost, and one that says what to look at."""
    check = EchoCheck()
    for _ in range(2):
        for _ in range(7):
            check.note_sent(b"request")
            check.judge()
        check.note_sent(b"request")
        check.heard(b"request")
    for _ in range(7):
        check.note_sent(b"request")
        check.judge()
    check.note_sent(b"request")
    with pytest.raises(EchoError, match=r"nothing comes back\. Two senders at once, a broken wire, or an adapter"):
        check.judge()


@contextmanager
def opened(directory: Path, family: str, faults: str, *, echo: bool = True) -> Iterator[WheelDriver]:
    """The driver on a virtual line with these faults."""
    path = write_config(directory, "nowhere", wheel={"protocol": family, "echo": echo})
    configuration, clock = load_configuration(path), VirtualClock()
    protocol = checked_protocol(configuration)
    assert isinstance(protocol, RegisterProtocol)
    plant = PlantRunner(PlantParameters(), PlantNoise(0.0), 1)
    server = protocol.electronics(protocol.wire_map, plant, faults=FaultInjector(parse_faults([faults]), 3))
    driver = opener(configuration, VirtualCable(server, clock).carrying(protocol), clock)(None)
    try:
        yield driver
        clock.sleep(1.0)
    finally:
        driver.close()


@pytest.mark.parametrize("family", SERIAL_FAMILIES)
def test_each_family_on_a_serial_line_reads_and_writes_through_an_echo(family: str, tmp_path: Path) -> None:
    """A hundred readings and currents: none is lost, and nothing that was heard is damaged or of another request."""
    with opened(tmp_path, family, "echo") as driver:
        stale = driver.link.stale
        for number in range(100):
            assert driver.read(0.1) is not None
            issued = driver.command_current(1e-3 * (number % 50))
            assert issued.acknowledged
        assert driver.link.echoes_lost == 0
        assert driver.link.damaged == 0
        assert driver.link.stale == stale


def test_a_write_of_one_byte_is_not_acknowledged_by_its_own_echo(tmp_path: Path) -> None:
    """Unchecked, the echo of a mode has the form of its reply, and zero means ok; checked, nothing is believed."""
    for echo, is_believed in ((False, True), (True, False)):
        with opened(tmp_path, "sunspace-wheel", "echo,silence@1s", echo=echo) as driver:
            assert driver.read(0.1) is not None
            driver._host.sleep(2.0)  # type: ignore[attr-defined]
            assert driver.stop_current("zero_by_mode_idle").acknowledged is is_believed


def test_collisions_cost_what_collided_and_are_counted(tmp_path: Path) -> None:
    """One in five echoes is lost: those requests are unanswered and counted, though the wheel answers all."""
    with opened(tmp_path, "sunspace-wheel", "echo:80%") as driver:
        answered = sum(driver.read(0.1) is not None for _ in range(100))
        assert 60 <= answered <= 95
        assert driver.link.echoes_lost == driver.link.timeouts


def test_a_command_that_nothing_answers_is_not_believed_without_its_echo(tmp_path: Path) -> None:
    """One in five echoes is lost, of commands and of the questions behind them: what is acknowledged had all of its."""
    with opened(tmp_path, "vesc-wheel", "echo:80%") as driver:
        acknowledged = 0
        for number in range(100):
            lost = driver.link.echoes_lost
            issued = driver.command_current(0.1 * (-1) ** number)
            assert issued.acknowledged == (driver.link.echoes_lost == lost)
            acknowledged += issued.acknowledged
        assert 30 <= acknowledged <= 70  # of a command and two questions: half
        assert driver.link.echoes_lost == driver.link.timeouts


def test_an_adapter_without_echo_is_told_at_the_start(tmp_path: Path) -> None:
    """wheel.echo on a line that does not: the error names the key and what comes back."""
    with (
        pytest.raises(DriverError, match=r"wheel\.echo is true, but .*something else comes back.*wheel\.echo: false"),
        opened(tmp_path, "sunspace-wheel", "drop:0"),
    ):
        pass


def test_an_echo_over_a_real_tty(tmp_path: Path) -> None:
    """The same over a pty with the computer's clock: what is sent, what comes back, and who answers."""
    with served_wheel(tmp_path) as bench:
        bench.fault("echo")
        configuration = load_configuration(bench.config(wheel={"echo": True}))
        driver = opener(configuration, checked_protocol(configuration), SystemClock())(None)
        try:
            read = [driver.read(0.2) for _ in range(20)]
            assert sum(sample is not None for sample in read) >= 15
            assert driver.link.damaged == 0
        finally:
            driver.close()
