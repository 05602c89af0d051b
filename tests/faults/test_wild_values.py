"""Float registers carry infinity, NaN and 3e38 with a good checksum: none of them passes the driver."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator

import pytest

from rw_ekf.clock import SystemClock
from rw_ekf.course.course import WILD
from rw_ekf.driver import ZERO_BY_MODE
from rw_ekf.drivers.line.register_protocol import RegisterProtocol
from rw_ekf.drivers.line.registers import decode_register, is_plausible
from rw_ekf.drivers.line.serial_wheel import SerialWheel
from rw_ekf.drivers.line.wire_layout import BEYOND_ANY_MACHINE, QUANTITIES, Field, Register
from rw_ekf.drivers.line.wire_map import WireMap
from rw_ekf.drivers.sim.register_server import RegisterServer
from rw_ekf.settings.schema import LimitsSection
from rw_ekf.units import rad_s_from_rpm
from tests.faults.rig import is_unsolicited, let_pass
from tests.injecting import put_faults
from tests.live.bench import FAMILIES, Bench, wait_for
from tests.live.daemon import run
from tests.live.test_line_faults import fault
from tests.serial_wheels import open_serial_wheel

CLOCK = SystemClock()

CYCLE = 137
UNITS = {"speed": "rad/s", "current": "A", "current_command": "A", "temperature": "degC", "uptime": "s"}
WRONG = (math.inf, -math.inf, math.nan, 3.0e38, -3.0e38)


@pytest.fixture
def float_map(wire_map: WireMap) -> WireMap:
    """The project's map with a cycle of floats."""
    fields = tuple(Field(name=name, type="f32", unit=unit) for name, unit in UNITS.items())
    registers = tuple(r if r.id != CYCLE else r.model_copy(update={"fields": fields}) for r in wire_map.registers)
    return wire_map.model_copy(update={"registers": registers})


@pytest.fixture
def line(float_map: WireMap, bench: Bench) -> Iterator[tuple[SerialWheel, RegisterServer]]:
    """An open wheel with float telemetry, and the server behind it."""
    bench.registers.wire_map = float_map
    wheel = open_serial_wheel(bench.port, float_map, CLOCK, 0.5)
    yield wheel, bench.registers
    wheel.close()


@pytest.mark.parametrize("number", WRONG)
@pytest.mark.parametrize("name", list(UNITS))
def test_a_reply_with_an_impossible_number_is_damaged(
    line: tuple[SerialWheel, RegisterServer], name: str, number: float
) -> None:
    """Row 18: two such replies cost two samples and are counted as damaged; the third is a sample with a later time."""
    wheel, server = line
    before = wheel.read(1.0)
    put_faults(server, f"value/cycle:{name}={number!r}")
    assert wheel.read(1.0) is None
    assert wheel.read(1.0) is None
    assert wheel.link.damaged == 2
    put_faults(server)
    after = wheel.read(1.0)
    assert before is not None
    assert after is not None
    assert before.time_s < after.time_s < before.time_s + 10.0
    assert wheel.link.damaged == 2


def test_a_float_tells_the_command_to_its_last_digits(line: tuple[SerialWheel, RegisterServer]) -> None:
    """Row 14: 0.3 A in force is not taken for a zero that was refused: mode idle follows."""
    wheel, server = line
    assert wheel.command_current(0.3).acknowledged
    put_faults(server, "nack/current_command")
    assert wheel.stop_current().reason == ZERO_BY_MODE
    assert server.command_A == 0.0


@pytest.mark.parametrize(("name", "number"), [("speed", math.inf), ("uptime", math.nan), ("current", 3.0e38)])
def test_the_daemon_goes_on(
    float_map: WireMap, timed: Bench, monkeypatch: pytest.MonkeyPatch, name: str, number: float
) -> None:
    """Row 18: in mid-run: every other sample is there, counted, logged, and the log reads."""
    monkeypatch.setattr("tests.live.daemon.checked_protocol", lambda configuration: RegisterProtocol(float_map))
    timed.registers.wire_map = float_map
    ran = run(timed, 2.0, *fault(timed, 0.75, 0.95, f"value/cycle:{name}={number!r}"))
    assert ran.outcome.link.damaged >= 1
    assert ran.outcome.statistics.missing >= ran.outcome.link.damaged
    assert math.isfinite(ran.outcome.belief.mean[0])
    assert ran.outcome.statistics.samples > 10
    assert len(ran.log) == ran.outcome.statistics.samples


@pytest.mark.parametrize("family", [FAMILIES[1], "odrive-ascii-wheel"], indirect=True)
@pytest.mark.parametrize("number", WRONG)
def test_a_wheel_that_speaks_in_floats_is_held_to_them(bench: Bench, wheel: SerialWheel, number: float) -> None:
    """Row 18: as above for a speed that a file of its own carries; of a temperature only that value is missing."""
    bench.fault(f"value/speed:speed={number!r}")
    assert wheel.read(1.0) is None
    assert wheel.link.damaged == 1
    bench.fault(f"value/temperature:temperature={number!r}")
    sample = wheel.read(1.0)
    assert sample is not None
    assert sample.temperature_degC is None


@pytest.mark.parametrize("family", [FAMILIES[0], FAMILIES[2]], indirect=True)
@pytest.mark.parametrize("number", ["inf", "-inf", "nan", "1715.7", "-1715.73"])
def test_a_speed_at_the_end_of_its_integer_is_none(bench: Bench, wheel: SerialWheel, number: str) -> None:
    """Row 18: saturated at either end of what 16 bits carry: no sample, counted as damaged; then as before."""
    bench.fault(f"value/cycle:speed={number}")
    let_pass(wheel)
    damaged = wheel.link.damaged
    assert wheel.read(1.0) is None
    assert wheel.read(1.0) is None
    assert wheel.link.damaged == damaged + 2
    bench.fault("")
    let_pass(wheel)
    wait_for(lambda: wheel.read(0.5) is not None)


@pytest.mark.parametrize("family", [FAMILIES[0], FAMILIES[2]], indirect=True)
def test_a_speed_that_goes_round_the_end_of_its_integer_is_none(bench: Bench, wheel: SerialWheel) -> None:
    """Row 18: -16000 rpm just after 16000 rpm is a wrap and no reading; what stays so for a second is believed."""
    bench.fault(f"value/cycle:speed={rad_s_from_rpm(16000.0)}")
    let_pass(wheel)
    if is_unsolicited(wheel):
        CLOCK.sleep(1.2)  # what was read before is then no reason to doubt it
    first = wheel.read(1.0)
    assert first is not None
    assert first.speed_rad_s == pytest.approx(rad_s_from_rpm(16000.0))
    bench.fault(f"value/cycle:speed={rad_s_from_rpm(-16000.0)}")
    damaged = wheel.link.damaged
    let_pass(wheel)
    assert wheel.read(1.0) is None
    assert wheel.link.damaged > damaged
    wait_for(lambda: wheel.read(0.5) is not None)
    bench.fault("")
    let_pass(wheel)
    wait_for(lambda: wheel.read(0.5) is not None)
    sample = wheel.read(1.0)
    assert sample is not None
    assert sample.speed_rad_s == pytest.approx(20.0, abs=4.0)


def test_fields_that_nobody_uses_may_hold_anything() -> None:
    """A reserved word of a register is not judged; one that is used is."""
    fields = (Field(name="speed", type="f32", unit="rad/s"), Field(name="reserved", type="f32"))
    register = Register(id=1, name="mixed", access="read", fields=fields)
    assert is_plausible(register, decode_register(register, struct.pack("<2f", 1.0, math.nan)))
    assert not is_plausible(register, decode_register(register, struct.pack("<2f", math.nan, 1.0)))


def test_the_bounds_lie_between_what_is_allowed_and_what_a_replay_refuses() -> None:
    """Every quantity has one; a limit that can be configured passes, and what passes can be replayed."""
    assert set(BEYOND_ANY_MACHINE) == set(QUANTITIES.values())
    most = {name: info.metadata for name, info in LimitsSection.model_fields.items()}
    current, rpm = (next(m.le for m in most[name] if hasattr(m, "le")) for name in ("current_A", "speed_rpm"))
    assert current < BEYOND_ANY_MACHINE["current"] < WILD
    assert rad_s_from_rpm(rpm) < BEYOND_ANY_MACHINE["speed"] < WILD
