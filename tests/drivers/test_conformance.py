"""One suite for every driver: what the loop may rely on, whatever the wheel is."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import pytest

from rw_ekf.clock import SystemClock
from rw_ekf.driver import WheelDriver
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.drivers.replay_wheel import ReplayWheel
from rw_ekf.drivers.sim.register_server import RegisterServer
from rw_ekf.drivers.sim.simulated_wheel import SimulatedWheel
from rw_ekf.errors import DriverError, EndOfRecord
from rw_ekf.records import IssuedCommand, WheelSample
from tests.serial_wheels import open_serial_wheel

CLOCK = SystemClock()

Served = Callable[..., AbstractContextManager[RegisterServer]]


class Backend(NamedTuple):
    """A driver with what is true of its kind."""

    driver: WheelDriver
    scheme: str
    takes_commands: bool


def recorded() -> ReplayWheel:
    """A short record."""
    rows = [
        (WheelSample(time_s=i * 0.1, speed_rad_s=50.0 + i * 0.01, current_A=0.1), IssuedCommand(0.1, 0.012))
        for i in range(50)
    ]
    return ReplayWheel(rows, "run_012.csv")


@pytest.fixture(params=["serial", "simulated", "replay"])
def backend(request: pytest.FixtureRequest, wire_map: WireMap, served: Served, tmp_path: Path) -> Iterator[Backend]:
    """Each driver in turn, closed again behind the test."""
    if request.param == "serial":
        with served(wire_map, tmp_path / "wheel"):
            wheel = open_serial_wheel(str(tmp_path / "wheel"), wire_map, CLOCK, 0.2)
            yield Backend(wheel, "serial+", True)
            wheel.close()
    elif request.param == "simulated":
        yield Backend(SimulatedWheel(initial_speed_rad_s=50.0), "sim+", True)
    else:
        yield Backend(recorded(), "replay+", False)


def test_it_is_a_wheel_driver_that_says_where_its_data_comes_from(backend: Backend) -> None:
    """The protocol's members are there, and no record hides its source."""
    assert isinstance(backend.driver, WheelDriver)
    assert backend.driver.source.startswith(backend.scheme)


def test_samples_are_si_and_time_moves_on(backend: Backend) -> None:
    """Ten reads give ten samples at increasing times, with a finite speed near the true 50 rad/s."""
    samples = [backend.driver.read(1.0) for _ in range(10)]
    times = [sample.time_s for sample in samples if sample is not None]
    assert len(times) == 10
    assert all(late > early for early, late in pairwise(times))
    assert all(sample.speed_rad_s == pytest.approx(50.0, abs=1.0) for sample in samples if sample is not None)
    assert {sample.segment for sample in samples if sample is not None} == {0}


def test_a_command_reports_what_went_out_and_when_it_acts(backend: Backend) -> None:
    """The issued current is finite and comes with a delay of milliseconds behind the sample."""
    backend.driver.read(1.0)
    issued = backend.driver.command_current(0.1)
    assert issued.acknowledged
    assert issued.current_A == pytest.approx(0.1, abs=1e-4)
    assert 0.0 < issued.delay_s < 5.0  # seconds, not milliseconds; a busy machine may be late


def test_a_command_reaches_the_wheel(backend: Backend) -> None:
    """The current commanded is the one in force at the next sample (a record goes its own way)."""
    backend.driver.read(1.0)
    backend.driver.command_current(-0.25)
    sample = backend.driver.read(1.0)
    assert sample is not None
    assert sample.current_A == pytest.approx(-0.25 if backend.takes_commands else 0.1, abs=1e-4)


def test_a_current_that_is_no_number_never_goes_out(backend: Backend) -> None:
    """NaN is refused by every driver that commands anything."""
    if backend.takes_commands:
        with pytest.raises(DriverError, match="finite"):
            backend.driver.command_current(math.nan)


def test_closing_twice_is_safe_and_nothing_is_read_afterwards(backend: Backend) -> None:
    """close() may come from several ways out; a closed driver says so instead of giving data."""
    backend.driver.close()
    backend.driver.close()
    with pytest.raises((DriverError, EndOfRecord)):
        backend.driver.read(0.1)


def test_a_record_ends_and_gives_back_its_own_commands() -> None:
    """Behind the last row comes EndOfRecord; the command in force is the logged one of the row just read."""
    rows = [(WheelSample(float(i), 1.0), IssuedCommand(i / 10, i / 100)) for i in range(3)]
    wheel = ReplayWheel(iter(rows), "x.csv")
    for sample, command in rows:
        assert wheel.read(0.0) is sample
        assert wheel.command_current(9.0) is command
    with pytest.raises(EndOfRecord):
        wheel.read(0.0)
    assert wheel.source == "replay+x.csv"


def test_the_simulated_wheel_repeats_itself_and_knows_the_truth() -> None:
    """The same seed gives the same readings; `truth` is free of noise; telemetry steps show in the readings."""
    one, two = (SimulatedWheel(seed=5, initial_speed_rad_s=20.0, speed_step_rad_s=0.05) for _ in range(2))
    first = [one.read(0.0) for _ in range(5)]
    assert first == [two.read(0.0) for _ in range(5)]
    assert first[4] is not None
    assert first[4].speed_rad_s is not None
    assert first[4].speed_rad_s / 0.05 == pytest.approx(round(first[4].speed_rad_s / 0.05))
    assert one.truth.speed_rad_s != first[4].speed_rad_s
    assert one.truth.time_s == pytest.approx(0.4)
