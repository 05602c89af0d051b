"""What the tests of faults share: a simulated wheel on a pty, and its wire map."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from rw_ekf.clock import SystemClock
from rw_ekf.drivers.line.serial_wheel import SerialWheel, open_serial_wheel
from rw_ekf.drivers.line.wire_map import WireMap
from tests.live.bench import Bench, served_wheel, wire_map_of


@pytest.fixture(scope="session")
def wire_map() -> WireMap:
    """The project's wire map."""
    return wire_map_of("sunspace-wheel")


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A wheel on a pty."""
    with served_wheel(tmp_path) as made:
        yield made


@pytest.fixture
def wheel(bench: Bench, wire_map: WireMap) -> Iterator[SerialWheel]:
    """The real driver, open on that pty; patient, because the machine may be busy."""
    opened = open_serial_wheel(bench.port, wire_map, SystemClock(), 0.15)
    yield opened
    opened.close()
