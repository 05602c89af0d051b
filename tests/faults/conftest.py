"""What the tests of faults share: a simulated wheel on a pty, and its wire map."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from rw_ekf.clock import SystemClock
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.drivers.line.wire_map import WireMap
from tests.faults.rig import FAMILY, open_timed
from tests.live.bench import FAMILIES, Bench, protocol_named, served_wheel, virtual_wheel, wire_map_of


@pytest.fixture
def family(request: pytest.FixtureRequest) -> Iterator[str]:
    """A map of the family of wheels that a test is about; `EACH_FAMILY` marks tests of each."""
    found: str = getattr(request, "param", FAMILIES[0])
    token = FAMILY.set(found)
    yield found
    FAMILY.reset(token)


@pytest.fixture
def wire_map(family: str) -> WireMap:
    """The wire map of that family."""
    return wire_map_of(family)


@pytest.fixture
def bench(tmp_path: Path, family: str) -> Iterator[Bench]:
    """A wheel on a pty."""
    with served_wheel(tmp_path, protocol=family) as made:
        yield made


@pytest.fixture
def wheel(bench: Bench, family: str) -> Iterator[SerialWheel]:
    """The real driver, open on that pty; patient, because the machine may be busy."""
    opened = protocol_named(family).open_wheel(bench.port, SystemClock(), 0.15)
    assert isinstance(opened, SerialWheel)
    yield opened
    opened.close()


@pytest.fixture
def timed(tmp_path: Path, family: str) -> Bench:
    """A wheel on a virtual clock: only a fault makes a reply late."""
    return virtual_wheel(tmp_path, protocol=family)


@pytest.fixture
def timed_wheel(timed: Bench, family: str) -> SerialWheel:
    """The real driver there."""
    return open_timed(timed, family, 0.15)
