"""The real serial driver over a simulated wheel's line in this process, on a virtual clock."""

from __future__ import annotations

import contextlib
import itertools

import pytest

from rw_ekf.clock import VirtualClock
from rw_ekf.drivers.line.register_protocol import RegisterProtocol
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.drivers.sim.fault_draw import LOTS, drawn_faults
from rw_ekf.drivers.sim.fault_text import parse_fault, parse_faults
from rw_ekf.drivers.sim.faults import FaultInjector
from rw_ekf.drivers.sim.plant_parameters import PlantNoise, PlantParameters, PlantState
from rw_ekf.drivers.sim.plant_runner import PlantRunner
from rw_ekf.drivers.sim.register_server import RegisterServer
from rw_ekf.drivers.sim.virtual_line import VirtualCable
from rw_ekf.errors import DriverError


def test_the_real_driver_on_a_virtual_clock(wire_map: WireMap) -> None:
    """A cable pulled for a second and a silence of another: errors and missed samples, then as before, on its clock."""
    clock = VirtualClock()
    plant = PlantRunner(PlantParameters(), PlantNoise(0.0), 1, PlantState(speed_rad_s=50.0))
    faults = FaultInjector(parse_faults(["hangup@2s:1s,silence@5s:1s"]))
    protocol = VirtualCable(RegisterServer(wire_map, plant, faults=faults), clock).carrying(RegisterProtocol(wire_map))
    wheel = protocol.open_wheel("nowhere", clock, 0.04)
    came: dict[str, list[float]] = {"sample": [], "missed": [], "lost": []}
    while clock.monotonic() < 8.0:
        now_s = clock.monotonic()
        try:
            sample = wheel.read(0.05)
            came["missed" if sample is None else "sample"].append(now_s)
            if sample is not None:
                assert sample.time_s == pytest.approx(now_s, abs=0.05)
                assert wheel.command_current(0.1).acknowledged
        except DriverError:
            came["lost"].append(now_s)
            with contextlib.suppress(DriverError):
                wheel = protocol.open_wheel("nowhere", clock, 0.04, probe=False, previous=wheel)
        clock.sleep(max(now_s + 0.1 - clock.monotonic(), 0.0))
    assert all(2.0 <= t < 3.1 for t in came["lost"])
    assert all(5.0 <= t < 6.1 or t < 3.2 for t in came["missed"])
    assert len(came["lost"]) >= 8
    assert len(came["missed"]) >= 8
    assert len(came["sample"]) >= 50
    assert max(came["sample"]) > 7.8


def test_no_drawn_fault_breaks_the_driver(wire_map: WireMap) -> None:
    """An hour of faults drawn at random: nothing but a DriverError ever comes out, and samples come to the end."""
    clock = VirtualClock()
    plant = PlantRunner(PlantParameters(), PlantNoise(0.0), 1, PlantState(speed_rad_s=50.0), fine_step_s=0.02)
    faults = FaultInjector(drawn_faults(11, 3600.0, mean_gap_s=20.0))
    protocol = VirtualCable(RegisterServer(wire_map, plant, faults=faults), clock).carrying(RegisterProtocol(wire_map))
    wheel = protocol.open_wheel("nowhere", clock, 0.04)
    samples, lost, last_s = 0, 0, 0.0
    while clock.monotonic() < 3600.0:
        now_s = clock.monotonic()
        try:
            if wheel.read(0.25) is not None:
                samples, last_s = samples + 1, now_s
                wheel.command_current(0.05)
        except DriverError:
            lost += 1
            with contextlib.suppress(DriverError):
                wheel = protocol.open_wheel("nowhere", clock, 0.04, probe=False, previous=wheel)
        clock.sleep(max(now_s + 0.5 - clock.monotonic(), 0.0))
    assert lost > 0
    assert samples > 3600
    assert last_s > 3500.0


def test_a_drawn_schedule_is_the_same_for_a_seed_and_can_be_written() -> None:
    """In order, one after the other, within the time, of all kinds in the end; each text reads back as the fault."""
    drawn = drawn_faults(5, 72 * 3600.0)
    assert drawn == drawn_faults(5, 72 * 3600.0) != drawn_faults(6, 72 * 3600.0)
    assert 500 < len(drawn) < 4000
    assert all(parse_fault(fault.text) == fault for fault in drawn)
    assert all(a.start_s + a.lasts_s < b.start_s for a, b in itertools.pairwise(drawn))
    assert drawn[-1].start_s < 72 * 3600.0
    assert {fault.kind for fault in drawn} == {text.split(":")[0].split("/")[0] for text, _, _ in LOTS}
    assert {fault.kind for fault in drawn_faults(5, 3600.0, kinds=("drop", "reset"))} == {"drop", "reset"}
    with pytest.raises(ValueError, match="no fault to draw"):
        drawn_faults(5, 3600.0, kinds=("frezze",))
